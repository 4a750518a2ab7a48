//! Requests of benches: cases, seeds, robots, and folders for rows.

use crate::eval::demo;
use contract::{Error, Kind, Result};
use robot::Model;
use simulate::Plant;
use std::ops::Range;
use std::path::{Path, PathBuf};

/// Random cases of a seed.
#[derive(Debug, Clone)]
pub struct DrawnCases {
    /// Number of the first case.
    pub first: usize,
    /// Seed of all cases.
    pub seed: u64,
    /// Robot library; the demo's robots where left out.
    pub robots: Option<PathBuf>,
    /// Where rows and tables go; scenes, scans and results, too, with `keep`.
    pub out: Option<PathBuf>,
    /// Whether scenes, scans and results are kept.
    pub keep: bool,
}

impl DrawnCases {
    /// Numbers of the first `n` cases.
    pub(super) fn numbers(&self, n: usize) -> Range<usize> {
        self.first..self.first + n
    }

    /// Seed of one case.
    pub(super) fn seed_of(&self, number: usize) -> u64 {
        self.seed * 100_000 + number as u64
    }

    /// The requested library, else that of the demo, written to a folder.
    pub(super) fn library(&self, folder: &Path) -> Result<PathBuf> {
        if let Some(dir) = &self.robots {
            return Ok(dir.clone());
        }
        let robots = folder.join("robots");
        demo::write_robots(&robots)?;
        Ok(robots)
    }
}

/// How large the plants of a bench are, and how finely they are scanned.
#[derive(Debug, Clone, Copy)]
pub struct PlantSize {
    /// Robots of each plant.
    pub n_robots: usize,
    /// Scanners of each plant.
    pub n_scanners: usize,
    /// Angle between beams, degrees.
    pub step_deg: f64,
}

impl PlantSize {
    /// The plant of a seed: rows of five robots, nothing moves.
    pub(super) fn plant(&self, seed: u64) -> Plant {
        Plant {
            seed,
            n_robots: self.n_robots,
            n_rows: self.n_robots.div_ceil(5),
            n_scanners: self.n_scanners,
            step_deg: self.step_deg,
            is_tight: false,
            moves: false,
        }
    }
}

/// Suite of the rescan bench.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, clap::ValueEnum)]
pub enum RescanSuite {
    /// Plants of which one cell is scanned again, in the plant's frame.
    #[default]
    Same,
    /// Plants of which one cell is scanned again, in random frames.
    Frames,
    /// Lines of equal cells with the new scans in random frames.
    Lines,
    /// Halls without robots in which three things were pushed and turned.
    Things,
}

/// Request of the rescan bench.
#[derive(Debug, Clone)]
pub struct RescanBench {
    /// Seed, library and folders.
    pub drawn: DrawnCases,
    /// Cases.
    pub n_cases: usize,
    /// Robots and scanners of each plant.
    pub size: PlantSize,
    /// What is drawn.
    pub suite: RescanSuite,
    /// Do the main job on the new scans alone, too, to compare with.
    pub alone: bool,
}

/// Refuses names of unknown suites.
pub(super) fn check_suites(asked: &[String], names: &[&str]) -> Result<()> {
    match asked.iter().find(|s| !names.contains(&s.as_str())) {
        None => Ok(()),
        Some(odd) => Err(Error::new(Kind::Usage, format!("there is no suite \"{odd}\""))
            .hint(format!("there are {}", names.join(", ")))),
    }
}

/// Indices of the robots with the requested names.
pub(super) fn chosen(models: &[Model], names: &[String]) -> Result<Vec<usize>> {
    let wanted = |m: &Model| names.is_empty() || names.iter().any(|n| m.name.contains(n.as_str()));
    let out: Vec<usize> =
        (0..models.len()).filter(|&i| !models[i].is_tool() && wanted(&models[i])).collect();
    if out.is_empty() {
        return Err(Error::new(Kind::Usage, "no robot of the library has such a name"));
    }
    Ok(out)
}
