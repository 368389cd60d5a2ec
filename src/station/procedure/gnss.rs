//! The GNSS receiver: its raw sentences and 1PPS edges come through the board; they are read and weighed here.

use std::time::Duration;

use chrono::NaiveDate;
use gnc_executive::bench::{Site, SitePlace};
use gnc_executive::plan::Params;
use gnc_executive::quantity::Unit;
use gnc_protocol::message::{GnssRestart, GnssStart, StreamStart};
use gnc_protocol::stream::{PpsCapture, StreamId};
use gnc_protocol::wire::{Reader, Wire as _};
use tokio::time::Instant;

use super::{Bench, Report, Trouble};
use crate::board::stream::{Closed, Stream};
use crate::figures::Findings;
use crate::figures::clock::BoardClock;
use crate::nmea::{Epoch, Sentences};
use crate::statistics::mean;

/// WGS-84: semi-major axis and first eccentricity squared (NIMA TR8350.2, table 3.1).
const EARTH_RADIUS_M: f64 = 6_378_137.0;
const ECCENTRICITY_SQUARED: f64 = 6.694_379_990_14e-3;

/// Older than any run of this program; a receiver that counts its weeks wrongly is 19.6 years away.
const EARLIEST: NaiveDate = match NaiveDate::from_ymd_opt(2026, 1, 1) {
    Some(date) => date,
    None => NaiveDate::MIN,
};
/// The GPS week of the old navigation message counts to 1023 (IS-GPS-200, 20.3.3.3.1.1).
const WEEKS_DAYS: u64 = 1024 * 7;

/// A receiver's slowest pace.
const RECEIVER_SPEAKS_EVERY: Duration = Duration::from_secs(1);

pub(super) async fn run(bench: &Bench<'_>, params: &Params, report: &Report<'_>) -> Result<(), Trouble> {
    let window_s = params.quantity("window", Unit::Second)?;
    let timeout_s = params.quantity("timeout", Unit::Second)?;
    let restarted = match params.choice("start")? {
        "hot" => Some(GnssStart::Hot),
        "warm" => Some(GnssStart::Warm),
        "cold" => Some(GnssStart::Cold),
        _ => None,
    };
    let mut pulses = bench.board.listen(StreamId::Pps).await?;
    let mut bytes = bench.board.listen(StreamId::Gnss).await?;
    if let Some(start) = restarted {
        bench.board.call(&GnssRestart { start: start as u8 }).await?;
    }
    // Both at once, so that no time passes between them, also where simulated time does not wait.
    let [start_pulses, start_bytes] =
        [StreamId::Pps, StreamId::Gnss].map(|stream| StreamStart { stream: stream as u8, ..StreamStart::default() });
    tokio::try_join!(bench.board.call(&start_pulses), bench.board.call(&start_bytes))?;
    let asked = Instant::now();
    let heard = listen(&mut bytes, &mut pulses, window_s, timeout_s).await?;
    bench.board.spent(heard.listened + heard.waited(asked));
    let in_window = bytes.losses();
    let (bytes, pulses) = tokio::try_join!(bench.board.stop_stream(bytes), bench.board.stop_stream(pulses))?;
    // A receiver is not mute, and a pulse not missing, because the line lost what they said. Of a receiver with a fix
    // nothing is used that came behind the window.
    let said = if heard.fixes.is_empty() { bytes } else { Closed { losses: in_window, ..bytes } };
    for Closed { produced, losses } in [said, pulses] {
        if losses.any() {
            return Err(Trouble::SamplesLost { wanted: produced, losses });
        }
    }
    file(&heard, restarted.is_some(), bench.site, report).await
}

/// What came of the receiver.
#[derive(Debug, Default)]
struct Heard {
    /// From the first sentence to the first fix.
    time_to_fix_s: Option<f64>,
    /// Epochs since the fix.
    fixes: Vec<Epoch>,
    /// The last epoch without one.
    without_fix: Option<Epoch>,
    /// Epochs after the first fix that had none.
    fixes_lost: u32,
    sentence_errors: u32,
    epochs_repeated: u32,
    pulses_ns: Vec<u64>,
    /// When the first sentence came, by link time.
    first: Option<Instant>,
    /// Board time from the first sentence to the last.
    listened: Duration,
}

impl Heard {
    /// Board time from the start of the stream to the first sentence. No frame tells it, so it is link time at the
    /// pace at which board time passed after it; a receiver that runs speaks at least once a second.
    fn waited(&self, asked: Instant) -> Duration {
        let Some(first) = self.first else { return Duration::ZERO };
        let pace = self.listened.as_secs_f64() / first.elapsed().as_secs_f64().max(1e-6);
        let waited_s = (first - asked).as_secs_f64() * pace;
        Duration::from_secs_f64(waited_s).min(RECEIVER_SPEAKS_EVERY)
    }
}

/// Listens until the window after the fix is over, or the time for a fix is. Both go by the board's clock.
async fn listen(bytes: &mut Stream, pulses: &mut Stream, window_s: f64, timeout_s: f64) -> Result<Heard, Trouble> {
    let mut heard = Heard::default();
    let mut sentences = Sentences::default();
    let mut began_us = None;
    let mut fixed_us = None;
    let mut now_us = 0;
    loop {
        tokio::select! {
            // Pulses first: at full speed the simulated bench says seconds at once, and the window ends with the sentences.
            biased;
            frame = pulses.next() => {
                let Some(frame) = frame? else { continue };
                let mut reader = Reader::new(&frame.samples);
                for _ in 0..frame.head.count {
                    let capture = PpsCapture::get(&mut reader)
                        .map_err(|error| Trouble::Nonsense { what: "the PPS stream", why: error.to_string() })?;
                    heard.pulses_ns.push(capture.board_time_ns);
                }
            }
            frame = bytes.next() => match frame? {
                Some(frame) => {
                    now_us = frame.head.board_time_us;
                    began_us.get_or_insert(now_us);
                    heard.first.get_or_insert_with(Instant::now);
                    for epoch in sentences.push(&frame.samples) {
                        if epoch.has_fix() {
                            fixed_us.get_or_insert(now_us);
                            heard.fixes.push(epoch);
                        } else {
                            heard.fixes_lost += u32::from(fixed_us.is_some());
                            heard.without_fix = Some(epoch);
                        }
                    }
                }
                // The receiver is mute, while the board's clock goes on.
                None => {
                    now_us = bytes.board_time_us();
                    began_us.get_or_insert(now_us);
                }
            }
        }
        let Some(began_us) = began_us else { continue };
        let waited_s = |since: u64| now_us.saturating_sub(since) as f64 * 1e-6;
        heard.time_to_fix_s = fixed_us.map(|fixed: u64| fixed.saturating_sub(began_us) as f64 * 1e-6);
        if fixed_us.map_or(waited_s(began_us) > timeout_s, |fixed| waited_s(fixed) > window_s) {
            heard.sentence_errors = sentences.errors();
            heard.epochs_repeated = sentences.repeated();
            heard.listened = Duration::from_secs_f64(waited_s(began_us));
            return Ok(heard);
        }
    }
}

async fn file(heard: &Heard, restarted: bool, site: Option<&Site>, report: &Report<'_>) -> Result<(), Trouble> {
    report.count("sentence_errors", heard.sentence_errors.into()).await?;
    report.count("epochs_repeated", heard.epochs_repeated.into()).await?;
    report.count("pps_pulses", heard.pulses_ns.len() as u64).await?;
    let Some(last) = heard.fixes.last() else {
        let satellites = heard.without_fix.as_ref().and_then(|epoch| epoch.satellites_used).unwrap_or(0);
        report.count("satellites_used", satellites.into()).await?;
        let state = if heard.without_fix.is_some() { "none" } else { "none (no sentence heard)" };
        return report.text("fix_type", state).await;
    };
    // Of all epochs the worst counts: one without a fix in the window is none.
    let worst = heard.fixes.iter().map(|epoch| epoch.dimensions).min().unwrap_or(0);
    let state = if heard.fixes_lost > 0 { "lost".to_owned() } else { format!("{worst}D") };
    report.text("fix_type", &state).await?;
    // Of a broken sentence nothing is known, but those of other epochs say it too.
    match heard.fixes.iter().rev().find_map(|epoch| epoch.date) {
        Some(date) => report.count("week_rollovers", week_rollovers(date)).await?,
        None => report.not_available("week_rollovers", "the receiver says no date").await?,
    }
    match heard.time_to_fix_s.filter(|_| restarted) {
        Some(time_s) => report.number("time_to_fix", time_s, Unit::Second).await?,
        None => report.not_available("time_to_fix", "the receiver was not restarted").await?,
    }
    let average = |pick: &dyn Fn(&Epoch) -> Option<f64>| mean(&heard.fixes.iter().filter_map(pick).collect::<Vec<_>>());
    let latitude_deg = average(&|epoch| epoch.latitude_deg);
    // The average of 179.9 and -179.9 degrees is 180, not 0: all are counted from the last one.
    let from_deg = last.longitude_deg.unwrap_or(f64::NAN);
    let longitude_deg =
        short_way_deg(from_deg + average(&|epoch| epoch.longitude_deg.map(|deg| short_way_deg(deg - from_deg))));
    let height_m = average(&|epoch| epoch.height_m);
    report.number("latitude", latitude_deg, Unit::Degree).await?;
    report.number("longitude", longitude_deg, Unit::Degree).await?;
    report.number("height", height_m, Unit::Metre).await?;
    match site.and_then(|site| site.place) {
        Some(site) => {
            let horizontal_m = horizontal_distance_m(&site, latitude_deg, longitude_deg);
            report.number("horizontal_error", horizontal_m, Unit::Metre).await?;
            report.number("height_error", (height_m - site.height_m).abs(), Unit::Metre).await?;
        }
        None => {
            let why = "the bench file has no surveyed place under [site]";
            report.not_available("horizontal_error", why).await?;
            report.not_available("height_error", why).await?;
        }
    }
    report.number("ground_speed", average(&|epoch| epoch.ground_speed_mps), Unit::MetrePerSecond).await?;
    let used = heard.fixes.iter().filter_map(|epoch| epoch.satellites_used).min().unwrap_or(0);
    report.count("satellites_used", used.into()).await?;
    let dilution = |value: Option<f32>| value.map_or(f64::NAN, f64::from);
    report.number("hdop", dilution(last.hdop), Unit::Count).await?;
    report.number("vdop", dilution(last.vdop), Unit::Count).await?;
    if heard.pulses_ns.len() >= 2 {
        let error_us = heard.pulses_ns.windows(2).map(|pair| (pair[1].wrapping_sub(pair[0])) as f64 * 1e-3 - 1e6);
        let worst_us = error_us.map(f64::abs).fold(0.0, f64::max);
        report.number("pps_period_error", worst_us, Unit::Microsecond).await?;
    } else {
        report.not_available("pps_period_error", "fewer than two pulses came").await?;
    }
    // Of a receiver whose fix came and went the pulses are no reference.
    let clock = if worst == 3 && heard.fixes_lost == 0 {
        BoardClock::of_pulses(&heard.pulses_ns)
    } else {
        Err("the receiver kept no 3D fix".into())
    };
    match clock {
        Ok(clock) => {
            // Later items take it for their sample clock.
            let measured = vec![("board_clock_error".to_owned(), clock.value(0.95))];
            report.found(Findings { measured, details: clock.details() }).await
        }
        Err(why) => report.not_available("board_clock_error", &why).await,
    }
}

/// By how many turns of the 10-bit GPS week a date is too early, at least: no module is tested before [`EARLIEST`].
fn week_rollovers(date: NaiveDate) -> u64 {
    let early_days = EARLIEST.signed_duration_since(date).num_days();
    u64::try_from(early_days).unwrap_or(0).div_ceil(WEEKS_DAYS)
}

/// Distance on the ellipsoid, by its radii of curvature at the site: exact to a millimetre over a kilometre.
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

/// An angle as the shorter way round, also across the date line: -180 to below 180 degrees.
fn short_way_deg(angle_deg: f64) -> f64 {
    (angle_deg + 180.0).rem_euclid(360.0) - 180.0
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 2019-04-07 was a week 0, and receivers of before said 1999-08-22.
    #[test]
    fn a_date_of_another_era_is_known() {
        let date = |year, month, day| NaiveDate::from_ymd_opt(year, month, day).unwrap();
        assert_eq!(week_rollovers(date(2026, 11, 22)), 0);
        assert_eq!(week_rollovers(date(2044, 12, 31)), 0);
        assert_eq!(week_rollovers(date(2026, 11, 22) - chrono::TimeDelta::days(7168)), 1);
        assert_eq!(week_rollovers(date(1999, 8, 22)), 2);
        assert_eq!(week_rollovers(date(2025, 12, 31)), 1);
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
