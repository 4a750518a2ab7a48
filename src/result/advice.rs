//! Advice for a run that found no robot: what scans and library lack, and what supplying it would
//! change.

use crate::store::TileEntry;
use contract::{Scan, quote};
use geometry::Aabb;
use robot::Model;

/// Density below which robots are often missed, points per square metre of surface: of twelve arms
/// that a camera showed in 1,400 to 2,800 points, about as many per square metre, four were found
/// (benches/README.md, Depth cameras).
const SPARSE: f64 = 2_800.0;
/// Most names of scans that a sentence lists.
const N_NAMES: usize = 3;

/// Scans, tiles and models of a run that found no robot.
pub(crate) struct SearchInputs<'a> {
    /// Scans with points.
    pub(crate) scans: &'a [&'a Scan],
    /// Catalogue entries of their tiles.
    pub(crate) tiles: &'a [TileEntry],
    /// Models of the library.
    pub(crate) models: &'a [Model],
    /// Number of regions that were searched.
    pub(crate) n_places: usize,
}

impl SearchInputs<'_> {
    /// One sentence for each input that is missing or may be missing.
    pub(crate) fn advice(&self) -> Vec<String> {
        let mut out: Vec<String> =
            [self.of_models(), self.of_positions(), self.of_cameras(), self.of_density()]
                .into_iter()
                .flatten()
                .collect();
        if self.n_places == 0 {
            out.push(
                "nothing as large as a robot of the library stands by itself above a floor: see with 'inspect' whether the \
                 bounds are those of the cell in metres with z up, and whether the scans show the robot"
                    .into(),
            );
        } else if out.is_empty() {
            let arms = self.models.iter().filter(|m| !m.is_tool()).map(|m| m.name.as_str());
            let arms = listed(arms.collect());
            out.push(format!(
                "if a robot stands in these scans, its model may be missing: the library holds {arms}; add its URDF, or name the \
                 place, model and posture in a --review file, where the search then begins"
            ));
        }
        out
    }

    fn of_models(&self) -> Option<String> {
        let n_tools = self.models.iter().filter(|m| m.is_tool()).count();
        (n_tools == self.models.len()).then(|| {
            format!(
                "the library holds no robot, only {n_tools} tool(s): add the URDF of each robot that may stand in the scans"
            )
        })
    }

    fn of_positions(&self) -> Option<String> {
        let unknown: Vec<&str> = self.names(|scan| !scan.has_beams());
        let which = if unknown.len() == self.scans.len() {
            "no scan".into()
        } else {
            listed(unknown.clone())
        };
        (!unknown.is_empty()).then(|| {
            let lacks = if unknown.len() == self.scans.len() { "has" } else { "lack" };
            format!(
                "{which} {lacks} a usable scanner position: with it, beams show where nothing stands, which rules out wrong \
                 places and finds robots that points alone leave open; give it with --scanners, or export E57 with poses, one \
                 scan a position"
            )
        })
    }

    fn of_cameras(&self) -> Option<String> {
        let cameras = self.names(|scan| scan.lattice.is_some_and(|lattice| lattice.is_camera));
        (!cameras.is_empty()).then(|| {
            format!(
                "{} comes from a depth camera, which bends surfaces by millimetres: views from other sides, with the robot's \
                 foot in the picture, or a laser scan find what one picture does not",
                listed(cameras)
            )
        })
    }

    fn of_density(&self) -> Option<String> {
        let bounds = self.tiles.iter().fold(Aabb::EMPTY, |all, tile| all.union(&tile.bounds));
        let n_points: u64 = self.tiles.iter().map(|tile| tile.n_points).sum();
        let [x, y, z] = bounds.size();
        let per_metre = n_points as f64 / (2.0 * (x * y + y * z + z * x));
        (per_metre < SPARSE).then(|| {
            format!(
                "the points are sparse, about {per_metre:.0} a square metre of the walls, floor and ceiling about them: scan \
                 finer, from nearer or from more positions, until a robot shows at least {SPARSE} points"
            )
        })
    }

    fn names(&self, is_meant: impl Fn(&Scan) -> bool) -> Vec<&str> {
        self.scans.iter().filter(|s| is_meant(s)).map(|s| s.name.as_str()).collect()
    }
}

/// Names as one phrase: the first few, and the number of the others.
fn listed(names: Vec<&str>) -> String {
    let mut words: Vec<String> =
        names.iter().take(N_NAMES).map(|name| format!("'{}'", quote::shown(name))).collect();
    if names.len() > N_NAMES {
        words.push(format!("{} more", names.len() - N_NAMES));
    }
    match words.split_last() {
        Some((last, [])) => last.clone(),
        Some((last, first)) => format!("{} and {last}", first.join(", ")),
        None => "nothing".into(),
    }
}

#[cfg(test)]
mod tests {
    use super::listed;

    #[test]
    fn names_are_listed_in_one_phrase() {
        assert_eq!(listed(vec!["a"]), "'a'");
        assert_eq!(listed(vec!["a", "b"]), "'a' and 'b'");
        assert_eq!(listed(vec!["a", "b", "c", "d", "e"]), "'a', 'b', 'c' and 2 more");
    }
}
