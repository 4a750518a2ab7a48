//! Hoses, tools, workpieces and walls beside a two-link robot.

use super::*;
use contract::{JointFit, PointKind, SurfaceSums, Verdict};
use geometry::{Aabb, Pose, Vector};
use robot::{Joint, JointKind, Link, Motion, Role};
use std::sync::Arc;

/// A robot whose base carries an arm, and each link of the arm the next one.
fn model(n_links: usize) -> Model {
    let link = |name: &str, parent_joint| Link {
        name: name.into(),
        role: Role::Main,
        parent_joint,
        mesh: Arc::default(),
        cad: Arc::default(),
        bounds: Aabb::EMPTY,
    };
    let joint = |k: usize| Joint {
        name: format!("j{}", k + 1),
        kind: JointKind::Revolute,
        parent: k,
        child: k + 1,
        parent_from_joint: Pose::identity(),
        axis: Vector::z_axis(),
        limits: None,
        motion: Motion::Free(k),
    };
    let arm = (1..n_links).map(|k| link("arm", Some(k - 1)));
    Model {
        name: "m".into(),
        links: std::iter::once(link("base", None)).chain(arm).collect(),
        joints: (0..n_links - 1).map(joint).collect(),
        free: (0..n_links - 1).collect(),
        loops: Vec::new(),
        main_chain: (0..n_links - 1).collect(),
        symmetries: Vec::new(),
        mesh_sigmas: Vec::new(),
    }
}

fn fit(n_links: usize) -> Fit {
    Fit {
        model: 0,
        model_name: "m".into(),
        world_from_base: Pose::identity(),
        base_sigma: [0.0; 6],
        joints: (1..n_links)
            .map(|k| JointFit {
                name: format!("j{k}"),
                value: 0.0,
                sigma: 0.0,
                certainty: contract::Certainty::Determined,
                ..JointFit::default()
            })
            .collect(),
        verdict: Verdict::Trusted,
        ..Fit::default()
    }
}

/// One voxel whose distance from link `link` is given in voxels.
pub(super) fn voxel(at: Voxel, link: u16, n_away: i32) -> ResidualVoxel {
    ResidualVoxel {
        voxel: at,
        n_residual: 5,
        n_link: 0,
        nearest: LinkAt { robot: 0, link },
        distance: n_away as f32 * 0.02 + 0.01,
        at_border: false,
        grounded: false,
        surface: SurfaceSums::default(),
    }
}

pub(super) fn attached(parts: &[Vec<ResidualVoxel>]) -> Attached {
    attached_to_one_of(2, parts)
}

/// What is attached to a robot of so many links; the last one is its hand.
pub(super) fn attached_to_one_of(n_links: usize, parts: &[Vec<ResidualVoxel>]) -> Attached {
    let attach = Attach::new(&[fit(n_links)], &[model(n_links)], Settings::default());
    let mut sum = attach.empty();
    for part in parts {
        attach.add(&mut sum, part.clone()).expect("add");
    }
    attach.finish(sum).expect("finish")
}

#[test]
fn a_workpiece_in_the_gripper_is_carried_whole() {
    let piece: Vec<_> =
        (0..40).flat_map(|x| (0..80).map(move |z| voxel([x, 0, z], 1, z))).collect();
    let out = attached(&[piece]);
    assert_eq!(out.voxels.len(), 40 * 80);
    assert_eq!(out.label([3, 0, 79]), Label { kind: PointKind::Attachment, robot: 0, link: 1 });
    assert_eq!(out.label([3, 1, 79]), Label::FIXED);
}

#[test]
fn a_hose_moves_up_to_the_floor_and_a_touched_wall_is_not_lost() {
    let mut hose: Vec<_> = (0..60).map(|z| voxel([0, 0, z], 1, z)).collect();
    hose[57..].iter_mut().for_each(|v| v.grounded = true);
    let out = attached(&[hose]);
    let n = out.voxels.iter().filter(|v| v.1.kind == PointKind::Attachment).count();
    assert_eq!(n, 56, "it moves up to where it is held");
    let mut wall = Vec::new();
    for x in -30_i32..=30 {
        for y in -30_i32..=30 {
            let mut v = voxel([x, y, 0], 1, f64::from(x * x + y * y).sqrt() as i32);
            v.at_border = x.abs() == 30;
            wall.push(v);
        }
    }
    let out = attached(&[wall]);
    assert!(!out.voxels.is_empty());
    assert!(out.voxels.iter().all(|v| v.1 == Label::UNCERTAIN));
}

#[test]
fn voxels_that_touch_only_the_base_or_nothing_are_fixed() {
    let box_on_base: Vec<_> = (0..10).map(|z| voxel([0, 0, z], 0, z)).collect();
    let alone: Vec<_> = (0..10).map(|z| voxel([50, 0, z], 1, z + 10)).collect();
    let out = attached(&[box_on_base, alone]);
    assert!(out.voxels.is_empty());
}

#[test]
fn a_cable_between_base_and_arm_is_shared() {
    let cable: Vec<_> = (0..12)
        .map(|z| if z < 6 { voxel([0, 0, z], 0, z) } else { voxel([0, 0, z], 1, 11 - z) })
        .collect();
    let out = attached(&[cable]);
    assert_eq!(out.label([0, 0, 0]), Label::FIXED);
    assert_eq!(out.label([0, 0, 11]).kind, PointKind::Attachment);
}

#[test]
fn the_result_does_not_depend_on_the_order_of_parts() {
    let attach = Attach::new(&[fit(2)], &[model(2)], Settings::default());
    let part = |k: i32| -> Vec<ResidualVoxel> {
        (0..40).map(|z| voxel([(z * 7 + k) % 3, k % 2, z], 1, (z * 13 + k * 5) % 37)).collect()
    };
    let parts: Vec<_> = (0..9).map(part).collect();
    let whole = attached(&parts);
    for cut in 0..=parts.len() {
        let (mut a, mut b) = (attach.empty(), attach.empty());
        for (i, part) in parts.iter().enumerate() {
            attach.add(if i < cut { &mut a } else { &mut b }, part.clone()).expect("add");
        }
        attach.join(&mut a, b).expect("join");
        assert_eq!(attach.finish(a).expect("finish"), whole);
    }
}

/// The outside of a box between two corners.
pub(super) fn shell(
    min: Voxel,
    max: Voxel,
    voxel: impl Fn(Voxel) -> ResidualVoxel,
) -> Vec<ResidualVoxel> {
    let mut out = Vec::new();
    for x in min[0]..=max[0] {
        for y in min[1]..=max[1] {
            for z in min[2]..=max[2] {
                let at = [x, y, z];
                if (0..3).any(|i| at[i] == min[i] || at[i] == max[i]) {
                    out.push(voxel(at));
                }
            }
        }
    }
    out
}

/// A gripper of a body and two fingers below the arm at z = 0, and a part below them on a bench.
fn gripper_on_a_part() -> [Vec<ResidualVoxel>; 3] {
    let near = |at: Voxel| voxel(at, 1, -at[2]);
    let mut tool = shell([-3, -2, -8], [3, 2, 0], near);
    for x in [-3, 2] {
        tool.extend(shell([x, -1, -16], [x + 1, 1, -9], near));
    }
    let part = shell([-7, -7, -26], [7, 7, -17], near);
    let bench = shell([-30, -30, -28], [30, 30, -27], |at| ResidualVoxel {
        at_border: at[0].abs() == 30,
        ..near(at)
    });
    [tool, part, bench]
}

#[test]
fn a_gripper_that_touches_a_part_moves_and_the_part_does_not() {
    let parts = gripper_on_a_part();
    let out = attached(&parts);
    let [tool, part, bench] = &parts;
    let n = |of: &[ResidualVoxel], kind: PointKind| {
        of.iter().filter(|v| out.label(v.voxel).kind == kind).count()
    };
    let n_moving = n(tool, PointKind::Attachment);
    assert!(n_moving * 4 >= tool.len() * 3, "{n_moving} of {}: fingers as well", tool.len());
    assert!(n(tool, PointKind::Fixed) * 20 <= tool.len());
    assert_eq!(n(part, PointKind::Attachment) + n(bench, PointKind::Attachment), 0);
}

#[test]
fn a_plate_in_the_air_belongs_to_the_hand_beside_it_unless_a_bench_is_as_near() {
    let link = ResidualVoxel { n_residual: 0, n_link: 9, ..voxel([0, 0, 0], 1, 0) };
    let plate: Vec<_> =
        (0..12).flat_map(|x| (0..8).map(move |y| voxel([x, y, -10], 1, 99))).collect();
    let out = attached(&[vec![link], plate.clone()]);
    assert_eq!(out.label([5, 5, -10]), Label { kind: PointKind::Attachment, robot: 0, link: 1 });
    let bench = shell([-30, -30, -16], [30, 30, -15], |at| ResidualVoxel {
        at_border: at[0].abs() == 30,
        ..voxel(at, 1, 99)
    });
    let out = attached(&[vec![link], plate, bench]);
    assert_eq!(out.label([5, 5, -10]), Label::FIXED);
}

#[test]
fn a_hose_that_is_seen_sparsely_moves_up_to_where_it_is_held() {
    // Its ends are whole, and between them every other voxel is missing.
    let hose: Vec<_> = (0..80)
        .filter(|k| !(6..74).contains(k) || k % 2 == 0)
        .map(|k| ResidualVoxel { at_border: k >= 78, ..voxel([k / 2, k / 2, k], 1, k) })
        .collect();
    let out = attached(std::slice::from_ref(&hose));
    let n = hose.iter().filter(|v| out.label(v.voxel).kind == PointKind::Attachment).count();
    assert!(n >= 40, "{n} of {}", hose.len());
}

#[test]
fn a_gap_in_a_hose_is_bridged_although_mixed_pixels_hang_beside_it() {
    let hose: Vec<_> = (0..80)
        .filter(|k| !(18..20).contains(k))
        .map(|k| ResidualVoxel { at_border: k >= 78, ..voxel([k / 2, 0, k], 1, k) })
        .collect();
    let mixed = vec![voxel([9, 5, 17], 1, 99), voxel([9, 4, 20], 1, 99)];
    let out = attached(&[hose.clone(), mixed]);
    let n = hose.iter().filter(|v| out.label(v.voxel).kind == PointKind::Attachment).count();
    assert!(n >= 70, "{n} of {}", hose.len());
}

#[test]
fn mixed_pixels_beside_a_carried_plate_do_not_hold_it() {
    let link = ResidualVoxel { n_residual: 0, n_link: 9, ..voxel([0, 0, 0], 1, 0) };
    let plate: Vec<_> =
        (0..12).flat_map(|x| (0..8).map(move |y| voxel([x, y, -10], 1, 99))).collect();
    let mixed = vec![voxel([5, 5, -14], 1, 99), voxel([5, 6, -18], 1, 99)];
    let out = attached(&[vec![link], plate, mixed]);
    assert_eq!(out.label([5, 5, -10]), Label { kind: PointKind::Attachment, robot: 0, link: 1 });
}

/// A tool whose wide tip stands on a bench with a narrow foot: the least cut is through the foot.
#[test]
fn a_bench_with_a_narrow_foot_is_not_taken_with_the_tool_that_touches_it() {
    let near = |at: Voxel| voxel(at, 1, -at[2]);
    let (mut tool, mut top) =
        (shell([-6, -6, -9], [6, 6, 0], near), shell([-12, -12, -12], [12, 12, -10], near));
    // No scan sees where they touch.
    let is_hidden = |v: &ResidualVoxel| v.voxel[..2].iter().all(|i| i.abs() < 6);
    tool.retain(|v| v.voxel[2] > -9 || !is_hidden(v));
    top.retain(|v| v.voxel[2] < -10 || !is_hidden(v));
    let mut foot = shell([-2, -2, -20], [2, 2, -13], near);
    foot.extend(shell([-12, -12, -22], [12, 12, -21], |at| ResidualVoxel {
        grounded: at[2] == -22,
        ..near(at)
    }));
    let out = attached(&[tool.clone(), top.clone(), foot.clone()]);
    let n = |of: &[ResidualVoxel], kind: PointKind| {
        of.iter().filter(|v| out.label(v.voxel).kind == kind).count()
    };
    assert_eq!(n(&top, PointKind::Attachment) + n(&foot, PointKind::Attachment), 0);
    assert_eq!(n(&tool, PointKind::Fixed), 0);
}

#[test]
fn a_wire_beside_a_hand_stays_where_it_is() {
    let link = ResidualVoxel { n_residual: 0, n_link: 9, ..voxel([0, 0, 0], 1, 0) };
    let wire: Vec<_> = (-15..15).map(|z| voxel([6, z / 3, z], 1, 99)).collect();
    assert!(attached(&[vec![link], wire]).voxels.is_empty());
}

#[test]
fn a_torch_moves_up_to_its_tip_and_the_sheet_below_it_stays() {
    let near = |at: Voxel| voxel(at, 1, -at[2]);
    let mut torch = shell([-2, -2, -8], [2, 2, 0], near);
    // Its neck is seen worst where it begins.
    torch.extend(
        (9..20).flat_map(|z| (0..if z < 12 { 1 } else { 3 }).map(move |x| near([x, 0, -z]))),
    );
    let sheet = shell([-20, -20, -21], [20, 20, -20], |at| ResidualVoxel {
        grounded: at[0].abs() == 20,
        ..near(at)
    });
    let out = attached(&[torch.clone(), sheet.clone()]);
    let n = |of: &[ResidualVoxel]| {
        of.iter().filter(|v| out.label(v.voxel).kind == PointKind::Attachment).count()
    };
    assert!(n(&torch) * 5 >= torch.len() * 4, "{} of {}", n(&torch), torch.len());
    assert_eq!(n(&sheet), 0);
}

/// How many voxels of a curve that touches a bundle of hoses at the arm move, and their number.
fn moving_beside_a_bundle(curve: Vec<Voxel>) -> [usize; 2] {
    let near = |at: Voxel| voxel(at, 1, at[1].abs());
    let is_end = |at: Voxel| at[1].max(at[2].abs()) >= 78;
    let bundle = shell([-3, 0, -3], [3, 4, 3], near);
    let curve: Vec<_> =
        curve.into_iter().map(|at| ResidualVoxel { at_border: is_end(at), ..near(at) }).collect();
    let out = attached(&[bundle, curve.clone()]);
    let moves = |v: &&ResidualVoxel| out.label(v.voxel).kind == PointKind::Attachment;
    [curve.iter().filter(moves).count(), curve.len()]
}

#[test]
fn a_hose_that_leaves_a_bundle_moves_and_a_pipe_that_passes_does_not() {
    // The hose is seen best far from the robot.
    let hose = (5..80).flat_map(|y| (0..if y < 20 { 1 } else { 2 }).map(move |x| [x, y, 0]));
    let [n, of] = moving_beside_a_bundle(hose.collect());
    assert!(n * 10 >= of * 9, "{n} of {of}");
    let pipe = (-80..80).flat_map(|z| (0..2).map(move |x| [x, 5, z]));
    let [n, of] = moving_beside_a_bundle(pipe.collect());
    assert!(n * 10 <= of, "{n} of {of}");
}

#[test]
fn a_tool_that_only_a_hose_joins_to_the_building_moves_whole() {
    // A slender mount, wide cups, and a hose from the mount to the ceiling.
    let near = |at: Voxel| voxel(at, 1, -at[2]);
    let mut tool = shell([-1, -1, -20], [1, 1, 0], near);
    tool.extend(shell([-9, -9, -23], [9, 9, -21], near));
    let hose =
        (2..80).map(|k| ResidualVoxel { at_border: k >= 78, ..voxel([k, 0, k / 2 - 8], 1, k) });
    let out = attached(&[tool.clone(), hose.collect()]);
    let n = tool.iter().filter(|v| out.label(v.voxel).kind == PointKind::Attachment).count();
    assert!(n * 20 >= tool.len() * 19, "{n} of {}", tool.len());
}
