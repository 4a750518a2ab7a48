//! Reads regular files up to a limit on their size.

use crate::encoding;
use crate::finding::Findings;
use crate::settings::Settings;
use contract::{Error, Result};
use std::borrow::Cow;
use std::io::Read as _;
use std::path::Path;

pub(crate) fn file_name(path: &Path) -> String {
    path.file_name().map_or_else(String::new, |n| n.to_string_lossy().into_owned())
}

/// Reads a regular file of at most `limit` bytes; `setting` is the name of the setting of that
/// limit, for the message.
pub(crate) fn read_bytes(
    path: &Path,
    limit: u64,
    setting: &str,
) -> std::result::Result<Vec<u8>, String> {
    // Reading a pipe would wait for ever for a writer, and a device may have no end.
    if path.metadata().is_ok_and(|meta| !meta.is_file()) {
        return Err("is not a regular file; only regular files are read".to_owned());
    }
    let open = || {
        let file = std::fs::File::open(path)?;
        let len = file.metadata()?.len();
        let mut bytes = Vec::new();
        if len <= limit {
            file.take(limit + 1).read_to_end(&mut bytes)?;
        }
        Ok::<_, std::io::Error>((len.max(bytes.len() as u64), bytes))
    };
    match open() {
        Ok((len, bytes)) if len <= limit => Ok(bytes),
        Ok((len, _)) => Err(format!(
            "is larger than the limit of {limit} bytes \"{len}\"; if the file is right, raise --set robot.{setting}"
        )),
        Err(error) => Err(format!("cannot be read ({error})")),
    }
}

pub(crate) fn read_text(
    path: &Path,
    limit: u64,
    place: &str,
    findings: &mut Findings,
) -> Option<String> {
    let text = read_bytes(path, limit, "max_urdf_bytes")
        .and_then(|bytes| String::from_utf8(bytes).map_err(|e| format!("is not UTF-8 ({e})")));
    text.map_err(|what| findings.fail(place, what, "repair or replace the file")).ok()
}

/// Reads an XML file of at most `limit` bytes in the encoding that it declares.
pub(crate) fn read_xml(
    path: &Path,
    limit: u64,
    place: &str,
    findings: &mut Findings,
) -> Option<String> {
    read_bytes(path, limit, "max_urdf_bytes")
        .and_then(|bytes| encoding::decode(&bytes).map(Cow::into_owned))
        .map_err(|what| findings.fail(place, what, "repair or replace the file"))
        .ok()
}

/// The text of a URDF file in the encoding that it declares, without its byte order mark.
///
/// # Errors
/// If the file cannot be read, exceeds the limit for a URDF, or has an unsupported encoding.
pub fn urdf_text(path: &Path) -> Result<String> {
    read_bytes(path, Settings::default().max_urdf_bytes, "max_urdf_bytes")
        .and_then(|bytes| encoding::decode(&bytes).map(Cow::into_owned))
        .map_err(|what| Error::bad_input(what).at(path.display()))
}
