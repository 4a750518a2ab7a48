//! Tools that touch things, and things that stand beside a tool.

use super::tests::{attached, attached_to_one_of, shell, voxel};
use super::*;
use crate::attached::Attached;
use contract::{PointKind, SurfaceSums};

fn below(at: Voxel) -> ResidualVoxel {
    voxel(at, 1, -at[2])
}

fn n_of(out: &Attached, of: &[ResidualVoxel], kind: PointKind) -> usize {
    of.iter().filter(|v| out.label(v.voxel).kind == kind).count()
}

/// A bench whose border lies outside of the region.
fn bench(min: Voxel, max: Voxel) -> Vec<ResidualVoxel> {
    shell(min, max, |at| ResidualVoxel { at_border: at[0] == max[0], ..below(at) })
}

#[test]
fn a_box_beside_a_tool_does_not_go_with_it() {
    // Of what holds the box on the bench less is seen than of how near it is to the tool.
    let tool = shell([-2, -2, -9], [2, 2, 0], below);
    let box_beside = shell([3, -5, -16], [9, 5, -4], below);
    let bench = bench([3, -5, -18], [30, 5, -17]);
    let out = attached(&[tool.clone(), box_beside.clone(), bench.clone()]);
    let n_lost = n_of(&out, &box_beside, PointKind::Attachment);
    assert!(10 * n_lost <= box_beside.len(), "{n_lost} of {}", box_beside.len());
    assert_eq!(n_of(&out, &bench, PointKind::Attachment), 0);
    assert_eq!(n_of(&out, &tool, PointKind::Fixed), 0);
}

/// A plate below a pole under the arm, with four cups that stand on a pile.
fn plate_on_cups() -> [Vec<ResidualVoxel>; 2] {
    let mut tool = shell([-1, -1, -6], [1, 1, 0], below);
    tool.extend(shell([-10, -8, -8], [10, 8, -7], below));
    for (x, y) in [(-8, -6), (-8, 6), (8, -6), (8, 6)] {
        tool.extend(shell([x, y, -12], [x, y, -9], below));
    }
    let mut pile = shell([-14, -14, -30], [14, 14, -13], |at| ResidualVoxel {
        grounded: at[2] == -30,
        ..below(at)
    });
    for top in pile.iter_mut().filter(|v| v.voxel[2] == -13) {
        *top = faced(top.voxel, [0, 0, 1]);
    }
    [tool, pile]
}

#[test]
fn a_plate_of_suction_cups_on_a_pile_moves_and_the_pile_does_not() {
    let [tool, pile] = plate_on_cups();
    let out = attached(&[tool.clone(), pile.clone()]);
    let n_moving = n_of(&out, &tool, PointKind::Attachment);
    assert!(10 * n_moving >= 9 * tool.len(), "{n_moving} of {}", tool.len());
    assert_eq!(n_of(&out, &pile, PointKind::Attachment), 0);
}

#[test]
fn a_plate_of_cups_whose_mount_is_hidden_is_no_fixed_thing() {
    // Of the slender pole between flange and plate no point is nearer to the flange than 15 mm. In
    // the second case a side of the plate is seen apart, without its cups.
    for is_split in [false, true] {
        let [mut tool, mut pile] = plate_on_cups();
        tool.retain(|v| v.voxel[2] <= -7);
        tool.extend((-6..=0).map(|z| below([0, 0, z])));
        if is_split {
            tool.retain(|v| v.voxel[0] < 3 || v.voxel[0] > 5 && v.voxel[2] > -9);
        }
        for v in tool.iter_mut().chain(&mut pile) {
            v.distance += 0.005;
        }
        let out = attached(&[tool.clone(), pile.clone()]);
        let n_fixed = n_of(&out, &tool, PointKind::Fixed);
        assert!(20 * n_fixed <= tool.len(), "{n_fixed} of {}, {is_split}", tool.len());
        assert_eq!(n_of(&out, &pile, PointKind::Attachment), 0);
        let n_open = n_of(&out, &pile, PointKind::Uncertain);
        assert!(20 * n_open <= pile.len(), "{n_open} of {}", pile.len());
    }
}

#[test]
fn a_table_beside_the_hand_is_no_plate_of_cups() {
    let [mut tool, _] = plate_on_cups();
    // The same below a tool's tip, but all to one side of it, and on legs to the floor.
    tool.retain(|v| v.voxel[2] >= -6);
    let top = shell([-1, -1, -8], [40, 30, -7], below);
    let mut legs = Vec::new();
    for (x, y) in [(0, 0), (39, 0), (0, 29), (39, 29)] {
        legs.extend(shell([x, y, -40], [x, y, -9], |at| ResidualVoxel {
            grounded: at[2] == -40,
            ..below(at)
        }));
    }
    let out = attached(&[tool, top.clone(), legs.clone()]);
    assert_eq!(n_of(&out, &legs, PointKind::Attachment), 0);
    let n_lost = n_of(&out, &top, PointKind::Attachment);
    assert!(100 * n_lost <= top.len(), "{n_lost} of {}", top.len());
}

#[test]
fn what_may_hang_on_a_hidden_flange_is_open() {
    let farther = |v: &ResidualVoxel| ResidualVoxel { distance: v.distance + 0.03, ..*v };
    let tool: Vec<_> = shell([-2, -2, -9], [2, 2, -1], below).iter().map(farther).collect();
    let part: Vec<_> = shell([-9, -9, -14], [9, 9, -10], below).iter().map(farther).collect();
    let bench: Vec<_> = bench([-30, -30, -16], [30, 30, -15]).iter().map(farther).collect();
    let out = attached(&[tool.clone(), part, bench.clone()]);
    assert_eq!(n_of(&out, &tool, PointKind::Attachment), 0);
    let n_open = n_of(&out, &tool, PointKind::Uncertain);
    assert!(3 * n_open >= 2 * tool.len(), "{n_open} of {}", tool.len());
    assert!(out.groups.iter().all(|group| group.n_attached == 0));
    assert_eq!(n_of(&out, &bench, PointKind::Attachment), 0);
}

/// A voxel of a face that is seen with this normal.
fn faced(at: Voxel, normal: [i32; 3]) -> ResidualVoxel {
    let surface = SurfaceSums { places: [640; 3], normals: normal.map(|v| 5 * 256 * v) };
    ResidualVoxel { surface, ..below(at) }
}

#[test]
fn a_cut_follows_the_inner_corner() {
    // A cup of 7 × 7 voxels on a box of 9 × 9: the corner is at z = -5, and an edge as long as the
    // cup is round is anywhere above it.
    let side = |half: i32, z: std::ops::Range<i32>, grounded: i32| {
        let mut out = Vec::new();
        for (k, z) in (-half..half).flat_map(|k| z.clone().map(move |z| (k, z))) {
            for (at, normal) in [
                ([half, k, z], [1, 0, 0]),
                ([-k, half, z], [0, 1, 0]),
                ([-half, -k, z], [-1, 0, 0]),
                ([k, -half, z], [0, -1, 0]),
            ] {
                out.push(ResidualVoxel { grounded: z <= grounded, ..faced(at, normal) });
            }
        }
        out
    };
    let cup = side(3, -5..1, i32::MIN);
    let mut part = side(4, -20..-6, -19);
    for (x, y) in (-4..=4).flat_map(|x| (-4..=4).map(move |y| (x, y))) {
        part.push(faced([x, y, -6], [0, 0, 1]));
    }
    let out = attached(&[cup.clone(), part.clone()]);
    let n_moving = n_of(&out, &cup, PointKind::Attachment);
    assert!(4 * n_moving >= 3 * cup.len(), "{n_moving} of {}", cup.len());
    assert_eq!(n_of(&out, &part, PointKind::Attachment), 0);
}

/// A tool that holds a plate, which something else holds as well.
fn held_plate(other: Vec<ResidualVoxel>) -> [Vec<ResidualVoxel>; 3] {
    let tool = shell([-2, -2, -9], [2, 2, 0], below);
    [tool, shell([-15, -15, -20], [15, 15, -10], below), other]
}

#[test]
fn a_part_that_hangs_on_a_hand_and_a_hose_moves_and_one_on_a_post_does_not() {
    let hose = (0..60).flat_map(|z| [[14, 14, z - 9], [14, 15, z - 9]]);
    let hose = hose.map(|at| ResidualVoxel { at_border: at[2] == 50, ..voxel(at, 1, 10) });
    let held = held_plate(hose.collect());
    let out = attached(&held);
    for (of, least) in held.iter().zip([95, 95, 80]) {
        let n_moving = n_of(&out, of, PointKind::Attachment);
        assert!(100 * n_moving >= least * of.len(), "{n_moving} of {}", of.len());
    }
    let held = held_plate(shell([-3, -3, -60], [3, 3, -21], |at| ResidualVoxel {
        grounded: at[2] == -60,
        ..below(at)
    }));
    let out = attached(&held);
    assert_eq!(n_of(&out, &held[1], PointKind::Attachment), 0);
    assert_eq!(n_of(&out, &held[2], PointKind::Attachment), 0);
}

#[test]
fn a_column_to_which_a_hose_leads_stands_though_its_foot_is_hidden() {
    // A hose from the arm, and a column of which only the upper part is seen. Distances from links
    // are known up to 16 cm.
    let far = |at: Voxel| {
        let near = voxel(at, 1, at[0]);
        ResidualVoxel { distance: if at[0] > 7 { f32::INFINITY } else { near.distance }, ..near }
    };
    let hose: Vec<_> = (0..70).flat_map(|x| [[x, 0, 1], [x, 1, 1]]).map(far).collect();
    let column = shell([70, -4, -50], [78, 4, 20], far);
    let out = attached(&[hose.clone(), column.clone()]);
    assert_eq!(n_of(&out, &column, PointKind::Attachment), 0);
    let n_moving = n_of(&out, &hose, PointKind::Attachment);
    assert!(10 * n_moving >= 9 * hose.len(), "{n_moving} of {}", hose.len());
}

#[test]
fn a_part_in_the_air_has_the_columns_of_beams_that_graze_it_and_no_wire() {
    let link = ResidualVoxel { n_residual: 0, n_link: 9, ..voxel([0, 0, 0], 1, 0) };
    let far = |at: Voxel| ResidualVoxel { distance: 0.2, ..below(at) };
    let part = shell([-12, -12, -30], [12, 12, -10], far);
    let columns: Vec<_> =
        [15, 19, 23].into_iter().flat_map(|x| (-27..-13).map(move |z| far([x, 12, z]))).collect();
    let out = attached(&[vec![link], part.clone(), columns.clone()]);
    for of in [&part, &columns] {
        assert_eq!(n_of(&out, of, PointKind::Attachment), of.len());
    }
    let wire: Vec<_> = (-60..20).map(|z| far([15, 12, z])).collect();
    let out = attached(&[vec![link], part.clone(), wire.clone()]);
    assert_eq!(n_of(&out, &wire, PointKind::Attachment), 0);
    assert_eq!(n_of(&out, &part, PointKind::Attachment), 0);
}

#[test]
fn the_lines_of_beams_on_a_sheet_stay_when_a_tip_touches_one() {
    let mut torch = shell([-3, -3, -8], [3, 3, 0], below);
    torch.extend(shell([-1, -1, -25], [2, 2, -9], below));
    torch.retain(|v| v.voxel[2] != -21);
    // Around the tip the sheet is lines of beams that graze it, 8 cm apart.
    let sheet = shell([-16, -16, -21], [30, 16, -21], |at| ResidualVoxel {
        at_border: at[0] == 30,
        ..below(at)
    });
    let is_seen = |v: &ResidualVoxel| v.voxel[0].abs() > 10 || v.voxel[1] % 4 == 0;
    let sheet: Vec<_> = sheet.into_iter().filter(is_seen).collect();
    let out = attached(&[torch.clone(), sheet.clone()]);
    let n_lost = n_of(&out, &sheet, PointKind::Attachment);
    assert!(n_lost <= 6, "{n_lost} of {}", sheet.len());
    let n_moving = n_of(&out, &torch, PointKind::Attachment);
    assert!(5 * n_moving >= 4 * torch.len(), "{n_moving} of {}", torch.len());
}

#[test]
fn a_hose_whose_end_is_hidden_moves_and_what_passes_or_stands_beside_the_robot_does_not() {
    // The nearest voxel is 15 mm from the link.
    let near = |at: Voxel, way: i32| {
        let voxel = voxel(at, 1, way.abs());
        ResidualVoxel { distance: voxel.distance + 0.005, ..voxel }
    };
    let hose: Vec<_> = (0..80).map(|k| near([k / 3, k * k / 200, k], k)).collect();
    let passing: Vec<_> = (-60..80).map(|k| near([k / 3, 0, k], k)).collect();
    let post: Vec<_> = (0..60).map(|k| near([0, 0, -k], k)).collect();
    let n_moving = |of: &[ResidualVoxel], n_links: usize| {
        let (mut of, n) = (of.to_vec(), of.len());
        let stands = of[n - 1].voxel[2] < 0;
        for end in &mut of[n - 3..] {
            (end.at_border, end.grounded) = (!stands, stands);
        }
        n_of(&attached_to_one_of(n_links, &[of.clone()]), &of, PointKind::Attachment)
    };
    // Beside a hand, and beside another link.
    for n_links in [2, 4] {
        assert!(n_moving(&hose, n_links) >= 70, "{} of 80", n_moving(&hose, n_links));
        assert_eq!([n_moving(&passing, n_links), n_moving(&post, n_links)], [0, 0], "{n_links}");
    }
}

#[test]
fn a_tool_on_a_hose_moves_whole_with_a_bit_beside_the_hose_and_a_clamp_at_its_end() {
    let mut tool = shell([-3, -3, -10], [3, 3, 0], below);
    tool.extend(shell([-10, -10, -12], [10, 10, -11], below));
    let far = |at: Voxel| voxel(at, 1, 99);
    let border = |at: Voxel| ResidualVoxel { at_border: true, ..far(at) };
    tool.extend(shell([6, 6, -10], [10, 10, -6], below));
    // From the plate up to a beam, with a knob: no hose by its shape.
    let mut line: Vec<_> = (-5..60).map(|z| far([8, 8, z])).collect();
    line.extend((0..60).map(|z| far([9, 8, z])));
    let knob = shell([6, 6, -2], [10, 10, -1], far);
    line.extend(knob.iter().filter(|v| v.voxel[..2] != [8, 8]));
    let beam = shell([0, 0, 60], [40, 20, 64], border);
    // From the mount to a clamp.
    let mut hose: Vec<_> = (4..80).map(|k| far([k, 0, k / 2 - 8])).collect();
    hose[0] = voxel([4, 0, -6], 1, 0);
    let clamp = shell([80, -1, 31], [82, 1, 33], |at| match at[0] {
        82 => border(at),
        _ => far(at),
    });
    for held in [vec![line, beam], vec![hose, clamp]] {
        let parts: Vec<_> = std::iter::once(tool.clone()).chain(held.clone()).collect();
        let out = attached(&parts);
        for (of, least) in [(&tool, 95), (&held[0], 90)] {
            let n = n_of(&out, of, PointKind::Attachment);
            assert!(100 * n >= least * of.len(), "{n} of {}", of.len());
        }
    }
}
