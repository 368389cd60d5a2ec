//! Attitudes whose field differs from that of the others, and parts that differ from their attitude.

use gnc_metrology::Refusal;

use super::coverage_field::good_attitudes;
use super::*;

const TEXT: &str = "dwell = \"2 s\", rate = \"100 Hz\"";

fn ask_with(site: &BenchSite, captures: &[Capture]) -> Result<Findings, FigureError> {
    let params = params(ItemId::MagnetometerEllipsoid, TEXT);
    analyse(ItemId::MagnetometerEllipsoid, &AnalysisInput { params: &params, site: Some(site), captures, earlier: &[] })
}

/// Adds a field along the sensor's own reading to some samples of a capture, as from iron that strengthens the field.
fn disturb(capture: &mut Capture, rows: std::ops::Range<usize>, mgauss: f64) {
    for sample in &mut capture.samples[rows] {
        let length = sample.mag.iter().map(|code| f64::from(*code).powi(2)).sum::<f64>().sqrt();
        sample.mag = sample.mag.map(|code| code + (f64::from(code) / length * mgauss * 1250.0).round() as i32);
    }
}

/// Returns the odd attitudes that are named, with their differences; empty where the item has figures.
fn odd(site: &BenchSite, captures: &[Capture]) -> Vec<(String, f64)> {
    match ask_with(site, captures) {
        Ok(_) => Vec::new(),
        Err(FigureError::Disturbed { attitudes, .. }) => attitudes,
        Err(other) => panic!("{other}"),
    }
}

#[test]
fn a_good_module_keeps_all_its_attitudes() {
    for seed in 0..60 {
        let (site, captures) = good_attitudes(seed);
        let found = ask_with(&site, &captures).unwrap_or_else(|error| panic!("seed {seed}: {error}"));
        assert_eq!(value_of(&found, "rejected"), Some(&Value::count(0)), "seed {seed}");
    }
}

/// Iron beside the bench in one attitude, in two, or in four, weak and strong: the error names these attitudes with
/// their differences.
#[test]
fn wrong_attitudes_are_named() {
    for (mgauss, wrong) in
        [(2.0, &[7][..]), (-2.0, &[0]), (5.0, &[3, 16]), (30.0, &[23]), (150.0, &[11]), (8.0, &[1, 2, 9, 20])]
    {
        for seed in [100, 101, 102] {
            let (site, mut captures) = good_attitudes(seed);
            for &place in wrong {
                let rows = captures[place].samples.len();
                disturb(&mut captures[place], 0..rows, mgauss);
            }
            let mut named = odd(&site, &captures);
            named.sort_by_key(|(label, _)| captures.iter().position(|capture| capture.about.label == *label));
            let labels: Vec<&str> = named.iter().map(|(label, _)| label.as_str()).collect();
            let expected: Vec<&str> = wrong.iter().map(|&place| captures[place].about.label.as_str()).collect();
            assert_eq!(labels, expected, "seed {seed}, {mgauss} mgauss");
            // The ambient field is 0.1 mgauss in each attitude. The tolerance is five standard deviations, and soft
            // iron of 1 %.
            let near = |off: f64| (off - mgauss).abs() < 0.7 + 0.02 * mgauss.abs();
            assert!(named.iter().all(|(_, off)| near(*off)), "seed {seed}: {named:?}");
        }
    }
}

#[test]
fn the_message_says_where_and_by_how_much() {
    let (site, mut captures) = good_attitudes(103);
    let rows = captures[7].samples.len();
    disturb(&mut captures[7], 0..rows, 2.0);
    let error = ask_with(&site, &captures).unwrap_err();
    let text = error.to_string();
    assert!(text.contains(&captures[7].about.label) && text.contains("mgauss"), "{text}");
    assert!(error.try_this().contains("ambient_u"), "{}", error.try_this());
}

/// A bench whose field moves by more than its file states has wider intervals, and the error names no attitude.
#[test]
fn a_restless_bench_widens_the_intervals() {
    let (quiet, captures) = good_attitudes(104);
    let fixture = Some(BenchImperfections { ambient_u_gauss: 0.02e-3, ..BenchImperfections::default() });
    let told = BenchSite { fixture, ..quiet.clone() };
    let name = "soft_iron_xy";
    let (wide, honest) = (ask_with(&told, &captures).unwrap(), ask_with(&quiet, &captures).unwrap());
    let rows = |found: &Findings| found.details["budget"][name]["contributions"].to_string();
    assert!(rows(&wide).contains("differences between attitudes"), "{}", rows(&wide));
    assert!(!rows(&honest).contains("differences between attitudes"), "{}", rows(&honest));
    let expanded = |found: &Findings| figure(found, name).2.expanded().unwrap();
    assert!(expanded(&wide) > 0.6 * expanded(&honest), "{} {}", expanded(&wide), expanded(&honest));
}

/// A short disturbance is left out of its attitude and counted. A field that changes in the middle of an attitude is
/// refused there.
#[test]
fn parts_are_judged_against_their_attitude() {
    let (site, mut captures) = good_attitudes(105);
    let whole = ask_with(&site, &captures).unwrap();
    disturb(&mut captures[5], 60..80, 3.0);
    let found = ask_with(&site, &captures).unwrap();
    assert_eq!(value_of(&found, "rejected"), Some(&Value::count(2)));
    let moved = figure(&found, "soft_iron_xx").0 - figure(&whole, "soft_iron_xx").0;
    assert!(moved.abs() < 20.0, "{moved} ppm");
    disturb(&mut captures[5], 100..200, 3.0);
    let error = ask_with(&site, &captures).unwrap_err();
    assert!(matches!(&error, FigureError::Unfit { label, .. } if *label == captures[5].about.label), "{error}");
}

/// Nine parameters need more than nine attitudes.
#[test]
fn few_attitudes_are_refused() {
    let (site, captures) = good_attitudes(106);
    let error = ask_with(&site, &captures[..6]).unwrap_err();
    assert!(
        matches!(error, FigureError::Refused { refusal: Refusal::TooFew { got: 6, needed: 12, .. }, .. }),
        "{error}"
    );
}
