//! Turns a result into one HTML file that needs nothing else: points thinned to what a page can
//! hold, robots as meshes with their joints, tables, and the script that shows them.
//!
//! The crate reads no files and takes no decisions about the result: what it says is what
//! `result.json` and `changes.json` say.
//!
//! # Example
//! ```
//! use contract::Label;
//! use report_page::{PagePoint, PageTexts, ReportPage};
//!
//! let result = r#"{"robots": [], "inputs": [], "stages": [], "warnings": []}"#.to_owned();
//! let page = ReportPage::new(PageTexts { result, ..PageTexts::default() }, Vec::new());
//! let mut points = page.points([0.0; 3]);
//! points.add(&[PagePoint { world: [1.0, 2.0, 0.0], label: Label::FLOOR }]);
//! points.settle();
//! let html = page.html(&points)?;
//! assert!(html.starts_with("<!doctype html>") && html.contains("Content-Security-Policy"));
//! # Ok::<(), contract::Error>(())
//! ```
#![forbid(unsafe_code)]

mod blocks;
mod encode;
mod input;
mod meshes;
mod morton;
mod page;
mod part;
mod texts;
mod trees;

pub use blocks::PagePoints;
pub use input::{PageLoop, PagePin, PagePoint, PageRobot, PageScanner, PageTexts};
pub use page::{MOST_POINTS, PAGE_SCHEMA, ReportPage};
pub use part::PagePart;
