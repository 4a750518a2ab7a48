//! Tells which points of a cloud are those of which setup: all, those of a source id, or stretches
//! of the file, whose ends are found between windows or by reading the file once.

use super::owned::Ownership;
use contract::{Format, Result, Scan};
use ingest::{Sources, Want};
use setups::{FoundSetups, ScanWindow, Setup, owner};
use std::collections::BTreeMap;

/// Share of the owned windows of a source id, or of a file, that must have one setup.
const SAME: f64 = 0.98;
/// Share of all windows that must be owned where a setup is to own a whole file or id: points of a
/// scanner that was not found would prove free space from a wrong place.
const OWNED: f64 = 0.95;
/// Number of windows in a row without a setup from which on a file has a gap there.
const GAP: usize = 4;
/// Changes from one setup to another between windows, for each setup, up to which a file counts as
/// scan after scan.
const FEW_CHANGES: usize = 6;
/// Number of points of the windows between which the end of a stretch is found: fewer do not tell.
const END_POINTS: usize = 64;
/// Number of points that are told apart together where a file is read once.
const PIECE: usize = 64;
/// Stretches shorter than this many points are left to nobody: they cost more than they tell.
const SHORT: u64 = 256;

/// Which points are those of each setup, in the order of the setups.
pub(super) fn of_setups(
    sources: &Sources,
    scan: &Scan,
    windows: &[ScanWindow],
    found: &FoundSetups,
) -> Result<Vec<Ownership>> {
    let n = found.setups.len();
    if n == 0 {
        return Ok(Vec::new());
    }
    let format = sources.inputs[scan.input.0 as usize].format;
    let n_owned = found.owners.iter().flatten().count();
    if n == 1 && n_owned as f64 >= OWNED * windows.len() as f64 {
        return Ok(vec![Ownership::Whole]);
    }
    if !matches!(format, Format::Las | Format::Laz) {
        return Ok(vec![Ownership::Untold; n]);
    }
    if let Some(by_source) = by_source(windows, found) {
        return Ok(by_source);
    }
    let places = match between_windows(sources, scan, windows, found)? {
        Some(places) => places,
        None => by_reading(sources, scan, &found.setups)?,
    };
    let own = |places: Vec<[u64; 2]>| match places.is_empty() {
        true => Ownership::Untold,
        false => Ownership::Places(places),
    };
    Ok(places.into_iter().map(own).collect())
}

/// The source id of each setup, where ids tell all of them apart.
fn by_source(windows: &[ScanWindow], found: &FoundSetups) -> Option<Vec<Ownership>> {
    let mut of_id: BTreeMap<u32, (usize, BTreeMap<usize, usize>)> = BTreeMap::new();
    for (window, owner) in windows.iter().zip(&found.owners) {
        let counts = of_id.entry(window.source).or_default();
        counts.0 += 1;
        if let Some(owner) = owner {
            *counts.1.entry(*owner).or_default() += 1;
        }
    }
    let mut ids: Vec<Option<u16>> = vec![None; found.setups.len()];
    for (id, (n, owners)) in &of_id {
        let Some((owner, most)) =
            owners.iter().max_by_key(|(owner, n)| (**n, usize::MAX - **owner))
        else {
            continue;
        };
        let n_owned: usize = owners.values().sum();
        if (*most as f64) < SAME * n_owned as f64 || (n_owned as f64) < OWNED * *n as f64 {
            return None;
        }
        // A setup whose points have several ids is told by places.
        if ids[*owner].replace(u16::try_from(*id).ok()?).is_some() {
            return None;
        }
    }
    ids.into_iter().map(|id| id.map(Ownership::Source)).collect()
}

/// Stretches of a file that holds one scan after the other; `None` where setups take turns.
fn between_windows(
    sources: &Sources,
    scan: &Scan,
    windows: &[ScanWindow],
    found: &FoundSetups,
) -> Result<Option<Vec<Vec<[u64; 2]>>>> {
    let all = windows.iter().zip(&found.owners).enumerate();
    let owned: Vec<(usize, usize)> =
        all.filter_map(|(i, (_, owner))| owner.map(|owner| (i, owner))).collect();
    let n_changes = owned.windows(2).filter(|w| w[0].1 != w[1].1).count();
    if owned.len() * 10 < windows.len() * 8 || n_changes > FEW_CHANGES * found.setups.len() {
        return Ok(None);
    }
    let Some(n) = sources.n_stated(scan.input) else { return Ok(None) };
    let place = |i: usize| windows[i].place;
    let after = |i: usize| windows[i].place + windows[i].points.len() as u64;
    let (Some(&(first, _)), Some(&(last, owner))) = (owned.first(), owned.last()) else {
        return Ok(None);
    };
    let mut out = vec![Vec::new(); found.setups.len()];
    let mut from = if first < GAP { 0 } else { place(first) };
    for pair in owned.windows(2) {
        let [(i, own), (j, next)] = [pair[0], pair[1]];
        if j - i > GAP {
            out[own].push([from, after(i) - 1]);
            from = place(j);
        } else if own != next {
            let ends = end(sources, scan, (place(i), own), (place(j), next), &found.setups)?;
            let Some(end) = ends else { return Ok(None) };
            out[own].push([from, end - 1]);
            from = end;
        }
    }
    let is_to_end = windows.len() - 1 - last < GAP;
    let end = if is_to_end { n.max(from + 1) } else { after(last) };
    out[owner].push([from, end - 1]);
    Ok(Some(out))
}

/// The place between two windows of different setups at which the later one begins. `None` where
/// places cannot be read one by one.
fn end(
    sources: &Sources,
    scan: &Scan,
    before: (u64, usize),
    after: (u64, usize),
    setups: &[Setup],
) -> Result<Option<u64>> {
    let (mut low, mut high) = (before.0, after.0);
    while high - low > END_POINTS as u64 {
        let middle = low + (high - low) / 2;
        let Some(window) = sources.window_at(scan.id, middle, END_POINTS)? else {
            return Ok(None);
        };
        if window.place > low && window.place < middle {
            match owner(&window.points, setups) {
                Some(own) if own == after.1 => high = window.place,
                _ => low = window.place,
            }
            continue;
        }
        if window.place != middle {
            // Within a compressed piece: its points are read from its beginning.
            let n = (high - window.place) as usize;
            let Some(piece) = sources.window_at(scan.id, middle, n)? else { return Ok(None) };
            return Ok(Some(within(&piece.points, piece.place, low, before.1, setups)));
        }
        match owner(&window.points, setups) {
            Some(own) if own == after.1 => high = middle,
            _ => low = middle,
        }
    }
    Ok(Some(low + (high - low) / 2))
}

/// The first place of a run of points from which on they are no longer those of a setup.
fn within(points: &[[f64; 3]], first: u64, least: u64, own: usize, setups: &[Setup]) -> u64 {
    let mut pieces = points.chunks(END_POINTS);
    let last = pieces.rposition(|piece| owner(piece, setups) == Some(own));
    let end = last.map_or(first, |i| first + ((i + 1) * END_POINTS) as u64);
    end.clamp(least + 1, first + points.len() as u64)
}

/// Stretches of a file in which setups take turns, by reading all of it.
fn by_reading(sources: &Sources, scan: &Scan, setups: &[Setup]) -> Result<Vec<Vec<[u64; 2]>>> {
    let mut out: Vec<Vec<[u64; 2]>> = vec![Vec::new(); setups.len()];
    let mut now: Option<(usize, [u64; 2])> = None;
    let mut end = |now: &mut Option<(usize, [u64; 2])>| {
        if let Some((owner, places)) = now.take().filter(|(_, p)| p[1] - p[0] + 1 >= SHORT) {
            out[owner].push(places);
        }
    };
    for strip in sources.strips(scan.input, Want::Coordinates)? {
        let strip = strip?;
        let pose = scan.world_from_scan;
        let pieces = strip.xyz.chunks(PIECE).zip(strip.place.chunks(PIECE));
        for (points, places) in pieces {
            let world: Vec<[f64; 3]> = points
                .iter()
                .map(|p| (pose * geometry::Point::from(p.map(f64::from))).coords.into())
                .collect();
            let place = |at: &u32| strip.first_place + u64::from(*at);
            let (Some(first), Some(last)) = (places.first(), places.last()) else { continue };
            let (first, last) = (place(first), place(last));
            let own =
                now.and_then(|(owner, _)| setups::is_own(&world, &setups[owner]).then_some(owner));
            match (own.or_else(|| owner(&world, setups)), &mut now) {
                (Some(own), Some((before, places))) if own == *before => places[1] = last,
                (Some(own), _) => {
                    end(&mut now);
                    now = Some((own, [first, last]));
                }
                (None, _) => end(&mut now),
            }
        }
    }
    end(&mut now);
    Ok(out)
}
