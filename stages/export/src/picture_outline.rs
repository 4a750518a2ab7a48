//! What the pictures of a robot show of its posture, so that processes that draw points of the same
//! robot do not draw its triangles again.

use crate::robot_picture::{PictureView, RobotPicture};
use contract::{Error, Result};
use geometry::Pose;
use robot::Model;
use serde::{Deserialize, Serialize};

/// Surface and edges of a posture in all views of a picture.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct PictureOutline(Vec<ViewOutline>);

/// The same of one view.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
struct ViewOutline {
    /// Runs of pixels that show the posture: first pixel and number.
    shown: Vec<[u32; 2]>,
    /// What those pixels hold.
    #[serde(with = "geometry::raw_list")]
    surface: Vec<[f32; 2]>,
    /// Runs of pixels on edges.
    edges: Vec<[u32; 2]>,
}

impl RobotPicture {
    /// Surface and edges of the posture.
    #[must_use]
    pub fn outlines(&self) -> PictureOutline {
        PictureOutline(self.views.iter().map(ViewOutline::of).collect())
    }

    /// As [`RobotPicture::new`], with the surface and edges of an equal picture.
    ///
    /// # Errors
    /// Those of a picture with other views.
    pub fn outlined(
        robot: i16,
        model: &Model,
        world_from_link: &[Pose],
        outlines: &PictureOutline,
    ) -> Result<Self> {
        let mut picture = Self::blank(robot, model, world_from_link);
        let has_all = picture.views.len() == outlines.0.len();
        let mut views = picture.views.iter_mut().zip(&outlines.0);
        if !has_all || !views.all(|(view, outline)| outline.set(view).is_some()) {
            return Err(Error::bad_input("outlines of another picture: start the job again"));
        }
        Ok(picture)
    }
}

impl ViewOutline {
    fn of(view: &PictureView) -> Self {
        let is_shown = |pixel: &[f32; 2]| !pixel[0].is_nan();
        Self {
            shown: runs(view.surface.iter().map(is_shown)),
            surface: view.surface.iter().copied().filter(is_shown).collect(),
            edges: runs(view.outline.iter().copied()),
        }
    }

    /// Sets the pixels of a view; `None` where they do not fit.
    fn set(&self, view: &mut PictureView) -> Option<()> {
        let mut rest = &self.surface[..];
        for run in &self.shown {
            let (own, after) = rest.split_at_checked(run[1] as usize)?;
            pixels(&mut view.surface, *run)?.copy_from_slice(own);
            rest = after;
        }
        self.edges.iter().try_for_each(|run| {
            pixels(&mut view.outline, *run)?.fill(true);
            Some(())
        })
    }
}

/// The pixels of a run.
fn pixels<T>(all: &mut [T], [first, n]: [u32; 2]) -> Option<&mut [T]> {
    let first = first as usize;
    all.get_mut(first..first.checked_add(n as usize)?)
}

/// Runs of pixels that are set.
fn runs(pixels: impl Iterator<Item = bool>) -> Vec<[u32; 2]> {
    let mut out: Vec<[u32; 2]> = Vec::new();
    for (at, _) in pixels.enumerate().filter(|(_, is_set)| *is_set) {
        match out.last_mut() {
            Some([first, n]) if *first + *n == at as u32 => *n += 1,
            _ => out.push([at as u32, 1]),
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use contract::{Label, OneByOne, PointKind};
    use robot::{CadCloud, Link, Mesh, Role};
    use std::sync::Arc;

    #[test]
    fn a_picture_with_known_outlines_is_the_same() {
        let mesh = Mesh {
            vertices: vec![[0.0; 3], [1.0, 0.0, 0.2], [0.0, 1.0, 0.4], [0.3, 0.2, 1.0]],
            triangles: vec![[0, 1, 2], [0, 1, 3], [1, 2, 3]],
        };
        let bounds = geometry::Aabb { min: [0.0; 3], max: [1.0; 3] };
        let link = Link {
            name: "arm".into(),
            role: Role::Main,
            parent_joint: None,
            mesh: Arc::new(mesh),
            cad: Arc::new(CadCloud::default()),
            bounds,
        };
        let model = Model { links: vec![link], ..Model::default() };
        let poses = [Pose::identity()];
        let mut drawn = RobotPicture::new(0, &model, &poses, &OneByOne);
        let outlines = drawn.outlines();
        let mut again = RobotPicture::outlined(0, &model, &poses, &outlines).expect("its own");
        assert_eq!(again.outlines(), outlines);
        assert!(outlines.0.iter().all(|view| view.surface.len() > 100 && !view.edges.is_empty()));
        let label = Label { kind: PointKind::Link, robot: 0, link: 0 };
        for picture in [&mut drawn, &mut again] {
            (0..50).for_each(|i| picture.add([0.01 * f64::from(i), 0.1, 0.2], label));
        }
        assert_eq!(drawn.pixels(), again.pixels());
        let other = PictureOutline::default();
        assert!(RobotPicture::outlined(0, &model, &poses, &other).is_err());
    }
}
