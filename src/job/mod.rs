//! A job: flags and configuration in, everything that a run needs to know out, checked once.

mod memory;
mod method;
pub(crate) mod places;
mod settings;
pub(crate) mod units;
mod value;

pub use memory::{memory_bytes, memory_words};
pub use method::Method;
pub use settings::Settings;

use crate::engine::CHANNEL_BYTES;
use contract::{Error, Kind, Result};
use std::path::{Path, PathBuf};

/// Memory of a run where none is asked for, bytes: half of a small office machine.
pub const MEMORY_BYTES: u64 = 4 << 30;
/// Memory below which regions are searched one after the other, bytes.
const NARROW_BYTES: u64 = 3 << 29;
/// Least memory that a run is tried with, bytes: program, library of robots and one strip a worker.
pub const LEAST_MEMORY_BYTES: u64 = 256 << 20;
/// What program and robot library take, bytes, before any point is read.
const PROGRAM_BYTES: u64 = 160 << 20;
/// The setting that bounds configurations, reviews, scenes, paths and lists of readings.
pub const MAX_TEXT: &str = "ingest.max_text_bytes";

/// What is to be done, with which means.
#[derive(Debug, Clone)]
pub struct Job {
    /// Scan files, in the order of the command line.
    pub inputs: Vec<PathBuf>,
    /// Folder of the robot library.
    pub robots: PathBuf,
    /// Scanner poses for formats that carry none.
    pub scanners: Option<PathBuf>,
    /// Where results go.
    pub out: PathBuf,
    /// What a person knows of the robots.
    pub review: Option<PathBuf>,
    /// Finish without the inputs and regions that fail, and say so.
    pub keep_going: bool,
    /// Inputs that were left out because they failed, in words.
    pub left_out: Vec<String>,
    /// How much, in which way.
    pub means: Means,
}

impl Job {
    /// A job as most are: nothing known of scanners and robots, and no failure forgiven.
    #[must_use]
    pub fn new(inputs: Vec<PathBuf>, robots: PathBuf, out: PathBuf, means: Means) -> Self {
        let (scanners, review, keep_going, left_out) = (None, None, false, Vec::new());
        Self { inputs, robots, scanners, out, review, keep_going, left_out, means }
    }
}

/// Means and settings of any command.
#[derive(Debug, Clone)]
pub struct Means {
    /// Upper bound of resident memory, bytes.
    pub memory_bytes: u64,
    /// Worker threads.
    pub n_threads: usize,
    /// Scanner poses named by the configuration.
    pub scanners: Option<PathBuf>,
    /// Tunables of all stages.
    pub settings: Settings,
}

/// What a run came to, for the command line.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Outcome {
    /// What people read at the end, on standard output.
    pub summary: String,
    /// Said on standard error; they are in the result as well.
    pub warnings: Vec<String>,
    /// Something was skipped or refused, as the result says: exit code 3.
    pub partial: bool,
    /// What was there from earlier runs and not made again; said on standard error.
    pub reused: Vec<String>,
    /// What became of files beside the result; said on standard error, and no part of the result.
    pub told: Vec<String>,
}

/// Means as flags give them; `None` where a flag is missing.
#[derive(Debug, Clone, Default)]
pub struct Given {
    /// `--memory`.
    pub memory: Option<String>,
    /// `--threads`.
    pub threads: Option<usize>,
    /// `--config`.
    pub config: Option<PathBuf>,
    /// `--set`, in order.
    pub set: Vec<String>,
}

impl Means {
    /// Defaults, then the configuration file, then `--set`, then the other flags.
    ///
    /// # Errors
    /// A key that does not exist, a value of another kind: usage; a configuration that cannot be
    /// read: as it is.
    pub fn of(given: &Given) -> Result<Self> {
        let mut means = Self {
            memory_bytes: MEMORY_BYTES,
            n_threads: std::thread::available_parallelism().map_or(1, std::num::NonZero::get),
            scanners: None,
            settings: Settings::default(),
        };
        // Before the file, since they bound it, too; and after it, since they go before what it
        // says.
        means.set_all(&given.set)?;
        if let Some(path) = &given.config {
            means.read(path)?;
            means.set_all(&given.set)?;
        }
        if let Some(memory) = &given.memory {
            means.memory_bytes = memory_bytes(memory).map_err(|e| e.at("--memory"))?;
        }
        if let Some(threads) = given.threads {
            means.n_threads = threads;
        }
        means.checked()
    }

    /// What the points that wait for their tiles may keep, bytes: a quarter of what the program
    /// itself leaves. As much goes into vectors that grow by copying and tiles on their way to
    /// disk; more would not make scans any faster.
    #[must_use]
    pub fn ingest_bytes(&self) -> usize {
        let free = self.memory_bytes.saturating_sub(PROGRAM_BYTES) / 4;
        usize::try_from(free).unwrap_or(usize::MAX)
    }

    /// What mapped pages of the store may keep resident, bytes.
    #[must_use]
    pub fn store_bytes(&self) -> usize {
        usize::try_from(self.memory_bytes / 16).unwrap_or(usize::MAX)
    }

    /// What each channel of a pass may keep, bytes: small beside the whole, and never more than is
    /// of use.
    #[must_use]
    pub fn channel_bytes(&self) -> usize {
        usize::try_from(self.memory_bytes / 128).unwrap_or(usize::MAX).clamp(1 << 20, CHANNEL_BYTES)
    }

    /// Whether there is too little memory for two regions at once: twenty scans of one take half a
    /// gigabyte.
    #[must_use]
    pub fn is_narrow(&self) -> bool {
        self.memory_bytes < NARROW_BYTES
    }

    fn checked(self) -> Result<Self> {
        if self.n_threads == 0 || self.n_threads > 1024 {
            return Err(usage(format!(
                "threads must lie within 1..1024, got \"{}\"",
                self.n_threads
            )));
        }
        if self.memory_bytes < LEAST_MEMORY_BYTES {
            let (least, got) = (memory_words(LEAST_MEMORY_BYTES), memory_words(self.memory_bytes));
            return Err(Error::new(
                Kind::OverBudget,
                format!("a run takes {least} at least, got \"{got}\""),
            )
            .hint("raise --memory"));
        }
        self.settings.ingest.check()?;
        let export = &self.settings.export;
        if export.copc && !export.tiles {
            let what = "export.copc needs export.tiles: the COPC file is made of the tiles";
            return Err(usage(what).hint("leave export.tiles as it is"));
        }
        Ok(self)
    }

    fn set_all(&mut self, pairs: &[String]) -> Result<()> {
        for pair in pairs {
            let (key, value) = pair.split_once('=').ok_or_else(|| {
                usage(format!("--set takes key=value, got \"{pair}\""))
                    .hint("for example fit.beam=150")
            })?;
            self.set(key.trim(), &parsed(value.trim())).map_err(|e| e.at("--set"))?;
        }
        Ok(())
    }

    /// Takes the settings of a file. What is wrong in it is bad input: the command line that names
    /// it is right.
    fn read(&mut self, path: &Path) -> Result<()> {
        let text = ingest::read_text(path, self.settings.ingest.max_text_bytes, MAX_TEXT)?;
        let table = text.parse().map_err(|e: toml::de::Error| {
            usage("this is not TOML").because(e.message().to_owned()).at(line(&text, &e))
        });
        let taken = table.and_then(|table| self.take(&table, path));
        taken.map_err(|e| e.at(path.display()).of_kind(Kind::BadInput))
    }

    fn take(&mut self, table: &toml::Table, path: &Path) -> Result<()> {
        for (key, value) in table {
            match value {
                toml::Value::Table(room) => {
                    for (field, value) in room {
                        self.set(&format!("{key}.{field}"), value)?;
                    }
                }
                value => self.set(key, value)?,
            }
        }
        // A path in a configuration is meant from where the configuration lies.
        if let (Some(scanners), Some(dir)) = (&self.scanners, path.parent()) {
            self.scanners = Some(dir.join(scanners));
        }
        Ok(())
    }

    fn set(&mut self, key: &str, value: &toml::Value) -> Result<()> {
        let text = value.as_str();
        match key {
            "memory" => {
                let bytes = value.as_integer().and_then(|v| u64::try_from(v).ok());
                self.memory_bytes = match (bytes, text) {
                    (Some(bytes), _) => bytes,
                    (None, Some(text)) => memory_bytes(text)?,
                    _ => {
                        return Err(usage(format!(
                            "memory is a size such as 4GiB, got \"{value}\""
                        )));
                    }
                };
            }
            "threads" => {
                let n = value.as_integer().and_then(|v| usize::try_from(v).ok());
                self.n_threads =
                    n.ok_or_else(|| usage(format!("threads is a number, got \"{value}\"")))?;
            }
            "scanners" => {
                let path =
                    text.ok_or_else(|| usage(format!("scanners is a path, got \"{value}\"")))?;
                self.scanners = Some(PathBuf::from(path));
            }
            _ => self.settings.set(key, value)?,
        }
        Ok(())
    }
}

/// A value on the command line: TOML where it is, else a word.
fn parsed(text: &str) -> toml::Value {
    let table = format!("v = {text}").parse::<toml::Table>();
    table.ok().and_then(|mut t| t.remove("v")).unwrap_or_else(|| toml::Value::String(text.into()))
}

fn line(text: &str, error: &toml::de::Error) -> String {
    let start = error.span().map_or(0, |s| s.start).min(text.len());
    format!("line {}", text.as_bytes()[..start].iter().filter(|b| **b == b'\n').count() + 1)
}

fn usage(what: impl Into<String>) -> Error {
    Error::new(Kind::Usage, what)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn with(set: &[&str]) -> Result<Means> {
        let set = set.iter().map(ToString::to_string).collect();
        Means::of(&Given { set, ..Given::default() })
    }

    #[test]
    fn flags_beat_set_and_set_beats_the_file() {
        let dir = tempfile::tempdir().expect("a folder");
        let path = dir.path().join("plant.toml");
        let text =
            "memory = \"8GiB\"\nthreads = 3\nscanners = \"s.toml\"\n[fit]\nbeam = 77\nthin = 1\n";
        std::fs::write(&path, text).expect("writes");
        let given = Given {
            memory: Some("1 GiB".into()),
            threads: None,
            config: Some(path),
            set: vec!["fit.beam=99".into(), "fit.plane_sigma=[0.1, 2]".into()],
        };
        let means = Means::of(&given).expect("reads");
        assert_eq!((means.memory_bytes, means.n_threads), (1 << 30, 3));
        assert_eq!((means.settings.fit.beam, means.settings.fit.thin), (99, 1.0));
        assert_eq!(means.settings.fit.plane_sigma, [0.1, 2.0]);
        assert_eq!(means.scanners, Some(dir.path().join("s.toml")));
    }

    #[test]
    fn what_is_recorded_of_a_run_can_be_set_again() {
        let settings = Settings::default();
        for (key, value) in settings.all() {
            let mut again = settings.clone();
            again.set(key, &value).unwrap_or_else(|e| panic!("{key} = {value}: {e}"));
            let written = again.all().into_iter().find(|(k, _)| *k == key).map(|(_, v)| v);
            assert_eq!(written, Some(value), "{key}");
        }
        // Single precision does not hold it.
        let single = settings.all().into_iter().any(|(key, _)| {
            let huge = toml::Value::Float(1e300);
            let mut again = settings.clone();
            again.set(key, &huge).is_ok() && format!("{:?}", again.all()).contains("inf")
        });
        assert!(!single, "a setting is infinite");
    }

    #[test]
    fn what_is_not_known_is_refused_by_name() {
        for (set, says) in [
            ("fit.bean=3", "\"fit.bean\""),
            ("colour=3", "\"colour\""),
            ("fit.beam=many", "\"many\""),
            ("fit.beam=-1", "\"-1\""),
            ("fit.thin=nan", "\"nan\""),
            ("beam", "\"beam\""),
            ("threads=0", "\"0\""),
        ] {
            let error = with(&[set]).expect_err(set);
            assert_eq!(error.kind(), Kind::Usage, "{set}");
            assert!(error.to_string().contains(says), "{error}");
        }
        assert_eq!(with(&["memory=1MiB"]).expect_err("small").kind(), Kind::OverBudget);
        let error = with(&["export.copc=true", "export.tiles=false"]).expect_err("no tiles");
        assert!(error.to_string().contains("export.tiles"), "{error}");
        assert!(with(&["fit.bean=3"]).expect_err("typo").to_string().contains("beam"));
    }

    #[test]
    fn a_broken_configuration_names_its_line() {
        let dir = tempfile::tempdir().expect("a folder");
        let path = dir.path().join("plant.toml");
        std::fs::write(&path, "threads = 2\n[fit\n").expect("writes");
        let given = Given { config: Some(path), ..Given::default() };
        let error = Means::of(&given).expect_err("broken").to_string();
        assert!(error.contains("plant.toml: line 2: this is not TOML"), "{error}");
    }
}
