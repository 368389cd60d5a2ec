//! One-sigma position and velocity about the surveyed antenna, and the jitter of the 1PPS.

use gnc_executive::bench::SitePlace;
use gnc_executive::catalogue::sensors;
use gnc_executive::measurement::Value;
use gnc_executive::quantity::Unit;
use gnc_executive::uncertainty::Uncertainty;
use gnc_metrology::stats;
use gnc_nmea::{Epoch, Sentences};
use serde_json::json;

use super::clock::{BOARD_CLOCK, BoardClock, SECOND_NS};
use super::{AnalysisInput, FigureError, Findings, mean, thin};
use crate::details::performance::{FixScatter, MEAN_ERROR_M, MeanError, SCATTER};

/// WGS-84: semi-major axis and first eccentricity squared (NIMA TR8350.2, table 3.1).
const EARTH_RADIUS_M: f64 = 6_378_137.0;
const ECCENTRICITY_SQUARED: f64 = 6.694_379_990_14e-3;
/// Least number of epochs for a standard deviation that means something.
const LEAST: usize = 10;
/// Step of the board's capture timer.
const TIMER_NS: f64 = 10.0;

pub(super) fn analyse(question: &AnalysisInput<'_>) -> Result<Findings, FigureError> {
    let probability = question.probability()?;
    let place = question.site.and_then(|site| site.place).ok_or(FigureError::NoPlace)?;
    let survey_u = question.params.quantity("survey_u", Unit::Metre)?;
    let mut sentences = Sentences::default();
    let mut epochs = Vec::new();
    for capture in question.captures {
        if capture.losses.any() {
            return Err(FigureError::Lost { label: capture.about.label.clone(), losses: capture.losses });
        }
        for said in &capture.receiver.said {
            epochs.extend(sentences.push(&said.bytes));
        }
        epochs.extend(sentences.finish());
    }
    let fixes: Vec<&Epoch> = epochs.iter().filter(|epoch| epoch.has_fix()).collect();
    if fixes.len() < LEAST {
        return Err(FigureError::FewEpochs { got: fixes.len(), needed: LEAST });
    }
    let errors: Vec<[f64; 3]> = fixes.iter().map(|epoch| east_north_up(epoch, &place)).collect();
    let [east, north, up] =
        [0, 1, 2].map(|k| errors.iter().map(|error| error[k]).filter(|error| error.is_finite()).collect::<Vec<f64>>());
    let worth = (dof_of_rms(&east) + dof_of_rms(&north)) / 2.0;
    let mut findings = Findings::new(json!({
        "equation": "root mean square about the surveyed antenna: of east and north together, and of height",
        "epochs": epochs.len(), "with_fix": fixes.len(), "with_height": up.len(),
        "sentence_errors": sentences.counts().errors, "receiver_faults": sentences.counts().faults,
        "receiver_fault": sentences.fault().map(ToString::to_string), "foreign_frames": sentences.foreign(),
        "survey_u_m": survey_u, "effective": { "horizontal": worth, "height": dof_of_rms(&up) },
        "label": "neighbouring epochs are correlated and counted as what they are worth",
    }));
    let [east_mean, north_mean, up_mean] = [&east, &north, &up].map(|errors| stats::mean(errors));
    findings.part(&MEAN_ERROR_M, MeanError { east: east_mean, north: north_mean, up: Some(up_mean) });
    findings.part(&SCATTER, scatter(&errors));
    let horizontal = (stats::rms(&east).powi(2) + stats::rms(&north).powi(2)).sqrt();
    let position = |rms: f64, dof: f64| spread(rms, dof, survey_u, Unit::Metre, probability);
    findings.put(&sensors::POSITION_HORIZONTAL, position(horizontal, 2.0 * worth));
    findings.put(
        &sensors::POSITION_HEIGHT,
        if up.len() >= LEAST {
            position(stats::rms(&up), dof_of_rms(&up))
        } else {
            Value::NotAvailable(no_height(&fixes))
        },
    );
    let speeds: Vec<f64> = fixes.iter().filter_map(|epoch| epoch.ground_speed_mps).collect();
    findings.put(
        &sensors::VELOCITY_HORIZONTAL,
        if speeds.len() < LEAST {
            Value::NotAvailable(format!("{} epochs with a speed, needs at least {LEAST}", speeds.len()))
        } else {
            spread(stats::rms(&speeds), 2.0 * dof_of_rms(&speeds), 0.0, Unit::MetrePerSecond, probability)
        },
    );
    findings.put(
        &sensors::VELOCITY_HEIGHT,
        Value::NotAvailable("the receiver's sentences hold no vertical velocity".into()),
    );
    pulses(question, &mut findings, probability);
    board_clock(question, &mut findings, probability);
    findings
        .put(&sensors::PPS_ACCURACY, Value::NotAvailable("not measured: there is no external time reference".into()));
    findings.put(&sensors::EPOCHS, Value::count(fixes.len() as u64));
    findings.number(&sensors::EFFECTIVE_EPOCHS, worth.floor(), Unit::Count);
    Ok(findings)
}

/// Returns the reason why there is no height above the ellipsoid.
fn no_height(fixes: &[&Epoch]) -> String {
    let [above_sea, heights] = [|epoch: &Epoch| epoch.altitude_m, |epoch: &Epoch| epoch.height_m]
        .map(|pick| fixes.iter().filter(|epoch| pick(epoch).is_some()).count());
    match (above_sea, heights) {
        (0, _) => "the receiver gives no height".to_owned(),
        (_, 0) => "the receiver gives no geoid separation, and so no height above the ellipsoid".to_owned(),
        _ => format!("{heights} epochs with a height, needs at least {LEAST}"),
    }
}

/// Thins the errors over the epochs evenly, and always keeps the epoch farthest off.
fn scatter(errors: &[[f64; 3]]) -> FixScatter {
    let every = thin::stride(errors.len());
    let off = |error: &[f64; 3]| error[0].hypot(error[1]);
    let worst = errors.iter().enumerate().max_by(|a, b| off(a.1).total_cmp(&off(b.1))).map(|(place, _)| place);
    let kept: Vec<usize> = (0..errors.len()).filter(|place| place % every == 0 || Some(*place) == worst).collect();
    let of = |axis: usize| thin::rounded(kept.iter().map(|place| errors[*place][axis]), 3);
    let up_m = of(2).into_iter().map(|up| Some(up).filter(|up| up.is_finite())).collect();
    FixScatter { every, east_m: of(0), north_m: of(1), up_m, epoch: kept }
}

/// A root mean square with its interval: chi-square, and the uncertainty of the surveyed place.
fn spread(rms: f64, dof: f64, survey_u: f64, unit: Unit, probability: f64) -> Value {
    let (low, high) = stats::sd_interval(rms, dof, probability);
    let off = stats::normal_quantile(0.5 + probability / 2.0) * survey_u;
    Value::estimate(rms, unit, Uncertainty::interval((low - off).max(0.0), high + off, probability))
}

fn dof_of_rms(values: &[f64]) -> f64 {
    // The place is known, so that no degree of freedom goes to a mean.
    mean::dof_of_sd(values) * values.len() as f64 / (values.len() as f64 - 1.0)
}

/// Error of a fix in metres: east, north, up.
fn east_north_up(epoch: &Epoch, place: &SitePlace) -> [f64; 3] {
    let (sin, cos) = place.latitude_deg.to_radians().sin_cos();
    let w = (1.0 - ECCENTRICITY_SQUARED * sin * sin).sqrt();
    let meridian = EARTH_RADIUS_M * (1.0 - ECCENTRICITY_SQUARED) / w.powi(3) + place.height_m;
    let parallel = (EARTH_RADIUS_M / w + place.height_m) * cos;
    let east_deg = epoch.longitude_deg.unwrap_or(f64::NAN) - place.longitude_deg;
    let east_deg = (east_deg + 180.0).rem_euclid(360.0) - 180.0;
    let north_deg = epoch.latitude_deg.unwrap_or(f64::NAN) - place.latitude_deg;
    let up_m = epoch.height_m.map_or(f64::NAN, |height| height - place.height_m);
    [east_deg.to_radians() * parallel, north_deg.to_radians() * meridian, up_m]
}

/// The board's clock compared with the pulses.
fn board_clock(question: &AnalysisInput<'_>, findings: &mut Findings, probability: f64) {
    let pulses: Vec<u64> = question.captures.iter().flat_map(|capture| capture.receiver.pulses_ns.clone()).collect();
    match BoardClock::of_pulses(&pulses) {
        Ok(clock) => {
            findings.part(&BOARD_CLOCK, clock);
            findings.put(&sensors::BOARD_CLOCK_ERROR, clock.value(probability));
        }
        Err(why) => findings.put(&sensors::BOARD_CLOCK_ERROR, Value::NotAvailable(why)),
    }
}

/// Standard deviation of the intervals between pulses, on the board's clock. The mean removes the rate of that clock.
fn pulses(question: &AnalysisInput<'_>, findings: &mut Findings, probability: f64) {
    let intervals: Vec<f64> = question
        .captures
        .iter()
        .flat_map(|capture| capture.receiver.pulses_ns.windows(2).map(|pair| pair[1].saturating_sub(pair[0]) as f64))
        .collect();
    let whole: Vec<f64> = intervals.iter().copied().filter(|ns| (SECOND_NS.0..=SECOND_NS.1).contains(ns)).collect();
    if whole.len() < LEAST {
        findings.put(&sensors::PPS_JITTER, Value::NotAvailable(format!("{} intervals between pulses", whole.len())));
        return;
    }
    let (mean_ns, sd_ns) = stats::mean_sd(&whole);
    // Intervals share their edges: for white edges two thirds of the degrees of freedom are left.
    let (low, high) = stats::sd_interval(sd_ns, (whole.len() - 1) as f64 * 2.0 / 3.0, probability);
    // Both edges of an interval are rounded to the timer's step.
    let rounding_ns = TIMER_NS / 6.0_f64.sqrt();
    let low = (low * low - rounding_ns * rounding_ns).max(0.0).sqrt();
    findings.detail(
        "pps",
        json!({
            "intervals": whole.len(), "others": intervals.len() - whole.len(), "mean_ns": mean_ns, "sd_ns": sd_ns,
            "timer_ns": TIMER_NS, "rounding_ns": rounding_ns,
            "label": "intervals between pulses by the board's timer; its resolution is in the interval of the figure",
        }),
    );
    let interval = Uncertainty::interval(low, high, probability);
    findings.put(&sensors::PPS_JITTER, Value::estimate(sd_ns, Unit::Nanosecond, interval));
}
