//! Closed triangle bodies from outlines, rings and paths, of which hall and demo robots are made.

mod body;
mod cap;
mod shapes;

pub use body::Solid;
pub use shapes::{Ring, bolts, cuboid, disc, lathe, loft, prism, rounded, tube};

#[cfg(test)]
mod tests {
    use super::*;
    use geometry::Point;
    use std::collections::BTreeMap;

    /// Whether every edge is used once in each direction, so that there is no hole and no doubled
    /// face.
    fn is_closed(solid: &Solid) -> bool {
        let mut edges: BTreeMap<(u32, u32), i32> = BTreeMap::new();
        for t in &solid.triangles {
            for k in 0..3 {
                *edges.entry((t[k], t[(k + 1) % 3])).or_default() += 1;
            }
        }
        edges.iter().all(|(&(a, b), &n)| n == 1 && edges.get(&(b, a)) == Some(&1))
    }

    #[test]
    fn shapes_are_closed_and_turned_outwards() {
        let u = [
            [0.0, 0.0],
            [3.0, 0.0],
            [3.0, 2.0],
            [2.0, 2.0],
            [2.0, 1.0],
            [1.0, 1.0],
            [1.0, 2.0],
            [0.0, 2.0],
        ];
        let path =
            [[0.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.5, 0.0, 1.5], [0.5, 1.0, 1.5]].map(Point::from);
        let shapes = [
            ("cuboid", cuboid([1.0, 2.0, 3.0], 0.0), 6.0, 1e-9),
            ("chamfered", cuboid([1.0, 2.0, 3.0], 0.05), 6.0, 0.1),
            ("prism", prism(&u, -0.5, 0.5, 0.0), 5.0, 1e-9),
            ("prism with chamfer", prism(&u, -0.5, 0.5, 0.05), 5.0, 0.3),
            ("disc", disc(1.0, 0.0, 1.0, 0.02, 64), std::f64::consts::PI, 0.1),
            ("tube", tube(&path, 0.1, 24), 0.075, 0.005),
            (
                "loft",
                loft(&[
                    rounded([0.0; 3], [1.0, 1.0], 0.2, 6),
                    rounded([0.1, 0.0, 1.0], [0.5, 0.5], 0.1, 6),
                ]),
                0.55,
                0.05,
            ),
        ];
        for (name, solid, volume, slack) in shapes {
            assert!(is_closed(&solid), "{name} is not closed");
            assert!((solid.volume() - volume).abs() < slack, "{name}: {}", solid.volume());
        }
    }
}
