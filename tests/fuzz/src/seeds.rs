//! A folder in; in it a folder for each target with small files to begin from, all made here, out.
//! Whole files and odd ones: what a mutation would take long to find, such as another point format,
//! is a file of its own.

mod clouds;
mod texts;

use crate::own;
use std::path::{Path, PathBuf};

/// Where seeds go.
struct Seeds(PathBuf);

impl Seeds {
    fn put(&self, target: &str, name: &str, bytes: impl AsRef<[u8]>) {
        let folder = self.0.join(target);
        std::fs::create_dir_all(&folder).expect("a folder can be made");
        std::fs::write(folder.join(name), bytes).expect("a seed can be written");
    }

    fn put_all<T: AsRef<[u8]>>(&self, target: &str, all: impl IntoIterator<Item = T>) {
        for (i, bytes) in all.into_iter().enumerate() {
            self.put(target, &format!("seed-{i:02}"), bytes);
        }
    }
}

/// Writes the seeds of all targets.
pub(crate) fn write(out: PathBuf) {
    let seeds = Seeds(out);
    let scratch = seeds.0.join("scratch");
    std::fs::create_dir_all(&scratch).expect("a folder can be made");
    clouds::put(&seeds, &scratch);
    texts::put(&seeds, &scratch);
    put_own(&seeds, &scratch);
    #[cfg(feature = "program")]
    put_program(&seeds, &scratch);
    std::fs::remove_dir_all(&scratch).expect("the scratch folder can be removed");
}

/// Files of results.
fn put_own(seeds: &Seeds, scratch: &Path) {
    let head = vec![b' '; 128];
    let places: Vec<u8> = [0_u64, 3, 7, 900].iter().flat_map(|p| p.to_le_bytes()).collect();
    seeds.put("masks", "places", [&head[..], &places].concat());
    seeds.put("masks", "kinds", [&head[..], &[0, 1, 2, 3, 255, 0, 0, 0]].concat());
    let voxels = [0, 1, 2, 3, 4, 0, 1, 2, 3, 4, 0, 1];
    seeds.put("space", "seed", [&[2, 3, 2], &head[..], &voxels].concat());
    for compress in [false, true] {
        let las = export::LasSettings { compress, ..own::tile_settings() };
        let path = scratch.join("tile.las");
        clouds::write_tile(&path, &las);
        let bytes = std::fs::read(&path).expect("a tile");
        let name = if compress { "laz" } else { "las" };
        seeds.put("tile", name, [&[u8::from(compress)], &bytes[..]].concat());
    }
}

/// Files of the program's own.
#[cfg(feature = "program")]
fn put_program(seeds: &Seeds, scratch: &Path) {
    let dir = scratch.join("store");
    crate::program::small_store(&dir);
    let read = |name: &str| std::fs::read(dir.join(name)).expect("a store has two files");
    let (catalogue, tiles) = (read("catalogue.rkyv"), read("tiles.bin"));
    let archive = &catalogue[64..];
    let n = (archive.len() as u32).to_le_bytes();
    seeds.put("store", "seed", [&n[..], archive, &tiles[64..]].concat());
    seeds.put("plant", "seed", stillpoint::eval::fuzz_doors::plant_body());
    seeds.put_all("pieces", stillpoint::eval::fuzz_doors::pieces(&crate::robots::models()[0]));
    let means =
        stillpoint::job::Means::of(&stillpoint::job::FlagValues::default()).expect("defaults");
    let all = means.settings.all().into_iter().map(|(key, value)| format!("{key} = {value}\n"));
    seeds.put("settings", "all", all.collect::<String>());
}
