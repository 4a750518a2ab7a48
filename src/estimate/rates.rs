//! The rates that times are predicted with: processor time, shared among all threads. `bench plan`
//! draws halls and does them, `scripts/plan_rates.py` measures these rates anew from its rows;
//! benches/README.md says on which machine and how well they hold.

use contract::Format;

/// Points of a format that one thread reads in a second.
pub(super) const INGEST: [(Format, f64); 4] =
    [(Format::E57, 20e6), (Format::Las, 18e6), (Format::Laz, 2.8e6), (Format::Ptx, 6e6)];
/// Points that one thread gets through in a second: into tiles, planes, labels near robots,
/// labelling and writing of all.
pub(super) const REST: [f64; 4] = [30e6, 8e6, 60e6, 9e6];
/// Points that one thread makes a COPC file of in a second.
pub(super) const COPC: f64 = 0.9e6;
/// Seconds of one thread to load a megabyte of a model's folder: its meshes are read, joined, and
/// sampled.
pub(super) const LOAD: f64 = 0.38;
/// Processor seconds of the search of a region, whatever stands there and whatever the models: what
/// its scans see of it.
pub(super) const REGION: f64 = 0.6;
/// Processor seconds of the search for a model over a square metre of regions: bases are tried all
/// over them, the best are fitted.
pub(super) const AREA: f64 = 0.10;
/// Processor seconds of the search for each thousand voxels of 5 cm that hold points above the
/// floor: views and fits have more points to look at.
pub(super) const SURFACE: f64 = 0.29;
/// By so much a search may take more or less than is predicted.
pub(super) const SPREAD: f64 = 1.5;
