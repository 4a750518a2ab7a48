//! The search for robots in arrays of NumPy.

use crate::calls::Listener;
use crate::errors::{guarded, raised};
use contract::{Error, Kind, Result};
use numpy::{Element, PyArray2, PyArrayMethods, PyUntypedArrayMethods};
use pyo3::prelude::*;
use std::path::PathBuf;
use stillpoint::arrays::{ArrayScan, ArraysRequest};
use stillpoint::job::FlagValues;

/// Name, pose of the scanner if it is known (world, metres; rows of rotation and position), and
/// points of one scan.
type GivenScan<'py> = (String, Option<[[f64; 4]; 3]>, Bound<'py, PyAny>);
/// Memory, threads, configuration and single settings, as the flags of these names.
type GivenFlags = (Option<String>, Option<usize>, Option<PathBuf>, Vec<String>);

/// Finds robots in arrays; the fits as JSON, as `robots` of `result.json`.
#[pyfunction]
#[pyo3(signature = (scans, models, about, scratch, flags, progress=None, note=None))]
#[allow(clippy::too_many_arguments)] // called from one place, `_fit.py`
pub(crate) fn fit(
    py: Python<'_>,
    scans: Vec<GivenScan<'_>>,
    models: Vec<PathBuf>,
    about: Option<([f64; 3], f64)>,
    scratch: Option<PathBuf>,
    flags: GivenFlags,
    progress: Option<Py<PyAny>>,
    note: Option<Py<PyAny>>,
) -> PyResult<String> {
    guarded(py, || {
        let (memory, threads, config, set) = flags;
        let flags = FlagValues { memory, threads, config, set, ..FlagValues::default() };
        let scans: Result<Vec<ArrayScan>> = scans.into_iter().map(scan).collect();
        let scans = scans.map_err(|error| raised(py, &error))?;
        Listener { progress, note }.hear(py, |own| {
            let (means, engine) = stillpoint::cli::means_and_engine(flags, &own)?;
            let request = ArraysRequest { scans, models, about, scratch, means };
            let robots = stillpoint::arrays::fit(request, &engine)?;
            let bug = |e| Error::new(Kind::Bug, "the fits cannot be written as JSON").because(e);
            serde_json::to_string(&robots).map_err(bug)
        })
    })
}

/// The points of an array, copied to the frame of their scanner: other threads of Python may write
/// to the array later.
fn scan((name, scanner, array): GivenScan<'_>) -> Result<ArrayScan> {
    if let Ok(array) = array.cast::<PyArray2<f64>>() {
        return taken(name, scanner, array, |v| v);
    }
    if let Ok(array) = array.cast::<PyArray2<f32>>() {
        return taken(name, scanner, array, f64::from);
    }
    let what = "points are an array of N rows and 3 columns, float64 or float32";
    Err(Error::new(Kind::Usage, what).at(name))
}

fn taken<T: Element + Copy>(
    name: String,
    scanner: Option<[[f64; 4]; 3]>,
    array: &Bound<'_, PyArray2<T>>,
    metres: impl Fn(T) -> f64,
) -> Result<ArrayScan> {
    let usage = |what: &str| Error::new(Kind::Usage, what.to_owned());
    // A view of a field of packed records has strides that are no multiple of an item: read by
    // whole items, it would give wrong values.
    let bytes = size_of::<T>() as isize;
    if array.strides().iter().any(|stride| stride % bytes != 0) || !is_aligned(array) {
        let error = usage("the array is a view of packed records").at(name);
        return Err(error.hint("copy it with numpy.ascontiguousarray"));
    }
    if array.shape()[1] != 3 {
        return Err(usage("points have 3 columns: x, y and z").at(name));
    }
    let borrowed = array.try_readonly().map_err(|e| usage(&format!("it is written to: {e}")))?;
    let points = borrowed.as_array();
    ArrayScan::new(name, scanner, points.nrows(), |i| [0, 1, 2].map(|a| metres(points[[i, a]])))
}

/// Whether the first item lies where the processor reads items of its kind.
fn is_aligned<T: Element>(array: &Bound<'_, PyArray2<T>>) -> bool {
    array.data().is_aligned()
}
