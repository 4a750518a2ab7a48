//! Chooses, among the depth images of one scanner, those that can show a place. Where the images
//! are the faces of a cube, usually only one has to be looked up.

use crate::DepthImage;
use crate::depth::{LANES, Lanes, Look, Looks, transform_lanes};

/// A scanner with its depth images.
#[derive(Debug, Clone)]
pub struct Eye<'a> {
    images: Vec<&'a DepthImage>,
    faces: Faces,
}

impl<'a> Eye<'a> {
    /// A scanner with all of its depth images, which must share their scanner position.
    #[must_use]
    pub fn new(images: impl IntoIterator<Item = &'a DepthImage>) -> Self {
        let images: Vec<&DepthImage> = images.into_iter().collect();
        let faces = Faces::new(images.iter().copied());
        Self { images, faces }
    }

    /// Whether the scanner has no image.
    pub(crate) fn is_blind(&self) -> bool {
        self.images.is_empty()
    }

    /// Position of the scanner in the local frame, metres.
    #[inline]
    #[must_use]
    pub fn at(&self) -> [f32; 3] {
        self.faces.scanner
    }

    /// Looks up several places of the local frame, each as [`Eye::look`] does.
    #[inline]
    #[must_use]
    pub fn look_lanes(&self, local: &Lanes, footprint: f32) -> Looks {
        if let Some(image) = self.faces.of_all(local).map(|i| self.images[i]) {
            return image.look_lanes(&transform_lanes(&image.rows, local), footprint);
        }
        let mut out = Looks::NOTHING;
        for i in 0..LANES {
            let look = self.look([local[0][i], local[1][i], local[2][i]], footprint);
            look.iter().for_each(|look| out.set(i, look));
        }
        out
    }

    /// What the scanner's beams found in the direction of a place (local frame, metres), in a cell
    /// about `footprint` metres wide; `None` where nothing is known.
    #[inline]
    #[must_use]
    pub fn look(&self, local: [f32; 3], footprint: f32) -> Option<Look> {
        let images = self.faces.towards(local).iter();
        images.map(|&i| self.images[i]).find_map(|image| image.look_at(local, footprint))
    }
}

/// An index from directions to the images of one scanner that cover them.
#[derive(Debug, Clone)]
pub struct Faces {
    scanner: [f32; 3],
    all: Vec<usize>,
    /// Indices of images by the axis and side along which they look (−x, +x, −y, …); `None` where
    /// the images are not the faces of a cube.
    by_side: Option<[Vec<usize>; 6]>,
    /// If the largest coordinate of a place (scanner as origin) is at least this multiple of the
    /// next one, the place lies on one face only; rasters extend up to half a cell beyond the
    /// edge.
    apart: f32,
}

impl Faces {
    /// Builds the index for the images of one scanner.
    #[must_use]
    pub fn new<'i>(images: impl IntoIterator<Item = &'i DepthImage>) -> Self {
        let images: Vec<&DepthImage> = images.into_iter().collect();
        let scanner = images.first().map_or([0.0; 3], |i| i.scanner().coords.cast::<f32>().into());
        let mut by_side: [Vec<usize>; 6] = Default::default();
        let mut is_cube = images.len() > 1;
        for (i, image) in images.iter().enumerate() {
            let along = image.rows[2];
            let side = (0..6).find(|side| along[side / 2] * sign(*side) > 0.999_99);
            is_cube &= side.is_some_and(|side| by_side[side].is_empty());
            side.into_iter().for_each(|side| by_side[side].push(i));
        }
        let focal = images.iter().map(|image| image.focal()).fold(f32::INFINITY, f32::min);
        Self {
            scanner,
            all: (0..images.len()).collect(),
            by_side: is_cube.then_some(by_side),
            apart: 1.0 + 1.0 / focal.max(1.0),
        }
    }

    /// Indices of the images that a place of the local frame may lie on; it lies on no other one.
    #[inline]
    #[must_use]
    pub fn towards(&self, local: [f32; 3]) -> &[usize] {
        let Some(by_side) = &self.by_side else { return &self.all };
        let d: [f32; 3] = std::array::from_fn(|i| local[i] - self.scanner[i]);
        let a = d.map(f32::abs);
        let axis = if a[0] >= a[1] && a[0] >= a[2] { 0 } else { 1 + usize::from(a[2] > a[1]) };
        let next = a[(axis + 1) % 3].max(a[(axis + 2) % 3]);
        if a[axis] <= next * self.apart {
            return &self.all;
        }
        &by_side[2 * axis + usize::from(d[axis] > 0.0)]
    }

    /// The one image that all of these places may lie on, if there is one.
    #[inline]
    #[must_use]
    pub fn of_all(&self, local: &Lanes) -> Option<usize> {
        let &[one] = self.towards([local[0][0], local[1][0], local[2][0]]) else { return None };
        if self.by_side.is_none() {
            return Some(one);
        }
        let at = self.scanner;
        let first = [local[0][0] - at[0], local[1][0] - at[1], local[2][0] - at[2]];
        let a = first.map(f32::abs);
        let axis = if a[0] >= a[1] && a[0] >= a[2] { 0 } else { 1 + usize::from(a[2] > a[1]) };
        let way = first[axis].signum();
        let others = [(axis + 1) % 3, (axis + 2) % 3];
        let off = |axis: usize, i: usize| local[axis][i] - at[axis];
        let mut all = true;
        for i in 0..LANES {
            let next = off(others[0], i).abs().max(off(others[1], i).abs());
            all &= way * off(axis, i) > next * self.apart;
        }
        all.then_some(one)
    }
}

fn sign(side: usize) -> f32 {
    if side % 2 == 1 { 1.0 } else { -1.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::depth::{Empty, lanes, transform};
    use crate::{Point, Pose, Vector};
    use nalgebra::{Rotation3, Translation3, UnitQuaternion};

    fn cube(scanner: Point, n_faces: usize) -> Vec<DepthImage> {
        let axes = [Vector::x(), Vector::y(), Vector::z()];
        let along = axes.iter().flat_map(|a| [*a, -a]).take(n_faces);
        let image = |along: Vector| {
            let up = if along.z.abs() > 0.9 { Vector::x() } else { Vector::z() };
            let rotation = Rotation3::look_at_lh(&along, &up);
            let turned = UnitQuaternion::from_rotation_matrix(&rotation);
            let camera_from_local = Pose::from_parts(Translation3::identity(), turned)
                * Pose::from_parts(Translation3::from(-scanner.coords), UnitQuaternion::identity());
            let mut image = DepthImage::new(camera_from_local, 1.0, 30.3);
            image.finish(0, |_| Empty::NoReturn);
            image
        };
        along.map(image).collect()
    }

    #[test]
    fn no_image_shows_a_place_that_it_is_not_asked_for() {
        let mut random = 1_u64;
        let mut next = || {
            random = random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            (random >> 40) as f32 / (1 << 24) as f32 - 0.5
        };
        for n_faces in [1, 5, 6] {
            let images = cube(Point::new(0.3, -2.0, 1.5), n_faces);
            let faces = Faces::new(&images);
            let mut n_asked = 0;
            for _ in 0..20_000 {
                let p = [next() * 9.0, next() * 9.0, next() * 9.0];
                let asked = faces.towards(p);
                n_asked += asked.len();
                for (i, image) in images.iter().enumerate().filter(|(i, _)| !asked.contains(i)) {
                    let camera = transform(&image.rows, p);
                    assert!(image.look(camera, 0.0).is_none(), "{p:?} is on image {i}");
                }
            }
            assert!(n_faces == 1 || n_asked < 26_000, "{n_asked}");
        }
    }

    #[test]
    fn places_looked_up_together_give_the_same_as_one_by_one() {
        let mut random = 7_u64;
        let mut next = || {
            random = random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            (random >> 40) as f32 / (1 << 24) as f32 - 0.5
        };
        for n_faces in [1, 5, 6] {
            let scanner = Point::new(0.3, -2.0, 1.5);
            let [mut one, mut together] = [0, 1].map(|_| cube(scanner, n_faces));
            let faces = Faces::new(&one);
            let mut n_shared = 0;
            for spread in [9.0, 0.3].repeat(300) {
                let at = [next() * 9.0, next() * 9.0, next() * 9.0];
                let places: Vec<[f32; 3]> =
                    (0..LANES).map(|_| at.map(|v| v + spread * next())).collect();
                let places = lanes(&places[..1 + (next().abs() * 30.0) as usize]);
                let Some(image) = faces.of_all(&places) else { continue };
                n_shared += 1;
                let camera = transform_lanes(&one[image].rows, &places);
                for i in 0..LANES {
                    let place = places.map(|axis| axis[i]);
                    assert_eq!(faces.towards(place), [image]);
                    one[image].splat(transform(&together[image].rows, place));
                }
                together[image].splat_lanes(&camera, LANES);
            }
            assert!(n_shared > 100, "{n_shared}");
            for image in one.iter_mut().chain(&mut together) {
                image.finish(1, |_| Empty::NoReturn);
            }
            let (one, together) = (Eye::new(&one), Eye::new(&together));
            for spread in [9.0, 0.3].repeat(2000) {
                let at = [next() * 9.0, next() * 9.0, next() * 9.0];
                let places: Vec<[f32; 3]> =
                    (0..LANES).map(|_| at.map(|v| v + spread * next())).collect();
                let each: Vec<Option<Look>> =
                    places.iter().map(|place| one.look(*place, 0.05)).collect();
                let looks = together.look_lanes(&lanes(&places), 0.05);
                assert_eq!((0..LANES).map(|i| looks.get(i)).collect::<Vec<_>>(), each);
            }
        }
    }
}
