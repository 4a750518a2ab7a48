//! The rates with which times are predicted: processor seconds, shared by all threads. `bench plan`
//! scans and processes halls, and `scripts/plan_rates.py` computes these rates from its rows;
//! benches/README.md states machine and accuracy.

use contract::Format;

/// Points per second that one thread reads, by format. Those of lists of points are lower bounds,
/// measured beside other work by `rates_of_one_thread` in `stages/ingest/src/cloud/tests.rs`.
pub(super) const INGEST: [(Format, f64); 8] = [
    (Format::E57, 20e6),
    (Format::Las, 18e6),
    (Format::Laz, 2.8e6),
    (Format::Ptx, 6e6),
    (Format::Pts, 3e6),
    (Format::Xyz, 3e6),
    (Format::Ply, 5e6),
    (Format::Pcd, 5e6),
];
/// Points per second of one thread in four parts of a run: writing lattice tiles, planes, labels
/// near robots, and labelling and writing all points.
pub(super) const REST: [f64; 4] = [30e6, 8e6, 60e6, 9e6];
/// Points per second of one thread in the COPC conversion.
pub(super) const COPC: f64 = 0.9e6;
/// Points per second of each thread that reads the points of the page of the result.
pub(super) const PAGE: f64 = 9e6;
/// Seconds of one thread per megabyte of a model's folder, for reading, joining and sampling its
/// meshes.
pub(super) const LOAD: f64 = 0.38;
/// Processor seconds per region for its views, independent of models and contents.
pub(super) const REGION: f64 = 0.6;
/// Processor seconds per model and square metre of regions, for base search and fits.
pub(super) const AREA: f64 = 0.10;
/// Processor seconds per thousand voxels (5 cm) with points above the floor, for views and fits of
/// more points.
pub(super) const SURFACE: f64 = 0.29;
/// Factor by which the time of a search may exceed or fall below the prediction.
pub(super) const SPREAD: f64 = 1.5;
