//! Dimensions of the spot welder that both its main chain and its sub chains are built on, metres.

/// Joint 2 from joint 1, metres.
pub(super) const SHOULDER: [f64; 3] = [0.33, 0.0, 0.34];
/// Length of the upper arm, metres.
pub(super) const UPPER: f64 = 1.075;
/// Pin of the balancer's cylinder on link_1, metres.
pub(super) const CYLINDER_PIN: [f64; 3] = [-0.36, -0.30, 0.10];
/// Pin of the balancer's rod on link_2, metres.
pub(super) const ROD_PIN: [f64; 3] = [-0.18, -0.30, 0.12];
/// Length of the lever and of link_3's rear arm, metres.
pub(super) const LEVER: f64 = 0.36;
