//! The hardest cases of the calibrations: each ill-posed record is refused for its own reason, with its numbers.

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    clippy::print_stdout,
    reason = "a test may end with a panic and says what it saw"
)]

#[path = "truth/truth.rs"]
mod truth;

use gnc_metrology::position::{LABELS, Limits, Position, from_directions, from_labels, up_of};
use gnc_metrology::rotation::{self, RotationAxis};
use gnc_metrology::{Refusal, ellipse, ellipsoid, six_position};
use nalgebra::Vector3;
use truth::{Dice, Session, borrowed};

/// Labelled runs of a rotation session.
type Runs = Vec<(String, [Vec<f64>; 3])>;

const G: f64 = 9.8;
/// Rows of a position.
const ROWS: usize = 200;

/// An accelerometer of 1000 LSB per m/s^2 in six positions, as rows.
struct Record {
    labels: Vec<&'static str>,
    channels: [Vec<f64>; 3],
}

impl Record {
    fn six() -> Self {
        let mut dice = Dice::new(1);
        let mut record = Self { labels: Vec::new(), channels: Default::default() };
        for label in LABELS {
            for _ in 0..ROWS {
                record.labels.push(label);
                for i in 0..3 {
                    record.channels[i].push(1000.0 * G * up_of(label).unwrap()[i] + 10.0 * dice.normal());
                }
            }
        }
        record
    }

    fn calibrate(&self) -> Result<six_position::SixPositionCalibration, Refusal> {
        let [x, y, z] = &self.channels;
        six_position::calibrate(&from_labels(&self.labels, [x, y, z], &Limits::ACCELEROMETER)?, G)
    }

    #[track_caller]
    fn refused(change: impl FnOnce(&mut Self), expected: &str) {
        let mut record = Self::six();
        change(&mut record);
        let refusal = record.calibrate().expect_err("a refusal").to_string();
        assert!(refusal.contains(expected), "`{refusal}` does not contain `{expected}`");
    }
}

#[test]
fn six_positions() {
    Record::six().calibrate().expect("a good record");
    Record::refused(|r| r.channels[1][700] = f64::NAN, "y: sample 700 is NaN");
    Record::refused(|r| r.channels[2].truncate(7), "channels differ in length");
    let cut = |r: &mut Record, rows: std::ops::Range<usize>| {
        r.labels.drain(rows.clone());
        r.channels.iter_mut().for_each(|c| drop(c.drain(rows.clone())));
    };
    Record::refused(|r| cut(r, 3 * ROWS..4 * ROWS), "missing: y-");
    Record::refused(|r| cut(r, 10..ROWS), "position x+ has 10 rows, the median position 200");
    Record::refused(
        |r| r.labels[5 * ROWS..].fill("x+"),
        "`x+` stands in two separated blocks, from row 1 and again from row 1001",
    );
    Record::refused(|r| r.labels[0] = "up", "unknown label `up` in row 1");
    Record::refused(
        |r| (0..2).for_each(|b| r.labels[b * ROWS..(b + 1) * ROWS].fill(["x-", "x+"][b])),
        "sensor x answers -1.00",
    );
    Record::refused(
        |r| {
            [(0, "y+"), (2, "x+"), (1, "y-"), (3, "x-")]
                .iter()
                .for_each(|(b, l)| r.labels[b * ROWS..(b + 1) * ROWS].fill(l));
        },
        "sensor x answers 1.000001e3 to axis y but",
    );
    // 14 degrees of tilt in one position.
    Record::refused(|r| r.channels[1][..ROWS].iter_mut().for_each(|y| *y += 250.0 * G), "misses the fit by");
    // The table still settles: 10 mrad over the position.
    Record::refused(
        |r| (0..ROWS).for_each(|i| r.channels[1][i] += 98.0 * i as f64 / ROWS as f64),
        "position x+ moved: block means of y spread by",
    );
    Record::refused(|r| r.channels[0][..ROWS].fill(8191.0), "x stands still at 8191 for 200 samples of position x+");
    let limits = Limits { saturation: Some(9000.0), ..Limits::ACCELEROMETER };
    let Record { labels, channels: [x, y, z] } = Record::six();
    assert!(matches!(from_labels(&labels, [&x, &y, &z], &limits), Err(Refusal::Saturated { .. })));
    assert!(matches!(six_position::calibrate(&positions(&labels, &x, &y, &z), -1.0), Err(Refusal::Parameter { .. })));
    assert!(matches!(from_labels::<&str>(&[], [&[], &[], &[]], &limits), Err(Refusal::Missing { .. })));
}

fn positions(labels: &[&str], x: &[f64], y: &[f64], z: &[f64]) -> Vec<Position> {
    from_labels(labels, [x, y, z], &Limits::ACCELEROMETER).unwrap()
}

#[test]
fn attitudes_that_do_not_span_space() {
    let up: Vec<Vector3<f64>> =
        (0..8).map(|k| (f64::from(k) * 0.8).sin_cos()).map(|(s, c)| Vector3::new(c, s, 0.0)).collect();
    let columns = [0, 1, 2].map(|i| up.iter().map(|u| u[i]).collect::<Vec<_>>());
    let channels = [0, 1, 2].map(|i| up.iter().map(|u| 9.8 * u[i]).collect::<Vec<_>>());
    let read = |u: [&[f64]; 3]| from_directions(u, [&channels[0], &channels[1], &channels[2]], &Limits::ACCELEROMETER);
    let positions = read([&columns[0], &columns[1], &columns[2]]).unwrap();
    assert!(matches!(six_position::calibrate(&positions, G), Err(Refusal::IllConditioned { .. })));
    assert!(matches!(six_position::calibrate(&positions[..4], G), Err(Refusal::TooFew { got: 4, needed: 5, .. })));
    let long: Vec<f64> = columns[0].iter().map(|u| u * 1.1).collect();
    assert!(matches!(read([&long, &columns[1], &columns[2]]), Err(Refusal::NotUnit { row: 1, .. })));
}

#[track_caller]
fn rotation_refused(
    change: impl FnOnce(&mut Runs),
    options: impl FnOnce(&mut rotation::RotationOptions),
    expected: &str,
) {
    let session = Session::example();
    let mut runs = session.runs(&mut Dice::new(2));
    let mut how = session.options(RotationAxis::Polar);
    change(&mut runs);
    options(&mut how);
    let refusal = rotation::calibrate(&borrowed(&runs), &how).expect_err("a refusal").to_string();
    assert!(refusal.contains(expected), "`{refusal}` does not contain `{expected}`");
}

#[test]
fn rotations() {
    let refused = |change: &dyn Fn(&mut Runs), expected| rotation_refused(change, |_| {}, expected);
    refused(&|r| drop(r.remove(4)), "missing: z+");
    refused(&|r| r[1].0 = "x+".to_owned(), "`x+` stands in two separated blocks");
    refused(&|r| r[3].1[0][55] = f64::INFINITY, "x: sample 55 is inf");
    // 9.5 to 10 s of rest end the record. The cut is 4 s earlier, in the ramp.
    refused(&|r| r[2].1.iter_mut().for_each(|c| c.truncate(650)), "run y+ is cut off: 0.000 s of rest after");
    refused(&|r| r[2].1.iter_mut().for_each(|c| drop(c.drain(..400))), "run y+ is cut off: 0.000 s of rest before");
    refused(&|r| r[2].1.iter_mut().for_each(|c| c.truncate(100)), "run y+: 100 samples");
    refused(&|r| r[0].1[0].fill(12.0), "run x+: no rotation found");
    refused(
        &|r| r[0].1[0][900..930].iter_mut().for_each(|v| *v += 500.0),
        "run x+ moves outside its rotation: x deviates",
    );
    refused(
        &|r| r[0].1[2][850..880].iter_mut().for_each(|v| *v += 500.0),
        "run x+ moves outside its rotation: z deviates",
    );
    // The way back turns by 1078 instead of 1080 degrees.
    refused(
        &|r| r[5].1[2].iter_mut().for_each(|v| *v = 5.0 + (*v - 5.0) * 1078.0 / 1080.0),
        "axis z: rotations forth and back differ by",
    );
    refused(&|r| r[1].1 = r[0].1.clone(), "axis x: both runs turn the same way");
    refused(&|r| (0..2).for_each(|k| r[k].0 = ["x-", "x+"][k].to_owned()), "sensor x answers -1.99");
    refused(&|r| (0..4).for_each(|k| r[k].0 = ["y+", "y-", "x+", "x-"][k].to_owned()), "no rotation found");
    let no = |_: &mut Runs| {};
    rotation_refused(no, |o| o.saturation = Some(7000.0), "x is saturated");
    // Both directions are cut off alike: they cancel, and only the plateau shows the fault.
    let clip = |r: &mut Runs| (0..2).for_each(|k| r[k].1[0].iter_mut().for_each(|v| *v = v.clamp(-7000.0, 7000.0)));
    refused(&clip, "x of run x+ is saturated");
    rotation_refused(no, |o| o.nominal = Some((2500.0, 5.0)), "sensor x: response 1.99");
    rotation_refused(no, |o| o.rate_hz = f64::NAN, "rate (Hz) is NaN");
    rotation_refused(no, |o| o.turns = 0.0, "turns is 0");
}

/// A channel that froze through a run seems not to answer there. Noise below a code also repeats, and is accepted.
#[test]
fn a_channel_that_froze_through_a_run() {
    let frozen = |names: &'static [&'static str]| {
        move |runs: &mut Runs| {
            runs.iter_mut().filter(|run| names.contains(&run.0.as_str())).for_each(|run| run.1[1].fill(-8.0));
        }
    };
    let expected = "y stands still at -8 for 1000 samples of run x+ while it is noisy elsewhere";
    rotation_refused(frozen(&["x+"]), |_| {}, expected);
    rotation_refused(frozen(&["x+", "x-", "z+", "z-"]), |_| {}, expected);
    let mut session = Session::example();
    // Steps of 60 LSB, noise of a twentieth of them, no cross-coupling: y shows one value in the runs of x and z.
    session.response = nalgebra::Matrix3::from_diagonal(&session.response.diagonal());
    let mut runs = session.runs(&mut Dice::new(2));
    runs.iter_mut().flat_map(|run| &mut run.1).flatten().for_each(|v| *v = (*v / 60.0).round() * 60.0);
    assert!(runs[0].1[1].iter().all(|v| *v == runs[0].1[1][0]));
    let found = rotation::calibrate(&borrowed(&runs), &session.options(RotationAxis::Polar));
    assert!(!matches!(found, Err(Refusal::Stuck { .. })), "{found:?}");
}

/// A sensor with a hundred times the scale factor is not refused.
#[test]
fn unequal_scale_factors_are_normal() {
    let mut session = Session::example();
    session.response *= nalgebra::Matrix3::identity();
    for j in 0..3 {
        session.response[(0, j)] *= 100.0;
    }
    session.noise[0] *= 100.0;
    let runs = session.runs(&mut Dice::new(2));
    let c = rotation::calibrate(&borrowed(&runs), &session.options(RotationAxis::Polar)).unwrap();
    assert!((c.response[(0, 0)] / 200_000.0 - 1.0).abs() < 1e-3 && (c.response[(1, 1)] / 3000.0 - 1.0).abs() < 1e-3);
}

#[track_caller]
fn ellipse_refused((x, y): (Vec<f64>, Vec<f64>), expected: &str) {
    let refusal = ellipse::fit(&x, &y, None).expect_err("a refusal").to_string();
    assert!(refusal.contains(expected), "`{refusal}` does not contain `{expected}`");
}

#[test]
fn ellipses() {
    let mut dice = Dice::new(3);
    let shape = [3.0, -5.0, 100.0, 80.0, 25.0];
    let mut good = |n, noise| truth::ellipse_points(n, shape, noise, &mut dice);
    let mut nan = good(1000, 1.0);
    nan.1[17] = f64::NAN;
    ellipse_refused(nan, "y: sample 17 is NaN");
    ellipse_refused(good(15, 1.0), "an ellipse: 15 samples, needs at least 20");
    ellipse_refused(good(60, 1.0), "2.50 turns, needs at least 3");
    ellipse_refused(good(1000, 30.0), "of the radius, limit 0.25");
    ellipse_refused((vec![1.0; 100], good(100, 1.0).1), "all 100 samples are 1");
    let mut cut = good(1000, 0.0);
    cut.0.iter_mut().for_each(|x| *x = x.min(80.0));
    ellipse_refused(cut, "x is saturated");
    // One branch of a hyperbola, and both.
    let branch: (Vec<f64>, Vec<f64>) = (-200..200).map(|t| f64::from(t) / 100.0).map(|t| (t.cosh(), t.sinh())).unzip();
    ellipse_refused(branch.clone(), "the points lie on a hyperbola, not on an ellipse");
    let both: (Vec<f64>, Vec<f64>) = branch
        .0
        .iter()
        .enumerate()
        .map(|(i, x)| if i % 2 == 0 { *x } else { -x })
        .zip(branch.1.iter().copied())
        .unzip();
    ellipse_refused(both, "hyperbola");
    // Half a turn back and forth.
    let half: (Vec<f64>, Vec<f64>) =
        (0..2000).map(|k| (f64::from(k) * 0.01).sin() * 1.5).map(|a| (100.0 * a.cos(), 100.0 * a.sin())).unzip();
    ellipse_refused(half, "poor coverage");
    // The table stood still for three quarters of the record.
    let mut stood = good(1000, 1.0);
    let rest = good(3000, 1.0);
    stood.0.extend(rest.0.iter().map(|_| 93.0 + 3.0));
    stood.1.extend(rest.1.iter().enumerate().map(|(k, _)| 40.0 + (k as f64 * 0.7).sin()));
    ellipse_refused(stood, "points");
    assert!(matches!(ellipse::fit(&[1.0], &[], None), Err(Refusal::Lengths { .. })));
}

/// Spikes at 0.1 % ruin extremes and plain least squares; the fit counts and rejects them.
#[test]
fn spikes_are_counted_and_do_no_harm() {
    let mut dice = Dice::new(4);
    let (mut x, y) = truth::ellipse_points(20_000, [3.0, -5.0, 100.0, 80.0, 25.0], 0.5, &mut dice);
    let clean = ellipse::fit(&x, &y, None).unwrap();
    x.iter_mut().step_by(1000).for_each(|v| *v += 3000.0 * dice.normal());
    let spiked = ellipse::fit(&x, &y, None).unwrap();
    assert_eq!((clean.rejected, spiked.rejected), (0, 20));
    assert!((clean.semi_axes[0] - spiked.semi_axes[0]).abs() < 2e-3, "{} {}", clean.semi_axes[0], spiked.semi_axes[0]);
    assert!((spiked.extremes.dx - 3.0).abs() > 100.0, "the print's zero is ruined");
}

fn sphere(keep: impl Fn(&Vector3<f64>) -> bool, scale: [f64; 3], noise: f64) -> [Vec<f64>; 3] {
    let mut dice = Dice::new(5);
    let points: Vec<Vector3<f64>> = truth::directions(4000).into_iter().filter(keep).collect();
    [0, 1, 2].map(|i| points.iter().map(|u| 10.0 + scale[i] * u[i] + noise * dice.normal()).collect())
}

#[track_caller]
fn ellipsoid_refused([x, y, z]: [Vec<f64>; 3], expected: &str) {
    match ellipsoid::fit(&x, &y, &z, None, None) {
        Ok(e) => panic!("fitted {e:?}"),
        Err(refusal) => assert!(refusal.to_string().contains(expected), "`{refusal}` does not contain `{expected}`"),
    }
}

#[test]
fn ellipsoids() {
    let round = [50.0, 50.0, 50.0];
    // A nearly planar record is refused, at any noise.
    for noise in [0.0, 0.01, 0.5, 5.0] {
        for width in [0.02, 0.1, 0.25] {
            let [x, y, z] = sphere(|u| u[2].abs() < width, round, noise);
            let fit = ellipsoid::fit(&x, &y, &z, None, None);
            let refusal = fit.map_err(|e| e.to_string()).expect_err("a refusal");
            assert!(refusal.contains("poor coverage"), "noise {noise}, width {width}: {refusal}");
        }
    }
    ellipsoid_refused(sphere(|u| u[2].abs() < 0.1, round, 0.01), "poor coverage");
    ellipsoid_refused(sphere(|u| u[2] > 0.9, round, 0.05), "poor coverage");
    ellipsoid_refused(sphere(|_| true, round, 20.0), "of the radius, limit 0.25");
    let hyperboloid: Vec<[f64; 3]> = truth::directions(2000)
        .iter()
        .map(|u| {
            let t = 1.5 * u[2];
            let a = u[1].atan2(u[0]);
            [t.cosh() * a.cos(), t.cosh() * a.sin(), t.sinh()]
        })
        .collect();
    ellipsoid_refused([0, 1, 2].map(|i| hyperboloid.iter().map(|p| p[i]).collect()), "hyperboloid");
    let mut nan = sphere(|_| true, round, 0.5);
    nan[2][5] = f64::NEG_INFINITY;
    ellipsoid_refused(nan, "z: sample 5 is -inf");
    let mut cut = sphere(|_| true, round, 0.0);
    cut[0].iter_mut().for_each(|v| *v = v.min(50.0));
    ellipsoid_refused(cut, "x is saturated");
}

/// A flat ellipsoid that is well covered is an ellipsoid.
#[test]
fn flat_ellipsoids_are_fitted() {
    let [x, y, z] = sphere(|_| true, [50.0, 50.0, 5.0], 0.05);
    let e = ellipsoid::fit(&x, &y, &z, None, None).unwrap();
    assert!((e.semi_axes[2] - 5.0).abs() < 0.02 && (e.semi_axes[0] - 50.0).abs() < 0.05, "{:?}", e.semi_axes);
    assert!((e.matrix.determinant() - 1.0).abs() < 1e-12);
}

/// Two fields in one record, and iron that moved in the middle of it.
#[test]
fn records_of_two_fields_are_refused() {
    let mut dice = Dice::new(8);
    let (mut x, mut y) = truth::ellipse_points(2000, [3.0, -5.0, 100.0, 95.0, 25.0], 0.5, &mut dice);
    assert!(ellipse::fit(&x, &y, None).is_ok());
    let mut moved = x.clone();
    moved[1000..].iter_mut().for_each(|v| *v += 15.0);
    ellipse_refused((moved.clone(), y.clone()), "of the ellipse moves by 1");
    assert!(ellipse::fit_within(&moved, &y, None, 0.3).is_ok());
    // The turns alternate between fields that differ by 30 %.
    for k in (0..2000).filter(|k| k / 100 % 2 == 0) {
        x[k] = 3.0 + 1.3 * (x[k] - 3.0);
        y[k] = -5.0 + 1.3 * (y[k] + 5.0);
    }
    ellipse_refused((x, y), "of the radius off the ellipse");
    let mut points = sphere(|_| true, [50.0, 48.0, 45.0], 0.2);
    // In the order of the heights a part would not show its centre.
    let order: Vec<usize> = (0..points[0].len()).map(|k| k * 1597 % points[0].len()).collect();
    points = points.map(|column| order.iter().map(|&k| column[k]).collect());
    let half = points[0].len() / 2;
    let mut moved = points.clone();
    moved[2][half..].iter_mut().for_each(|v| *v += 7.5);
    ellipsoid_refused(moved, "of the ellipsoid moves by 1");
    for k in (0..2 * half).filter(|k| k / 50 % 2 == 0) {
        (0..3).for_each(|i| points[i][k] = 10.0 + 1.3 * (points[i][k] - 10.0));
    }
    ellipsoid_refused(points, "of the radius off the ellipsoid");
}

/// Outliers on one side are reported as outliers, not as missing directions.
#[test]
fn one_sided_outliers_are_not_poor_coverage() {
    let mut points = sphere(|_| true, [50.0, 48.0, 45.0], 0.2);
    points[0].iter_mut().step_by(15).for_each(|v| *v += 400.0);
    let [x, y, z] = points;
    let refusal = ellipsoid::fit(&x, &y, &z, None, None).unwrap_err();
    assert!(!matches!(refusal, Refusal::Coverage { .. }), "{refusal}");
}
