//! Robust kernels: residual and scale in, weight out.

/// Tukey's biweight: `(1 − (r/c)²)²` inside `c`, zero outside. Redescending: an outlier has no pull at all.
#[inline]
#[must_use]
pub fn tukey(residual: f64, scale: f64) -> f64 {
    let u = residual / scale;
    let v = 1.0 - u * u;
    if v <= 0.0 { 0.0 } else { v * v }
}

/// What Tukey's biweight makes of half a square, `∫ w(r) r dr`: `c²/6 (1 − (1 − (r/c)²)³)`, from `c` on the same for all.
#[inline]
#[must_use]
pub fn tukey_cost(residual: f64, scale: f64) -> f64 {
    let u = residual / scale;
    let v = (1.0 - u * u).max(0.0);
    scale * scale / 6.0 * (1.0 - v * v * v)
}

/// Median by selection, reordering `values`; `None` for none. NaN sorts last.
pub fn median(values: &mut [f64]) -> Option<f64> {
    if values.is_empty() {
        return None;
    }
    let at = values.len() / 2;
    Some(*values.select_nth_unstable_by(at, f64::total_cmp).1)
}
