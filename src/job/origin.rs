//! Where the value of each setting comes from, and all settings as a configuration file.

use super::settings::{Settings, present_name};
use std::collections::BTreeMap;
use std::fmt::{Display, Formatter, Write as _};
use std::path::PathBuf;

/// Where the value of a setting comes from.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum SettingOrigin {
    /// A configuration file.
    File(PathBuf),
    /// A variable of the environment.
    Environment(String),
    /// `--set`, or a flag that sets the same.
    Set,
    /// A flag of its own: `--memory`, `--threads`.
    Flag(&'static str),
}

impl Display for SettingOrigin {
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::File(path) => write!(f, "{}", path.display()),
            Self::Environment(name) => write!(f, "environment, {name}"),
            Self::Set => write!(f, "--set"),
            Self::Flag(name) => write!(f, "{name}"),
        }
    }
}

/// Origins of all settings that are not at their defaults.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct SettingOrigins(BTreeMap<String, SettingOrigin>);

impl SettingOrigins {
    pub(super) fn note(&mut self, key: &str, origin: SettingOrigin) {
        self.0.insert(present_name(key), origin);
    }

    /// Where the value of a setting comes from; `None` for its default.
    #[must_use]
    pub fn of(&self, key: &str) -> Option<&SettingOrigin> {
        self.0.get(key)
    }
}

/// The setting that a variable of the environment is for: `STILLPOINT_SET_FIT_BEAM` is `fit.beam`.
pub(super) fn setting_of_variable(name: &str) -> Option<String> {
    let wanted = name.strip_prefix("STILLPOINT_SET_")?;
    let of_all = ["memory", "threads", "scanners"].map(String::from);
    let all = Settings::default().all();
    let mut keys = of_all.into_iter().chain(all.iter().map(|(key, _)| (*key).to_owned()));
    keys.find(|key| key.to_uppercase().replace('.', "_") == wanted)
}

/// Settings with their values as a configuration file; `with_origin` adds where each value comes
/// from, and `only_changed` leaves out what is at its default.
pub(super) fn as_toml(
    settings: &[(&str, String)],
    origins: &SettingOrigins,
    with_origin: bool,
    only_changed: bool,
) -> String {
    let (mut text, mut room) = (String::new(), "");
    for (key, value) in settings {
        let origin = origins.of(key);
        if only_changed && origin.is_none() {
            continue;
        }
        let (of, name) = key.split_once('.').unwrap_or(("", key));
        if of != room {
            let _ = writeln!(text, "{}[{of}]", if text.is_empty() { "" } else { "\n" });
            room = of;
        }
        let line = format!("{name} = {value}");
        let origin = origin.map_or_else(|| "default".into(), ToString::to_string);
        // A line break in the name of a file would end the comment.
        let origin: String = origin.chars().filter(|c| !c.is_control()).collect();
        let _ = if with_origin {
            writeln!(text, "{line:<39} # {origin}")
        } else {
            writeln!(text, "{line}")
        };
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::job::{FlagValues, Means};

    #[test]
    fn what_is_printed_reads_back_the_same_and_says_where_it_comes_from() {
        let dir = tempfile::tempdir().expect("a folder");
        let path = dir.path().join("plant.toml");
        let text = "threads = 3\n[fit]\nbeam = 77\nthin = 1\n[merge]\ngap = 0.5\n";
        std::fs::write(&path, text).expect("writes");
        let given = FlagValues {
            memory: Some("1 GiB".into()),
            config: Some(path.clone()),
            environment: vec![
                ("STILLPOINT_SET_FIT_BEAM".into(), "88".into()),
                ("STILLPOINT_SET_FIT_THIN".into(), "2".into()),
            ],
            set: vec!["fit.thin=3".into()],
            ..FlagValues::default()
        };
        let means = Means::of(&given).expect("reads");
        assert_eq!((means.settings.fit.beam, means.settings.fit.thin), (88, 3.0));
        let origins = [
            ("memory", Some(SettingOrigin::Flag("--memory"))),
            ("threads", Some(SettingOrigin::File(path.clone()))),
            ("fit.beam", Some(SettingOrigin::Environment("STILLPOINT_SET_FIT_BEAM".into()))),
            ("fit.thin", Some(SettingOrigin::Set)),
            ("attach.gap", Some(SettingOrigin::File(path.clone()))),
            ("fit.method", None),
        ];
        for (key, origin) in origins {
            assert_eq!(means.origins.of(key), origin.as_ref(), "{key}");
        }
        for only_changed in [false, true] {
            std::fs::write(&path, means.as_toml(true, only_changed)).expect("writes");
            let again = FlagValues { config: Some(path.clone()), ..FlagValues::default() };
            let again = Means::of(&again).expect("what is printed can be read");
            assert_eq!(again.as_toml(false, false), means.as_toml(false, false));
        }
    }

    #[test]
    fn a_variable_that_is_no_setting_is_refused() {
        let environment = vec![("STILLPOINT_SET_FIT_BEAN".to_owned(), "3".to_owned())];
        let error = Means::of(&FlagValues { environment, ..FlagValues::default() });
        let error = error.expect_err("no setting").to_string();
        assert!(error.contains("STILLPOINT_SET_FIT_BEAN"), "{error}");
        let name = "STILLPOINT_SET_BASE_SEARCH_N_COARSE";
        assert_eq!(setting_of_variable(name).as_deref(), Some("base_search.n_coarse"));
    }
}
