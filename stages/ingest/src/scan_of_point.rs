//! Tells to which scan of a LAS file a point belongs: by its source id, by its place in the file,
//! or by the rasters of the scanners.

use crate::rasters_of_scans::RastersOfScans;

/// Which points of a file belong to which of its scans.
#[derive(Debug)]
pub(crate) enum ScanOfPoint {
    /// All to the only scan.
    One,
    /// By source id: the scan of each of 65,536 ids.
    BySource(Vec<u16>),
    /// By place.
    ByPlace(PlacesOfScans),
    /// By the angles under which the scanners see it.
    ByRaster(RastersOfScans),
}

/// Stretches of places, each of one scan, and the scan of all other places.
#[derive(Debug)]
pub(crate) struct PlacesOfScans {
    /// First and last place, and the scan; ascending, without overlap.
    stretches: Vec<(u64, u64, u16)>,
    rest: u16,
}

impl PlacesOfScans {
    /// Of stretches in any order. A place that several stretches claim belongs to the first of
    /// them.
    pub(crate) fn new(mut stretches: Vec<(u64, u64, u16)>, rest: u16) -> Self {
        stretches.sort_unstable();
        let mut own: Vec<(u64, u64, u16)> = Vec::with_capacity(stretches.len());
        for (first, last, scan) in stretches {
            let from = own.last().map_or(first, |before| first.max(before.1 + 1));
            if from <= last {
                own.push((from, last, scan));
            }
        }
        Self { stretches: own, rest }
    }

    /// Whether all places from one to another belong to stretches.
    pub(crate) fn are_all(&self, (first, last): (u64, u64)) -> bool {
        let ends = self.stretches.first().zip(self.stretches.last());
        ends.is_some_and(|(a, b)| a.0 <= first && b.1 >= last)
            && self.stretches.windows(2).all(|w| w[0].1 + 1 == w[1].0)
    }

    /// The scan of a place, and the last place up to which it stays the same.
    pub(crate) fn of(&self, place: u64) -> (u16, u64) {
        let at = self.stretches.partition_point(|stretch| stretch.1 < place);
        match self.stretches.get(at) {
            Some((first, last, scan)) if *first <= place => (*scan, *last),
            Some((first, ..)) => (self.rest, first - 1),
            None => (self.rest, u64::MAX),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_place_belongs_to_the_first_stretch_that_claims_it_or_to_the_rest() {
        let places = PlacesOfScans::new(vec![(10, 19, 1), (3, 11, 0), (30, 39, 0)], 2);
        let scans: Vec<u16> = [0, 3, 11, 12, 19, 20, 29, 30, 39, 40].map(|p| places.of(p).0).into();
        assert_eq!(scans, [2, 0, 0, 1, 1, 2, 2, 0, 0, 2]);
        assert_eq!((places.of(4), places.of(20), places.of(99)), ((0, 11), (2, 29), (2, u64::MAX)));
        assert!(!places.are_all((3, 19)) && !places.are_all((0, 5)));
        assert!(PlacesOfScans::new(vec![(0, 4, 0), (5, 9, 1)], 2).are_all((0, 9)));
    }
}
