//! Measurements from what the receiver said. A figure that does not exist is left out, and its reason is filed.

use chrono::NaiveDate;
use gnc_analysis::figures::Findings;
use gnc_analysis::figures::clock::BoardClock;
use gnc_executive::bench::{BenchSite, SitePlace};
use gnc_executive::catalogue::MeasurementSpec;
use gnc_executive::catalogue::sensors::{
    BOARD_CLOCK_ERROR, EPOCHS_REPEATED, FIX_TYPE, FOREIGN_FRAMES, GROUND_SPEED, HDOP, HEIGHT, HEIGHT_ERROR,
    HORIZONTAL_ERROR, LATITUDE, LONGITUDE, PPS_PERIOD_ERROR, PPS_PULSES, RECEIVER_FAULT, RECEIVER_FAULTS,
    SATELLITES_USED, SENTENCE_ERRORS, SENTENCES_UNCHECKED, TIME_TO_FIX, VDOP, WEEK_ROLLOVERS,
};
use gnc_executive::quantity::Unit;
use gnc_metrology::stats::mean;
use gnc_nmea::{Epoch, Fix, SentenceFault};

use super::Heard;
use crate::procedure::ProcedureError;
use crate::recorder::Recorder;

/// WGS-84: semi-major axis and first eccentricity squared (NIMA TR8350.2, table 3.1).
const EARTH_RADIUS_M: f64 = 6_378_137.0;
const ECCENTRICITY_SQUARED: f64 = 6.694_379_990_14e-3;

/// Earlier than any run of this program. A receiver that counts its weeks wrongly is 19.6 years off.
const EARLIEST: NaiveDate = match NaiveDate::from_ymd_opt(2026, 1, 1) {
    Some(date) => date,
    None => NaiveDate::MIN,
};
/// The GPS week of the old navigation message counts to 1023 (IS-GPS-200, 20.3.3.3.1.1).
const WEEKS_DAYS: u64 = 1024 * 7;

pub(super) async fn file(
    heard: &Heard,
    restarted: bool,
    site: Option<&BenchSite>,
    recorder: &Recorder<'_>,
) -> Result<(), ProcedureError> {
    said(heard, recorder).await?;
    let Some(last) = heard.fixes.last() else {
        let satellites = heard.without_fix.as_ref().and_then(|epoch| epoch.satellites_used).unwrap_or(0);
        recorder.count(&SATELLITES_USED, satellites.into()).await?;
        return Ok(recorder.text(&FIX_TYPE, &without_fix(heard)).await?);
    };
    recorder.text(&FIX_TYPE, fix_type(&heard.fixes, heard.fixes_lost)).await?;
    // A broken sentence gives no date, but those of other epochs do.
    match newest(&heard.fixes, |epoch| epoch.date) {
        Some(date) => recorder.count(&WEEK_ROLLOVERS, week_rollovers(date)).await?,
        None => recorder.not_available(&WEEK_ROLLOVERS, "the receiver sends no date").await?,
    }
    match heard.time_to_fix_s.filter(|_| restarted) {
        Some(time_s) => recorder.number(&TIME_TO_FIX, time_s, Unit::Second).await?,
        None => recorder.not_available(&TIME_TO_FIX, "the receiver was not restarted").await?,
    }
    place(&heard.fixes, last, site.and_then(|site| site.place), recorder).await?;
    let or = async |measurement: &MeasurementSpec, value: Option<f64>, unit, why| match value {
        Some(value) => recorder.number(measurement, value, unit).await,
        None => recorder.not_available(measurement, why).await,
    };
    let speed_mps = average(&heard.fixes, |epoch| epoch.ground_speed_mps);
    or(&GROUND_SPEED, speed_mps, Unit::MetrePerSecond, "neither RMC nor VTG gives a speed").await?;
    let used = heard.fixes.iter().filter_map(|epoch| epoch.satellites_used).min();
    or(&SATELLITES_USED, used.map(f64::from), Unit::Count, "no sentence gives the number of satellites used").await?;
    let hdop = newest(&heard.fixes, |epoch| epoch.hdop);
    or(&HDOP, hdop, Unit::Count, "GGA, GNS and GSA do not give it").await?;
    let vdop = newest(&heard.fixes, |epoch| epoch.vdop);
    or(&VDOP, vdop, Unit::Count, "GSA does not give it").await?;
    if heard.pulses_ns.len() >= 2 {
        let error_us = heard.pulses_ns.windows(2).map(|pair| (pair[1].wrapping_sub(pair[0])) as f64 * 1e-3 - 1e6);
        let worst_us = error_us.map(f64::abs).fold(0.0, f64::max);
        recorder.number(&PPS_PERIOD_ERROR, worst_us, Unit::Microsecond).await?;
    } else {
        recorder.not_available(&PPS_PERIOD_ERROR, "fewer than two pulses came").await?;
    }
    board_clock(heard, recorder).await
}

/// The board's clock against the pulses. Later items take it for their sample clock.
async fn board_clock(heard: &Heard, recorder: &Recorder<'_>) -> Result<(), ProcedureError> {
    // If the fix came and went, the pulses are not a reference.
    let clock = if fix_type(&heard.fixes, heard.fixes_lost) == Fix::ThreeD.name() {
        BoardClock::of_pulses(&heard.pulses_ns)
    } else {
        Err("the receiver kept no 3D fix".into())
    };
    match clock {
        Ok(clock) => {
            let measured = vec![(BOARD_CLOCK_ERROR.name, clock.value(0.95))];
            Ok(recorder.found(Findings { measured, details: clock.details() }).await?)
        }
        Err(why) => Ok(recorder.not_available(&BOARD_CLOCK_ERROR, &why).await?),
    }
}

/// Files what is known of a receiver, with or without a fix.
async fn said(heard: &Heard, recorder: &Recorder<'_>) -> Result<(), ProcedureError> {
    let counts = heard.sentences.counts();
    recorder.count(&SENTENCE_ERRORS, counts.errors.into()).await?;
    recorder.count(&SENTENCES_UNCHECKED, counts.unchecked.into()).await?;
    recorder.count(&RECEIVER_FAULTS, counts.faults.into()).await?;
    let fault = heard.sentences.fault().map_or_else(|| "none".to_owned(), ToString::to_string);
    recorder.text(&RECEIVER_FAULT, &fault).await?;
    recorder.count(&FOREIGN_FRAMES, counts.foreign.into()).await?;
    if counts.foreign > 0 {
        recorder.note(&format!("the receiver sends frames of other protocols: {}", heard.sentences.foreign())).await?;
    }
    recorder.count(&EPOCHS_REPEATED, counts.repeated.into()).await?;
    Ok(recorder.count(&PPS_PULSES, heard.pulses_ns.len() as u64).await?)
}

/// Why there is no fix.
fn without_fix(heard: &Heard) -> String {
    let sentences = &heard.sentences;
    match (&heard.without_fix, sentences.fault(), sentences.foreign()) {
        // Impossible sentences give no epoch or a void one.
        (None, Some(fault), _) | (_, Some(fault @ SentenceFault::Void { .. }), _) => format!("none ({fault})"),
        (Some(epoch), ..) => epoch.fix.name().to_owned(),
        (None, None, foreign) if foreign.is_empty() => "none (no sentence heard)".to_owned(),
        (None, None, foreign) => format!("none (no sentence heard, but frames: {foreign})"),
    }
}

/// The worst epoch counts: an epoch without a fix in the window means no fix, and an epoch with unknown dimensions is
/// not a 3D fix. Epochs before the first GSA do not count: a GSA comes only with every few epochs.
fn fix_type(fixes: &[Epoch], lost: u32) -> &'static str {
    if lost > 0 {
        return "lost";
    }
    let told = fixes.iter().map(|epoch| epoch.fix).skip_while(|fix| *fix == Fix::DimensionsUnknown);
    let worst = |fix: &Fix| match fix {
        Fix::ThreeD => 2,
        Fix::DimensionsUnknown => 1,
        _ => 0,
    };
    told.min_by_key(worst).unwrap_or(Fix::DimensionsUnknown).name()
}

async fn place(
    fixes: &[Epoch],
    last: &Epoch,
    site: Option<SitePlace>,
    recorder: &Recorder<'_>,
) -> Result<(), ProcedureError> {
    // The average of 179.9 and -179.9 degrees is 180, not 0: so all differences are taken from the last longitude.
    let from_deg = last.longitude_deg.unwrap_or_default();
    let off_deg = average(fixes, |epoch| epoch.longitude_deg.map(|deg| short_way_deg(deg - from_deg)));
    let here = average(fixes, |epoch| epoch.latitude_deg).zip(off_deg.map(|off_deg| short_way_deg(from_deg + off_deg)));
    let height_m = average(fixes, |epoch| epoch.height_m);
    let no_height = match average(fixes, |epoch| epoch.altitude_m) {
        Some(_) => "the receiver sends no geoid separation, so the height above the ellipsoid is not known",
        None => "the receiver sends no height",
    };
    if let Some((latitude_deg, longitude_deg)) = here {
        recorder.number(&LATITUDE, latitude_deg, Unit::Degree).await?;
        recorder.number(&LONGITUDE, longitude_deg, Unit::Degree).await?;
    }
    match height_m {
        Some(height_m) => recorder.number(&HEIGHT, height_m, Unit::Metre).await?,
        None => recorder.not_available(&HEIGHT, no_height).await?,
    }
    let Some(site) = site else {
        let why = "the bench file has no surveyed place under [site]";
        recorder.not_available(&HORIZONTAL_ERROR, why).await?;
        return Ok(recorder.not_available(&HEIGHT_ERROR, why).await?);
    };
    if let Some((latitude_deg, longitude_deg)) = here {
        let horizontal_m = horizontal_distance_m(&site, latitude_deg, longitude_deg);
        recorder.number(&HORIZONTAL_ERROR, horizontal_m, Unit::Metre).await?;
    }
    match height_m {
        Some(height_m) => Ok(recorder.number(&HEIGHT_ERROR, (height_m - site.height_m).abs(), Unit::Metre).await?),
        None => Ok(recorder.not_available(&HEIGHT_ERROR, no_height).await?),
    }
}

/// The average over the epochs that have the value.
fn average(fixes: &[Epoch], pick: impl Fn(&Epoch) -> Option<f64>) -> Option<f64> {
    let told: Vec<f64> = fixes.iter().filter_map(pick).collect();
    (!told.is_empty()).then(|| mean(&told))
}

/// The value of the last epoch that has it.
fn newest<T>(fixes: &[Epoch], pick: impl Fn(&Epoch) -> Option<T>) -> Option<T> {
    fixes.iter().rev().find_map(pick)
}

/// The least number of turns of the 10-bit GPS week by which a date is too early: no module is tested before
/// [`EARLIEST`].
fn week_rollovers(date: NaiveDate) -> u64 {
    let early_days = EARLIEST.signed_duration_since(date).num_days();
    u64::try_from(early_days).unwrap_or(0).div_ceil(WEEKS_DAYS)
}

/// Distance on the ellipsoid, by its radii of curvature at the site. It is exact to a millimetre over a kilometre.
fn horizontal_distance_m(site: &SitePlace, latitude_deg: f64, longitude_deg: f64) -> f64 {
    let (sin, cos) = site.latitude_deg.to_radians().sin_cos();
    let w = (1.0 - ECCENTRICITY_SQUARED * sin * sin).sqrt();
    let prime_vertical_m = EARTH_RADIUS_M / w + site.height_m;
    let meridian_m = EARTH_RADIUS_M * (1.0 - ECCENTRICITY_SQUARED) / w.powi(3) + site.height_m;
    let north_m = (latitude_deg - site.latitude_deg).to_radians() * meridian_m;
    let east_deg = short_way_deg(longitude_deg - site.longitude_deg);
    let east_m = east_deg.to_radians() * prime_vertical_m * cos;
    north_m.hypot(east_m)
}

/// An angle taken the shorter way round, also across the date line: -180 to below 180 degrees.
fn short_way_deg(angle_deg: f64) -> f64 {
    (angle_deg + 180.0).rem_euclid(360.0) - 180.0
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 2019-04-07 began a week 0, and receivers built earlier said 1999-08-22.
    #[test]
    fn a_date_of_another_era_is_known() {
        let date = |year, month, day| NaiveDate::from_ymd_opt(year, month, day).unwrap();
        assert_eq!(week_rollovers(date(2026, 11, 22)), 0);
        assert_eq!(week_rollovers(date(2044, 12, 31)), 0);
        assert_eq!(week_rollovers(date(2026, 11, 22) - chrono::TimeDelta::days(7168)), 1);
        assert_eq!(week_rollovers(date(1999, 8, 22)), 2);
        assert_eq!(week_rollovers(date(2025, 12, 31)), 1);
    }

    /// The worst epoch counts; an epoch before the first GSA does not.
    #[test]
    fn the_worst_epoch_counts() {
        use Fix::{DimensionsUnknown, ThreeD, TwoD};
        let of = |fixes: &[Fix], lost| {
            let epochs: Vec<Epoch> = fixes.iter().map(|fix| Epoch { fix: *fix, ..Epoch::default() }).collect();
            fix_type(&epochs, lost)
        };
        assert_eq!(of(&[ThreeD, ThreeD], 0), "3D");
        assert_eq!(of(&[ThreeD, TwoD, DimensionsUnknown], 0), "2D");
        assert_eq!(of(&[DimensionsUnknown, DimensionsUnknown, ThreeD], 0), "3D");
        assert_eq!(of(&[DimensionsUnknown, ThreeD, DimensionsUnknown], 0), "dimensions unknown");
        assert_eq!(of(&[DimensionsUnknown; 2], 0), "dimensions unknown");
        assert_eq!(of(&[ThreeD, ThreeD], 1), "lost");
    }

    #[test]
    fn the_date_line_is_no_step() {
        assert_eq!(short_way_deg(-179.9 - 179.9).round(), 0.0);
        assert_eq!(short_way_deg(190.0), -170.0);
        let site = SitePlace { latitude_deg: 0.0, longitude_deg: 179.999_99, height_m: 0.0 };
        // 2e-5 deg on the equator are 2.2 m.
        let away_m = horizontal_distance_m(&site, 0.0, -179.999_99);
        assert!((away_m - 2.226).abs() < 0.01, "{away_m}");
    }
}
