//! Finds connected sets of sorted voxels. Rows are cut into runs and neighbouring runs are joined,
//! so that the work is linear in the number of voxels.

use contract::Voxel;

/// A voxel with the number of points in it.
pub(crate) type Counted = (Voxel, u32);

/// Consecutive voxels of one row, with small gaps bridged.
struct VoxelRun {
    first: i32,
    last: i32,
}

/// A row of voxels along x.
struct RowOfVoxels {
    z: i32,
    y: i32,
    runs: std::ops::Range<usize>,
}

/// Index of the connected set of each voxel: 0, 1, … in the order of the sets' first voxels. Two
/// voxels are connected if they differ by at most `gap + 1` along each axis. `voxels` must be
/// sorted by (z, y, x).
pub(crate) fn connect(voxels: &[Counted], gap: i32) -> Vec<u32> {
    let reach = gap.saturating_add(1);
    let (rows, runs, run_of) = cut(voxels, reach);
    let mut parent: Vec<u32> = (0..runs.len() as u32).collect();
    for dz in -reach..=0 {
        for dy in -reach..=reach {
            // Only earlier rows, so that each pair of rows is visited once.
            if (dz, dy) < (0, 0) {
                join_rows(&rows, &runs, RowOffset { dz, dy }, reach, &mut parent);
            }
        }
    }
    let mut number = vec![u32::MAX; runs.len()];
    let mut n = 0;
    run_of
        .iter()
        .map(|&run| {
            let root = find(&mut parent, run) as usize;
            if number[root] == u32::MAX {
                number[root] = n;
                n += 1;
            }
            number[root]
        })
        .collect()
}

fn cut(voxels: &[Counted], reach: i32) -> (Vec<RowOfVoxels>, Vec<VoxelRun>, Vec<u32>) {
    let (mut rows, mut runs): (Vec<RowOfVoxels>, Vec<VoxelRun>) = (Vec::new(), Vec::new());
    let mut run_of = Vec::with_capacity(voxels.len());
    for &([x, y, z], _) in voxels {
        let same_row = rows.last().is_some_and(|r| r.z == z && r.y == y);
        if !same_row {
            rows.push(RowOfVoxels { z, y, runs: runs.len()..runs.len() });
        }
        match runs.last_mut() {
            Some(run) if same_row && x.saturating_sub(run.last) <= reach => run.last = x,
            _ => {
                runs.push(VoxelRun { first: x, last: x });
                if let Some(row) = rows.last_mut() {
                    row.runs.end = runs.len();
                }
            }
        }
        run_of.push(runs.len() as u32 - 1);
    }
    (rows, runs, run_of)
}

/// Position of one row relative to another, voxels.
#[derive(Debug, Clone, Copy)]
struct RowOffset {
    dz: i32,
    dy: i32,
}

/// Joins runs of each row with those of the row at an offset from it.
fn join_rows(
    rows: &[RowOfVoxels],
    runs: &[VoxelRun],
    offset: RowOffset,
    reach: i32,
    parent: &mut [u32],
) {
    // Both sequences of rows are sorted and walked through once.
    let mut other = 0;
    for row in rows {
        let wanted = (row.z.saturating_add(offset.dz), row.y.saturating_add(offset.dy));
        while other < rows.len() && (rows[other].z, rows[other].y) < wanted {
            other += 1;
        }
        if other == rows.len() {
            break;
        }
        if (rows[other].z, rows[other].y) != wanted {
            continue;
        }
        let (mut i, mut j) = (row.runs.start, rows[other].runs.start);
        while i < row.runs.end && j < rows[other].runs.end {
            let (a, b) = (&runs[i], &runs[j]);
            if a.first <= b.last.saturating_add(reach) && b.first <= a.last.saturating_add(reach) {
                join(parent, i as u32, j as u32);
            }
            if a.last < b.last { i += 1 } else { j += 1 }
        }
    }
}

fn find(parent: &mut [u32], mut at: u32) -> u32 {
    while parent[at as usize] != at {
        let up = parent[parent[at as usize] as usize];
        parent[at as usize] = up;
        at = up;
    }
    at
}

fn join(parent: &mut [u32], a: u32, b: u32) {
    let (a, b) = (find(parent, a), find(parent, b));
    parent[a.max(b) as usize] = a.min(b);
}
