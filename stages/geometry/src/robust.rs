//! Robust kernels: the weight of a residual at a given scale.

/// Tukey's biweight: `(1 − (r/c)²)²` for `|r| < c` and zero beyond, with `r` the residual and `c`
/// the scale in the same unit. It is redescending: an outlier has no influence at all.
#[inline]
#[must_use]
pub fn tukey(residual: f64, scale: f64) -> f64 {
    let u = residual / scale;
    let v = 1.0 - u * u;
    if v <= 0.0 { 0.0 } else { v * v }
}

/// Derivative of Tukey's influence `w(r)·r` by the residual: how much the pull of a residual grows
/// with it. It never exceeds the weight `w(r)`.
#[inline]
#[must_use]
pub fn tukey_slope(residual: f64, scale: f64) -> f64 {
    let u2 = (residual / scale).powi(2);
    if u2 >= 1.0 { 0.0 } else { (1.0 - u2) * (1.0 - 5.0 * u2) }
}

/// Largest factor by which a step with robust weights is lengthened. Normally distributed errors
/// ask for 1.2; priors and outliers ask for none.
const MAX_STRETCH: f64 = 1.25;

/// Factor by which a Gauss-Newton step with Tukey's weights should be lengthened, from the sums of
/// weights and of slopes. The weights overestimate how fast the pull changes with the residual, so
/// that a step by them alone covers only about five sixths of the way.
#[must_use]
pub fn stretch(weights: f64, slopes: f64) -> f64 {
    if slopes > 0.0 { (weights / slopes).clamp(1.0, MAX_STRETCH) } else { MAX_STRETCH }
}

/// Cost whose derivative is Tukey's influence, `∫ w(r) r dr` = `c²/6 (1 − (1 − (r/c)²)³)`; constant
/// from `|r| = c` on.
#[inline]
#[must_use]
pub fn tukey_cost(residual: f64, scale: f64) -> f64 {
    let u = residual / scale;
    let v = (1.0 - u * u).max(0.0);
    scale * scale / 6.0 * (1.0 - v * v * v)
}

/// Median by selection, which reorders `values`; `None` where there are none. NaN sorts last.
pub fn median(values: &mut [f64]) -> Option<f64> {
    if values.is_empty() {
        return None;
    }
    let at = values.len() / 2;
    Some(*values.select_nth_unstable_by(at, f64::total_cmp).1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slopes_are_those_of_the_influence() {
        let influence = |r: f64| tukey(r, 4.0) * r;
        for k in -50..=50 {
            let (r, h) = (0.1 * f64::from(k) + 0.03, 1e-6);
            let slope = (influence(r + h) - influence(r - h)) / (2.0 * h);
            assert!((tukey_slope(r, 4.0) - slope).abs() < 1e-6, "{r}");
        }
        assert_eq!(
            [stretch(3.0, 2.8), stretch(3.0, 1.0), stretch(3.0, -1.0)],
            [3.0 / 2.8, 1.25, 1.25]
        );
    }
}
