//! Pictures of a plant and a robot made of boxes have the right size and show the robot.

use contract::{Equal, Fit, JointFit, Label, LinkEvidence, PointKind, Verdict};
use export::*;
use geometry::{Aabb, Point, Pose, Vector};
use robot::{Joint, JointKind, Link, Mesh, Model, Motion, Role};
use std::path::Path;
use std::sync::Arc;

/// A box mesh, wound outward.
fn brick(min: [f32; 3], max: [f32; 3]) -> Mesh {
    let pick = |n: usize, i: usize| if n >> i & 1 == 1 { max[i] } else { min[i] };
    let vertices = (0..8).map(|n| [pick(n, 0), pick(n, 1), pick(n, 2)]).collect();
    let quads =
        [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    let triangles = quads.iter().flat_map(|q| [[q[0], q[1], q[2]], [q[0], q[2], q[3]]]).collect();
    Mesh { vertices, triangles }
}

fn shoulder() -> Joint {
    Joint {
        name: "shoulder_lift_joint_of_the_second_welder".into(),
        kind: JointKind::Revolute,
        parent: 0,
        child: 1,
        parent_from_joint: Pose::translation(0.0, 0.0, 0.52),
        axis: Vector::y_axis(),
        limits: Some([-2.0, 2.0]),
        motion: Motion::Free(0),
    }
}

/// What the evidence page is to show: a long name, a sentence of several lines.
fn fit() -> Fit {
    let link = |name: &str, violated: f64| LinkEvidence {
        name: name.into(),
        seen: 0.42,
        matched: 1.0 - violated,
        violated,
        n_points: 12_581,
        rms: 0.0017,
    };
    Fit {
        model_name: "box".into(),
        joints: vec![JointFit {
            name: shoulder().name,
            value: 0.8,
            sigma: 0.12,
            ..JointFit::default()
        }],
        links: vec![link("base", 0.0), link("upper_arm_with_a_long_name_behind_it", 0.2)],
        verdict: Verdict::Trusted,
        score: 0.773,
        rms: 0.00169,
        equals: vec![Equal { posture: vec![-1.2], margin: 0.5 }],
        reasons: vec![
            "a reason that is longer than the page is wide goes on in a second line. ".repeat(4),
        ],
        ..Fit::default()
    }
}

#[test]
fn pictures_show_robots_where_they_stand() {
    let link = |name: &str, min: [f32; 3], max: [f32; 3]| Link {
        name: name.into(),
        role: Role::Main,
        parent_joint: None,
        mesh: brick(min, max).into(),
        cad: Arc::default(),
        bounds: Aabb { min: min.map(f64::from), max: max.map(f64::from) },
    };
    let model = Model {
        name: "box".into(),
        links: vec![
            link("base", [-0.2, -0.2, 0.0], [0.2, 0.2, 0.5]),
            link("arm", [-0.08, -0.08, 0.0], [0.08, 0.08, 0.9]),
        ],
        joints: vec![shoulder()],
        free: vec![0],
        loops: Vec::new(),
        main_chain: Vec::new(),
        symmetries: Vec::new(),
        mesh_sigmas: Vec::new(),
    };
    let base = Pose::translation(400_003.0, 5_000_002.0, 100.0);
    let poses = [base, base * Pose::new(Vector::new(0.0, 0.0, 0.52), Vector::y() * 0.8)];
    let mut views = RobotPicture::new(0, &model, &poses, &contract::OneByOne);
    let bounds =
        Aabb { min: [399_995.0, 4_999_995.0, 100.0], max: [400_012.0, 5_000_009.0, 103.0] };
    let plan = PlanPicture::new(&bounds);
    let mut add = |world: [f64; 3], label: Label| {
        plan.add(&[world], &[label]);
        views.add(world, label);
    };
    for i in 0..170 * 140 {
        let p =
            [399_995.0 + f64::from(i % 170) * 0.1, 4_999_995.0 + f64::from(i / 170) * 0.1, 100.0];
        add(p, Label::FLOOR);
    }
    for i in 0..3000 {
        add(
            [400_001.0 + f64::from(i % 100) * 0.03, 5_000_003.0, 100.0 + f64::from(i / 100) * 0.05],
            Label::FIXED,
        );
    }
    for (index, (pose, link)) in poses.iter().zip(&model.links).enumerate() {
        let (min, size) = (link.bounds.min, link.bounds.size());
        for i in 0..40_000 {
            let (u, v) = (f64::from(i % 200) / 200.0, f64::from(i / 200) / 200.0);
            let walls = [[1.0, u, v], [u, 1.0, v], [u, v, 1.0], [0.0, u, v]];
            let f = walls[(i % 4) as usize];
            let p = pose * Point::from([0, 1, 2].map(|k| min[k] + f[k] * size[k]));
            add([p.x, p.y, p.z], Label { kind: PointKind::Link, robot: 0, link: index as i16 });
        }
    }
    let out = Path::new(env!("CARGO_TARGET_TMPDIR")).join("pictures");
    std::fs::create_dir_all(&out).expect("a folder");
    let plan = plan.draw(
        "plant.las",
        &[PlanRobot {
            name: "R1".into(),
            at: [400_003.0, 5_000_002.0],
            reach: 1.5,
            body: vec![[400_003.2, 5_000_002.1], [400_003.4, 5_000_002.1]],
        }],
        &[("scan_01".into(), [400_007.0, 5_000_004.0])],
    );
    plan.write(&out.join("plan.png")).expect("writes");
    draw_evidence("R1 box trusted", &views, &fit(), &model)
        .write(&out.join("R1_evidence.png"))
        .expect("writes");
    let views = views.draw("R1 box trusted");
    views.write(&out.join("R1.png")).expect("writes");
    let read = png::Decoder::new(std::io::BufReader::new(
        std::fs::File::open(out.join("R1.png")).expect("opens"),
    ));
    let info = read.read_info().expect("reads");
    assert_eq!(
        (info.info().width as usize, info.info().height as usize),
        (views.width(), views.height())
    );
}
