//! Commands and flags, as `clap` parses them. Their names are stable, since people and scripts rely
//! on them.

use super::bench_flags::BenchCommand;
use super::common::Common;
use super::program_flags::{CompletionsFlags, ConfigCommand, ManualFlags, SchemaFlags};
use super::scanners_flags::ScannersFlags;
use crate::check::PathDoubt;
use crate::result::conversion::ExportFormat;
use crate::result::mesh_export::MeshFormat;
use clap::{Args, Parser, Subcommand};
use contract::Result;
use std::path::PathBuf;

/// Finds robots in laser scans of a plant, recovers their postures, and divides the points into
/// moving and fixed ones.
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
    /// Build a virtual robot cell, scan it, run on the scans and compare the result with the truth
    Demo(DemoFlags),
    /// Show what scans contain, and which missing data make results worse
    Inspect(InspectFlags),
    /// Find from the points where the scanners stood, for clouds that do not state it
    Scanners(ScannersFlags),
    /// Find the robots in scans, recover their postures and label all points (the main command)
    Run(RunFlags),
    /// Estimate memory, disk space and time of a run without running it
    Plan(PlanFlags),
    /// Bring one cell of an earlier result up to date with new scans; writes the whole result and a
    /// list of changes
    Rescan(RescanFlags),
    /// List the shards of a run: pieces of work that many machines with a shared disk do in its
    /// place. The list grows while shards are made
    Shards(ShardsFlags),
    /// Make one shard of a run; two processes may make the same one
    Shard(ShardFlags),
    /// Write the result of a run whose shards are all made
    Gather(RunFlags),
    /// Verify that the files of a result are unchanged since they were written
    Verify(OutFlags),
    /// Print all about a result; --html makes sure that there is a page with the plant in 3D,
    /// --junit writes its robots as test cases for a build server
    Report(ReportFlags),
    /// Write the points of a result in another format, or its scene for planners and simulators
    Export(ExportFlags),
    /// Check whether paths of robots keep clear of scanned obstacles
    Check(CheckFlags),
    /// List the robots that differ between two results of a plant: moved, exchanged, appeared, gone
    Diff(DiffFlags),
    /// List the results in a folder, which result each one started from, and its size; --remove
    /// removes one
    History(HistoryFlags),
    /// Scan a scene file with the virtual scanner; writes scans and their truth
    Simulate(SimulateFlags),
    /// Measure accuracy and speed
    #[command(subcommand)]
    Bench(BenchCommand),
    /// Check and calibrate robot libraries
    #[command(subcommand)]
    Robots(RobotsCommand),
    /// Show the settings of a run and where each value comes from
    #[command(subcommand)]
    Config(ConfigCommand),
    /// Print the JSON schema of a file that the program reads or writes; --out writes all of them
    Schema(SchemaFlags),
    /// Print a script that completes commands and options in a shell
    Completions(CompletionsFlags),
    /// Write manual pages for `man`, one for each command
    Manual(ManualFlags),
}

#[derive(Debug, Subcommand)]
pub(super) enum RobotsCommand {
    /// Check a robot library
    Lint(LintFlags),
    /// Combine what runs with --calibrate have found for one robot, and write its corrected model
    Calibrate(CalibrateFlags),
}

#[derive(Debug, Args)]
pub(super) struct DemoFlags {
    /// Folder that keeps scene, scans, robots and results (default: a temporary folder that is
    /// removed)
    #[arg(long, value_name = "DIR")]
    pub(super) out: Option<PathBuf>,
    /// Number of beams of each of the four scanners; 300000 makes a small cell that takes seconds
    /// (default: about three million)
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(10_000..=100_000_000))]
    pub(super) beams: Option<u64>,
}

#[derive(Debug, Args)]
pub(super) struct InspectFlags {
    /// Scan files: E57, PTX, LAS, LAZ, PTS, XYZ, PLY, PCD
    #[arg(required = true, value_name = "INPUT")]
    pub(super) inputs: Vec<PathBuf>,
    /// Print JSON
    #[arg(long)]
    pub(super) json: bool,
}

#[derive(Debug, Args)]
pub(super) struct RunFlags {
    /// Scan files: E57, PTX, LAS, LAZ, PTS, XYZ, PLY, PCD
    #[arg(required = true, value_name = "INPUT")]
    pub(super) inputs: Vec<PathBuf>,
    /// Robot library: a folder with one subfolder per model, each with robot.urdf and its meshes
    #[arg(long, value_name = "DIR")]
    pub(super) robots: PathBuf,
    /// Output folder
    #[arg(long, value_name = "DIR")]
    pub(super) out: PathBuf,
    /// Review file (TOML) with what a person knows: places with a robot, with a certain model, or
    /// without one
    #[arg(long, value_name = "FILE")]
    pub(super) review: Option<PathBuf>,
    /// Go on without files and robots that fail, and exit with code 3
    #[arg(long)]
    pub(super) keep_going: bool,
    /// Also estimate the joint axes of each robot, for robots that their models fit poorly
    #[arg(long)]
    pub(super) calibrate: bool,
    /// Write a small result: compressed tiles, no cloud of fixed points (takes longer)
    #[arg(long)]
    pub(super) lean: bool,
}

#[derive(Debug, Args)]
pub(super) struct PlanFlags {
    #[command(flatten)]
    pub(super) run: RunFlags,
    /// Also estimate the job on N machines with a shared disk and --threads cores each, as `shards`
    /// divides it: time, machine hours, storage and transfers
    #[arg(long, value_name = "N")]
    pub(super) nodes: Option<std::num::NonZeroUsize>,
    /// Print JSON
    #[arg(long)]
    pub(super) json: bool,
}

#[derive(Debug, Args)]
pub(super) struct ShardsFlags {
    #[command(flatten)]
    pub(super) run: RunFlags,
    /// Print JSON
    #[arg(long)]
    pub(super) json: bool,
}

#[derive(Debug, Args)]
pub(super) struct ShardFlags {
    /// Id of the shard, as `shards` lists it
    #[arg(value_name = "ID")]
    pub(super) id: String,
    #[command(flatten)]
    pub(super) run: RunFlags,
    /// With --keep-going: do not make the shard, but record why it cannot be made, and let the job
    /// go on without it
    #[arg(long, value_name = "WHY", requires = "keep_going")]
    pub(super) leave_out: Option<String>,
    /// Print JSON
    #[arg(long)]
    pub(super) json: bool,
}

#[derive(Debug, Args)]
pub(super) struct RescanFlags {
    /// Output folder of the earlier run or rescan
    #[arg(long, value_name = "OUT")]
    pub(super) base: PathBuf,
    /// New scans of the cell: E57, PTX, LAS, LAZ, PTS, XYZ, PLY, PCD
    #[arg(required = true, value_name = "INPUT")]
    pub(super) inputs: Vec<PathBuf>,
    /// Output folder; unchanged files are shared with the earlier result
    #[arg(long, value_name = "DIR")]
    pub(super) out: PathBuf,
    /// Robot library (default: that of the earlier run)
    #[arg(long, value_name = "DIR")]
    pub(super) robots: Option<PathBuf>,
    /// Bounds of the cell, metres: least x, y, z, then greatest x, y, z (default: what the new
    /// scans see well)
    #[arg(
        long,
        value_name = "X,Y,Z,X,Y,Z",
        value_delimiter = ',',
        num_args = 1,
        allow_hyphen_values = true,
        conflicts_with = "robot"
    )]
    pub(super) cell: Vec<f64>,
    /// Frame of the new scans: "same" for the plant's frame, or the approximate position of the
    /// first new scanner in the plant, metres, and the turn of the new frame, degrees (default:
    /// found from surfaces, and refused where that is ambiguous)
    #[arg(long, value_name = "X,Y,Z,YAW", allow_hyphen_values = true)]
    pub(super) frame: Option<String>,
    /// Use the reach of these robots of the earlier run as the cell
    #[arg(long, value_name = "ID", value_delimiter = ',')]
    pub(super) robot: Vec<String>,
}

#[derive(Debug, Args)]
pub(super) struct ExportFlags {
    /// Output folder of a run
    #[arg(value_name = "OUT")]
    pub(super) out: PathBuf,
    /// Format; files are written to OUT/export. A later run into OUT removes files of points
    /// (copc, ply) if the points have changed, and reports it; scenes and scans (e57, ptx) stay,
    /// and those of an earlier result are named
    #[arg(long, value_name = "FORMAT", value_enum)]
    pub(super) to: ExportFormat,
    /// Robot library, for scenes and meshes (default: that of the run)
    #[arg(long, value_name = "DIR")]
    pub(super) robots: Option<PathBuf>,
    /// ROS package in whose folder the scene will lie: mesh paths of URDFs become
    /// package://NAME/... (default: relative paths)
    #[arg(long, value_name = "NAME")]
    pub(super) package: Option<String>,
    /// Folder in which the scans lie now, for e57 and ptx (default: where the run found them)
    #[arg(long, value_name = "DIR")]
    pub(super) inputs: Option<PathBuf>,
    /// Leave moving points out instead of flagging them as invalid, for e57
    #[arg(long)]
    pub(super) drop_moving: bool,
    /// Write no classes, robots and links, for e57: for readers that refuse extensions
    #[arg(long)]
    pub(super) without_labels: bool,
    #[command(flatten)]
    pub(super) mesh: MeshFlags,
}

/// Flags of collision meshes.
#[derive(Debug, Args)]
pub(super) struct MeshFlags {
    /// Mesh: greatest distance of a fixed point from it, metres (default: 0.01)
    #[arg(long, value_name = "METRES")]
    pub(super) bound: Option<f64>,
    /// Mesh: most triangles; where the bound takes more, the finest coarser bound is taken that
    /// does not, and stated
    #[arg(long, value_name = "N")]
    pub(super) triangles: Option<usize>,
    /// Mesh: format of the file (default: stl)
    #[arg(long, value_name = "FORMAT", value_enum)]
    pub(super) mesh_format: Option<MeshFormat>,
    /// Mesh: only the known space around this robot
    #[arg(long, value_name = "ID")]
    pub(super) robot: Option<String>,
    /// Mesh: also the space around robots that no beam passed through, as a closed mesh
    #[arg(long)]
    pub(super) unknown: bool,
    /// Mesh: also convex pieces that cover it, for programs that collide convex bodies only
    #[arg(long)]
    pub(super) convex: bool,
}

#[derive(Debug, Args)]
pub(super) struct CheckFlags {
    /// Output folder of a run
    #[arg(value_name = "OUT")]
    pub(super) out: PathBuf,
    /// More paths, so that `check OUT --trajectory *.csv` checks all of them
    #[arg(value_name = "FILE")]
    pub(super) more: Vec<PathBuf>,
    /// Path: CSV with joint names in the first line, or JSON as trajectory_msgs/JointTrajectory;
    /// radians and metres. Several take little longer than one, and the exit code is the worst
    #[arg(long, value_name = "FILE", required = true)]
    pub(super) trajectory: Vec<PathBuf>,
    /// Robot of all paths (default: of each the only robot that has all of its joints)
    #[arg(long, value_name = "ID")]
    pub(super) robot: Option<String>,
    /// Distance below which something is in the way, metres
    #[arg(long, value_name = "METRES", default_value_t = 0.02)]
    pub(super) margin: f64,
    /// The paths state turning joints in degrees
    #[arg(long)]
    pub(super) degrees: bool,
    /// Doubts that are allowed in a path that passes
    #[arg(long, value_name = "WHAT", value_enum, value_delimiter = ',')]
    pub(super) allow: Vec<PathDoubt>,
    /// Robot library (default: that of the run)
    #[arg(long, value_name = "DIR")]
    pub(super) robots: Option<PathBuf>,
    /// Print JSON
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
    /// Folder that contains the output folders of runs and rescans
    #[arg(value_name = "DIR")]
    pub(super) folder: PathBuf,
    /// Remove this session; the others keep the files that they share with it
    #[arg(long, value_name = "NAME")]
    pub(super) remove: Vec<String>,
    /// Print JSON
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
    /// Print JSON
    #[arg(long)]
    pub(super) json: bool,
}

#[derive(Debug, Args)]
pub(super) struct ReportFlags {
    /// Output folder of a run
    #[arg(value_name = "OUT")]
    pub(super) out: PathBuf,
    /// Write each robot as a test case to this JUnit file: trusted ones pass
    #[arg(long, value_name = "FILE")]
    pub(super) junit: Option<PathBuf>,
    /// Write OUT/report.html where the run has not: the plant in 3D with tables, one file that any
    /// browser shows offline; a later run into OUT replaces it if the result has changed
    #[arg(long)]
    pub(super) html: bool,
    /// Write a page to this file that also shows times, rates and memory of the run; these differ
    /// from run to run, so OUT/report.html has none
    #[arg(long, value_name = "FILE")]
    pub(super) page: Option<PathBuf>,
    /// Print the data of that page as JSON
    #[arg(long)]
    pub(super) json: bool,
}

#[derive(Debug, Args)]
pub(super) struct SimulateFlags {
    /// Scene file (TOML)
    #[arg(value_name = "SCENE")]
    pub(super) scene: PathBuf,
    /// Output folder of scans and truth
    #[arg(long, value_name = "DIR")]
    pub(super) out: PathBuf,
    /// Robot library with the models of the scene's robots
    #[arg(long, value_name = "DIR")]
    pub(super) robots: Option<PathBuf>,
}

#[derive(Debug, Args)]
pub(super) struct LintFlags {
    /// Robot library
    #[arg(value_name = "DIR")]
    pub(super) dir: PathBuf,
    /// Print JSON
    #[arg(long)]
    pub(super) json: bool,
}

#[derive(Debug, Args)]
pub(super) struct CalibrateFlags {
    /// Output folders of runs with --calibrate
    #[arg(required = true, value_name = "OUT")]
    pub(super) results: Vec<PathBuf>,
    /// Name of the model in the library (default: the only calibrated one)
    #[arg(long, value_name = "NAME")]
    pub(super) model: Option<String>,
    /// Ids of the robots in the results; they count as one and the same robot (default: all of the
    /// model)
    #[arg(long, value_name = "ID", value_delimiter = ',')]
    pub(super) robot: Vec<String>,
    /// Readings file (TOML): joint values that the controller showed during the scans, to estimate
    /// the offsets of its zeros
    #[arg(long, value_name = "FILE")]
    pub(super) readings: Option<PathBuf>,
    /// Robot library that contains the model
    #[arg(long, value_name = "DIR")]
    pub(super) robots: PathBuf,
    /// Output folder of the corrected model, which becomes a robot library
    #[arg(long, value_name = "DIR")]
    pub(super) out: PathBuf,
}

/// Refuses inputs that are not files, before anything else is done.
pub(super) fn present(inputs: &[PathBuf]) -> Result<()> {
    inputs.iter().try_for_each(|path| ingest::regular(path))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn flags_are_consistent() {
        crate::cli::help::command().debug_assert();
    }

    #[test]
    fn common_flags_stand_anywhere() {
        for args in [
            "stillpoint --threads 2 run a.e57 b.ptx --robots r --out o",
            "stillpoint run a.e57 b.ptx --robots r --out o --threads 2",
        ] {
            let line = Line::try_parse_from(args.split(' ')).expect("parses");
            assert_eq!(line.common.threads(), Some(2));
            let Command::Run(run) = line.command else { panic!("{args}") };
            assert_eq!(run.inputs.len(), 2);
        }
    }
}
