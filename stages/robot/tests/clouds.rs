//! CAD clouds have evenly spread prefixes and outward normals, and leave out hidden faces.
#![allow(missing_docs, clippy::unwrap_used, clippy::print_stdout)]

mod common;

use robot::{CadCloud, Library, Model, Settings};
use std::time::Instant;

fn load(text: &str) -> Model {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("robot.urdf");
    std::fs::write(&path, text).unwrap();
    Model::load_urdf(&path, "test", &Settings::default()).unwrap().0
}

fn body(shapes: &str) -> CadCloud {
    let model = load(&format!("<robot name='r'><link name='base'>{shapes}</link></robot>"));
    model.links[0].cad.as_ref().clone()
}

const SPHERE: &str = "<visual><geometry><sphere radius='0.3'/></geometry></visual>";
const INNER: &str = "<visual><geometry><box size='0.2 0.2 0.2'/></geometry></visual>";

#[test]
fn normals_point_outward_and_inner_parts_are_gone() {
    let alone = body(SPHERE);
    let filled = body(&format!("{SPHERE}{INNER}"));
    for cloud in [&alone, &filled] {
        assert!(
            (f64::from(cloud.area) - 4.0 * std::f64::consts::PI * 0.09).abs() < 0.03,
            "{}",
            cloud.area
        );
        assert!((cloud.spacing - 0.005).abs() < 0.0007, "{}", cloud.spacing);
        for (p, n) in cloud.points.iter().zip(&cloud.normals) {
            let r = (p[0] * p[0] + p[1] * p[1] + p[2] * p[2]).sqrt();
            assert!((r - 0.3).abs() < 0.003, "{r}");
            let outward = (p[0] * n[0] + p[1] * n[1] + p[2] * n[2]) / r;
            assert!(outward > 0.98, "{outward}");
        }
    }
}

#[test]
fn every_prefix_is_even() {
    let cloud = body(SPHERE);
    for n in [100, 300, 1000, 4000] {
        // Distances from many places to the nearest sample of the prefix, and between samples.
        let spacing = (f64::from(cloud.area) / n as f64).sqrt();
        let near = |p: &[f32; 3], skip: usize| {
            (cloud.points[..n].iter().enumerate().filter(|(k, _)| *k != skip))
                .map(|(_, q)| (0..3).map(|k| f64::from(p[k] - q[k]).powi(2)).sum::<f64>())
                .fold(f64::INFINITY, f64::min)
                .sqrt()
        };
        let hole = cloud.points.iter().step_by(37).map(|p| near(p, usize::MAX)).fold(0.0, f64::max);
        let closest = (0..n).map(|k| near(&cloud.points[k], k)).fold(f64::INFINITY, f64::min);
        println!("{n}: hole {:.2}, closest {:.2} spacings", hole / spacing, closest / spacing);
        assert!(hole < 1.9 * spacing, "{n}: {hole} {spacing}");
        assert!(closest > 0.4 * spacing, "{n}: {closest} {spacing}");
    }
}

#[test]
fn the_same_model_gives_the_same_cloud() {
    assert_eq!(body(SPHERE), body(SPHERE));
}

/// Loads and measures the shared robots that `wanted` names.
fn measure(wanted: impl Fn(&str) -> bool) {
    let Some(dir) = common::shared("robots") else {
        return;
    };
    let (folders, _) = Library::open(&dir).unwrap();
    for folder in folders.iter().filter(|f| wanted(&f.file_name().unwrap().to_string_lossy())) {
        let start = Instant::now();
        let model = Library::load_folder(&dir, folder, &Settings::default()).0.unwrap();
        let seconds = start.elapsed().as_secs_f64();
        let n: usize = model.links.iter().map(|l| l.cad.points.len()).sum();
        let outer: f64 = model.links.iter().map(|l| f64::from(l.cad.area)).sum();
        let whole: f64 = model.links.iter().map(|l| area(&l.mesh)).sum();
        println!("{}: {n} samples, outer {outer:.2} of {whole:.2} m², {seconds:.2} s", model.name);
        assert!(outer > 0.6 * whole && outer <= 1.001 * whole);
        for link in model.links.iter().filter(|l| !l.mesh.triangles.is_empty()) {
            assert!(
                link.cad.points.len() > 100
                    && link.cad.points.len() <= Settings::default().max_samples
            );
            assert!(
                link.cad.points.iter().all(|p| link.bounds.grown(1e-4).contains(p.map(f64::from)))
            );
        }
    }
}

#[test]
fn real_robots_have_clouds() {
    measure(|name| ["abb_irb2400_12_155", "kuka_kr10_r1100_sixx", "robotiq_2f_85"].contains(&name));
}

#[test]
#[ignore = "a minute in the dev profile; for the figures of the whole library"]
fn all_real_robots_have_clouds() {
    measure(|_| true);
}

fn area(mesh: &robot::Mesh) -> f64 {
    let corner = |i: u32| geometry::Vector::from(mesh.vertices[i as usize].map(f64::from));
    (mesh.triangles.iter())
        .map(|t| 0.5 * (corner(t[1]) - corner(t[0])).cross(&(corner(t[2]) - corner(t[0]))).norm())
        .sum()
}
