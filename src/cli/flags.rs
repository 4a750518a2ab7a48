//! Commands and flags, as `clap` parses them. Their names are stable, since people and scripts rely
//! on them.

use super::bench_flags::BenchCommand;
use super::say::LogFormat;
use crate::check::PathDoubt;
use crate::engine::Engine;
use crate::engine::progress::{Mode, Progress};
use crate::job::{Given, Means};
use crate::result::conversion::Format;
use clap::{Args, Parser, Subcommand};
use contract::Result;
use std::path::PathBuf;

/// Finds the robots in laser scans of a plant, in which posture they stand, and splits the cloud
/// into what moves and what stands still.
#[derive(Debug, Parser)]
#[command(name = "stillpoint", version, subcommand_required = true, arg_required_else_help = true)]
pub(super) struct Line {
    #[command(subcommand)]
    pub(super) command: Command,
    #[command(flatten)]
    pub(super) common: Common,
}

#[derive(Debug, Subcommand)]
pub(super) enum Command {
    /// A virtual robot cell: build, scan, run, compare with truth, report
    Demo(DemoFlags),
    /// What is in these scans, and what will be worse for what they lack
    Inspect(InspectFlags),
    /// The main job: scans and a robot library in, postures and masks out
    Run(RunFlags),
    /// As run, but only says what it would take: memory, disk, time
    Plan(PlanFlags),
    /// One cell again: an earlier result and new scans in, the whole result with that cell brought
    /// up to date out
    Rescan(RescanFlags),
    /// Whether the files of a result are what they were when they were written
    Verify(OutFlags),
    /// What a run came to, once more; robots as cases for a build server with --junit
    Report(ReportFlags),
    /// A result's points in another format: COPC or PLY
    Export(ExportFlags),
    /// Whether a path of one robot keeps clear of what was scanned
    Check(CheckFlags),
    /// Which robots differ between two results of one plant: moved, exchanged, appeared, gone
    Diff(DiffFlags),
    /// Which results lie in a folder, which goes on from which, and what each takes; --remove takes
    /// one away
    History(HistoryFlags),
    /// Virtual scanner: a scene file in, scans and their truth out
    Simulate(SimulateFlags),
    /// How exact, how fast
    #[command(subcommand)]
    Bench(BenchCommand),
    /// About robot libraries
    #[command(subcommand)]
    Robots(RobotsCommand),
}

#[derive(Debug, Subcommand)]
pub(super) enum RobotsCommand {
    /// Check a robot library
    Lint(LintFlags),
    /// Put together what runs with --calibrate found of one robot, and write its model so corrected
    Calibrate(CalibrateFlags),
}

#[derive(Debug, Args)]
pub(super) struct DemoFlags {
    /// Keep scene, scans, robots and results here (else in a temporary folder that is removed)
    #[arg(long, value_name = "DIR")]
    pub(super) out: Option<PathBuf>,
}

#[derive(Debug, Args)]
pub(super) struct InspectFlags {
    /// Scan files: E57, PTX, LAS, LAZ
    #[arg(required = true, value_name = "INPUT")]
    pub(super) inputs: Vec<PathBuf>,
    /// Answer in JSON
    #[arg(long)]
    pub(super) json: bool,
}

#[derive(Debug, Args)]
pub(super) struct RunFlags {
    /// Scan files: E57, PTX, LAS, LAZ
    #[arg(required = true, value_name = "INPUT")]
    pub(super) inputs: Vec<PathBuf>,
    /// Robot library: a folder of folders, each with robot.urdf and its meshes
    #[arg(long, value_name = "DIR")]
    pub(super) robots: PathBuf,
    /// Where results go
    #[arg(long, value_name = "DIR")]
    pub(super) out: PathBuf,
    /// What a person knows of the robots: places where one stands, of which model, or none (TOML)
    #[arg(long, value_name = "FILE")]
    pub(super) review: Option<PathBuf>,
    /// Finish without the files and robots that fail, and exit with 3
    #[arg(long)]
    pub(super) keep_going: bool,
    /// Estimate where the joints of each robot really are, too: for robots that their models fit
    /// poorly
    #[arg(long)]
    pub(super) calibrate: bool,
}

#[derive(Debug, Args)]
pub(super) struct PlanFlags {
    #[command(flatten)]
    pub(super) run: RunFlags,
    /// Answer in JSON
    #[arg(long)]
    pub(super) json: bool,
}

#[derive(Debug, Args)]
pub(super) struct RescanFlags {
    /// Output folder of the earlier run, or rescan
    #[arg(long, value_name = "OUT")]
    pub(super) base: PathBuf,
    /// New scans of the cell: E57, PTX, LAS, LAZ
    #[arg(required = true, value_name = "INPUT")]
    pub(super) inputs: Vec<PathBuf>,
    /// Where results go; what did not change is shared with the earlier run
    #[arg(long, value_name = "DIR")]
    pub(super) out: PathBuf,
    /// Robot library (else that of the earlier run)
    #[arg(long, value_name = "DIR")]
    pub(super) robots: Option<PathBuf>,
    /// Bounds of the cell, metres: least x, y, z, greatest x, y, z (else what the new scans see
    /// well)
    #[arg(
        long,
        value_name = "X,Y,Z,X,Y,Z",
        value_delimiter = ',',
        num_args = 1,
        allow_hyphen_values = true,
        conflicts_with = "robot"
    )]
    pub(super) cell: Vec<f64>,
    /// Where the new scans are: "same", their frame is the plant's; or about where the first new
    /// scanner stands in the plant, metres, and how far the new frame is turned, degrees (else
    /// found by surfaces, and refused where that is not clear)
    #[arg(long, value_name = "X,Y,Z,YAW", allow_hyphen_values = true)]
    pub(super) frame: Option<String>,
    /// The cell is what these robots of the earlier run reach
    #[arg(long, value_name = "ID", value_delimiter = ',')]
    pub(super) robot: Vec<String>,
}

#[derive(Debug, Args)]
pub(super) struct ExportFlags {
    /// Output folder of a run
    #[arg(value_name = "OUT")]
    pub(super) out: PathBuf,
    /// Which format; files go to OUT/export; a later run into OUT takes them away where the points
    /// are others, and says so
    #[arg(long, value_name = "FORMAT", value_enum)]
    pub(super) to: Format,
}

#[derive(Debug, Args)]
pub(super) struct CheckFlags {
    /// Output folder of a run
    #[arg(value_name = "OUT")]
    pub(super) out: PathBuf,
    /// The path: CSV with joints' names in its head, or JSON as trajectory_msgs/JointTrajectory;
    /// radians and metres
    #[arg(long, value_name = "FILE")]
    pub(super) trajectory: PathBuf,
    /// Whose path it is (else the only robot that has all of its joints)
    #[arg(long, value_name = "ID")]
    pub(super) robot: Option<String>,
    /// What comes nearer to the robot is in its way, metres
    #[arg(long, value_name = "METRES", default_value_t = 0.02)]
    pub(super) margin: f64,
    /// Turning joints of the path are in degrees
    #[arg(long)]
    pub(super) degrees: bool,
    /// What a path that passes may leave in doubt
    #[arg(long, value_name = "WHAT", value_enum, value_delimiter = ',')]
    pub(super) allow: Vec<PathDoubt>,
    /// Robot library (else that of the run)
    #[arg(long, value_name = "DIR")]
    pub(super) robots: Option<PathBuf>,
    /// Answer in JSON
    #[arg(long)]
    pub(super) json: bool,
}

#[derive(Debug, Args)]
pub(super) struct OutFlags {
    /// Output folder of a run
    #[arg(value_name = "OUT")]
    pub(super) out: PathBuf,
}

#[derive(Debug, Args)]
pub(super) struct HistoryFlags {
    /// Folder in which output folders of runs and rescans lie
    #[arg(value_name = "DIR")]
    pub(super) folder: PathBuf,
    /// Take this session away; the others keep what they share with it
    #[arg(long, value_name = "NAME")]
    pub(super) remove: Vec<String>,
    /// Answer in JSON
    #[arg(long)]
    pub(super) json: bool,
}

#[derive(Debug, Args)]
pub(super) struct DiffFlags {
    /// Output folder of the earlier run
    #[arg(value_name = "THEN")]
    pub(super) then: PathBuf,
    /// Output folder of the later run
    #[arg(value_name = "NOW")]
    pub(super) now: PathBuf,
    /// Answer in JSON
    #[arg(long)]
    pub(super) json: bool,
}

#[derive(Debug, Args)]
pub(super) struct ReportFlags {
    /// Output folder of a run
    #[arg(value_name = "OUT")]
    pub(super) out: PathBuf,
    /// Write each robot as a test case: trusted ones pass
    #[arg(long, value_name = "FILE")]
    pub(super) junit: Option<PathBuf>,
}

#[derive(Debug, Args)]
pub(super) struct SimulateFlags {
    /// Scene file (TOML)
    #[arg(value_name = "SCENE")]
    pub(super) scene: PathBuf,
    /// Where scans and truth go
    #[arg(long, value_name = "DIR")]
    pub(super) out: PathBuf,
    /// Robot library that the scene's robots are taken from
    #[arg(long, value_name = "DIR")]
    pub(super) robots: Option<PathBuf>,
}

#[derive(Debug, Args)]
pub(super) struct LintFlags {
    /// Robot library
    #[arg(value_name = "DIR")]
    pub(super) dir: PathBuf,
    /// Answer in JSON
    #[arg(long)]
    pub(super) json: bool,
}

#[derive(Debug, Args)]
pub(super) struct CalibrateFlags {
    /// Output folders of runs with --calibrate
    #[arg(required = true, value_name = "OUT")]
    pub(super) results: Vec<PathBuf>,
    /// Model, as in the library (else the only one that was calibrated)
    #[arg(long, value_name = "NAME")]
    pub(super) model: Option<String>,
    /// Robots by their ids in the results (else all of the model: they count as one and the same)
    #[arg(long, value_name = "ID", value_delimiter = ',')]
    pub(super) robot: Vec<String>,
    /// Joint values that the controller showed while it was scanned: offsets of its zeros are
    /// estimated (TOML)
    #[arg(long, value_name = "FILE")]
    pub(super) readings: Option<PathBuf>,
    /// Robot library that the model is taken from
    #[arg(long, value_name = "DIR")]
    pub(super) robots: PathBuf,
    /// Where the corrected model goes: a folder of a library
    #[arg(long, value_name = "DIR")]
    pub(super) out: PathBuf,
}

/// Flags of all commands.
#[derive(Debug, Args)]
pub(super) struct Common {
    /// Upper bound of resident memory, for example 4GiB
    #[arg(long, global = true, value_name = "SIZE")]
    memory: Option<String>,
    /// Worker threads (else one a core)
    #[arg(long, global = true, value_name = "N")]
    threads: Option<usize>,
    /// Scanner poses, for formats that carry none (TOML or JSON)
    #[arg(long, global = true, value_name = "FILE")]
    scanners: Option<PathBuf>,
    /// Unit of the inputs' coordinates: m, cm, mm, km, in, ft, us-ft; one file's own as NAME=UNIT,
    /// heights apart as us-ft/m, several with commas (else what each file declares, else
    /// metres)
    #[arg(long, global = true, value_name = "UNIT")]
    units: Option<String>,
    /// Settings (TOML)
    #[arg(long, global = true, value_name = "FILE")]
    config: Option<PathBuf>,
    /// One setting, for example fit.beam=150; goes before the file
    #[arg(long, global = true, value_name = "KEY=VALUE")]
    set: Vec<String>,
    /// How postures are found: "beam" (else), or "paper", the method of the source, link after
    /// link
    #[arg(long, global = true, value_name = "NAME")]
    method: Option<String>,
    /// How progress is shown (else a bar on a terminal, lines elsewhere)
    #[arg(long, global = true, value_enum, value_name = "HOW")]
    progress: Option<Mode>,
    /// How warnings and errors are written
    #[arg(long, global = true, value_enum, value_name = "HOW", default_value = "text")]
    pub(super) log_format: LogFormat,
}

impl Common {
    /// Defaults, configuration and flags, put together and checked.
    pub(super) fn means(&self) -> Result<Means> {
        let method = self.method.iter().map(|name| format!("fit.method={name}"));
        let units = self.units.iter().map(|unit| format!("ingest.units=\"{unit}\""));
        Means::of(&Given {
            memory: self.memory.clone(),
            threads: self.threads,
            config: self.config.clone(),
            set: self.set.iter().cloned().chain(method).chain(units).collect(),
        })
    }

    /// The scanners' file: the flag, else that of the configuration.
    pub(super) fn scanners(&self, means: &Means) -> Option<PathBuf> {
        self.scanners.clone().or_else(|| means.scanners.clone())
    }

    /// An engine that shows progress and listens to Ctrl-C. Call once.
    pub(super) fn engine(&self, means: &Means) -> Result<Engine> {
        let mut engine = Engine::new(means.n_threads);
        engine.channel_bytes = means.channel_bytes();
        engine.is_narrow = means.is_narrow();
        engine.progress = match (self.progress, self.log_format) {
            // Nothing but JSON is asked for: bars and lines are for people.
            (Some(Mode::None), LogFormat::Json) => Progress::json_without_progress(),
            (_, LogFormat::Json) => Progress::new(Mode::Json),
            (mode, LogFormat::Text) => Progress::new(mode.unwrap_or_else(Mode::fitting)),
        };
        engine.cancel.on_ctrl_c()?;
        // Libraries that use rayon by themselves keep to the same number; a pool made earlier
        // (tests) is kept.
        let _ = rayon::ThreadPoolBuilder::new().num_threads(means.n_threads).build_global();
        Ok(engine)
    }
}

/// Refuses names of inputs that are no files, before anything else is done.
pub(super) fn present(inputs: &[PathBuf]) -> Result<()> {
    inputs.iter().try_for_each(|path| ingest::regular(path))
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory;

    #[test]
    fn flags_are_consistent() {
        Line::command().debug_assert();
    }

    #[test]
    fn common_flags_stand_anywhere() {
        for args in [
            "stillpoint --threads 2 run a.e57 b.ptx --robots r --out o",
            "stillpoint run a.e57 b.ptx --robots r --out o --threads 2",
        ] {
            let line = Line::try_parse_from(args.split(' ')).expect("parses");
            assert_eq!(line.common.threads, Some(2));
            let Command::Run(run) = line.command else { panic!("{args}") };
            assert_eq!(run.inputs.len(), 2);
        }
    }
}
