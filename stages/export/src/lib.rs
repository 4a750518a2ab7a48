//! Writes all output files: masks, `result.json`, clouds, scans and pictures. No other crate knows
//! their formats, and this crate makes no decisions about their content.
//!
//! Every file is written under a temporary name, synced, and renamed when it is complete.
//!
//! # Example
//! ```
//! use contract::{Label, MaskId};
//! use export::{LabelColumns, MaskFiles, MaskReader, MaskWriter};
//!
//! // The labels of two points, written as three NumPy arrays and read back.
//! let out = tempfile::tempdir()?;
//! let mut mask = MaskWriter::create(out.path(), MaskId(0))?;
//! mask.push(&LabelColumns::of(&[Label::FLOOR, Label::FIXED]))?;
//! let sums = mask.finish()?;
//! assert!(sums[0].path.ends_with("labels/0.kind.npy"));
//!
//! let files = MaskFiles::of(MaskId(0));
//! let reader = MaskReader::new(out.path(), [&files.kind, &files.robot, &files.link]);
//! assert_eq!(reader.range(0, 2)?.label(0)?, Label::FLOOR);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
#![forbid(unsafe_code)]

pub mod atomic;
pub mod block;
mod bodies;
mod body_cells;
mod calibration;
mod canvas;
mod change_picture;
mod change_view;
mod chunks;
mod clouds;
mod copc;
mod e57;
mod evidence_picture;
mod finite;
mod font;
mod joined;
mod junit;
mod las;
mod mask;
mod npy;
mod octomap;
mod pack;
mod picture_names;
mod picture_outline;
mod picture_pixels;
mod places;
mod plan_picture;
mod ply;
mod posture;
mod record;
mod refill;
mod result;
mod result_file;
mod review;
mod robot_model;
mod robot_picture;
mod scan_entry;
mod session;
mod settings;
mod space;
mod spool;
mod summed;
mod table;
mod tiles;

pub use atomic::AtomicFile;
pub use bodies::WrittenBodies;
pub use calibration::{CalibrationEntry, FrameEntry};
pub use canvas::{Canvas, Rgb, link_color, robot_color};
pub use change_picture::{ChangedThing, ComparedCell, ComparedRobot, draw_changes};
pub use clouds::{Clouds, WrittenFiles};
pub use copc::{COPC, CopcSteps, tiles, write_copc};
pub use e57::{E57Scans, GridPoint, GridScan};
pub use evidence_picture::draw_evidence;
pub use font::TextSize;
pub use joined::join_las;
pub use junit::write_junit;
pub use las::{LasSummary, LasWriter};
pub use mask::{LabelColumns, MaskFiles, MaskRange, MaskReader, MaskWriter};
pub use npy::{Element, NpyWriter, read_places};
pub use pack::{Pack, Packed, PointColumns};
pub use picture_outline::PictureOutline;
pub use picture_pixels::PicturePixels;
pub use places::NamedMap;
pub use plan_picture::{PlanPicture, PlanRobot};
pub use ply::{PLY, write_ply};
pub use posture::JointWords;
pub use record::{LasSettings, PROJECTION, Quantum, RawVlr, class_of};
pub use refill::{OldPoint, StatedTile, read_tile};
pub use result::{
    BasePose, BaseSigma, InputEntry, LabelFiles, LinkEntry, ResultFile, RobotEntry, RunnerUpEntry,
    SCHEMA, ScanLabels, StageEntry, TipPose, UnitsEntry,
};
pub use review::ReviewEntry;
pub use robot_model::{mesh_files, write_robot};
pub use robot_picture::RobotPicture;
pub use scan_entry::ScanEntry;
pub use session::{CarriedEntry, RegistrationEntry, RescanEntry};
pub use settings::Settings;
pub use space::{SpaceEntry, write_space};
pub use spool::Spool;
pub use summed::FileSum;
pub use table::write_table;
pub use tiles::Tiles;
