//! Finds the blocks of a PTX file: their offsets, poses and numbers of points. No point is kept.

use super::file::PtxScan;
use super::look::PtxLook;
use crate::frame::{self, FileFrame};
use crate::oddities::no_returns_note;
use crate::text::{TextLines, numbers};
use contract::{Error, Result, is_ptx_no_return};
use geometry::Pose;
use nalgebra::{Matrix3, Rotation3, Translation3, UnitQuaternion, Vector3};
use std::path::Path;

/// Smallest length of a line of points, bytes: three digits, two spaces and a line end, which the
/// last line may lack.
const MIN_LINE: u64 = 6;
/// Largest deviation of a matrix from a rotation; files carry 4 to 6 digits.
const RIGID: f64 = 1e-3;
/// Difference between stated scanner position and matrix that is reported, metres.
const SAME_POSITION: f64 = 1e-3;

/// All blocks of the file, in file order, each with messages about what is missing; `metres` is the
/// length of the file's unit.
pub(super) fn find(path: &Path, metres: f64) -> Result<Vec<(PtxScan, Vec<String>)>> {
    let n_bytes = std::fs::metadata(path)?.len();
    let mut lines = TextLines::open(path, 0, 0)?;
    let mut out = Vec::new();
    while lines.advance()? {
        out.push(block(&mut lines, n_bytes, metres)?);
    }
    if out.is_empty() {
        return Err(Error::bad_input(format!("file holds no scan, bytes \"{n_bytes}\"")));
    }
    Ok(out)
}

/// Reads one block, from the line with its columns to its last point.
fn block(lines: &mut TextLines, n_bytes: u64, metres: f64) -> Result<(PtxScan, Vec<String>)> {
    let mut notes = Vec::new();
    let n_cols = count(lines).map_err(|e| {
        if lines.number() == 1 {
            e
        } else {
            e.hint("the scan before may hold more points than it announces")
        }
    })?;
    next(lines)?;
    let n_rows = count(lines)?;
    let n_lines =
        n_rows.checked_mul(n_cols).filter(|n| *n <= (n_bytes - lines.end() + 1) / MIN_LINE);
    let Some(n_lines) = n_lines else {
        return Err(lines
            .error(format!(
                "file is too short for the announced columns and rows, \"{n_cols} x {n_rows}\""
            ))
            .hint("the file is truncated or its header is wrong: export it again"));
    };
    let pose = pose(lines, metres, &mut notes)?;
    let points_at = (lines.end(), lines.number());
    let (mut n_valid, mut n_columns) = (0, 0);
    let mut look = PtxLook::new(n_lines, metres);
    for n in 0..n_lines {
        if !lines.advance()? {
            return Err(lines
                .error(format!("scan ends after {n} of its announced points, \"{n_lines}\""))
                .hint("the file is truncated or its header is wrong: export it again"));
        }
        if n == 0 {
            n_columns = columns(lines)?;
        }
        if is_ptx_no_return(lines.line()) {
            continue;
        }
        look.add(n_valid, lines.line(), n_columns);
        n_valid += 1;
    }
    let frame = judge(pose, &look, &mut notes);
    if n_valid == 0 {
        notes.push("scan has no points".into());
    }
    let (intensity, note) = look.intensity();
    let step = look.step();
    notes.extend(note.into_iter().chain(step.map(crate::steps::note)));
    Ok((
        PtxScan { n_rows, n_lines, n_columns, n_valid, points_at, metres, frame, intensity, step },
        notes,
    ))
}

/// Chooses the scan frame: the file's own where its origin can be the scanner, else one with an
/// origin near the points.
fn judge(pose: Pose, look: &PtxLook, notes: &mut Vec<String>) -> FileFrame {
    if frame::within_reach(look.first()) {
        if look.n_at_origin > 0 {
            notes.push(no_returns_note(look.n_at_origin, look.n_looked));
        }
        return FileFrame::of_scanner(pose);
    }
    notes.push(
        "points lie farther from the scan's origin than any scanner reaches: the scanner is not known, so there \
         is no free-space evidence"
            .into(),
    );
    FileFrame::about(pose, frame::near(None, look.first()))
}

/// Moves to the next line of a header.
fn next(lines: &mut TextLines) -> Result<()> {
    if lines.advance()? {
        return Ok(());
    }
    Err(lines
        .error("file ends within the header of a scan")
        .hint("the file is truncated: copy it again"))
}

/// The count on the current line.
fn count(lines: &TextLines) -> Result<u64> {
    let [value] = lines.exactly()?;
    if value < 0.0 || value.fract() != 0.0 || value > 1e12 {
        return Err(lines.error(format!("number of columns or rows is no count, \"{value}\"")));
    }
    Ok(value as u64)
}

/// Reads scanner position, axes and matrix and converts them to metres. The matrix counts; a
/// position that differs from it is mentioned.
fn pose(lines: &mut TextLines, metres: f64, notes: &mut Vec<String>) -> Result<Pose> {
    next(lines)?;
    let position = Vector3::from(lines.exactly::<3>()?) * metres;
    for _axis in 0..3 {
        next(lines)?;
        lines.exactly::<3>()?;
    }
    let mut rows = [[0.0; 4]; 4];
    for row in &mut rows {
        next(lines)?;
        *row = lines.exactly()?;
    }
    for value in &mut rows[3][..3] {
        *value *= metres;
    }
    let pose = rigid(rows).map_err(|e| e.at(format!("line {}", lines.number())))?;
    if (pose.translation.vector - position).norm() > SAME_POSITION {
        notes.push(format!(
            "the stated scanner position differs from the matrix by {:.3} m: the matrix is used",
            (pose.translation.vector - position).norm()
        ));
    }
    Ok(pose)
}

/// The pose `world_from_file`. PTX multiplies row vectors from the left: the first three rows are
/// the axes of the scanner in the world, the last is its position.
fn rigid(rows: [[f64; 4]; 4]) -> Result<Pose> {
    let axes = Matrix3::from_fn(|i, j| rows[j][i]);
    let position = Vector3::new(rows[3][0], rows[3][1], rows[3][2]);
    let way_out = "export the scans again without scaling, shearing or mirroring them";
    if !axes.iter().chain(position.iter()).all(|v| v.is_finite()) {
        return Err(Error::bad_input("matrix of the pose holds what is no number").hint(way_out));
    }
    let last = [rows[0][3], rows[1][3], rows[2][3], rows[3][3] - 1.0];
    // Written so that NaN is refused.
    if !last.iter().all(|v| v.abs() <= RIGID) {
        return Err(
            Error::bad_input("last column of the pose's matrix is not \"0 0 0 1\"").hint(way_out)
        );
    }
    let scale = axes.determinant().cbrt();
    let residual = (axes.transpose() * axes - Matrix3::identity()).amax();
    if !(residual <= 2.0 * RIGID && scale >= 0.0) {
        let sheared =
            (axes.transpose() * axes - Matrix3::identity() * scale * scale).amax() > 2.0 * RIGID;
        let what = match (scale > 0.0, sheared) {
            (false, _) => format!(
                "matrix of the pose mirrors or flattens, its determinant is \"{}\"",
                scale.powi(3)
            ),
            (true, true) => {
                format!("matrix of the pose is no rotation, it is off by \"{residual}\"")
            }
            (true, false) => format!("matrix of the pose scales, by \"{scale}\""),
        };
        return Err(Error::bad_input(what).hint(way_out));
    }
    let rotation = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_eps(
        &axes,
        1e-15,
        100,
        Rotation3::from_matrix_unchecked(axes),
    ));
    Ok(Pose::from_parts(Translation3::from(position), rotation))
}

/// Number of values on each line of points of this block.
fn columns(lines: &TextLines) -> Result<usize> {
    match numbers(lines.line(), &mut [0.0; 7]) {
        Ok(n @ (3 | 4 | 6 | 7)) => Ok(n),
        Ok(n) => {
            Err(lines.error(format!("line of a point must hold 3, 4, 6 or 7 numbers, not \"{n}\"")))
        }
        Err(word) => Err(lines
            .error(format!("not a number, \"{word}\""))
            .hint("numbers need a decimal point, not a comma")),
    }
}
