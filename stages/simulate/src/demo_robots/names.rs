//! The names of the demo robots, which are those of their folders in the library.

/// Name of the small six-axis robot, 1.1 m reach.
pub const ARM: &str = "demo_arm_1100";
/// Name of the seven-joint spot welder, 2.6 m reach, with balancer (RPR), parallelogram (RRR) and
/// gun.
pub const WELDER: &str = "demo_welder_2600";
/// Name of the four-axis palletiser, 2.0 m reach, whose bars (RR) keep the wrist level.
pub const PALLETISER: &str = "demo_palletiser_2000";
