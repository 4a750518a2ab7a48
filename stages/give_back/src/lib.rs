//! Gives a scan file back without its moving points: the bytes of the original and the labels of
//! its points become a file with the same scans, poses, grids, colours, pictures and metadata, in
//! which moving points are flagged as invalid or left out.
//!
//! Everything that is not understood stays as it is: of an E57 file only the records of points and
//! a few places of its description are rewritten, of a PTX file only lines of moving points. The
//! crate reads and writes streams and knows no files.
#![forbid(unsafe_code)]

mod bits;
mod checked_pages;
mod e57_copy;
mod e57_edits;
mod e57_layout;
mod e57_marking;
mod e57_nodes;
mod e57_packets;
mod e57_records;
mod e57_scan;
mod fate;
mod legend;
mod ptx_marking;
mod ptx_pieces;
mod summed_pages;

pub use checked_pages::CheckedPages;
pub use e57_copy::{E57Copy, ScanCopy};
pub use e57_layout::{DescriptionLimits, E57Layout, E57Section, SectionBody};
pub use e57_marking::{MarkedPiece, RecordMarker, ScanPlan};
pub use e57_records::{E57Records, RecordPiece};
pub use e57_scan::ScanNode;
pub use fate::{GiveBack, GivenBack, PointFate, RobotNames, SUPERSEDED, ScanFates};
pub use ptx_marking::{LineMarker, MarkedLines};
pub use ptx_pieces::{PtxPiece, PtxPieces};
