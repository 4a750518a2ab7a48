//! The plant in, files out: masks, result, clouds, scans, pictures. The only writer of formats;
//! decides nothing.
//!
//! Every file is written under a temporary name, synced, and gets its own name only when it is
//! whole.
#![forbid(unsafe_code)]

pub mod atomic;
pub mod block;
mod calibration;
mod canvas;
mod change_picture;
mod chunks;
mod clouds;
mod copc;
mod e57;
mod evidence_picture;
mod font;
mod junit;
mod las;
mod mask;
mod npy;
mod octomap;
mod pack;
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
mod session;
mod settings;
mod space;
mod spool;
mod summed;
mod table;
mod tiles;

pub use atomic::AtomicFile;
pub use calibration::{CalibrationEntry, FrameEntry};
pub use canvas::{Canvas, Rgb, link_color, robot_color};
pub use change_picture::{ChangedThing, draw_changes};
pub use clouds::{Clouds, Written};
pub use copc::{COPC, CopcSteps, tiles, write_copc};
pub use e57::{E57Scans, GridPoint, GridScan};
pub use evidence_picture::draw_evidence;
pub use font::TextSize;
pub use junit::write_junit;
pub use las::{LasSummary, LasWriter};
pub use mask::{LabelColumns, MaskFiles, MaskRange, MaskReader, MaskWriter};
pub use npy::{Element, NpyWriter, read_places};
pub use pack::{Pack, Packed, PointColumns};
pub use places::Places;
pub use plan_picture::PlanPicture;
pub use ply::{PLY, write_ply};
pub use posture::JointWords;
pub use record::{LasSettings, Quantum, RawVlr, class_of};
pub use refill::{OldPoint, Stated, read_tile};
pub use result::{
    BasePose, BaseSigma, InputEntry, Labels, LinkEntry, ResultFile, RobotEntry, RunnerUpEntry,
    SCHEMA, ScanLabels, StageEntry, TipPose, UnitsEntry,
};
pub use review::ReviewEntry;
pub use robot_model::{mesh_files, write_robot};
pub use robot_picture::RobotPicture;
pub use session::{CarriedEntry, RegistrationEntry, RescanEntry};
pub use settings::Settings;
pub use space::{SpaceEntry, write_space};
pub use spool::Spool;
pub use summed::FileSum;
pub use table::write_table;
pub use tiles::Tiles;
