//! Reads small text files: regular files only, and never more than a limit.

use contract::{Error, Kind, Result};
use std::io::Read as _;
use std::path::Path;

/// Refuses a path that is no regular file: reading a pipe or device may have no end, or wait for
/// ever for a writer.
///
/// # Errors
/// If the path does not exist or is a folder, pipe, socket or device; the error names it.
pub fn regular(path: &Path) -> Result<()> {
    let meta = std::fs::metadata(path);
    let is_missing = |e: &std::io::Error| {
        matches!(e.kind(), std::io::ErrorKind::NotFound | std::io::ErrorKind::NotADirectory)
    };
    let bad = |what: &str, way: &str| Err(Error::bad_input(what).at(path.display()).hint(way));
    match meta {
        Ok(meta) if meta.is_file() => Ok(()),
        Ok(meta) if meta.is_dir() => bad("this is a folder", "name the files in it"),
        Ok(_) => bad(
            "this is a pipe, socket or device, and only regular files are read",
            "write it to a file first",
        ),
        Err(e) if is_missing(&e) => bad("there is no such file", "check the path"),
        Err(e) => Err(Error::from(e).at(path.display())),
    }
}

/// The text of a regular file of at most `limit` bytes; `setting` names the setting of that limit.
///
/// # Errors
/// If the file is not regular, is longer, or is not UTF-8; the error names its path.
pub fn read_text(path: &Path, limit: u64, setting: &str) -> Result<String> {
    regular(path)?;
    let failed = |e| Error::from(e).at(path.display());
    let mut bytes = Vec::new();
    let file = std::fs::File::open(path).map_err(failed)?;
    // The stated length is not trusted, since some files have no end.
    file.take(limit.saturating_add(1)).read_to_end(&mut bytes).map_err(failed)?;
    if bytes.len() as u64 > limit {
        return Err(Error::new(Kind::OverBudget, format!("it is longer than {limit} bytes"))
            .at(path.display())
            .hint(format!("if the file is right, raise --set {setting}")));
    }
    String::from_utf8(bytes).map_err(|e| {
        let at = e.utf8_error().valid_up_to();
        let what = format!("it is no text in UTF-8 from byte {at} on");
        Error::bad_input(what).at(path.display()).hint("write it in UTF-8")
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_regular_files_are_read_and_never_more_than_the_limit() {
        let dir = tempfile::tempdir().expect("a folder");
        let path = dir.path().join("a.toml");
        std::fs::write(&path, "text").expect("writes");
        assert_eq!(read_text(&path, 4, "x.y").expect("reads"), "text");
        let long = read_text(&path, 3, "x.y").expect_err("long");
        assert_eq!(long.kind(), Kind::OverBudget);
        let long = long.to_string();
        assert!(
            long.contains("a.toml") && long.contains("3 bytes") && long.contains("x.y"),
            "{long}"
        );
        std::fs::write(&path, b"te\xff").expect("writes");
        for (bad, said) in
            [(&*path, "byte 2"), (dir.path(), "folder"), (&path.join("x"), "no such file")]
        {
            let error = read_text(bad, 100, "x.y").expect_err(said);
            assert_eq!(error.kind(), Kind::BadInput);
            assert!(error.to_string().contains(said), "{error}");
        }
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn devices_and_pipes_are_refused_at_once() {
        let dir = tempfile::tempdir().expect("a folder");
        let pipe = dir.path().join("pipe");
        let made = std::process::Command::new("mkfifo").arg(&pipe).status();
        assert!(made.expect("the system makes pipes").success());
        for path in [&*pipe, Path::new("/dev/zero")] {
            let error = read_text(path, 100, "x.y").expect_err("no file").to_string();
            assert!(error.contains("only regular files"), "{error}");
        }
    }
}
