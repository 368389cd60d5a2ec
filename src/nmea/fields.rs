//! Fields of a sentence.
//!
//! The crate reads fields itself. The crate `nmea` (0.8), which is the peer in the tests, refuses or mistakes what real
//! receivers send: sentences above 102 characters, GSA with an empty dilution or more than 18 satellites, GNS with more
//! than two mode letters, the second 60 and 24:00:00, the quality 9, half-empty places (`,S,,W`). It also takes 73
//! minutes, four digits of longitude and `nan` for numbers.

use chrono::NaiveDate;

use super::fault::SentenceFault;

const DAY_MS: u32 = 86_400_000;
/// Bound of all numbers. Real fields stay below it, and its square is still a number.
const IMPOSSIBLE: f64 = 1e9;
/// Characters that a fault quotes, since a field may be as long as a sentence.
const SHOWN: usize = 24;
/// Times of one epoch differ by less than this, since its sentences may differ in their decimals.
const SAME_MS: u32 = 10;

/// Time of day in UTC. A leap second comes after the last second of its day.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Time(u32);

impl Time {
    /// Whether both times belong to one epoch.
    pub(super) fn is(self, other: Self) -> bool {
        self.0.abs_diff(other.0) < SAME_MS
    }
}

/// The part of a field that a fault quotes.
fn shown(text: &str) -> String {
    text.chars().take(SHOWN).collect()
}

/// The fields of a sentence of one kind.
pub(super) struct Fields<'a> {
    pub(super) sentence: &'static str,
    fields: Vec<&'a str>,
}

impl<'a> Fields<'a> {
    /// Splits the fields after the address.
    ///
    /// # Errors
    /// There are fewer fields than needed.
    pub(super) fn new(sentence: &'static str, text: &'a str, needed: usize) -> Result<Self, SentenceFault> {
        let fields: Vec<&str> = text.split(',').map(str::trim).collect();
        if fields.len() < needed {
            return Err(SentenceFault::Short { sentence, fields: fields.len() });
        }
        Ok(Self { sentence, fields })
    }

    pub(super) fn len(&self) -> usize {
        self.fields.len()
    }

    /// A field; a missing field is empty.
    pub(super) fn get(&self, at: usize) -> &'a str {
        self.fields.get(at).copied().unwrap_or_default()
    }

    pub(super) fn letter(&self, at: usize) -> Option<char> {
        self.get(at).chars().next().map(|letter| letter.to_ascii_uppercase())
    }

    pub(super) fn wrong(&self, what: &'static str, text: &str) -> SentenceFault {
        SentenceFault::Number { sentence: self.sentence, what, text: shown(text) }
    }

    /// A number, which may be negative. `nan`, `inf` and exponents are not accepted.
    pub(super) fn number(&self, at: usize, what: &'static str) -> Result<Option<f64>, SentenceFault> {
        let text = self.get(at);
        if text.is_empty() {
            return Ok(None);
        }
        let written = text.bytes().all(|byte| byte.is_ascii_digit() || matches!(byte, b'.' | b'-' | b'+'));
        let number = text.parse::<f64>().ok().filter(|number| written && number.abs() < IMPOSSIBLE);
        number.map(Some).ok_or_else(|| self.wrong(what, text))
    }

    /// A number that must not be negative.
    pub(super) fn amount(&self, at: usize, what: &'static str) -> Result<Option<f64>, SentenceFault> {
        match self.number(at, what)? {
            Some(number) if number < 0.0 => Err(self.wrong(what, self.get(at))),
            amount => Ok(amount),
        }
    }

    pub(super) fn whole(&self, at: usize, what: &'static str) -> Result<Option<u32>, SentenceFault> {
        let text = self.get(at);
        if text.is_empty() {
            return Ok(None);
        }
        let digits = text.len() <= 6 && text.bytes().all(|byte| byte.is_ascii_digit());
        text.parse().ok().filter(|_| digits).map(Some).ok_or_else(|| self.wrong(what, text))
    }

    /// A length in metres. The field after it is the unit; another unit is an error.
    pub(super) fn metres(&self, at: usize, what: &'static str) -> Result<Option<f64>, SentenceFault> {
        let metres = self.number(at, what)?;
        match self.get(at + 1) {
            "" | "M" | "m" => Ok(metres),
            other if metres.is_some() => Err(self.wrong(what, other)),
            _ => Ok(None),
        }
    }

    /// `hhmmss` with any number of decimals. A receiver may send midnight as 24:00:00.
    pub(super) fn time(&self, at: usize) -> Result<Option<Time>, SentenceFault> {
        let text = self.get(at);
        if text.is_empty() {
            return Ok(None);
        }
        let wrong = || self.wrong("time", text);
        let (whole, decimals) = text.split_once('.').unwrap_or((text, ""));
        let digits = |text: &str| text.bytes().all(|byte| byte.is_ascii_digit());
        if whole.len() != 6 || !digits(whole) || !digits(decimals) || decimals.len() > 9 {
            return Err(wrong());
        }
        let number: u32 = whole.parse().map_err(|_| wrong())?;
        let (hour, minute, second) = (number / 10_000, number / 100 % 100, number % 100);
        let part: f64 = format!("0.{decimals}0").parse().map_err(|_| wrong())?;
        // Round down, so that 12.999 does not become the next second.
        let milliseconds = (part * 1000.0 + 1e-6) as u32;
        let time = (hour * 3600 + minute * 60 + second) * 1000 + milliseconds;
        match (hour, minute, second) {
            (24, 0, 0) => Ok(Some(Time(time - DAY_MS))),
            // Second 60 is a leap second, or a receiver that rounds.
            (0..=23, 0..=59, 0..=60) => Ok(Some(Time(time))),
            _ => Err(wrong()),
        }
    }

    /// `ddmmyy`: 83 to 99 lie in the nineties, as NMEA 0183 is from 1983. If all digits are zero, the date is not known
    /// yet.
    pub(super) fn date(&self, at: usize) -> Result<Option<NaiveDate>, SentenceFault> {
        let text = self.get(at);
        if text.is_empty() || text == "000000" {
            return Ok(None);
        }
        let number = text.parse::<u32>().ok().filter(|_| text.len() == 6 && text.bytes().all(|b| b.is_ascii_digit()));
        let date = number.and_then(|number| {
            let year = (number % 100) as i32;
            let year = if year >= 83 { 1900 + year } else { 2000 + year };
            NaiveDate::from_ymd_opt(year, number / 100 % 100, number / 10_000)
        });
        date.map(Some).ok_or_else(|| self.wrong("date", text))
    }

    /// Latitude and longitude in degrees, north and east positive, from four fields. `None` if either is empty.
    pub(super) fn place(&self, at: usize) -> Result<Option<(f64, f64)>, SentenceFault> {
        if self.get(at).is_empty() || self.get(at + 2).is_empty() {
            return Ok(None);
        }
        let latitude_deg = self.angle(at, "latitude", 4, 90, ['N', 'S'])?;
        let longitude_deg = self.angle(at + 2, "longitude", 5, 180, ['E', 'W'])?;
        Ok(Some((latitude_deg, longitude_deg)))
    }

    /// Degrees and minutes in one number, and the letter after it.
    fn angle(
        &self,
        at: usize,
        what: &'static str,
        needed: usize,
        most_deg: u32,
        [positive, negative]: [char; 2],
    ) -> Result<f64, SentenceFault> {
        let (sentence, text) = (self.sentence, self.get(at));
        if self.amount(at, what)?.is_none() || text.starts_with(['+', '-']) {
            return Err(self.wrong(what, text));
        }
        let digits = text.find('.').unwrap_or(text.len());
        if digits != needed {
            return Err(SentenceFault::Digits { sentence, what, text: shown(text), digits, needed });
        }
        // The text is split, since subtracting the degrees from one number loses digits of the minutes.
        let (degrees, minutes) = text.split_at(digits - 2);
        let minutes: f64 = minutes.parse().map_err(|_| self.wrong(what, text))?;
        if minutes >= 60.0 {
            return Err(SentenceFault::Minutes { sentence, what, text: shown(text) });
        }
        let degrees: f64 = degrees.parse().map_err(|_| self.wrong(what, text))?;
        let angle_deg = degrees + minutes / 60.0;
        if angle_deg > f64::from(most_deg) {
            return Err(SentenceFault::Beyond { sentence, what, text: shown(text), most_deg });
        }
        match self.letter(at + 1) {
            Some(letter) if letter == positive => Ok(angle_deg),
            Some(letter) if letter == negative => Ok(-angle_deg),
            _ => Err(SentenceFault::Hemisphere { sentence, what, text: shown(self.get(at + 1)) }),
        }
    }
}
