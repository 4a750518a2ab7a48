//! Parses the units that a user gives with `--units`, such as `mm` or `hall.las=us-ft`.

use super::known;
use super::length_unit::LengthUnit;
use contract::{Error, Kind, Result};
use std::path::Path;

/// The value with which a user leaves units to the files.
pub(crate) const DECLARED: &str = "declared";
/// Advice in messages about unknown units.
const HINT: &str =
    "units are m, cm, mm, km, in, ft and us-ft; a file's own as NAME=mm, heights apart as us-ft/m";

/// Units of x and y, and of z.
pub(crate) type UnitPair = [LengthUnit; 2];

/// The units that a user gave.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct Choice {
    /// Units of all files without units of their own.
    all: Option<UnitPair>,
    /// File names with their own units.
    own: Vec<(String, UnitPair)>,
}

impl Choice {
    /// Parses a comma-separated list.
    ///
    /// # Errors
    /// If a word is no unit, or if a file gets two units.
    pub(crate) fn read(text: &str) -> Result<Self> {
        let mut choice = Self::default();
        let usage = |what: String| Error::new(Kind::Usage, what).at("units");
        if text.trim() == DECLARED {
            return Ok(choice);
        }
        for word in text.split(',').map(str::trim) {
            let (name, unit) = word.rsplit_once('=').map_or((None, word), |(n, u)| (Some(n), u));
            let pair = pair(unit).ok_or_else(|| {
                usage(format!("this is no unit of length: \"{unit}\"")).hint(HINT)
            })?;
            let is_second = match name {
                None => choice.all.replace(pair).is_some(),
                Some(name) => {
                    let is_known = choice.own.iter().any(|(known, _)| known == name);
                    choice.own.push((name.to_owned(), pair));
                    is_known
                }
            };
            if is_second {
                return Err(usage(format!("a second unit for the same files: \"{word}\"")));
            }
        }
        Ok(choice)
    }

    /// The units given for a file: its own, by path, name, or name without suffix; else those for
    /// all files.
    pub(crate) fn of(&self, path: &Path) -> Option<&UnitPair> {
        let own = self.own.iter().find(|(name, _)| is_named(path, name)).map(|(_, pair)| pair);
        own.or(self.all.as_ref())
    }

    /// The first name that matches none of these files.
    pub(crate) fn unknown<'a>(&'a self, paths: &'a [std::path::PathBuf]) -> Option<&'a str> {
        let is_of_none = |name: &&str| !paths.iter().any(|path| is_named(path, name));
        self.own.iter().map(|(name, _)| name.as_str()).find(is_of_none)
    }
}

fn is_named(path: &Path, name: &str) -> bool {
    let is = |part: Option<&std::ffi::OsStr>| part.is_some_and(|part| part == name);
    path == Path::new(name) || is(path.file_name()) || is(path.file_stem())
}

fn pair(word: &str) -> Option<UnitPair> {
    let (horizontal, vertical) = word.split_once('/').unwrap_or((word, word));
    Some([known::by_name(horizontal)?, known::by_name(vertical)?])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_have_their_own_units_or_those_of_all() {
        let choice = Choice::read("mm, a.las=us-ft/m,b=in").expect("units");
        let metres =
            |path: &str| choice.of(Path::new(path)).map(|pair| [pair[0].metres, pair[1].metres]);
        assert_eq!(metres("x/a.las"), Some([known::US_FOOT, 1.0]));
        assert_eq!(metres("x/b.e57"), Some([0.0254; 2]));
        assert_eq!(metres("c.e57"), Some([0.001; 2]));
        assert_eq!(choice.unknown(&["x/a.las".into(), "b.e57".into()]), None);
        assert_eq!(choice.unknown(&["x/a.las".into()]), Some("b"));
        assert_eq!(Choice::read("declared").expect("none").of(Path::new("a")), None);
    }

    #[test]
    fn what_is_no_unit_is_refused_by_name() {
        for (text, word) in [
            ("mn", "\"mn\""),
            ("a=", "\"\""),
            ("", "\"\""),
            ("m,ft", "\"ft\""),
            ("a=m,a=ft", "a=ft"),
        ] {
            let error = Choice::read(text).expect_err(text);
            assert_eq!(error.kind(), Kind::Usage);
            assert!(error.to_string().contains(word), "{error}");
        }
    }
}
