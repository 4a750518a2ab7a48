//! A scan of an opened file as it is known before any of its points is sampled.

use crate::file::OpenFile;
use crate::place_look;
use crate::scanners::KnownScanner;
use contract::{Format, InputId, MaskId, Scan, ScanId, ScannerPosition};

/// A scan of a file, still without lattice. LAS poses are in the file's own scans already.
pub(crate) fn new_scan<'a>(
    input: InputId,
    file: &mut OpenFile,
    i: usize,
    scanner: &mut impl FnMut(&str) -> Option<&'a KnownScanner>,
) -> Scan {
    let seed = &file.reader.scans()[i];
    let mut scan = Scan {
        id: ScanId(file.first_scan + i as u32),
        input,
        mask: MaskId(file.first_mask + seed.mask as u32),
        name: seed.name.clone(),
        source_id: seed.source_id,
        places: seed.places.clone(),
        raster: seed.raster.clone(),
        scanner: seed.position,
        world_from_scan: seed.world_from_scan,
        lattice: None,
        stated_bounds: seed.stated_bounds,
        stated_points: seed.stated_points,
        notes: seed.notes.clone(),
    };
    let replaced = match file.reader.format() {
        Format::Las | Format::Laz | Format::Memory => None,
        _ => scanner(&seed.name),
    };
    file.known.push(seed.scanner_known || replaced.is_some());
    let moved = |known: &KnownScanner| known.world_from_scan.inverse() * seed.world_from_scan;
    file.moved.push(replaced.map(moved));
    if let Some(known) = replaced {
        scan.world_from_scan = known.world_from_scan;
        scan.scanner = known.position();
        scan.notes.push(match scan.scanner {
            ScannerPosition::Found { sigma } => place_look::found_note(sigma),
            _ => "the scanner's position is that of --scanners, not of the file".into(),
        });
    }
    scan
}
