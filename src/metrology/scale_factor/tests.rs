use super::*;

const RATES: [f64; 9] = [-300.0, -150.0, -50.0, -10.0, 0.0, 10.0, 50.0, 150.0, 300.0];
const OUTPUTS: [[f64; 9]; 3] = [
    [-59876.1, -29914.7, -9951.2, -1967.0, 29.5, 2026.9, 10012.0, 29981.2, 59938.4],
    [-59868.6, -29909.0, -9947.8, -1962.4, 33.9, 2031.0, 10015.2, 29981.5, 59935.4],
    [-59886.2, -29921.2, -9955.8, -1970.9, 26.3, 2022.8, 10008.4, 29979.6, 59940.6],
];

/// `scipy.stats.t.ppf(1 - 0.05 / 9 / 2, 14)`
const T_OF_14: f64 = 3.2727427095929515;

fn of(rates: &[f64], outputs: &[f64]) -> Vec<RatePoint> {
    RateRows { rates, outputs, cycles: None, points: None }.means().unwrap()
}

fn of_cycles(count: usize) -> Vec<RatePoint> {
    let rows = (0..count).flat_map(|c| (0..9).map(move |j| (RATES[j], OUTPUTS[c][j], c as f64 + 1.0)));
    let (rates, (outputs, cycles)): (Vec<f64>, (Vec<f64>, Vec<f64>)) = rows.map(|(r, o, c)| (r, (o, c))).unzip();
    RateRows { rates: &rates, outputs: &outputs, cycles: Some(&cycles), points: None }.means().unwrap()
}

#[track_caller]
fn near(found: f64, expected: f64) {
    assert!((found - expected).abs() <= 1e-9 * expected.abs(), "{found} {expected}");
}

/// Expected values are from numpy and scipy: `expected.py`.
#[test]
fn one_cycle_as_numpy_has_it() {
    let found = fit(&of(&RATES, &OUTPUTS[0]), &ScaleFactorOptions::default()).unwrap();
    near(found.scale_factor.value, 199.68216333622934);
    near(found.offset.value, 31.0);
    near(found.scale_factor.sd, 0.007035551247515632);
    near(found.offset.sd, 1.1251995135800783);
    assert_eq!(found.scale_factor.dof, 7.0);
    let of_full_scale = found.nonlinearity_full_scale;
    near(of_full_scale.value, 0.0001105840789468795);
    assert_eq!((of_full_scale.rate, of_full_scale.interval, found.full_scale), (-150.0, None, 300.0));
    let of_output = found.nonlinearity_output;
    near(of_output.value, 0.000590121129508951);
    assert_eq!(of_output.rate, -10.0);
    let asymmetry = found.asymmetry.unwrap();
    near(asymmetry.relative, 4.92769027044049e-05);
    let (sd, dof) = asymmetry.uncertainty.unwrap();
    near(sd, 0.00011733374685970067);
    near(dof, 2.632122818621333);
    assert_eq!((found.lack_of_fit, found.repeatability.is_err()), (Err(MissingFigure::NoRateTwice), true));
    // A range of twice the largest rate halves the first nonlinearity, and nothing else.
    let wider =
        fit(&of(&RATES, &OUTPUTS[0]), &ScaleFactorOptions { full_scale: Some(600.0), ..ScaleFactorOptions::default() })
            .unwrap();
    near(wider.nonlinearity_full_scale.value, 0.0001105840789468795 / 2.0);
    near(wider.nonlinearity_output.value, 0.000590121129508951);
}

#[test]
fn three_cycles_as_numpy_has_them() {
    let found = fit(&of_cycles(3), &ScaleFactorOptions::default()).unwrap();
    near(found.scale_factor.value, 199.6828844483058);
    near(found.scale_factor.sd, 0.01060008490526547);
    near(found.scale_factor.expanded(), 0.045608484253216536);
    near(found.offset.value, 30.80740740740792);
    let repeatability = found.repeatability.unwrap();
    near(repeatability.sd, 0.01835988562046372);
    assert_eq!((repeatability.runs, found.cycles.len(), found.curve.len()), (3, 3, 9));
    let test = found.lack_of_fit.unwrap();
    assert_eq!((test.dof, test.pure_dof), (7.0, 14.0));
    near(test.f, 82.02743401372331);
    assert!((test.p / 2.778094827368608e-10 - 1.0).abs() < 1e-6, "{}", test.p);
    near(test.pure_sd, 0.6441819588535068);
    assert_eq!(found.asymmetry.unwrap().uncertainty.map(|(_, dof)| dof), Some(2.0));
    // The mean of three visits, about a line through nine rates; scipy: t of 14 degrees at 1 - 0.05 / 9 / 2.
    let leverage = 1.0 / 9.0 + 22_500.0 / (2.0 * (90_000.0 + 22_500.0 + 2_500.0 + 100.0));
    let by_hand = T_OF_14 * 0.644_182 * ((1.0 - leverage) / 3.0_f64).sqrt() / (199.682_884 * 300.0);
    let Largest { value, rate, interval } = found.nonlinearity_full_scale;
    let (low, high) = interval.unwrap();
    assert!(rate.abs() == 150.0 && low > 0.0 && ((high - value) / by_hand - 1.0).abs() < 1e-5, "{value} {low} {high}");
}

/// By hand: x = 2 w + 1 + c (w^2 - mean) with rates -2 -1 0 1 2, so that the line keeps its slope and the residuals are
/// c (2, -1, -2, -1, 2).
#[test]
fn a_parabola_by_hand() {
    let rates = [-2.0, -1.0, 0.0, 1.0, 2.0];
    let outputs = rates.map(|w: f64| 2.0 * w + 1.0 + 0.01 * (w * w - 2.0));
    let found = fit(&of(&rates, &outputs), &ScaleFactorOptions::default()).unwrap();
    let close = |found: f64, expected: f64| assert!((found - expected).abs() < 1e-12, "{found} {expected}");
    close(found.scale_factor.value, 2.0);
    close(found.offset.value, 1.0);
    // sqrt(14e-4 / 3 / 10)
    close(found.scale_factor.sd, (14e-4_f64 / 30.0).sqrt());
    close(found.nonlinearity_full_scale.value, 0.02 / 4.0);
    close(found.nonlinearity_output.value, 0.01 / 2.0);
    // K+ = 2.03, K- = 1.97.
    let asymmetry = found.asymmetry.unwrap();
    close(asymmetry.relative, 0.06 / 2.0);
    assert_eq!(asymmetry.uncertainty, None);
    assert_eq!(found.suspects, []);
    // A sensor that is mounted in the opposite direction differs only in the sign of K.
    let reversed = fit(&of(&rates, &outputs.map(|x| -x)), &ScaleFactorOptions::default()).unwrap();
    close(reversed.scale_factor.value, -2.0);
    close(reversed.nonlinearity_full_scale.value, 0.02 / 4.0);
    close(reversed.asymmetry.unwrap().relative, 0.03);
}

/// Measured rates differ from row to row: numbered points are averaged in rate and output.
#[test]
fn numbered_points() {
    let rows = RateRows {
        rates: &[9.0, 11.0, -9.5, -10.5, 0.0, 2e-3],
        outputs: &[19.0, 21.0, -19.0, -21.0, 0.5, 0.5],
        cycles: None,
        points: Some(&[1.0, 1.0, 2.0, 2.0, 3.0, 3.0]),
    };
    let found = rows.means().unwrap();
    let seen: Vec<_> = found.iter().map(|p| (p.rate, p.output, p.rows)).collect();
    assert_eq!(seen, [(10.0, 20.0, 2), (-10.0, -20.0, 2), (1e-3, 0.5, 2)]);
    // A ten-thousandth of the full scale counts as rest.
    let found = fit(&found, &ScaleFactorOptions::default()).unwrap();
    assert_eq!(found.curve.iter().map(|p| p.of_output.is_some()).collect::<Vec<_>>(), [true, false, true]);
    assert_eq!(found.nonlinearity_output.rate.abs(), 10.0);
}

/// Rows of a rate in a block are one point, however many they are; rows in two blocks are two points.
#[test]
fn rows_become_points() {
    let found = of(&[1.0, 1.0, 2.0, 1.0], &[3.0, 5.0, 7.0, 9.0]);
    let seen: Vec<_> = found.iter().map(|p| (p.rate, p.output, p.row, p.rows)).collect();
    assert_eq!(seen, [(1.0, 4.0, 1, 2), (2.0, 7.0, 3, 1), (1.0, 9.0, 4, 1)]);
    let rows = RateRows { rates: &[1.0, 1.0], outputs: &[3.0, 5.0], cycles: Some(&[1.0, 2.0]), points: None };
    let split = rows.means().unwrap();
    assert_eq!(split.iter().map(|p| (p.cycle, p.row)).collect::<Vec<_>>(), [(1.0, 1), (2.0, 2)]);
}

#[test]
fn figures_that_do_not_exist_have_a_reason() {
    let one_sense = fit(&of(&RATES[4..], &OUTPUTS[0][4..]), &ScaleFactorOptions::default()).unwrap();
    let reason = one_sense.asymmetry.unwrap_err().to_string();
    assert_eq!(reason, "0 rates of the negative sense, a line needs 2");
    assert_eq!(one_sense.lack_of_fit.unwrap_err().to_string(), "no rate comes twice");
    let unequal: Vec<RatePoint> = of_cycles(2).into_iter().filter(|p| p.cycle < 2.0 || p.rate != 50.0).collect();
    let found = fit(&unequal, &ScaleFactorOptions::default()).unwrap();
    assert_eq!(found.lack_of_fit.unwrap_err().to_string(), "the cycles do not have the same rates");
    let no_sense: Vec<RatePoint> = of_cycles(2).into_iter().filter(|p| p.cycle < 2.0 || p.rate >= 0.0).collect();
    let reason = fit(&no_sense, &ScaleFactorOptions::default()).unwrap().asymmetry.unwrap_err().to_string();
    assert_eq!(reason, "0 rates of the negative sense in cycle 2, a line needs 2");
}

#[test]
fn refusals() {
    let check = |rates: &[f64], outputs: &[f64], expected: &str| {
        let refusal = fit(&of(rates, outputs), &ScaleFactorOptions::default()).unwrap_err();
        assert_eq!(refusal.to_string(), expected);
        assert!(!refusal.hint().is_empty());
    };
    check(&[], &[], "0 different rates, needs at least 3");
    check(&[5.0; 4], &[1.0, 2.0, 3.0, 4.0], "1 different rates, needs at least 3");
    check(&[-1.0, 1.0, -1.0], &[1.0, 2.0, 3.0], "2 different rates, needs at least 3");
    check(&[0.0, -0.0, 1.0], &[1.0, 2.0, 3.0], "2 different rates, needs at least 3");
    check(&[1.0, 2.0, 3.0], &[7.0; 3], "output: all 3 samples are 7");
    let not_finite = RateRows { rates: &[1.0, f64::NAN], outputs: &[7.0; 2], cycles: None, points: None };
    assert_eq!(not_finite.means().unwrap_err().to_string(), "rate: sample 1 is NaN");
    // A rate with the wrong sign: sums by hand give the line 0.5 + 0.5 w, full scale 1, residual 2.5.
    check(
        &[-2.0, -1.0, 0.0, 1.0, 2.0, -2.0],
        &[-2.0, -1.0, 0.0, 1.0, 2.0, 2.0],
        "rate -2 (row 6) misses the line by 250.00 % of the full scale, limit 5 %",
    );
    // No response: noise alone.
    check(&[-1.0, 0.0, 1.0], &[1.0, -1.0, 1.0], "rate 0 (row 2) misses the line by inf % of the full scale, limit 5 %");
    let twice: Vec<RatePoint> = [1.0, 2.0]
        .into_iter()
        .flat_map(|cycle| of(&RATES, &OUTPUTS[0]).into_iter().map(move |p| RatePoint { cycle, ..p }))
        .collect();
    let copied = fit(&twice, &ScaleFactorOptions::default()).unwrap_err().to_string();
    assert!(copied.starts_with("all 2 scale factors of the cycles are 199.6821633362293"), "{copied}");
    let short: Vec<RatePoint> = of_cycles(2).into_iter().filter(|p| p.cycle < 2.0 || p.rate > 100.0).collect();
    assert_eq!(
        fit(&short, &ScaleFactorOptions::default()).unwrap_err().to_string(),
        "2 different rates in cycle 2, needs at least 3"
    );
}

/// The one point of eleven that is off by 30 standard deviations is named, and no other.
#[test]
fn a_point_that_stands_out_is_named() {
    let rates: Vec<f64> = (-5..=5).map(f64::from).collect();
    let mut outputs: Vec<f64> = rates.iter().map(|w| 100.0 * w + 3.0 + (w * 2.7).sin() * 0.1).collect();
    assert_eq!(fit(&of(&rates, &outputs), &ScaleFactorOptions::default()).unwrap().suspects, []);
    outputs[8] += 3.0;
    let found = fit(&of(&rates, &outputs), &ScaleFactorOptions::default()).unwrap();
    assert_eq!(found.suspects.iter().map(|s| (s.point.rate, s.point.row)).collect::<Vec<_>>(), [(3.0, 9)]);
    assert!(found.suspects[0].studentised > 20.0);
}
