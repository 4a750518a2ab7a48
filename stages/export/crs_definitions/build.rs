//! Compresses the texts of all reference systems: for each its code and its length, two and four
//! bytes, lowest first; then the texts one after the other.

use flate2::{Compression, write::DeflateEncoder};
use std::io::Write;

fn main() -> std::io::Result<()> {
    println!("cargo::rerun-if-changed=build.rs");
    let (mut lengths, mut all) = (Vec::new(), Vec::new());
    let known = (0..=u16::MAX).filter_map(|code| texts::from_code(code).map(|def| (code, def.wkt)));
    for (code, text) in known {
        lengths.extend(code.to_le_bytes());
        lengths.extend((text.len() as u32).to_le_bytes());
        all.extend(text.as_bytes());
    }
    let n = (lengths.len() / 6) as u32;
    let out = std::env::var_os("OUT_DIR").expect("cargo sets OUT_DIR");
    let file = std::fs::File::create(std::path::Path::new(&out).join("texts"))?;
    let mut packed = DeflateEncoder::new(file, Compression::best());
    packed.write_all(&n.to_le_bytes())?;
    packed.write_all(&lengths)?;
    packed.write_all(&all)?;
    packed.finish().map(|_| ())
}
