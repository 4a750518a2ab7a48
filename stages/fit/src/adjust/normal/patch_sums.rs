//! Sums of residuals over one patch of the model's surface (METHOD.md §11.4).

use nalgebra::{DVector, Dyn, OMatrix, U5};

use crate::model::{Shape, ShapeSquare};

/// Sums over one patch.
#[derive(Debug, Clone)]
pub(super) struct PatchSums {
    /// Σ w J φᵀ.
    pub(super) a: PatchColumns,
    /// Its part of the gradient: Σ w J r, less what offsets explain once they are taken out.
    pub(super) g: DVector<f64>,
    /// Σ w φ φᵀ.
    pub(super) weight: ShapeSquare,
    /// Σ w r φ.
    pub(super) r: Shape,
}

impl PatchSums {
    pub(super) fn new(n: usize) -> Self {
        let (a, g) = (PatchColumns::zeros(n), DVector::zeros(n));
        Self { a, g, weight: ShapeSquare::zeros(), r: Shape::zeros() }
    }

    /// Σ w.
    pub(super) fn total(&self) -> f64 {
        self.weight[(0, 0)]
    }
}

/// A row for each unknown, and a column for each way in which a patch may be off.
pub(super) type PatchColumns = OMatrix<f64, Dyn, U5>;
