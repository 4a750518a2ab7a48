//! Shapes of things that people push about in a plant, as boxes in a frame of the thing.

use crate::random::Random;
use crate::scene::Cuboid;
use geometry::{Point, Pose};
use std::f64::consts::PI;

/// Number of boxes whose union is a drum: its faces are at most 3 mm from a cylinder.
const DRUM_BOXES: usize = 12;
/// Thickness of the walls of a bin and of a cart's handle, metres.
const SHEET: f64 = 0.03;

/// What a thing is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum MovableKind {
    /// A closed box or crate.
    Crate,
    /// A cabinet as high as a person.
    Cabinet,
    /// A pallet with a load on it that is not in its middle.
    Pallet,
    /// A box without a lid.
    Bin,
    /// A cart: a deck on wheels with a handle at one end.
    Cart,
    /// An upright drum, round but for 3 mm.
    Drum,
}

impl MovableKind {
    /// All kinds.
    pub const ALL: [Self; 6] =
        [Self::Crate, Self::Cabinet, Self::Pallet, Self::Bin, Self::Cart, Self::Drum];

    /// Its name, for tables.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Crate => "crate",
            Self::Cabinet => "cabinet",
            Self::Pallet => "pallet",
            Self::Bin => "bin",
            Self::Cart => "cart",
            Self::Drum => "drum",
        }
    }

    /// Share of its sides that there is: of a cart only deck, wheels and handle.
    pub(super) fn filled(self) -> f64 {
        if self == Self::Cart { 0.2 } else { 1.0 }
    }

    /// How many turns of a whole turn look the same; `None` if all do.
    #[must_use]
    pub fn n_alike(self) -> Option<usize> {
        match self {
            Self::Crate | Self::Cabinet | Self::Bin => Some(2),
            Self::Pallet | Self::Cart => Some(1),
            Self::Drum => None,
        }
    }
}

/// A box of a thing: middle and edges in the thing's frame, whose origin is the middle of its
/// footprint and whose z points up, metres; and its yaw in that frame, degrees.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct MovablePart {
    at: [f64; 3],
    size: [f64; 3],
    yaw_deg: f64,
}

/// Draws the parts of a thing; also returns its length, width and height, metres.
pub(super) fn parts(kind: MovableKind, random: &mut Random) -> (Vec<MovablePart>, [f64; 3]) {
    let part = |at, size| MovablePart { at, size, yaw_deg: 0.0 };
    let mut size = |low: [f64; 3], high: [f64; 3]| -> [f64; 3] {
        std::array::from_fn(|i| random.between(low[i], high[i]))
    };
    let whole = |s: [f64; 3]| (vec![part([0.0, 0.0, 0.5 * s[2]], s)], s);
    match kind {
        MovableKind::Crate => whole(size([0.5, 0.35, 0.4], [1.0, 0.48, 1.0])),
        MovableKind::Cabinet => whole(size([0.65, 0.4, 1.5], [1.1, 0.6, 2.0])),
        MovableKind::Pallet => {
            let load = size([0.7, 0.6, 0.3], [0.95, 0.75, 0.9]);
            // At one end of the deck.
            let off = 0.5 * (1.2 - load[0]) - 0.01;
            let parts = vec![
                part([0.0, 0.0, 0.07], [1.2, 0.8, 0.14]),
                part([off, 0.0, 0.14 + 0.5 * load[2]], load),
            ];
            (parts, [1.2, 0.8, 0.14 + load[2]])
        }
        MovableKind::Bin => {
            let s @ [x, y, z] = size([0.7, 0.5, 0.4], [1.2, 0.65, 0.9]);
            let side = |sign: f64| {
                [
                    part([sign * 0.5 * (x - SHEET), 0.0, 0.5 * z], [SHEET, y, z]),
                    part([0.0, sign * 0.5 * (y - SHEET), 0.5 * z], [x, SHEET, z]),
                ]
            };
            let ground = part([0.0, 0.0, 0.5 * SHEET], [x, y, SHEET]);
            ([vec![ground], side(1.0).to_vec(), side(-1.0).to_vec()].concat(), s)
        }
        MovableKind::Cart => {
            let [x, y, z] = size([0.8, 0.5, 0.9], [1.2, 0.7, 1.1]);
            let wheel = |a: f64, b: f64| {
                let at = [a * (0.5 * x - 0.08), b * (0.5 * y - 0.06), 0.1];
                part(at, [0.15, 0.05, 0.2])
            };
            let mut parts = vec![
                part([0.0, 0.0, 0.225], [x, y, 0.05]),
                part([SHEET - 0.5 * x, 0.0, 0.25 + 0.5 * (z - 0.25)], [SHEET, y, z - 0.25]),
            ];
            parts.extend([wheel(1.0, 1.0), wheel(1.0, -1.0), wheel(-1.0, 1.0), wheel(-1.0, -1.0)]);
            (parts, [x, y, z])
        }
        MovableKind::Drum => {
            let [radius, _, height] = size([0.25, 0.0, 0.7], [0.38, 1.0, 1.1]);
            let width = 2.0 * radius * (PI / (2 * DRUM_BOXES) as f64).tan();
            let one = |k: usize| MovablePart {
                at: [0.0, 0.0, 0.5 * height],
                size: [2.0 * radius, width, height],
                yaw_deg: 180.0 * k as f64 / DRUM_BOXES as f64,
            };
            ((0..DRUM_BOXES).map(one).collect(), [2.0 * radius, 2.0 * radius, height])
        }
    }
}

/// The parts at a pose (`world_from_thing`) as boxes of a scene.
pub(super) fn placed(
    parts: &[MovablePart],
    name: &str,
    pose: &Pose,
    reflectance: f64,
) -> Vec<Cuboid> {
    let yaw = pose.rotation.euler_angles().2.to_degrees();
    let one = |part: &MovablePart| Cuboid {
        name: name.into(),
        xyz: (pose * Point::from(part.at)).coords.into(),
        size: part.size,
        rpy_deg: [0.0, 0.0, yaw + part.yaw_deg],
        reflectance,
    };
    parts.iter().map(one).collect()
}
