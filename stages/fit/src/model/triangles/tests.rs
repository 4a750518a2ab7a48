//! Beams on blocks, pipes, slivers and meshes of any size.

use super::*;

/// A block's corner: the faces x = 0 and z = 0, half a metre wide, two triangles each.
fn corner() -> Mesh {
    let vertices = [[0.0, 0.0], [0.5, 0.0], [0.5, 0.5], [0.0, 0.5]];
    let top = vertices.map(|[x, y]| [x, y, 0.0]);
    let front = vertices.map(|[z, y]| [0.0, y, -z]);
    let vertices = top.into_iter().chain(front).collect();
    Mesh { vertices, triangles: vec![[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7]] }
}

/// Where a beam first meets a mesh up to 5 mm beside a place on it.
fn meet(triangles: &Triangles, at: Vector, ray: Vector) -> Option<MeshHit> {
    triangles.first(BeamPlace { at: &at, ray: &ray }, [-0.005, 0.005]).map(|(_, met)| met)
}

#[test]
fn beams_meet_the_face_that_they_end_on() {
    let mesh = corner();
    let triangles = Triangles::new(&mesh);
    let look = |at, ray| meet(&triangles, at, ray);
    // Down onto the top, from a place a millimetre above it.
    let down = Vector::new(0.1, 0.0, -1.0).normalize();
    let met = look(Vector::new(0.2, 0.3, 0.001), down).expect("the top");
    assert!((met.n - Vector::z()).norm() < 1e-6 && met.x.z.abs() < 1e-9);
    // A beam that ends on the front close below the edge: noise brought it nearer to the top.
    let ahead = Vector::new(1.0, 0.0, -0.1).normalize();
    let met = look(Vector::new(0.004, 0.3, -0.001), ahead).expect("the front");
    assert!((met.n + Vector::x()).norm() < 1e-6 && (met.x.z + 0.0006).abs() < 1e-6);
    // One straight down on the edge of all that there is.
    let met = look(Vector::new(0.0, 0.3, 0.001), -Vector::z()).expect("the edge of the top");
    assert!(met.x.z.abs() < 1e-9);
    // One that passes before the edge meets nothing; nor does one far away.
    assert!(look(Vector::new(-0.002, 0.3, 0.0), -Vector::z()).is_none());
    assert!(look(Vector::new(3.0, 0.3, 0.0), down).is_none());
}

#[test]
fn meshes_of_any_size_are_looked_through() {
    // The corner in millimetres, taken for metres: as many cells as memory stands, and the same
    // answer.
    let mesh = corner();
    let vertices = mesh.vertices.iter().map(|p| p.map(|v| 1000.0 * v)).collect();
    let large = Mesh { vertices, ..mesh };
    let triangles = Triangles::new(&large);
    assert!(triangles.begins.len() <= MOST.cells as usize + 1);
    let (at, down) = (Vector::new(200.0, 300.0, 0.001), -Vector::z());
    let met = meet(&triangles, at, down).expect("the top");
    assert!((met.n - Vector::z()).norm() < 1e-6);
    // A rod a million kilometres long, of no width.
    let vertices = vec![[0.0; 3], [1e9, 0.0, 0.0], [0.0, 1e-9, 0.0]];
    let rod = Mesh { vertices, triangles: vec![[0, 1, 2]] };
    assert!(Triangles::new(&rod).begins.len() <= MOST.cells as usize + 1);
    let nothing = Mesh { vertices: Vec::new(), triangles: Vec::new() };
    assert!(meet(&Triangles::new(&nothing), at, down).is_none());
}

#[test]
fn noise_along_the_beam_pushes_no_round_surface() {
    const RADIUS: f64 = 0.05;
    let around = (0..200).map(|k| f64::from(k) * std::f64::consts::TAU / 200.0);
    let rim = |z: f64| {
        around.clone().map(move |a| [RADIUS * a.cos(), RADIUS * a.sin(), z].map(|v| v as f32))
    };
    let sides = (0..200).flat_map(|k| {
        let next = (k + 1) % 200;
        [[k, next, next + 200], [k, next + 200, k + 200]]
    });
    let mesh = Mesh { vertices: rim(-0.1).chain(rim(0.1)).collect(), triangles: sides.collect() };
    let triangles = Triangles::new(&mesh);
    // Beams that end 30 to 38 mm beside the axis, 15 mm too long and too short.
    let beams = (0..200).flat_map(|k| [-0.015, 0.015].map(|noise| (k, noise)));
    for (k, noise) in beams {
        let y: f64 = 0.030 + 0.000_04 * f64::from(k);
        let on_it = Vector::new((RADIUS * RADIUS - y * y).sqrt(), y, 0.01);
        let (at, ray) = (on_it + Vector::x() * noise, -Vector::x());
        let beam = BeamPlace { at: &at, ray: &ray };
        let (t, met) = triangles.first(beam, [-0.02, 0.02]).expect("the near side");
        assert!((t - noise).abs() < 5e-5 && met.n.x > 0.5, "{t} for {noise}");
    }
}

#[test]
fn a_triangle_is_met_from_everywhere() {
    // Slivers, specks and plates.
    let mut seed = 7_u32;
    let mut draw = || {
        seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (seed >> 8) as f32 / (1 << 24) as f32
    };
    for width in [1e-4, 0.003, 0.05, 0.4] {
        let about: [f32; 3] = std::array::from_fn(|_| draw());
        let end = std::array::from_fn(|i| about[i] + 0.4 * draw());
        let other = std::array::from_fn(|i| about[i] + width * draw());
        let mesh = Mesh { vertices: vec![about, end, other], triangles: vec![[0, 1, 2]] };
        let triangles = Triangles::new(&mesh);
        let mut n_met = 0;
        for _ in 0..20_000 {
            let (u, v) = (draw(), draw());
            let (u, v) = if u + v > 1.0 { (1.0 - u, 1.0 - v) } else { (u, v) };
            let p: [f32; 3] = std::array::from_fn(|i| {
                about[i] + u * (end[i] - about[i]) + v * (other[i] - about[i])
            });
            let ray = Vector::from_fn(|_, _| f64::from(draw()) - 0.5).normalize();
            let at = Vector::from(p.map(f64::from)) + ray * f64::from(draw() - 0.5);
            let Some((t, _)) = crosses(&[about, end, other], BeamPlace { at: &at, ray: &ray })
            else {
                continue;
            };
            n_met += 1;
            let met = triangles
                .first(BeamPlace { at: &at, ray: &ray }, [-1.0, 1.0])
                .expect("it is there");
            assert!((met.0 - t).abs() < 1e-12);
            // Not where the beam ends before it or begins behind it.
            assert!(
                triangles.first(BeamPlace { at: &at, ray: &ray }, [t + 1e-9, t + 0.1]).is_none()
            );
            assert!(
                triangles.first(BeamPlace { at: &at, ray: &ray }, [t - 0.1, t - 1e-9]).is_none()
            );
        }
        assert!(n_met > 10_000, "only {n_met} beams");
    }
}
