//! Build script: a digest of the program's own sources (`STILLPOINT_CODE`), which is part of all
//! cache keys, so that pieces of another program version are never used.

use std::hash::{DefaultHasher, Hash, Hasher};
use std::path::{Path, PathBuf};

fn main() {
    let mut files = vec![PathBuf::from("Cargo.toml"), PathBuf::from("Cargo.lock")];
    for file in &files {
        println!("cargo:rerun-if-changed={}", file.display());
    }
    for entry in std::fs::read_dir("stages").into_iter().flatten().flatten() {
        let path = entry.path();
        // The Python package is made of this program, and decides nothing of what is computed.
        if path.ends_with("py") || !path.is_dir() {
            continue;
        }
        println!("cargo:rerun-if-changed={}", path.display());
        gather(&path, &mut files);
    }
    // The guide is no code: a page that is written anew needs no new build.
    for entry in std::fs::read_dir("src").into_iter().flatten().flatten() {
        let path = entry.path();
        if path.ends_with("guide") {
            continue;
        }
        if path.is_dir() {
            println!("cargo:rerun-if-changed={}", path.display());
            gather(&path, &mut files);
        } else if path.extension().is_some_and(|e| e == "rs") {
            println!("cargo:rerun-if-changed={}", path.display());
            files.push(path);
        }
    }
    files.sort();
    let mut hasher = DefaultHasher::new();
    for file in &files {
        file.hash(&mut hasher);
        // An unreadable file fails the build where it is compiled.
        std::fs::read(file).unwrap_or_default().hash(&mut hasher);
    }
    // Processors with other vector units may round differently.
    for name in ["TARGET", "CARGO_CFG_TARGET_FEATURE"] {
        std::env::var(name).unwrap_or_default().hash(&mut hasher);
    }
    println!("cargo:rustc-env=STILLPOINT_CODE={:016x}", hasher.finish());
}

fn gather(folder: &Path, files: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(folder).into_iter().flatten().flatten() {
        let path = entry.path();
        if path.is_dir() {
            gather(&path, files);
        } else if path.extension().is_some_and(|e| e == "rs" || e == "toml") {
            files.push(path);
        }
    }
}
