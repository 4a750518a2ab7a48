//! A job: what a run reads, where it writes and with which memory, threads and settings, taken from
//! flags and configuration and checked once.

mod memory;
mod method;
mod origin;
pub(crate) mod places;
mod settings;
pub(crate) mod units;
mod value;

pub use memory::{memory_bytes, memory_words};
pub use method::Method;
pub use origin::{SettingOrigin, SettingOrigins};
pub use settings::Settings;

use crate::engine::CHANNEL_BYTES;
use contract::{Error, Kind, Result};
use std::path::{Path, PathBuf};

/// Default of `--memory`, bytes: half of the memory of a small office machine.
pub const MEMORY_BYTES: u64 = 4 << 30;
/// Memory below which regions are searched one after the other, bytes.
const NARROW_BYTES: u64 = 3 << 29;
/// Least memory that a run accepts, bytes: enough for program, robot library and one strip per
/// worker.
pub const LEAST_MEMORY_BYTES: u64 = 256 << 20;
/// Memory of the program and the robot library before any point is read, bytes.
const PROGRAM_BYTES: u64 = 160 << 20;
/// The setting that bounds the length of configurations, reviews, scenes, paths and lists of
/// readings, bytes.
pub const MAX_TEXT: &str = "ingest.max_text_bytes";

/// Inputs, output folder, memory, threads and settings of a run.
#[derive(Debug, Clone)]
pub struct Job {
    /// Scan files, in the order of the command line.
    pub inputs: Vec<PathBuf>,
    /// Folder of the robot library.
    pub robots: PathBuf,
    /// File of scanner poses, for formats without poses.
    pub scanners: Option<PathBuf>,
    /// Whether scanner positions are found from the points where no file of poses is given.
    pub find_scanners: bool,
    /// Output folder.
    pub out: PathBuf,
    /// Review file: what a person knows of the robots.
    pub review: Option<PathBuf>,
    /// Whether to go on without the inputs and regions that fail, and to report them.
    pub keep_going: bool,
    /// Messages about inputs that were left out because they failed.
    pub left_out: Vec<String>,
    /// Memory, threads and settings.
    pub means: Means,
}

impl Job {
    /// A job without scanner poses and review that ends at the first failure.
    #[must_use]
    pub fn new(inputs: Vec<PathBuf>, robots: PathBuf, out: PathBuf, means: Means) -> Self {
        let (scanners, review, keep_going, left_out) = (None, None, false, Vec::new());
        let find_scanners = true;
        Self { inputs, robots, scanners, find_scanners, out, review, keep_going, left_out, means }
    }

    /// Index of the input that an error is about, if the job can go on without it.
    pub(crate) fn failed_input(&self, error: &Error) -> Option<usize> {
        let is_of_file = matches!(error.kind(), Kind::BadInput | Kind::Unsupported | Kind::Io);
        if !self.keep_going || !is_of_file || self.inputs.len() < 2 {
            return None;
        }
        let place = error.place()?;
        self.inputs.iter().position(|path| place.starts_with(&path.display().to_string()))
    }
}

/// Memory, threads and settings of any command.
#[derive(Debug, Clone)]
pub struct Means {
    /// Upper bound of resident memory, bytes.
    pub memory_bytes: u64,
    /// Number of worker threads.
    pub n_threads: usize,
    /// File of scanner poses that the configuration names.
    pub scanners: Option<PathBuf>,
    /// Settings of all stages.
    pub settings: Settings,
    /// Where values that differ from the defaults come from.
    pub origins: SettingOrigins,
}

/// Outcome of a run, for the command line.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Outcome {
    /// Summary for people, written to standard output at the end.
    pub summary: String,
    /// Warnings, written to standard error and to the result.
    pub warnings: Vec<String>,
    /// Whether something was skipped or refused, as the result states: exit code 3.
    pub partial: bool,
    /// Messages about pieces of earlier runs that were used again, written to standard error.
    pub reused: Vec<String>,
    /// Messages about files that were removed beside the result, written to standard error but not
    /// to the result.
    pub notes: Vec<String>,
}

/// Values of flags; `None` where a flag is missing.
#[derive(Debug, Clone, Default)]
pub struct FlagValues {
    /// `--memory`.
    pub memory: Option<String>,
    /// `--threads`.
    pub threads: Option<usize>,
    /// `--config`.
    pub config: Option<PathBuf>,
    /// Variables of the environment that hold a setting each, with their values.
    pub environment: Vec<(String, String)>,
    /// `--set`, in order.
    pub set: Vec<String>,
}

impl Means {
    /// Applies in this order: defaults, the configuration file, the environment, `--set`, other
    /// flags. Later ones take precedence.
    ///
    /// # Errors
    /// `Usage` for an unknown key or a value of the wrong kind; `BadInput` for a configuration that
    /// cannot be read.
    pub fn of(given: &FlagValues) -> Result<Self> {
        let mut means = Self {
            memory_bytes: MEMORY_BYTES,
            n_threads: std::thread::available_parallelism().map_or(1, std::num::NonZero::get),
            scanners: None,
            settings: Settings::default(),
            origins: SettingOrigins::default(),
        };
        // `--set` and the environment are applied before the file, whose length they may bound, and
        // again after it, since they take precedence.
        means.set_all(given)?;
        if let Some(path) = &given.config {
            means.read(path)?;
            means.set_all(given)?;
        }
        if let Some(memory) = &given.memory {
            means.memory_bytes = memory_bytes(memory).map_err(|e| e.at("--memory"))?;
            means.origins.note("memory", SettingOrigin::Flag("--memory"));
        }
        if let Some(threads) = given.threads {
            means.n_threads = threads;
            means.origins.note("threads", SettingOrigin::Flag("--threads"));
        }
        means.checked()
    }

    /// All settings as a configuration file, which `--config` reads; `with_origin` adds where each
    /// value comes from, and `only_changed` leaves out what is at its default.
    #[must_use]
    pub fn as_toml(&self, with_origin: bool, only_changed: bool) -> String {
        let words = memory_words(self.memory_bytes);
        let is_exact = memory_bytes(&words).is_ok_and(|bytes| bytes == self.memory_bytes);
        let memory = if is_exact { format!("\"{words}\"") } else { self.memory_bytes.to_string() };
        let mut all = vec![("memory", memory), ("threads", self.n_threads.to_string())];
        let scanners = self.scanners.as_ref().map(|path| path.to_string_lossy().into_owned());
        all.extend(scanners.map(|path| ("scanners", toml::Value::String(path).to_string())));
        let settings = self.settings.all();
        all.extend(settings.iter().map(|(key, value)| (*key, value.to_string())));
        origin::as_toml(&all, &self.origins, with_origin, only_changed)
    }

    /// Memory for points that wait for their tiles, bytes: a quarter of what the program itself
    /// leaves. As much is used by vectors that grow by copying and by tiles on their way to disk;
    /// more would not make scans faster.
    #[must_use]
    pub fn ingest_bytes(&self) -> usize {
        let free = self.memory_bytes.saturating_sub(PROGRAM_BYTES) / 4;
        usize::try_from(free).unwrap_or(usize::MAX)
    }

    /// Memory for a sample of a cloud's points whose scanners are looked for, before anything else
    /// is held, bytes: half of what the program itself leaves.
    #[must_use]
    pub fn sample_bytes(&self) -> usize {
        let free = self.memory_bytes.saturating_sub(PROGRAM_BYTES) / 2;
        usize::try_from(free).unwrap_or(usize::MAX)
    }

    /// Memory for mapped pages of the store, bytes.
    #[must_use]
    pub fn store_bytes(&self) -> usize {
        usize::try_from(self.memory_bytes / 16).unwrap_or(usize::MAX)
    }

    /// Most bytes that wait in each channel of a pass.
    #[must_use]
    pub fn channel_bytes(&self) -> usize {
        usize::try_from(self.memory_bytes / 128).unwrap_or(usize::MAX).clamp(1 << 20, CHANNEL_BYTES)
    }

    /// Whether memory is too small for two regions at once: the views of twenty scans of one region
    /// take half a gigabyte.
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

    /// Applies the environment, and then `--set`.
    fn set_all(&mut self, given: &FlagValues) -> Result<()> {
        for (name, value) in &given.environment {
            let key = origin::setting_of_variable(name)
                .ok_or_else(|| usage(format!("there is no setting for the variable {name}")))?;
            self.set(&key, &parsed(value.trim())).map_err(|e| e.at(name))?;
            self.origins.note(&key, SettingOrigin::Environment(name.clone()));
        }
        for pair in &given.set {
            let (key, value) = pair.split_once('=').ok_or_else(|| {
                usage(format!("--set takes key=value, got \"{pair}\""))
                    .hint("for example fit.beam=150")
            })?;
            self.set(key.trim(), &parsed(value.trim())).map_err(|e| e.at("--set"))?;
            self.origins.note(key.trim(), SettingOrigin::Set);
        }
        Ok(())
    }

    /// Applies the settings of a configuration file. An error in it is `BadInput`: the command line
    /// that names the file is right.
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
                        let origin = SettingOrigin::File(path.to_path_buf());
                        self.origins.note(&format!("{key}.{field}"), origin);
                    }
                }
                value => {
                    self.set(key, value)?;
                    self.origins.note(key, SettingOrigin::File(path.to_path_buf()));
                }
            }
        }
        // A path in a configuration is relative to the folder of the configuration.
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

/// Parses a value of the command line: TOML where it parses, else a word.
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
        Means::of(&FlagValues { set, ..FlagValues::default() })
    }

    #[test]
    fn flags_beat_set_and_set_beats_the_file() {
        let dir = tempfile::tempdir().expect("a folder");
        let path = dir.path().join("plant.toml");
        let text =
            "memory = \"8GiB\"\nthreads = 3\nscanners = \"s.toml\"\n[fit]\nbeam = 77\nthin = 1\n";
        std::fs::write(&path, text).expect("writes");
        let given = FlagValues {
            memory: Some("1 GiB".into()),
            threads: None,
            config: Some(path),
            set: vec!["fit.beam=99".into(), "fit.plane_sigma=[0.1, 2]".into()],
            ..FlagValues::default()
        };
        let means = Means::of(&given).expect("reads");
        assert_eq!((means.memory_bytes, means.n_threads), (1 << 30, 3));
        assert_eq!((means.settings.fit.beam, means.settings.fit.thin), (99, 1.0));
        assert_eq!(means.settings.fit.plane_sigma, [0.1, 2.0]);
        assert_eq!(means.scanners, Some(dir.path().join("s.toml")));
    }

    #[test]
    fn only_errors_of_an_input_are_forgiven() {
        let job = |keep_going: bool| {
            let inputs = vec!["a/one.e57".into(), "a/two.e57".into()];
            let means = with(&[]).expect("defaults");
            Job { keep_going, ..Job::new(inputs, "r".into(), "o".into(), means) }
        };
        let broken = Error::bad_input("damaged").at("page 3").at("a/two.e57");
        assert_eq!(job(true).failed_input(&broken), Some(1));
        assert_eq!(job(false).failed_input(&broken), None);
        assert_eq!(job(true).failed_input(&Error::bad_input("damaged").at("b/two.e57")), None);
        let full = Error::new(Kind::OverBudget, "the disk is full").at("a/two.e57");
        assert_eq!(job(true).failed_input(&full), None);
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
        // Single precision cannot represent this value.
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
        let given = FlagValues { config: Some(path), ..FlagValues::default() };
        let error = Means::of(&given).expect_err("broken").to_string();
        assert!(error.contains("plant.toml: line 2: this is not TOML"), "{error}");
    }
}
