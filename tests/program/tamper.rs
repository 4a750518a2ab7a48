//! A result of which one byte was changed: whoever reads it names the file, and whoever does not
//! read it gives the same answer. And folders that lead elsewhere: nothing is read, moved or taken
//! away through them.

use crate::common::boxed_cell;
use contract::Kind;
use serde_json::Value;
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use stillpoint::check;
use stillpoint::engine::Engine;
use stillpoint::job::{FlagValues, Job, Means};
use stillpoint::rescan::{Cell, Frame, RescanRequest, rescan};
use stillpoint::result::conversion::{ExportFormat, convert};
use stillpoint::result::history;
use stillpoint::{cache, plan};

/// Beams of each of six scanners: as few as the robot is found with.
const N_BEAMS: u64 = 250_000;
/// Draws the byte and the bit of each file.
const SEED: u64 = 59;
/// What `check`, `export` and a rescan read of a result and of its store, by families: each of
/// these is changed alone. All others are changed together, and no answer may be different by that.
const READ: [&str; 10] = [
    "manifest.json",
    "result.json",
    "plant.bin",
    "labels/#.kind.npy",
    "labels/#.robot.npy",
    "labels/#.link.npy",
    "clouds/robots.las",
    "tiles/#_#.las",
    "robots/R#/space.npy",
    "store/tiles/#",
];

/// A simulated cell, scanned twice, and the result of the first time.
struct Plant {
    dir: tempfile::TempDir,
}

/// What a command came to: its answer, or the kind and the words of its error.
type Came<T> = Result<T, (Kind, String)>;

fn came<T>(done: contract::Result<T>) -> Came<T> {
    done.map_err(|e| (e.kind(), e.to_string()))
}

/// All files below a folder, by name.
fn files(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let (mut all, mut folders) = (BTreeMap::new(), vec![folder.to_path_buf()]);
    while let Some(next) = folders.pop() {
        for entry in std::fs::read_dir(&next).expect("a folder") {
            let path = entry.expect("an entry").path();
            if path.is_dir() {
                folders.push(path);
                continue;
            }
            let name = path.strip_prefix(folder).expect("below").to_string_lossy().into_owned();
            all.insert(name, std::fs::read(&path).expect("a file"));
        }
    }
    all
}

/// A name without numbers and digests: files of a family are read alike.
fn family(name: &str) -> String {
    let parts = name.split('/').map(|part| {
        if part.len() >= 32 {
            return "#".to_owned();
        }
        let mut out = String::new();
        for c in part.chars() {
            match c {
                '0'..='9' | '-' if out.ends_with('#') => {}
                '0'..='9' | '-' => out.push('#'),
                c => out.push(c),
            }
        }
        out
    });
    parts.collect::<Vec<_>>().join("/")
}

/// A number that is drawn by the words.
fn drawn(words: &str) -> u64 {
    let mut x = SEED;
    for byte in words.bytes() {
        // SplitMix64.
        x = (x ^ u64::from(byte)).wrapping_add(0x9e37_79b9_7f4a_7c15);
        x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        x ^= x >> 31;
    }
    x
}

impl Plant {
    fn new() -> Self {
        let dir = tempfile::tempdir().expect("a folder");
        boxed_cell(dir.path(), "then", 12, N_BEAMS);
        boxed_cell(dir.path(), "now", 13, N_BEAMS);
        let plant = Self { dir };
        plan::run(&plant.job("then", "out"), &Engine::new(2)).expect("the run ends well");
        plant
    }

    fn at(&self, name: &str) -> PathBuf {
        self.dir.path().join(name)
    }

    fn means() -> Means {
        let set = ["export.copc=true", "export.tile_edge=3.0"].map(String::from).to_vec();
        Means::of(&FlagValues { set, ..FlagValues::default() }).expect("it can be set")
    }

    fn job(&self, scans: &str, out: &str) -> Job {
        let inputs = vec![self.at(scans).join("scans.e57")];
        Job::new(inputs, self.at("robots"), self.at(out), Self::means())
    }

    /// Changes one bit of a file at a drawn place. The file is another one then: a result that
    /// shares the old one keeps it.
    fn change(&self, name: &str, bytes: &[u8]) {
        let mut bytes = bytes.to_vec();
        let at = drawn(name) as usize % bytes.len();
        bytes[at] ^= 1 << (drawn(&format!("{name} bit")) % 8);
        self.put(name, &bytes);
    }

    fn put(&self, name: &str, bytes: &[u8]) {
        let path = self.at("out").join(name);
        std::fs::remove_file(&path).expect("goes");
        std::fs::write(path, bytes).expect("writes");
    }

    /// Files of which `verify` says that they are not what was written.
    fn verify(&self, out: &str) -> Came<Vec<String>> {
        came(cache::check(&self.at(out), &Engine::new(2)).map(|checked| checked.wrong))
    }

    /// What `check` says of a path that turns the robot to both sides.
    fn check(&self) -> Came<Value> {
        let request = check::CheckRequest {
            out: self.at("out"),
            trajectories: vec![self.at("path.csv")],
            robot: None,
            robots: None,
            margin: 0.02,
            degrees: false,
        };
        let report = check::check(&request, &Self::means(), &Engine::new(2));
        came(report.map(|reports| check::json(&reports, &[])))
    }

    /// Bytes that `export` writes.
    fn export(&self, format: ExportFormat) -> Came<Vec<Vec<u8>>> {
        let written = convert(&self.at("out"), format, &Engine::new(2));
        let written = came(written)?;
        Ok(written.iter().map(|path| std::fs::read(path).expect("a file")).collect())
    }

    /// All files of a rescan that makes everything anew.
    fn rescan(&self, out: &str) -> Came<BTreeMap<String, Vec<u8>>> {
        let _ = std::fs::remove_dir_all(self.at(out));
        self.rescan_again(out)
    }

    /// All files of a rescan that finds tiles and fits of the new scans in the store of an earlier
    /// one: the search is the same and need not be done once more.
    fn rescan_again(&self, out: &str) -> Came<BTreeMap<String, Vec<u8>>> {
        if let Ok(entries) = std::fs::read_dir(self.at(out)) {
            for path in entries.map(|entry| entry.expect("an entry").path()) {
                match path.is_dir() {
                    true if path.ends_with("store") => {}
                    true => std::fs::remove_dir_all(path).expect("goes"),
                    false => std::fs::remove_file(path).expect("goes"),
                }
            }
        }
        let bounds = geometry::Aabb { min: [-2.0, -2.0, -0.5], max: [2.0, 2.0, 3.0] };
        let job = self.job("now", out);
        let cell = Cell::Box(bounds);
        let request = RescanRequest { base: self.at("out"), cell, frame: Frame::Stated, job };
        came(rescan(&request, &Engine::new(2)))?;
        let mut all = files(&self.at(out));
        // What lies in the store is no part of the answer.
        all.retain(|name, _| !name.starts_with("store/"));
        Ok(all)
    }

    fn path(&self) {
        let text = std::fs::read_to_string(self.at("out/result.json")).expect("a result");
        let result: Value = serde_json::from_str(&text).expect("JSON");
        let joints = result["robots"][0]["joints"].as_object().expect("a robot was found");
        let names: Vec<&str> = joints.keys().map(String::as_str).collect();
        let line = |by: f64| {
            let own = joints.values().enumerate();
            let own =
                own.map(|(i, v)| v.as_f64().expect("a value") + if i == 0 { by } else { 0.0 });
            own.map(|v| v.to_string()).collect::<Vec<_>>().join(",")
        };
        let path = format!("{}\n{}\n{}\n", names.join(","), line(-0.3), line(0.3));
        std::fs::write(self.at("path.csv"), path).expect("writes");
    }
}

/// One file of each family, the first and a drawn one of large ones; empty files cannot be changed.
fn sampled(all: &BTreeMap<String, Vec<u8>>) -> Vec<&str> {
    let mut families: BTreeMap<String, Vec<&str>> = BTreeMap::new();
    for (name, _) in all.iter().filter(|(_, bytes)| !bytes.is_empty()) {
        families.entry(family(name)).or_default().push(name);
    }
    let mut out = BTreeSet::new();
    for (family, names) in &families {
        out.insert(names[drawn(family) as usize % names.len()]);
        if family == "tiles/#_#.las" {
            out.extend([names[0], names[names.len() / 2], names[names.len() - 1]]);
        }
    }
    out.into_iter().collect()
}

/// The same answer as of the whole result, or an error of bad input that names the file; whether it
/// was read.
fn told_or_same<T: PartialEq>(came: &Came<T>, whole: &T, name: &str, who: &str) -> bool {
    match came {
        Ok(answer) => {
            assert!(answer == whole, "{who} believes a changed {name}");
            false
        }
        Err((kind, text)) => {
            // Of a store the file is named by its folder, which has another name in a new result.
            let last = name.rsplit('/').next().expect("a name");
            assert!(*kind == Kind::BadInput && text.contains(last), "{who}, {name}: {text}");
            true
        }
    }
}

/// The list names what was written; the store is no part of it, and is made again where it is
/// damaged.
fn is_named(verified: &Came<Vec<String>>, name: &str) {
    match verified {
        Ok(wrong) if name.starts_with("store/") => assert_eq!(wrong, &[""; 0], "{name}"),
        Ok(wrong) => assert!(wrong.len() == 1 && wrong[0].contains(name), "{name}: {wrong:?}"),
        Err((kind, text)) => {
            assert!(*kind == Kind::BadInput && name == "manifest.json", "{name}: {text}");
            assert!(text.contains(name), "{text}");
        }
    }
}

#[test]
fn a_changed_byte_is_named_by_who_reads_it_and_changes_no_answer() {
    let plant = Plant::new();
    plant.path();
    let all = files(&plant.at("out"));
    let sampled = sampled(&all);
    let kinds: BTreeSet<String> = all.keys().map(|name| family(name)).collect();
    assert!(kinds.len() > 20 && sampled.len() >= kinds.len() - 1, "{kinds:#?}");
    let (path, points) =
        (plant.check().expect("checks"), plant.export(ExportFormat::Ply).expect("is written"));
    let again = plant.rescan("again").expect("the rescan ends well");
    assert_eq!(plant.verify("again"), Ok(Vec::new()));
    let (mut read, mut unread) = ([0; 3], Vec::new());
    for &name in &sampled {
        if !READ.iter().any(|own| family(name).starts_with(own)) {
            unread.push(name);
            continue;
        }
        plant.change(name, &all[name]);
        is_named(&plant.verify("out"), name);
        read[0] += usize::from(told_or_same(&plant.check(), &path, name, "check"));
        read[1] +=
            usize::from(told_or_same(&plant.export(ExportFormat::Ply), &points, name, "export"));
        // What lies in the base's store is read only where there is no other store.
        let came = match name.starts_with("store/") {
            true => plant.rescan("other"),
            false => plant.rescan_again("other"),
        };
        read[2] += usize::from(told_or_same(&came, &again, name, "rescan"));
        plant.put(name, &all[name]);
    }
    // The list, the result, the plant, the space and a tile; the list and tiles; nearly all that it
    // may read.
    assert!(read[0] >= 5 && read[1] >= 4 && read[2] >= READ.len() - 1, "{read:?}");

    // All that none of them reads. A rescan hands it on as it is, and what is wrong with it is
    // found in the new result, too.
    unread.iter().for_each(|name| plant.change(name, &all[*name]));
    let wrong = plant.verify("out");
    for name in unread.iter().filter(|name| !name.starts_with("store/")) {
        let wrong = wrong.as_ref().expect("has a list");
        assert!(wrong.iter().any(|words| words.contains(*name)), "{name}: {wrong:?}");
    }
    assert!(plant.check() == Ok(path) && plant.export(ExportFormat::Ply) == Ok(points));
    let mut other = plant.rescan_again("other").expect("reads nothing of what was changed");
    let wrong = plant.verify("other").expect("has a list").join("\n");
    // The page is made of all these files: a rescan that finds one changed makes none, and its list
    // has none.
    let list = String::from_utf8_lossy(&other["manifest.json"]).into_owned();
    assert!(!other.contains_key("report.html") && !list.contains("report.html"), "{list}");
    for name in ["report.html", "manifest.json"] {
        other.insert(name.into(), again[name].clone());
    }
    for name in &unread {
        if other.get(*name) != again.get(*name) {
            assert!(wrong.contains(*name), "{name} is not what was written, and nobody says so");
            other.insert((*name).to_owned(), again[*name].clone());
        }
    }
    assert!(other == again, "a rescan believes what was changed");
    unread.iter().for_each(|name| plant.put(name, &all[*name]));

    missing_files_are_bad_input(&plant, &all);
    #[cfg(unix)]
    folders_that_lead_elsewhere(&plant);
}

/// Of a tile that is missing, or shorter than it was, all say so before they believe the others.
fn missing_files_are_bad_input(plant: &Plant, all: &BTreeMap<String, Vec<u8>>) {
    let tile =
        all.keys().filter(|name| name.starts_with("tiles/")).max_by_key(|name| all[*name].len());
    let tile = tile.expect("a tile");
    let path = plant.at("out").join(tile);
    for shortened in [true, false] {
        if shortened {
            plant.put(tile, &all[tile][..all[tile].len() / 2]);
        } else {
            std::fs::remove_file(&path).expect("goes");
        }
        let errors = [
            plant.check().expect_err("a tile is missing"),
            plant.export(ExportFormat::Ply).expect_err("a tile is missing"),
            plant.rescan_again("other").expect_err("a tile is missing"),
        ];
        for (kind, text) in errors {
            assert_eq!(kind, Kind::BadInput, "{text}");
            assert!(text.contains(tile.as_str()) && text.contains("verify"), "{text}");
        }
    }
    std::fs::write(&path, &all[tile]).expect("writes");
}

/// Links and names that lead out of a folder.
#[cfg(unix)]
fn folders_that_lead_elsewhere(plant: &Plant) {
    use std::os::unix::fs::symlink;
    let before = files(&plant.at("again"));
    let engine = Engine::new(2);
    // Names of sessions are names.
    std::fs::create_dir(plant.at("sessions")).expect("is made");
    std::fs::rename(plant.at("out"), plant.at("sessions/first")).expect("moves");
    symlink("../again", plant.at("sessions/link")).expect("is made");
    let sessions = plant.at("sessions");
    let absolute = plant.at("again").display().to_string();
    for name in
        ["..", ".", "", "../again", "first/../../again", "/", absolute.as_str(), "link", "nobody"]
    {
        let error = history::remove(&sessions, name).expect_err(name);
        let (kind, text) = (error.kind(), error.to_string());
        assert!(
            kind == if name == "link" { Kind::BadInput } else { Kind::Usage },
            "{name}: {text}"
        );
    }
    assert!(files(&plant.at("again")) == before && sessions.join("first/result.json").is_file());
    let found = history::sessions(&sessions).expect("lists");
    let names: Vec<&str> = found.sessions.iter().map(|s| &*s.name).collect();
    assert_eq!((names, found.damaged), (vec!["first"], Vec::new()));
    // One that is damaged is named beside the others.
    let result = sessions.join("first/result.json");
    let bytes = std::fs::read(&result).expect("reads");
    std::fs::write(&result, [&bytes[..], b" "].concat()).expect("writes");
    let damaged = history::sessions(&sessions).expect("lists").damaged;
    assert!(damaged.len() == 1 && damaged[0].contains("result.json"), "{damaged:?}");
    std::fs::write(&result, bytes).expect("writes");

    // A folder of a result that is a link: whatever would be moved or taken away lies elsewhere.
    std::fs::rename(sessions.join("first"), plant.at("out")).expect("moves");
    std::fs::rename(plant.at("out/labels"), plant.at("labels")).expect("moves");
    symlink(plant.at("again/labels"), plant.at("out/labels")).expect("is made");
    let job = plant.job("then", "out");
    for error in [
        came(plan::run(&job, &engine).map(drop)).expect_err("leads elsewhere"),
        came(
            rescan(
                &RescanRequest {
                    base: plant.at("out"),
                    cell: Cell::Seen,
                    frame: Frame::Stated,
                    job: plant.job("now", "x"),
                },
                &engine,
            )
            .map(drop),
        )
        .expect_err("leads elsewhere"),
    ] {
        assert!(error.0 == Kind::BadInput && error.1.contains("labels"), "{error:?}");
    }
    assert!(plant.verify("out").expect("has a list").iter().any(|wrong| wrong.contains("link")));
    assert!(files(&plant.at("again")) == before, "another result was touched");
    std::fs::remove_file(plant.at("out/labels")).expect("goes");
    std::fs::rename(plant.at("labels"), plant.at("out/labels")).expect("moves");

    // A rescan within its base.
    for out in ["out", "out/sub", "out/store/sub"] {
        let job = plant.job("now", out);
        let (base, cell, frame) = (plant.at("out"), Cell::Seen, Frame::Stated);
        let request = RescanRequest { base, cell, frame, job };
        assert_eq!(rescan(&request, &engine).expect_err(out).kind(), Kind::Usage, "{out}");
    }

    // Exports are kept as long as they are true, and taken away with a word where they are not.
    let export = plant.at("out/export/fixed.ply");
    assert!(export.is_file());
    std::fs::remove_dir_all(plant.at("out/pictures")).expect("goes");
    let told = plan::run(&plant.job("then", "out"), &engine).expect("the run ends well").notes;
    assert!(told.is_empty() && export.is_file(), "{told:?}");
    let told = plan::run(&plant.job("now", "out"), &engine).expect("the run ends well").notes;
    assert!(told.iter().any(|t| t.contains("fixed.ply")) && !export.exists(), "{told:?}");

    // The last session goes as others do.
    std::fs::rename(plant.at("out"), sessions.join("first")).expect("moves");
    let mut last = std::process::Command::new(env!("CARGO_BIN_EXE_stillpoint"));
    let last =
        last.arg("history").arg(&sessions).args(["--remove", "first"]).output().expect("starts");
    assert!(last.status.success(), "{}", String::from_utf8_lossy(&last.stderr));
    assert!(!sessions.join("first").exists() && files(&plant.at("again")) == before);
}
