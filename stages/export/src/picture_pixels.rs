//! What the points of one input gave to the picture of a robot, so that inputs can be labelled by
//! different processes and drawn together. Pixels do not depend on the order of points.

use crate::canvas::Rgb;
use crate::robot_picture::RobotPicture;
use contract::{Error, Result};
use serde::{Deserialize, Serialize};

/// The pixels of a robot's views that points have changed.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct PicturePixels(Vec<ViewPixels>);

/// The same of one view: index of each pixel with what it holds.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
struct ViewPixels {
    points: Vec<(u32, f32, Rgb)>,
    residuals: Vec<(u32, f32, f32)>,
}

impl RobotPicture {
    /// The pixels that points have changed so far.
    #[must_use]
    pub fn pixels(&self) -> PicturePixels {
        let views = self.views.iter().map(|view| {
            let points = view.points.iter().enumerate().filter(|(_, p)| p.0 < f32::INFINITY);
            let residuals = view.residuals.iter().enumerate().filter(|(_, r)| r.0 < f32::INFINITY);
            ViewPixels {
                points: points.map(|(at, p)| (at as u32, p.0, p.1)).collect(),
                residuals: residuals.map(|(at, r)| (at as u32, r.0, r.1)).collect(),
            }
        });
        PicturePixels(views.collect())
    }

    /// Adds the pixels of the same picture that another process has drawn points in.
    ///
    /// # Errors
    /// Pixels of a picture with other views.
    pub fn add_pixels(&mut self, pixels: &PicturePixels) -> Result<()> {
        let other = || Error::bad_input("pixels of another picture: start the job again");
        if pixels.0.len() != self.views.len() {
            return Err(other());
        }
        for (view, own) in self.views.iter_mut().zip(&pixels.0) {
            for &(at, depth, color) in &own.points {
                let pixel = view.points.get_mut(at as usize).ok_or_else(other)?;
                if (depth, color) < *pixel {
                    *pixel = (depth, color);
                }
            }
            for &(at, depth, off) in &own.residuals {
                let pixel = view.residuals.get_mut(at as usize).ok_or_else(other)?;
                if (depth, off) < *pixel {
                    *pixel = (depth, off);
                }
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use contract::{Label, OneByOne, PointKind};
    use robot::Model;

    #[test]
    fn points_drawn_apart_give_the_same_picture() {
        let model = Model::default();
        let new = || RobotPicture::new(0, &model, &[], &OneByOne);
        let labels = [
            Label::FIXED,
            Label::FLOOR,
            Label { kind: PointKind::Link, robot: 0, link: 0 },
            Label { kind: PointKind::Attachment, robot: 1, link: 0 },
        ];
        let point = |i: usize| {
            let t = i as f64;
            let at = [(t * 0.7).sin(), (t * 1.3).cos(), (t * 0.11).sin()].map(|v| v * 0.6 + 0.5);
            (at, labels[i % labels.len()])
        };
        let (mut whole, mut joined) = (new(), new());
        for part in 0..3 {
            let mut own = new();
            for i in 4000 * part..4000 * (part + 1) {
                let (at, label) = point(i);
                whole.add(at, label);
                own.add(at, label);
            }
            joined.add_pixels(&own.pixels()).expect("is the same picture");
        }
        assert!(whole.pixels() == joined.pixels() && whole.pixels() != new().pixels());
        assert!(joined.add_pixels(&PicturePixels::default()).is_err(), "another picture");
    }
}
