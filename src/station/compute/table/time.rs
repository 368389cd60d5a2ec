//! Columns of time, found by name. They hold numbers with a unit, or stamps of date and time of day.

use chrono::{DateTime, NaiveDateTime, NaiveTime, Timelike};

use super::names::{self, Header, Name};
use super::number::{self, Form};

/// How the time stamps of a column are written.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Stamps {
    /// Numbers of this unit, s.
    Numbers(f64),
    /// Numbers under a name that means seconds, unless a rate shows that the unit is another one.
    Seconds,
    /// Numbers whose unit the header does not name.
    Unknown,
    /// Dates in ISO 8601 or in a form that is as clear.
    Dates,
}

/// A column of time.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct TimeColumn {
    pub(super) place: usize,
    pub(super) name: String,
    pub(super) stamps: Stamps,
}

/// Names of a time in seconds, unless a unit says otherwise.
const IN_SECONDS: [&str; 4] = ["t", "time", "zeit", "temps"];
/// Beginnings of names of a time column whose unit must be given.
const BEGINNINGS: [&str; 10] =
    ["timestamp", "time_stamp", "time stamp", "datetime", "date_time", "date time", "epoch", "utc", "time", "zeit"];

/// Finds the column of time from the header and the first row; or says why there is none.
pub(super) fn column(header: &Header, first_row: &[String], form: Form) -> Result<TimeColumn, String> {
    let mut unread = None;
    // A column that names its unit is the better clock.
    let mut found: Vec<TimeColumn> = Vec::new();
    for (place, name) in header.names.iter().enumerate() {
        let Some((unit_s, seconds)) = named(&name.text, name.unit.as_deref()) else { continue };
        let first = first_row.get(place).map_or("", String::as_str);
        let stamps = match (number::read(first.as_bytes(), form), unit_s) {
            (Err(_), _) if date(first).is_some() => Stamps::Dates,
            (_, Some(unit_s)) => Stamps::Numbers(unit_s),
            (Ok(first), None) if epoch_unit(first).is_some() => Stamps::Numbers(epoch_unit(first).unwrap_or(1.0)),
            _ if seconds => Stamps::Seconds,
            (Ok(_), None) => Stamps::Unknown,
            _ => {
                unread =
                    Some(format!("`{first}` in column `{}` is neither a number nor a date in ISO 8601", name.text));
                continue;
            }
        };
        found.push(TimeColumn { place, name: name.text.clone(), stamps });
    }
    let best = found.iter().position(|c| c.stamps != Stamps::Unknown).unwrap_or(0);
    if found.is_empty() {
        return Err(unread.unwrap_or_else(|| "no time column".to_owned()));
    }
    Ok(found.swap_remove(best))
}

/// Whether a column is one of time by its name.
pub(super) fn is_time(name: &Name) -> bool {
    named(&name.text, name.unit.as_deref()).is_some()
}

/// Whether a name is that of a time: its unit in s, if it has one, and whether it means seconds without a unit.
fn named(text: &str, unit: Option<&str>) -> Option<(Option<f64>, bool)> {
    let whole = text.trim().to_lowercase();
    let (base, beside) = match whole.find(['[', '(']) {
        Some(at) => (whole[..at].trim_end().trim_end_matches('/').trim_end().to_owned(), true),
        None => (whole.split(" / ").next().unwrap_or("").trim().to_owned(), whole.contains(" / ")),
    };
    let unit_s = unit.map(self::unit_s);
    // A unit of another kind: `t [degC]` is a temperature.
    if (beside || unit.is_some()) && unit_s.flatten().is_none() && unit.is_some_and(|u| names::unit(u).is_some()) {
        return None;
    }
    if IN_SECONDS.contains(&base.as_str()) {
        return Some((unit_s.flatten(), unit.is_none()));
    }
    if let Some(rest) = ["t_", "t."].iter().find_map(|start| base.strip_prefix(start)) {
        return self::unit_s(rest).map(|s| (Some(s), false));
    }
    let rest = BEGINNINGS.iter().find_map(|start| base.strip_prefix(start))?;
    match rest.chars().next() {
        None => Some((unit_s.flatten(), false)),
        Some(c) if c.is_alphabetic() => None,
        Some(_) => {
            let last = rest.rsplit(|c: char| !c.is_alphanumeric() && c != 'µ' && c != 'μ').next().unwrap_or("");
            Some((unit_s.flatten().or(self::unit_s(last)), false))
        }
    }
}

/// Size of a unit of time, s.
pub(super) fn unit_s(text: &str) -> Option<f64> {
    Some(match text.trim().to_lowercase().as_str() {
        "s" | "sec" | "secs" | "second" | "seconds" | "sek" | "с" => 1.0,
        "ms" | "msec" | "msecs" | "millis" | "millisecond" | "milliseconds" | "мс" => 1e-3,
        "us" | "µs" | "μs" | "usec" | "usecs" | "micros" | "microsecond" | "microseconds" | "мкс" => 1e-6,
        "ns" | "nsec" | "nsecs" | "nanos" | "nanosecond" | "nanoseconds" | "нс" => 1e-9,
        "min" | "minute" | "minutes" => 60.0,
        "h" | "hour" | "hours" => 3600.0,
        _ => return None,
    })
}

/// The unit of a time since 1970. For the years 2001 to 2286 the size of the number shows the unit.
fn epoch_unit(first: f64) -> Option<f64> {
    [1.0, 1e-3, 1e-6, 1e-9].into_iter().find(|unit| (1e9..1e10).contains(&(first * unit)))
}

/// The unit among s, ms, us and ns in which the steps fit a rate, if there is one.
pub(super) fn unit_for_rate(step: f64, rate_hz: f64) -> Option<f64> {
    [1.0, 1e-3, 1e-6, 1e-9].into_iter().find(|unit| (0.8..1.25).contains(&(step * unit * rate_hz)))
}

/// Reads a time stamp as text, s since 1970 or since midnight.
pub(super) fn date(text: &str) -> Option<f64> {
    let text = text.trim();
    let seconds = |whole: i64, nanos: u32| whole as f64 + f64::from(nanos) * 1e-9;
    if let Ok(stamp) = DateTime::parse_from_rfc3339(&plain(text)) {
        return Some(seconds(stamp.timestamp(), stamp.timestamp_subsec_nanos()));
    }
    let text = plain(text);
    for form in ["%Y-%m-%dT%H:%M:%S%.f", "%Y/%m/%dT%H:%M:%S%.f", "%d.%m.%YT%H:%M:%S%.f", "%Y%m%dT%H%M%S%.f"] {
        if let Ok(stamp) = NaiveDateTime::parse_from_str(&text, form) {
            return Some(seconds(stamp.and_utc().timestamp(), stamp.and_utc().timestamp_subsec_nanos()));
        }
    }
    if let Ok(stamp) = DateTime::parse_from_str(&text, "%Y-%m-%dT%H:%M:%S%.f%z") {
        return Some(seconds(stamp.timestamp(), stamp.timestamp_subsec_nanos()));
    }
    let stamp = NaiveTime::parse_from_str(&text, "%H:%M:%S%.f").ok()?;
    Some(seconds(i64::from(stamp.num_seconds_from_midnight()), stamp.nanosecond()))
}

/// The text with `T` between date and time, and a point before the decimals.
fn plain(text: &str) -> String {
    text.replacen(' ', "T", 1).replace(',', ".")
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::super::number::Decimal;
    use super::*;

    #[track_caller]
    fn stamps(name: &str, first: &str) -> Option<Stamps> {
        let header = Header::new(Path::new("r"), 1, vec![name.to_owned(), "w".to_owned()], None).unwrap();
        column(&header, &[first.to_owned(), "1".to_owned()], Form::Known(Decimal::Point)).ok().map(|c| c.stamps)
    }

    #[test]
    fn columns_of_time_in_every_dress() {
        let check = |name: &str, unit_s: f64| assert_eq!(stamps(name, "0.5"), Some(Stamps::Numbers(unit_s)), "{name}");
        for name in ["t", "T", "time", "Time"] {
            assert_eq!(stamps(name, "0.5"), Some(Stamps::Seconds), "{name}");
        }
        for name in ["t_s", "TIME_S", "Time [s]", "time (sec)", "t / s", "timestamp_s", "Zeit [s]"] {
            check(name, 1.0);
        }
        for name in ["time_ms", "Time [ms]", "timestamp (ms)", "t_ms"] {
            check(name, 1e-3);
        }
        for name in ["t_us", "time_us", "Timestamp [µs]", "time_usec"] {
            check(name, 1e-6);
        }
        check("timestamp_ns", 1e-9);
        for name in ["timestamp", "epoch", "datetime", "timestamp_host"] {
            assert_eq!(stamps(name, "10"), Some(Stamps::Unknown), "{name}");
        }
        assert_eq!(stamps("timestamp", "1732838400000"), Some(Stamps::Numbers(1e-3)));
        assert_eq!(stamps("epoch", "1732838400.25"), Some(Stamps::Numbers(1.0)));
        for name in ["n", "index", "number", "sample", "temperature", "timer", "T [degC]", "tx", "seq"] {
            assert_eq!(stamps(name, "1"), None, "{name}");
        }
        assert_eq!(stamps("timestamp", "2024-05-01T10:00:00.5Z"), Some(Stamps::Dates));
        assert_eq!(stamps("timestamp", "Wednesday"), None);
    }

    #[test]
    fn dates() {
        let base = 1_714_557_600.0;
        for (text, expected) in [
            ("2024-05-01T10:00:00Z", base),
            ("2024-05-01T12:00:00.25+02:00", base + 0.25),
            ("2024-05-01 10:00:00,125", base + 0.125),
            ("2024-05-01T10:00:00.125+0000", base + 0.125),
            ("01.05.2024 10:00:00.5", base + 0.5),
            ("2024/05/01 10:00:00", base),
            ("00:01:00.5", 60.5),
        ] {
            assert_eq!(date(text), Some(expected), "{text}");
        }
        for text in ["", "05/01/2024 10:00", "1.5", "10:00"] {
            assert_eq!(date(text), None, "{text}");
        }
    }
}
