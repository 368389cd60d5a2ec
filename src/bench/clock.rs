//! Whether the clock can be right: records are filed, found and trusted by their dates.
//!
//! A computer without a battery for its clock starts in 1970 or on the day of its firmware.

use chrono::{DateTime, FixedOffset, Local, NaiveDate, TimeDelta};
use gnc_executive::event::BuildInfo;

/// Two clocks that are right differ by less: they may stand in different time zones, and the one that dated the commit
/// may have been a little fast.
const TOLERANCE: TimeDelta = TimeDelta::days(1);
/// A program that does not know its commit is not older than this: the first one was written in this year.
const FIRST_YEAR: (i32, u32, u32) = (2026, 1, 1);

/// Why the clock is wrong.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum ClockError {
    /// The program did not exist yet.
    #[error("the clock says {}, but the sources of this program are of {}", .now.format("%F %T %:z"), .built.format("%F"))]
    BeforeBuild {
        /// What the clock says.
        now: DateTime<FixedOffset>,
        /// The day of the program's commit, or of the first program.
        built: NaiveDate,
    },
    /// A record was made later than now.
    #[error("the clock says {}, but there are records of {newest}", .now.format("%F %T %:z"))]
    BeforeRecords {
        /// What the clock says.
        now: DateTime<FixedOffset>,
        /// The newest day in the records folder.
        newest: NaiveDate,
    },
}

impl ClockError {
    /// What the operator can try.
    #[must_use]
    pub fn try_this(&self) -> &'static str {
        match self {
            Self::BeforeBuild { .. } => {
                "set the clock (sudo timedatectl set-ntp true), or say --clock-is-right if it is right"
            }
            Self::BeforeRecords { .. } => {
                "set the clock (sudo timedatectl set-ntp true); if it is right and that day's records have a wrong date, say --clock-is-right"
            }
        }
    }
}

/// What the clock says, in local time.
#[must_use]
pub fn now() -> DateTime<FixedOffset> {
    Local::now().fixed_offset()
}

/// Holds the clock against what cannot be later than now: the sources of this program, and the newest day that has
/// records.
///
/// # Errors
/// [`ClockError`].
pub fn check(
    now: DateTime<FixedOffset>,
    build: Option<&BuildInfo>,
    newest: Option<NaiveDate>,
) -> Result<(), ClockError> {
    let (year, month, day) = FIRST_YEAR;
    let first = NaiveDate::from_ymd_opt(year, month, day).unwrap_or_default();
    let (is_before, built) = match build {
        Some(build) => (build.committed - now > TOLERANCE, build.committed.date_naive()),
        None => (now.date_naive() < first, first),
    };
    if is_before {
        return Err(ClockError::BeforeBuild { now, built });
    }
    match newest {
        // Folders are named in local time, and the computer may have travelled.
        Some(newest) if newest - now.date_naive() > TOLERANCE => Err(ClockError::BeforeRecords { now, newest }),
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(text: &str) -> DateTime<FixedOffset> {
        DateTime::parse_from_rfc3339(text).unwrap()
    }

    fn build(committed: &str) -> BuildInfo {
        BuildInfo { commit: "0".repeat(40), committed: at(committed), modified: false }
    }

    fn day(text: &str) -> NaiveDate {
        text.parse().unwrap()
    }

    #[test]
    fn a_clock_before_the_commit_is_wrong() {
        let build = build("2026-11-28T12:00:00+08:00");
        let check = |now: &str| check(at(now), Some(&build), None);
        assert!(matches!(check("1970-01-01T00:00:30+00:00"), Err(ClockError::BeforeBuild { .. })));
        // A day of tolerance, whatever the time zones: 2026-11-27 04:00 in UTC.
        assert!(check("2026-11-27T03:59:59+00:00").is_err());
        assert_eq!(check("2026-11-27T04:00:00+00:00"), Ok(()));
        assert_eq!(check("2026-11-26T20:00:00-08:00"), Ok(()));
        assert_eq!(check("2036-11-28T12:00:00+08:00"), Ok(()));
        let said = check("1970-01-01T00:00:30+00:00").unwrap_err();
        assert_eq!(
            said.to_string(),
            "the clock says 1970-01-01 00:00:30 +00:00, but the sources of this program are of 2026-11-28"
        );
        assert!(said.try_this().contains("--clock-is-right"));
    }

    #[test]
    fn without_a_commit_the_first_year_counts() {
        assert!(check(at("2025-12-31T23:59:59+00:00"), None, None).is_err());
        assert_eq!(check(at("2026-01-01T00:00:00+00:00"), None, None), Ok(()));
    }

    #[test]
    fn a_clock_before_the_newest_record_is_wrong() {
        let now = at("2026-11-28T23:00:00+00:00");
        assert_eq!(check(now, None, Some(day("2026-11-29"))), Ok(()), "the record of another time zone");
        let error = check(now, None, Some(day("2026-11-30"))).unwrap_err();
        assert_eq!(error, ClockError::BeforeRecords { now, newest: day("2026-11-30") });
        assert!(error.try_this().contains("--clock-is-right"));
    }
}
