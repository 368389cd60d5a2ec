//! Six positions, still gyroscopes, rotations, and the coefficients that are stored.

use gnc_protocol::calibration::CompensatedSample;
use nalgebra::{Matrix3, Vector3};

use super::world::{GRAVITY, World};
use super::*;
use crate::figures::calibration::ModuleCoefficients;

pub(super) const SIX: &str = "dwell = \"60 s\", rate = \"20 Hz\", pose_u = \"0 deg\", gravity_u = \"0 ppm\"";

/// Six positions, rotations and still gyroscopes of a world, as in an acceptance.
pub(super) fn calibrated(world: &mut World) -> Vec<(String, Findings)> {
    let six = world.six("", 1, 60.0, 20);
    let turns = world.turns("", 1, 200);
    let mut earlier = Vec::new();
    earlier.push(("six-position".to_owned(), ask(ItemId::SixPosition, SIX, &six, &[]).unwrap()));
    let rotation = ask(ItemId::Rotation, "angle_u = \"0 deg\", clock_u = \"0 ppm\"", &turns, &earlier).unwrap();
    earlier.push(("rotation".to_owned(), rotation));
    let still = ask(ItemId::GyroStill, "of = \"six-position\", heading_u = \"0 deg\"", &six, &earlier).unwrap();
    earlier.push(("gyro-still".to_owned(), still));
    earlier
}

#[test]
fn six_positions_recover_the_truth() {
    let mut world = World::new(1);
    let captures = world.six("", 1, 60.0, 20);
    let findings = ask(ItemId::SixPosition, SIX, &captures, &[]).unwrap();
    complete(ItemId::SixPosition, &params(ItemId::SixPosition, SIX), &findings);
    let inverse = world.accel.try_inverse().unwrap();
    let bias_mg = inverse * world.accel_bias * 1e3;
    for (i, axis) in ["x", "y", "z"].iter().enumerate() {
        // White noise of 0.1 mg over 60 s in six positions: 0.0053 mg, and Student's factor.
        close(&findings, &format!("bias_{axis}"), bias_mg[i], 0.025);
        close(&findings, &format!("scale_error_{axis}"), (world.accel[(i, i)] - 1.0) * 1e6, 50.0);
        for (j, other) in ["x", "y", "z"].iter().enumerate().filter(|(j, _)| *j != i) {
            let truth = world.accel[(i, j)] / world.accel[(i, i)] * 1e6;
            close(&findings, &format!("coupling_{axis}{other}"), truth, 50.0);
        }
    }
    assert_eq!(figure(&findings, "bias_x").1, Unit::Milligravity);
    assert_eq!(findings.details["gravity_mps2"], GRAVITY);
    assert_eq!(findings.details["budget"]["bias_x"]["contributions"][0]["type"], "A");
    // A socket that is turned changes the couplings to the fixture, but not the angles between the axes.
    let angle = figure(&findings, "nonorthogonality_xy").0;
    let (sin, cos) = 0.002_f64.sin_cos();
    world.accel *= nalgebra::Matrix3::new(cos, -sin, 0.0, sin, cos, 0.0, 0.0, 0.0, 1.0);
    let turned = ask(ItemId::SixPosition, SIX, &world.six("", 1, 60.0, 20), &[]).unwrap();
    assert!((figure(&turned, "coupling_xy").0 - figure(&findings, "coupling_xy").0 + 2000.0).abs() < 30.0);
    assert!((figure(&turned, "nonorthogonality_xy").0 - angle).abs() < 30.0);
}

/// Attitudes that are worse than the plan says are detected: the scatter of the residuals is used, and the details say
/// so.
#[test]
fn bad_attitudes_widen_the_uncertainty() {
    let mut world = World { pose_rad: 1e-3, ..World::new(2) };
    let findings = ask(ItemId::SixPosition, SIX, &world.six("", 1, 60.0, 20), &[]).unwrap();
    assert!(findings.details["label"].as_str().unwrap().contains("residuals larger"), "{}", findings.details["label"]);
    assert!(figure(&findings, "bias_x").2.expanded().unwrap() > 0.1);
    // When the plan states the pose error, it is in the budget: a pose error d adds d / sqrt(2) to the cross terms.
    let told = SIX.replace("pose_u = \"0 deg\"", "pose_u = \"0.0573 deg\"");
    let findings = ask(ItemId::SixPosition, &told, &world.six("", 1, 60.0, 20), &[]).unwrap();
    let pose = &findings.details["budget"]["coupling_xy"]["contributions"][1];
    assert!((pose["u"].as_f64().unwrap() - 1000.0 / 2.0_f64.sqrt()).abs() < 2.0, "{pose}");
    assert_eq!(
        findings.details["label"],
        "coefficients relative to the table; couplings relative to the seat (frames)"
    );
}

#[test]
fn still_gyroscopes_recover_bias_and_g_sensitivity() {
    let mut world = World::new(3);
    let earlier = calibrated(&mut world);
    let findings = &earlier[2].1;
    complete(ItemId::GyroStill, &params(ItemId::GyroStill, "of = \"six-position\""), findings);
    assert!(findings.details["label"].as_str().unwrap().starts_with("with the rotation of the earth removed"));
    let inverse = world.gyro.try_inverse().unwrap();
    let (bias, per_g) = (inverse * world.gyro_bias, inverse * world.per_g * 3600.0);
    for (i, axis) in ["x", "y", "z"].iter().enumerate() {
        close(findings, &format!("bias_{axis}"), bias[i], 0.0006);
        for (j, other) in ["x", "y", "z"].iter().enumerate() {
            close(findings, &format!("g_sensitivity_{axis}{other}"), per_g[(i, j)], 5.0);
        }
    }
    // With unknown headings the horizontal earth rate of 12.4 deg/h may be in the bias, and the budget says so.
    let six = world.six("", 1, 60.0, 20);
    let unknown = ask(ItemId::GyroStill, "of = \"six-position\", heading = \"unknown\"", &six, &earlier).unwrap();
    let expanded = |findings: &Findings| figure(findings, "bias_x").2.expanded().unwrap();
    assert!(
        expanded(&unknown) > 3.0 / 3600.0 && expanded(&unknown) > 2.0 * expanded(findings),
        "{}",
        expanded(&unknown)
    );
    assert!(unknown.details["label"].as_str().unwrap().contains("headings unknown"));
}

#[test]
fn rotations_recover_scale_and_coupling() {
    let mut world = World::new(4);
    let text = "angle_u = \"0 deg\", clock_u = \"0 ppm\", pose_u = \"0 deg\"";
    let findings = ask(ItemId::Rotation, text, &world.turns("", 1, 200), &[]).unwrap();
    complete(ItemId::Rotation, &params(ItemId::Rotation, text), &findings);
    for (i, axis) in ["x", "y", "z"].iter().enumerate() {
        close(&findings, &format!("scale_error_{axis}"), (world.gyro[(i, i)] - 1.0) * 1e6, 20.0);
        for (j, other) in ["x", "y", "z"].iter().enumerate().filter(|(j, _)| *j != i) {
            let truth = world.gyro[(i, j)] / world.gyro[(i, i)] * 1e6;
            close(&findings, &format!("coupling_{axis}{other}"), truth, 20.0);
        }
    }
    // The bias at this attitude holds g-sensitivity: 0.012 deg/s and more on X, far more than its uncertainty.
    let inverse = world.gyro.try_inverse().unwrap();
    let at_attitude = inverse * (world.gyro_bias + world.per_g.column(0) * GRAVITY / 9.80665);
    close(&findings, "bias_at_attitude_x", at_attitude[0] * 3600.0, 15.0);
    assert!(findings.details["label"].as_str().unwrap().contains("at this attitude"));
    // An angle that is off by 100 ppm in both directions is invisible, and goes into the scale factor one to one.
    let mut world = World { angle_error: 1e-4, ..World::new(4) };
    let off = ask(ItemId::Rotation, text, &world.turns("", 1, 200), &[]).unwrap();
    assert!((figure(&off, "scale_error_x").0 - figure(&findings, "scale_error_x").0 - 100.0).abs() < 1.0);
    let told =
        ask(ItemId::Rotation, "angle_u = \"0.108 deg\", clock_u = \"20 ppm\"", &world.turns("", 1, 200), &[]).unwrap();
    let rows = &told.details["budget"]["scale_error_x"]["contributions"];
    assert!((rows[2]["u"].as_f64().unwrap() - 100.0).abs() < 0.01 && rows[3]["u"] == 20.0, "{rows}");
}

/// A board clock that runs 30 ppm fast makes every angle look 30 ppm large. Without a measurement, this is within the
/// interval of the scale error, which names the clock. With a measurement by pulses it is corrected, and the interval
/// holds the drift of the clock.
#[test]
fn the_sample_clock_is_taken_out_where_pulses_tell_it() {
    let text = "angle_u = \"0 deg\", pose_u = \"0 deg\"";
    let truth = (World::new(4).gyro[(0, 0)] - 1.0) * 1e6;
    // Samples of a clock that runs fast lie closer: a turn has 30 ppm more of them.
    let turns = World { angle_error: 30e-6, ..World::new(4) }.turns("", 1, 200);
    let pulses: Vec<u64> = (0..4).map(|k| 5_000_000_000 + k * 1_000_030_000).collect();
    let clock = super::clock::BoardClock::of_pulses(&pulses).unwrap();
    assert!((clock.error_ppm - 30.0).abs() < 1e-6, "{clock:?}");
    let row = |findings: &Findings| findings.details["budget"]["scale_error_x"]["contributions"][3].clone();

    let unknown = ask(ItemId::Rotation, text, &turns, &[]).unwrap();
    let (value, _, known) = figure(&unknown, "scale_error_x");
    assert!((value - truth - 30.0).abs() < 5.0, "{value} for {truth}");
    // A crystal of +-50 ppm: 29 ppm of standard uncertainty, twice that at 95 %.
    assert!((known.expanded().unwrap() - 56.8).abs() < 2.0, "{known:?}");
    assert_eq!((&row(&unknown)["name"], &row(&unknown)["u"]), (&"sample clock, not measured".into(), &29.0.into()));
    assert!(matches!(value_of(&unknown, "sample_rate_error"), Some(Value::NotAvailable(_))));

    let earlier = [("gnss".to_owned(), clock.details().into())];
    let measured = ask(ItemId::Rotation, text, &turns, &earlier).unwrap();
    let (value, _, known) = figure(&measured, "scale_error_x");
    assert!((value - truth).abs() < 5.0, "{value} for {truth}");
    // +-5 ppm of drift, all values equally likely, and 0.05 ppm of the pulses.
    assert!((row(&measured)["u"].as_f64().unwrap() - 5.0 / 3.0_f64.sqrt()).abs() < 0.01, "{}", row(&measured));
    // The noise of these turns is 4 ppm beside it.
    assert!(known.expanded().unwrap() < 12.0, "{known:?}");
    assert_eq!(row(&measured)["name"], "sample clock, by 1PPS");
    close(&measured, "sample_rate_error", 30.0, 6.0);
    // The stored coefficients follow: their inverse gives the true rate.
    assert_ne!(measured.details["calibration"]["gyro_scale"], unknown.details["calibration"]["gyro_scale"]);
}

/// The few points kept for the picture of a turn still add up to its angle, with its sign.
#[test]
fn the_thinned_records_show_the_turns() {
    let findings = ask(ItemId::Rotation, "", &World::new(8).turns("", 1, 200), &[]).unwrap();
    let records = findings.details["records"].as_array().unwrap();
    assert_eq!(records.len(), 6);
    for record in records {
        let numbers =
            |key: &str| -> Vec<f64> { record[key].as_array().unwrap().iter().map(|v| v.as_f64().unwrap()).collect() };
        let (time_s, rate_dps) = (numbers("time_s"), numbers("rate_dps"));
        assert!(time_s.len() <= 400 && time_s.len() == rate_dps.len() && time_s.is_sorted(), "{}", time_s.len());
        let turned_deg: f64 =
            (1..time_s.len()).map(|k| (time_s[k] - time_s[k - 1]) * f64::midpoint(rate_dps[k], rate_dps[k - 1])).sum();
        let told_deg = if record["capture"].as_str().unwrap().contains('+') { 1080.0 } else { -1080.0 };
        assert!((turned_deg - told_deg).abs() < 30.0, "{}: {turned_deg}", record["capture"]);
    }
}

#[test]
fn calibrations_come_back_with_their_bits() {
    let earlier = calibrated(&mut World::new(5));
    let calibration = ModuleCalibration::of(&earlier).unwrap();
    assert!(calibration.accel.is_some() && calibration.gyro_scale.is_some() && calibration.gyro_still.is_some());
    let files: Vec<(String, Findings)> = earlier
        .iter()
        .map(|(name, findings)| {
            let text = serde_json::to_string(&findings.details).unwrap();
            (name.clone(), Findings::new(serde_json::from_str(&text).unwrap()))
        })
        .collect();
    assert_eq!(ModuleCalibration::of(&files).unwrap(), calibration);
    // The newest item counts for each part.
    let mut twice = earlier.clone();
    twice.extend(calibrated(&mut World::new(6)));
    assert_ne!(ModuleCalibration::of(&twice).unwrap(), calibration);
    let broken = vec![("six".to_owned(), Findings::new(serde_json::json!({ "calibration": { "accel": 3 } })))];
    assert!(matches!(ModuleCalibration::of(&broken), Err(FigureError::BadCalibration { .. })));
}

#[test]
fn download_and_check_agree_with_the_module() {
    let mut world = World::new(7);
    let mut earlier = calibrated(&mut world);
    let download = ask(ItemId::CalibrationDownload, "", &[], &earlier).unwrap();
    assert_eq!(value_of(&download, "coefficients"), Some(&Value::count(37)));
    assert_eq!(download.details["coefficients"]["mag"]["ky"], 1.0);
    let text = "dwell = \"60 s\", rate = \"20 Hz\", turn_rate = \"200 Hz\"";
    let coefficients: ModuleCoefficients = serde_json::from_value(download.details["coefficients"].clone()).unwrap();
    let checked = |world: &mut World| {
        [world.still("z+", 1, "z+", 0.0, 60.0, 20), world.turn("z+ rotation", 1, 2, 1080.0, 200)]
            .map(|capture| as_the_board(&capture, &coefficients))
    };
    let captures = checked(&mut world);
    let missing = ask(ItemId::CalibrationCheck, text, &captures, &earlier);
    assert_eq!(missing, Err(FigureError::NotCalibrated { item: ItemId::CalibrationDownload }));
    earlier.push(("download".into(), download));
    let check = ask(ItemId::CalibrationCheck, text, &captures, &earlier).unwrap();
    complete(ItemId::CalibrationCheck, &params(ItemId::CalibrationCheck, text), &check);
    for name in ["force_error_x", "force_error_y", "force_error_z"] {
        assert!(figure(&check, name).0.abs() < 0.1, "{name} {:?}", figure(&check, name));
    }
    for name in ["rate_error_x", "rate_error_y", "rate_error_z"] {
        assert!(figure(&check, name).0.abs() < 5.0, "{name} {:?}", figure(&check, name));
    }
    assert!(figure(&check, "angle_error").0.abs() < 40.0 && figure(&check, "cross_angle").0 < 60.0);
    // The coefficients of another module do not pass.
    world.gyro[(2, 2)] *= 1.001;
    world.accel_bias[0] += 0.001;
    let captures = checked(&mut world);
    let check = ask(ItemId::CalibrationCheck, text, &captures, &earlier).unwrap();
    assert!((figure(&check, "angle_error").0 - 1000.0).abs() < 50.0);
    assert!((figure(&check, "force_error_x").0 - 1.0).abs() < 0.1);
}

/// Computes what the interface document says that a board makes of raw samples, by its formulas.
fn as_the_board(raw: &Capture, known: &ModuleCoefficients) -> Capture {
    let rows = |rows: [[f64; 3]; 3]| Matrix3::from_fn(|row, column| rows[row][column]);
    let counts = |values: Vector3<f64>, scale: f64| [0, 1, 2].map(|axis| (values[axis] * scale).round() as i32);
    let compensated = raw.samples.iter().map(|sample| {
        let [gyro, accel] = [sample.gyro, sample.accel].map(|codes| Vector3::from(codes.map(f64::from)));
        let force = rows(known.accel_matrix) * accel + Vector3::from(known.accel_offset);
        let rate =
            rows(known.gyro_matrix) * gyro - Vector3::from(known.gyro_offset) - rows(known.gyro_per_force) * force;
        CompensatedSample { rate: counts(rate, 1e8), force: counts(force, 1e6), ..CompensatedSample::default() }
    });
    Capture { compensated: compensated.collect(), samples: Vec::new(), ..raw.clone() }
}

/// A seat that sits askew on the table shows in every coupling relative to the table, but in no angle between the axes.
#[test]
fn the_mounting_of_the_seat_is_told_apart() {
    let truth_ppm = |world: &World| world.accel[(2, 1)] / world.accel[(2, 2)] * 1e6;
    let mounting = nalgebra::Vector3::new(0.02_f64, -0.03, 0.015).map(f64::to_radians);
    let calibrate = |mounting, fixture: Option<BenchImperfections>| {
        let mut world = World { mounting, ..World::new(5) };
        let (params, site) = (params(ItemId::SixPosition, SIX), BenchSite { fixture, ..site() });
        let captures = world.six("", 1, 60.0, 20);
        let question = AnalysisInput { params: &params, site: Some(&site), captures: &captures, earlier: &[] };
        (truth_ppm(&world), analyse(ItemId::SixPosition, &question).unwrap())
    };
    // Without a measurement, 350 ppm of error are inside the interval of the default.
    let (truth, unknown) = calibrate(mounting, None);
    let (found, _, known) = figure(&unknown, "coupling_zy");
    assert!((found - truth - mounting.x * 1e6).abs() < 20.0, "{found} {truth}");
    assert!(known.low < truth && truth < known.high, "{known:?} {truth}");
    assert!(unknown.details["frames"]["mounting_deg"].is_null());
    // With a measurement, the mounting is subtracted, and the interval includes the rest.
    let fixture = BenchImperfections {
        mounting_rad: Some(mounting.into()),
        mounting_u_rad: 0.001_f64.to_radians(),
        ..BenchImperfections::default()
    };
    let (truth, corrected) = calibrate(mounting, Some(fixture));
    let (found, _, known) = figure(&corrected, "coupling_zy");
    assert!((found - truth).abs() < 20.0 && known.expanded().unwrap() < 60.0, "{found} {truth} {known:?}");
    assert_eq!(figure(&corrected, "nonorthogonality_yz").0, figure(&unknown, "nonorthogonality_yz").0);
    // The way to measure the mounting: the module turned over in the socket about Z, then about X (docs/figures.md).
    let coupling = |mounting: nalgebra::Vector3<f64>, pair: [&str; 2]| {
        let (_, found) = calibrate(mounting, None);
        pair.map(|pair| figure(&found, &format!("coupling_{pair}")).0 * 1e-6)
    };
    let about_z = nalgebra::Vector3::new(-mounting.x, -mounting.y, mounting.z);
    let about_x = nalgebra::Vector3::new(mounting.x, -mounting.y, -mounting.z);
    for (axis, turned, pair) in [(0, about_z, ["zy", "yz"]), (1, about_z, ["xz", "zx"]), (2, about_x, ["yx", "xy"])] {
        let ([one, other], [one_turned, other_turned]) = (coupling(mounting, pair), coupling(turned, pair));
        let found = (one - one_turned - other + other_turned) / 4.0;
        assert!((found - mounting[axis]).abs() < 20e-6, "{axis}: {found} {}", mounting[axis]);
    }
}
