//! Epochs of a receiver from whatever bytes it sends.
//!
//! Each sentence is parsed by itself: nothing of an older one is carried over, and an implausible one counts as an
//! error. An epoch is what GGA, GSA and RMC of the same time say together.

use chrono::{NaiveDate, NaiveTime};
use nmea::ParseResult;
use nmea::sentences::gsa::GsaMode2;
use nmea::sentences::{FixType, GgaData, GsaData, RmcData};

/// Longest sentence: 82 characters by NMEA 0183, and room for receivers that exceed it.
const MAX_SENTENCE: usize = 128;
const KNOT_MPS: f64 = 1852.0 / 3600.0;

/// One solution of the receiver.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Epoch {
    /// 0 none, 2 or 3.
    pub dimensions: u8,
    /// North positive.
    pub latitude_deg: Option<f64>,
    /// East positive.
    pub longitude_deg: Option<f64>,
    /// Above the WGS-84 ellipsoid.
    pub height_m: Option<f64>,
    /// Over ground.
    pub ground_speed_mps: Option<f64>,
    /// In the solution.
    pub satellites_used: Option<u32>,
    /// Horizontal dilution of precision.
    pub hdop: Option<f32>,
    /// Vertical dilution of precision.
    pub vdop: Option<f32>,
    /// Day by the receiver's calendar.
    pub date: Option<NaiveDate>,
}

impl Epoch {
    /// Whether there is a position.
    #[must_use]
    pub fn has_fix(&self) -> bool {
        self.dimensions > 0 && self.latitude_deg.is_some() && self.longitude_deg.is_some()
    }
}

/// Finds sentences in bytes and epochs in sentences.
#[derive(Debug, Default)]
pub struct Sentences {
    line: Vec<u8>,
    synchronised: bool,
    errors: u32,
    repeated: u32,
    time: Option<NaiveTime>,
    /// Of the last epoch that ended.
    last_time: Option<NaiveTime>,
    gga: Option<GgaData>,
    gsa: Option<GsaData>,
    rmc: Option<RmcData>,
}

impl Sentences {
    /// Takes bytes as they come; gives the epochs that ended in them.
    pub fn push(&mut self, bytes: &[u8]) -> Vec<Epoch> {
        let mut epochs = Vec::new();
        for &byte in bytes {
            if byte == b'\n' {
                let line = std::mem::take(&mut self.line);
                // What was under way when listening began is no error.
                if std::mem::replace(&mut self.synchronised, true) {
                    self.sentence(&line, &mut epochs);
                }
            } else if self.line.len() < MAX_SENTENCE {
                self.line.push(byte);
            } else if self.synchronised {
                self.errors += 1;
                self.synchronised = false;
            }
        }
        epochs
    }

    /// Sentences with a wrong checksum, broken or implausible.
    #[must_use]
    pub fn errors(&self) -> u32 {
        self.errors
    }

    /// Epochs of the time of the one before: said again, or a clock that stands. They are none of their own.
    #[must_use]
    pub fn repeated(&self) -> u32 {
        self.repeated
    }

    fn sentence(&mut self, line: &[u8], epochs: &mut Vec<Epoch>) {
        let line = line.strip_suffix(b"\r").unwrap_or(line);
        if line.is_empty() {
            return;
        }
        let Ok(text) = std::str::from_utf8(line) else {
            self.errors += 1;
            return;
        };
        match nmea::parse_str(text) {
            Ok(sentence) if !plausible(&sentence) => self.errors += 1,
            Ok(ParseResult::GGA(gga)) => {
                let again = self.gga.is_some();
                epochs.extend(self.close_unless(gga.fix_time, again));
                self.gga = Some(gga);
            }
            Ok(ParseResult::RMC(rmc)) => {
                let again = self.rmc.is_some();
                epochs.extend(self.close_unless(rmc.fix_time, again));
                self.rmc = Some(rmc);
            }
            // Without a time of its own it belongs to the epoch that is open.
            Ok(ParseResult::GSA(gsa)) => self.gsa = Some(gsa),
            Ok(_) | Err(nmea::Error::DisabledSentence | nmea::Error::Unsupported(_)) => {}
            // The parser refuses some sentences that receivers do send (GSV without satellites); those of which
            // nothing is used must only have a good checksum.
            Err(nmea::Error::ParsingError(_)) if !used(text) => {}
            Err(_) => self.errors += 1,
        }
    }

    /// A sentence of another time, or of a kind that is there already, begins the next epoch. Receivers differ in
    /// which one they send first.
    fn close_unless(&mut self, time: Option<NaiveTime>, again: bool) -> Option<Epoch> {
        let same = self.time == time && !again;
        self.time = time;
        if same { None } else { self.close() }
    }

    fn close(&mut self) -> Option<Epoch> {
        let (gsa, rmc) = (self.gsa.take(), self.rmc.take());
        let gga = self.gga.take()?;
        let last = std::mem::replace(&mut self.last_time, gga.fix_time);
        if gga.fix_time.is_some() && last == gga.fix_time {
            self.repeated += 1;
            return None;
        }
        let fixed = !matches!(gga.fix_type, None | Some(FixType::Invalid | FixType::Estimated | FixType::Simulation));
        let dimensions = match gsa.as_ref().map(|gsa| &gsa.mode2) {
            Some(GsaMode2::Fix3D) if fixed => 3,
            Some(GsaMode2::Fix2D) if fixed => 2,
            _ => 0,
        };
        let height_m = gga.altitude.map(f64::from).zip(gga.geoid_separation.map(f64::from));
        Some(Epoch {
            dimensions,
            latitude_deg: gga.latitude,
            longitude_deg: gga.longitude,
            height_m: height_m.map(|(above_sea, geoid)| above_sea + geoid),
            date: rmc.as_ref().and_then(|rmc| rmc.fix_date),
            ground_speed_mps: rmc.and_then(|rmc| rmc.speed_over_ground).map(|knots| f64::from(knots) * KNOT_MPS),
            satellites_used: gga.fix_satellites,
            hdop: gga.hdop,
            vdop: gsa.and_then(|gsa| gsa.vdop),
        })
    }
}

/// Whether anything of a sentence of this kind is used.
fn used(sentence: &str) -> bool {
    sentence.get(3..6).is_some_and(|kind| matches!(kind, "GGA" | "GSA" | "RMC"))
}

/// The parser takes any number for a latitude, and for any other number also what is none.
fn plausible(sentence: &ParseResult) -> bool {
    // Dilutions and speeds have no sign.
    let amount = |number: Option<f32>| number.is_none_or(|number| number.is_finite() && number >= 0.0);
    match sentence {
        ParseResult::GGA(gga) => {
            let finite = |number: Option<f32>| number.is_none_or(f32::is_finite);
            gga.latitude.is_none_or(|latitude| latitude.abs() <= 90.0)
                && gga.longitude.is_none_or(|longitude| longitude.abs() <= 180.0)
                && finite(gga.altitude)
                && finite(gga.geoid_separation)
                && amount(gga.hdop)
        }
        ParseResult::GSA(gsa) => amount(gsa.vdop),
        ParseResult::RMC(rmc) => amount(rmc.speed_over_ground),
        _ => true,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A sentence with its checksum.
    fn sentence(body: &str) -> String {
        let sum = body.bytes().fold(0, |sum, byte| sum ^ byte);
        format!("${body}*{sum:02X}\r\n")
    }

    fn heard(bodies: &[&str]) -> (Vec<Epoch>, u32) {
        let mut sentences = Sentences::default();
        let text: String = bodies.iter().map(|body| sentence(body)).collect();
        let epochs = sentences.push(format!("\n{text}").as_bytes());
        (epochs, sentences.errors())
    }

    /// The parser takes `nan` for a height and `-inf` for a speed, and so did the epoch.
    #[test]
    fn a_number_that_is_none_is_an_error() {
        let gga = |hdop: &str, altitude: &str, geoid: &str| {
            format!("GPGGA,120000.00,3413.92,N,10854.92,E,1,08,{hdop},{altitude},M,{geoid},M,,")
        };
        let next = "GPGGA,120001.00,3413.92,N,10854.92,E,1,08,1.0,400.0,M,12.0,M,,";
        let good = gga("1.0", "400.0", "12.0");
        assert_eq!(heard(&[&good, next]).0[0].height_m, Some(412.0));
        for bad in [
            gga("nan", "400.0", "12.0"),
            gga("-1.0", "400.0", "12.0"),
            gga("1.0", "nan", "12.0"),
            gga("1.0", "400.0", "-inf"),
            gga("1.0", "1e39", "12.0"),
        ] {
            assert_eq!(heard(&[&bad, next]), (Vec::new(), 1), "{bad}");
        }
        for bad in ["GPRMC,120000.00,A,3413.92,N,10854.92,E,-inf,,010124,,,A", "GPGSA,A,3,1,2,3,4,,,,,,,,,1.8,1.1,nan"]
        {
            let (epochs, errors) = heard(&[&good, bad, next]);
            assert_eq!((epochs.len(), errors), (1, 1), "{bad}");
            assert_eq!((epochs[0].ground_speed_mps, epochs[0].vdop), (None, None), "{bad}");
        }
    }
}
