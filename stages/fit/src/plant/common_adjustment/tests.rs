//! What robots and walls tell one another, on scans that err in known ways.

use super::*;
use contract::{InputId, MaskId};
use geometry::Pose;

const PRIORS: [f64; N_SCAN] = [1e5, 1e5, 1e5, 1e7, 1e7, 1e7, 1e6];

/// A robot whose points say that the second of two scans needs 4 mm less along x than the first,
/// and whose base follows the second one by so much.
fn own(share: f64) -> RobotShare {
    let n = 2 * N_SCAN;
    let mut row = DVector::zeros(n);
    (row[0], row[N_SCAN]) = (1.0, -1.0);
    let mut information = DMatrix::zeros(n, n);
    information.ger(1e8, &row, &row, 1.0);
    let priors = DMatrix::from_diagonal(&repeated(&PRIORS, n));
    let vector = &row * (1e8 * 0.004);
    let errors = (&information + priors).cholesky().expect("positive").solve(&vector);
    let mut gain = DMatrix::zeros(6, n);
    (gain[(0, 0)], gain[(0, N_SCAN)]) = (1.0 - share, share);
    let scans = vec![ScanId(3), ScanId(5)];
    RobotShare { scans, errors, information, vector, gain, apart: apart(0.0, Some(&PRIORS)) }
}

#[test]
fn a_robot_that_others_say_nothing_to_stays() {
    let robot = own(0.5);
    assert!(robot.among(std::iter::empty(), &PRIORS).is_none());
    let strangers = ScanEvidence { scans: vec![ScanId(4)], ..own(0.5).told().expect("it tells") };
    let of_one = |m: &DMatrix<f64>| m.view((0, 0), (N_SCAN, N_SCAN)).into_owned();
    let information = of_one(&strangers.information);
    let vector = strangers.vector.rows(0, N_SCAN).into_owned();
    let strangers = ScanEvidence { information, vector, ..strangers };
    assert!(robot.among([&strangers].into_iter(), &PRIORS).is_none());
}

#[test]
fn what_several_say_alike_is_known_better_and_moves_nobody() {
    let robot = own(0.2);
    let told = own(0.7).told().expect("it tells");
    let new = robot.among([&told].into_iter(), &PRIORS).expect("it is told something");
    assert!(new.step.amax() < 2e-4, "{}", new.step);
    let mut row = DVector::zeros(2 * N_SCAN);
    (row[0], row[N_SCAN]) = (1.0, -1.0);
    assert!((row.transpose() * &new.gained * &row)[(0, 0)] > 0.0);
}

#[test]
fn a_scan_that_walls_see_off_moves_the_robot_that_it_alone_sees() {
    let scan = |id: u32, x: f64| Scan {
        id: ScanId(id),
        input: InputId(0),
        mask: MaskId(id),
        name: String::new(),
        source_id: None,
        places: Vec::new(),
        raster: None,
        scanner: contract::ScannerPosition::Stated,
        world_from_scan: Pose::translation(x, 0.0, 1.5),
        lattice: None,
        stated_bounds: None,
        stated_points: None,
        notes: Vec::new(),
    };
    let scans = [scan(3, -4.0), scan(5, 4.0), scan(7, 0.0)];
    // Floor and walls as the second scan has them: 3 mm too far along x.
    let mut still = Vec::new();
    for k in 0..60 {
        let along = -3.0 + 0.1 * f64::from(k);
        for (normal, at) in [
            ([0.0, 0.0, 1.0], [along, 0.5 * along, 0.0]),
            ([1.0, 0.0, 0.0], [-6.0, along, 1.0]),
            ([0.0, 1.0, 0.0], [along, -5.0, 1.2]),
            ([-1.0, 0.0, 0.0], [6.0, along, 1.4]),
        ] {
            let off = |id: u32| [at[0] + if id == 5 { 0.003 } else { 0.0 }, at[1], at[2]];
            let seen = [3, 5, 7].map(|id| (ScanId(id), off(id))).into();
            still.push(Overlap { normal, seen });
        }
    }
    let ids = [ScanId(3), ScanId(5), ScanId(7)];
    let told = ScanEvidence::by_surfaces(&still, &scans, &ids).expect("they overlap");
    let n = N_SCAN;
    // Only that scan sees the robot: alone nothing is known of its errors, and the base follows
    // them.
    let mut gain = DMatrix::zeros(6, n);
    (0..3).for_each(|i| gain[(i, i)] = 1.0);
    let robot = RobotShare {
        scans: vec![ScanId(5)],
        errors: DVector::zeros(n),
        information: DMatrix::zeros(n, n),
        vector: DVector::zeros(n),
        gain,
        apart: apart(0.0, Some(&PRIORS)),
    };
    let new = robot.among([&told].into_iter(), &PRIORS).expect("it is told something");
    // Two scans against one: two thirds of it are that one's.
    assert!((new.step[0] + 0.002).abs() < 5e-4 && new.step[1].abs() < 2e-4, "{}", new.step);
    let alone = 1.0 / PRIORS[0];
    assert!(new.gained[(0, 0)] > 0.4 * alone && new.gained[(0, 0)] < alone, "{}", new.gained);
}
