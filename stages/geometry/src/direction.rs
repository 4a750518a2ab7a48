//! Converts between beam directions as vectors and as azimuth and elevation, with a polynomial
//! arctangent that is fast enough for every point of a scan.

/// Azimuth of (x, y) in (−π, π] about +z from +x, radians, by a polynomial. The error is below
/// 2e-6 rad (0.0001°), less than a hundredth of the step of a fine scan.
#[inline]
#[must_use]
pub fn fast_atan2(y: f32, x: f32) -> f32 {
    let (ax, ay) = (x.abs(), y.abs());
    let (low, high) = if ax < ay { (ax, ay) } else { (ay, ax) };
    // Without branches, so that a loop over points is vectorised. The zero vector gives
    // 0/tiny = 0.
    let t = low / if high == 0.0 { f32::MIN_POSITIVE } else { high };
    let s = t * t;
    // Minimax polynomial of the arctangent on [0, 1]: odd, seven terms.
    let mut r = 0.002_823_638_8_f32;
    r = r * s - 0.015_956_933;
    r = r * s + 0.042_504_99;
    r = r * s - 0.074_890_09;
    r = r * s + 0.106_347_93;
    r = r * s - 0.142_027_37;
    r = r * s + 0.199_926_96;
    r = r * s - 0.333_331_03;
    r = r * s * t + t;
    if ay > ax {
        r = std::f32::consts::FRAC_PI_2 - r;
    }
    if x < 0.0 {
        r = std::f32::consts::PI - r;
    }
    if y < 0.0 { -r } else { r }
}

/// Azimuth, elevation (radians) and range (metres) of a point in the frame of its scanner, z up.
#[inline]
#[must_use]
pub fn spherical(p: [f32; 3]) -> (f32, f32, f32) {
    let flat = (p[0] * p[0] + p[1] * p[1]).sqrt();
    let range = (p[0] * p[0] + p[1] * p[1] + p[2] * p[2]).sqrt();
    (fast_atan2(p[1], p[0]), fast_atan2(p[2], flat), range)
}

/// Unit vector of an azimuth and an elevation, radians.
#[inline]
#[must_use]
pub fn unit(azimuth: f64, elevation: f64) -> [f64; 3] {
    let (se, ce) = elevation.sin_cos();
    let (sa, ca) = azimuth.sin_cos();
    [ce * ca, ce * sa, se]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn polynomial_arctangent_is_within_two_microradians() {
        let mut worst = 0.0_f64;
        for i in 0..200_000 {
            let a = f64::from(i) / 200_000.0 * std::f64::consts::TAU - std::f64::consts::PI;
            let got = fast_atan2((a.sin() * 3.7) as f32, (a.cos() * 3.7) as f32);
            let exact = f64::from((a.sin() * 3.7) as f32).atan2(f64::from((a.cos() * 3.7) as f32));
            let error = (f64::from(got) - exact).abs();
            worst = worst.max(error.min(std::f64::consts::TAU - error));
        }
        assert!(worst < 2e-6, "{worst}");
    }
}
