//! The labelled points of a result as arrays of NumPy, tile by tile.

use crate::errors::{guarded, raised};
use numpy::{PyArray1, PyArray2, PyArrayMethods};
use pyo3::prelude::*;
use std::path::PathBuf;
use stillpoint::result::labelled_points::{LabelledPoints, WantedPoints};

/// World coordinates, kinds, robots and links of some points.
type PointArrays<'py> = (
    Bound<'py, PyArray2<f64>>,
    Bound<'py, PyArray1<u8>>,
    Bound<'py, PyArray1<i16>>,
    Bound<'py, PyArray1<i16>>,
);

/// The spatial tiles of a result.
#[pyclass(frozen)]
pub(crate) struct LabelledTiles(LabelledPoints);

#[pymethods]
impl LabelledTiles {
    /// Opens the tiles of the result in a folder.
    #[new]
    fn open(py: Python<'_>, out: PathBuf) -> PyResult<Self> {
        guarded(py, || {
            let opened = py.detach(|| LabelledPoints::open(&out));
            opened.map(Self).map_err(|error| raised(py, &error))
        })
    }

    /// Number of tiles.
    fn __len__(&self) -> usize {
        self.0.n_tiles()
    }

    /// The points of one tile that are of these kinds and of this robot.
    fn tile<'py>(
        &self,
        py: Python<'py>,
        at: usize,
        kinds: Option<Vec<u8>>,
        robot: Option<i16>,
    ) -> PyResult<PointArrays<'py>> {
        guarded(py, || {
            let wanted = WantedPoints { kinds, robot };
            let columns = py.detach(|| self.0.tile(at, &wanted));
            let columns = columns.map_err(|error| raised(py, &error))?;
            let n = columns.kind.len();
            let xyz = PyArray1::from_vec(py, columns.xyz).reshape([n, 3])?;
            let kind = PyArray1::from_vec(py, columns.kind);
            let [robot, link] = [columns.robot, columns.link].map(|c| PyArray1::from_vec(py, c));
            Ok((xyz, kind, robot, link))
        })
    }
}
