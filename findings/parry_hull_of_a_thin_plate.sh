#!/usr/bin/env bash
# parry3d (Rust, of Rapier): `try_convex_hull` of points of a plate thinner than about a thousandth of its
# width succeeds, but its hull leaves out points by most of the thickness.
#
# Expected: a hull holds all of its points to the rounding of single precision, 1e-6 m at 2 m, or an error is returned.
# Seen (2026-11-30, Linux, parry3d 0.31.1): 200 points drawn evenly in a box, 50 draws each; how far a point lies beyond the
#   hull in the direction where that is most. 2 m by 1 mm: median 0.56 mm, largest 0.90 mm. 2 m by 2 mm: 1.00 and 1.80 mm.
#   2 m by 10 mm, and 0.5 m by 1 mm: less than 0.01 mm. Nothing is reported, and the hull is closed.
#   Sheet metal as a collision body then lies up to its own thickness inside what it stands for.
# Exits with 1 where that changes.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
mkdir src
cat > Cargo.toml <<'TOML'
[package]
name = "probe"
version = "0.0.0"
edition = "2021"

[dependencies]
parry3d = "=0.31.1"
TOML
cat > src/main.rs <<'RUST'
use parry3d::math::Vector;
use parry3d::transformation::try_convex_hull;

/// Evenly in 0..1, by Knuth's linear congruential generator.
fn draw(state: &mut u64) -> f32 {
    *state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
    (*state >> 40) as f32 / (1_u64 << 24) as f32
}

/// How far a point lies beyond all corners of the hull, metres, in the worst of 2,000 directions: half of them near the
/// plate's normal.
fn left_out(points: &[Vector], corners: &[Vector]) -> f64 {
    let mut state = 9;
    let mut most = 0.0_f64;
    for k in 0..2000 {
        let spread = if k % 2 == 0 { 0.002 } else { 2.0 };
        let mut along = || f64::from(draw(&mut state) - 0.5) * spread;
        let d = [along(), along(), if k % 3 == 0 { -1.0 } else { 1.0 }];
        let length = d.iter().map(|v| v * v).sum::<f64>().sqrt();
        let reach = |v: &Vector| (d[0] * f64::from(v.x) + d[1] * f64::from(v.y) + d[2] * f64::from(v.z)) / length;
        let farthest = |all: &[Vector]| all.iter().map(reach).fold(f64::NEG_INFINITY, f64::max);
        most = most.max(farthest(points) - farthest(corners));
    }
    most
}

/// Median and largest of 50 plates of this size and thickness, metres.
fn plates(size: f32, thickness: f32) -> [f64; 2] {
    let plate = |seed: u64| {
        let mut state = seed * 77 + 1;
        let mut point = || {
            let [x, y, z] = [0; 3].map(|_| draw(&mut state));
            Vector::new(size * (x - 0.5), size * (y - 0.5), thickness * z)
        };
        let points: Vec<Vector> = (0..200).map(|_| point()).collect();
        let (corners, _) = try_convex_hull(&points).expect("a hull");
        left_out(&points, &corners)
    };
    let mut all: Vec<f64> = (0..50).map(plate).collect();
    all.sort_by(f64::total_cmp);
    [all[25], all[49]]
}

fn main() {
    for (size, thickness, loses) in [(2.0, 0.001, true), (2.0, 0.002, true), (2.0, 0.01, false), (0.5, 0.001, false)] {
        let [median, most] = plates(size, thickness);
        println!("{size} m by {thickness} m: median {:.3} mm, largest {:.3} mm", 1e3 * median, 1e3 * most);
        let as_seen = if loses { median > 0.25 * f64::from(thickness) } else { most < 1e-5 };
        assert!(as_seen, "changed");
    }
}
RUST
CARGO_TARGET_DIR="$folder/target" cargo run -q --release
