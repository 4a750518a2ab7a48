//! States in words which unknowns of a fit trade off against one another, by its covariance
//! (METHOD.md §14.3).

use contract::Fit;
use nalgebra::DMatrix;

use super::settings::MODES;

/// Share of the direction from which on an unknown belongs to it.
const PART: f64 = 0.35;

/// A sentence for the weakest direction, where it joins several unknowns: the base's yaw and the
/// joints that turn.
pub(crate) fn trade_off(fit: &Fit, turning: &[usize]) -> Option<String> {
    let n = 6 + fit.joints.len();
    if fit.covariance.len() != n * n {
        return None;
    }
    // The base's turn about the vertical, then the joints.
    let at: Vec<usize> = [5].into_iter().chain(turning.iter().map(|j| 6 + j)).collect();
    let block = DMatrix::from_fn(at.len(), at.len(), |i, j| fit.covariance[at[i] * n + at[j]]);
    let eigen = block.symmetric_eigen();
    let weakest = eigen.eigenvalues.imax();
    let sigma = eigen.eigenvalues[weakest].max(0.0).sqrt();
    if !MODES.trade_off.contains(sigma) {
        return None;
    }
    let direction = eigen.eigenvectors.column(weakest);
    let parts: Vec<String> = direction
        .iter()
        .enumerate()
        .filter(|(_, v)| v.abs() > PART)
        .map(|(i, _)| match i {
            0 => "the base's yaw".into(),
            _ => format!("joint '{}'", fit.joints[turning[i - 1]].name),
        })
        .collect();
    let (last, first) = parts.split_last()?;
    (!first.is_empty()).then(|| {
        format!(
            "{} and {last} trade off: together they are known to ± {:.2}° only",
            first.join(", "),
            sigma.to_degrees()
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use contract::JointFit;

    fn fit(correlation: f64) -> Fit {
        let joint = |name: &str| JointFit { name: name.into(), ..JointFit::default() };
        let mut covariance = vec![0.0; 64];
        (0..8).for_each(|i| covariance[i * 9] = 1e-8);
        (covariance[5 * 8 + 5], covariance[6 * 8 + 6]) = (1e-5, 1e-5);
        (covariance[5 * 8 + 6], covariance[6 * 8 + 5]) = (1e-5 * correlation, 1e-5 * correlation);
        Fit { joints: vec![joint("a1"), joint("a2")], covariance, ..Fit::default() }
    }

    #[test]
    fn what_trades_off_is_named_and_what_stands_alone_is_not() {
        let text = trade_off(&fit(-0.98), &[0, 1]).expect("weak");
        assert!(text.starts_with("the base's yaw and joint 'a1' trade off"), "{text}");
        let mut alone = fit(0.0);
        alone.covariance[5 * 8 + 5] = 1e-8;
        assert_eq!(trade_off(&alone, &[0, 1]), None);
    }
}
