//! NMEA 0183 sentences of a GPS receiver, with checksums.
//!
//! An epoch has RMC, VTG, GGA, GSA and as many GSV as the satellites in view need, talker GP, 5 Hz. Without a fix: RMC
//! with V, GGA with quality 0, GSA with fix 1, positions empty, dilutions 99.99, and the time empty until it is known.

use std::fmt::Write;

use super::sky::{Dilution, Satellite};

/// What a receiver knows at an epoch.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct ReceiverSolution {
    /// Latitude, north positive.
    pub latitude_deg: f64,
    /// Longitude, east positive.
    pub longitude_deg: f64,
    /// Height above mean sea level (ellipsoidal height less the geoid's).
    pub altitude_m: f64,
    /// Height of the geoid above the ellipsoid.
    pub geoid_m: f64,
    /// Velocity north.
    pub north_mps: f64,
    /// Velocity east.
    pub east_mps: f64,
    /// The geometry.
    pub dilution: Dilution,
}

/// One epoch of a receiver.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct ReceiverEpoch {
    /// UTC of the epoch in seconds since 1970, if the receiver knows the time.
    pub utc_s: Option<f64>,
    /// Its position, if it has a fix.
    pub solution: Option<ReceiverSolution>,
    /// Satellites in view, each with whether it is tracked.
    pub view: Vec<(Satellite, bool)>,
    /// PRN of the satellites used.
    pub used: Vec<u8>,
}

impl ReceiverEpoch {
    /// All sentences of the epoch.
    #[must_use]
    pub(crate) fn sentences(&self) -> String {
        let mut out = String::new();
        for body in [self.rmc(), self.vtg(), self.gga(), self.gsa()] {
            push(&mut out, &body);
        }
        for body in self.gsv() {
            push(&mut out, &body);
        }
        out
    }

    fn time(&self) -> String {
        self.utc_s.map_or_else(String::new, |utc_s| {
            let hundredths = (utc_s * 100.0).round().rem_euclid(8_640_000.0) as u32;
            let (h, m, s) = (hundredths / 360_000, hundredths / 6000 % 60, hundredths / 100 % 60);
            format!("{h:02}{m:02}{s:02}.{:02}", hundredths % 100)
        })
    }

    fn date(&self) -> String {
        self.utc_s.map_or_else(String::new, |utc_s| {
            let (year, month, day) = civil((utc_s / 86_400.0).floor() as i64);
            format!("{day:02}{month:02}{:02}", year.rem_euclid(100))
        })
    }

    fn position(&self) -> String {
        self.solution.map_or_else(
            || ",,,".to_owned(),
            |s| {
                let ns = if s.latitude_deg < 0.0 { 'S' } else { 'N' };
                let ew = if s.longitude_deg < 0.0 { 'W' } else { 'E' };
                format!("{},{ns},{},{ew}", angle(s.latitude_deg, 2), angle(s.longitude_deg, 3))
            },
        )
    }

    fn rmc(&self) -> String {
        let (time, date, position) = (self.time(), self.date(), self.position());
        match self.solution {
            Some(s) => format!("GPRMC,{time},A,{position},{:.3},{:.2},{date},,,A", s.knots(), s.course_deg()),
            None => format!("GPRMC,{time},V,{position},,,{date},,,N"),
        }
    }

    fn vtg(&self) -> String {
        match self.solution {
            Some(s) => {
                let (course, knots) = (s.course_deg(), s.knots());
                format!("GPVTG,{course:.2},T,,M,{knots:.3},N,{:.3},K,A", knots * 1.852)
            }
            None => "GPVTG,,,,,,,,,N".to_owned(),
        }
    }

    fn gga(&self) -> String {
        let (time, position) = (self.time(), self.position());
        match self.solution {
            Some(s) => {
                let (used, hdop) = (self.used.len().min(12), s.dilution.hdop);
                format!("GPGGA,{time},{position},1,{used:02},{hdop:.2},{:.1},M,{:.1},M,,", s.altitude_m, s.geoid_m)
            }
            None => format!("GPGGA,{time},{position},0,00,99.99,,,,,,"),
        }
    }

    fn gsa(&self) -> String {
        let mut body = format!("GPGSA,A,{}", if self.solution.is_some() { 3 } else { 1 });
        for slot in 0..12 {
            body.push(',');
            if let Some(prn) = self.used.get(slot) {
                let _ = write!(body, "{prn:02}");
            }
        }
        let unknown = Dilution { pdop: 99.99, hdop: 99.99, vdop: 99.99 };
        let dilution = self.solution.map_or(unknown, |s| s.dilution);
        let _ = write!(body, ",{:.2},{:.2},{:.2}", dilution.pdop, dilution.hdop, dilution.vdop);
        body
    }

    fn gsv(&self) -> Vec<String> {
        let total = self.view.len();
        if total == 0 {
            return vec!["GPGSV,1,1,00".to_owned()];
        }
        let messages = total.div_ceil(4);
        let group = |(index, satellites): (usize, &[(Satellite, bool)])| {
            let mut body = format!("GPGSV,{messages},{},{total:02}", index + 1);
            for (satellite, tracked) in satellites {
                let Satellite { prn, elevation_deg, azimuth_deg, cn0_dbhz } = satellite;
                let azimuth = azimuth_deg.round() as u32 % 360;
                let _ = write!(body, ",{prn:02},{elevation_deg:02.0},{azimuth:03},");
                if *tracked {
                    let _ = write!(body, "{cn0_dbhz:02.0}");
                }
            }
            body
        };
        self.view.chunks(4).enumerate().map(group).collect()
    }
}

impl ReceiverSolution {
    fn knots(&self) -> f64 {
        self.north_mps.hypot(self.east_mps) * 3600.0 / 1852.0
    }

    fn course_deg(&self) -> f64 {
        // 359.996 would be printed with two digits as 360.00, which is not a valid course.
        let course = self.east_mps.atan2(self.north_mps).to_degrees().rem_euclid(360.0);
        if course >= 359.995 { 0.0 } else { course }
    }
}

/// Degrees and minutes in one number, minutes with five digits (2 cm).
fn angle(degrees: f64, digits: usize) -> String {
    let units = (degrees.abs() * 60.0 * 1e5).round() as u64;
    let (whole, minutes) = (units / 6_000_000, units % 6_000_000);
    format!("{whole:0digits$}{:02}.{:05}", minutes / 100_000, minutes % 100_000)
}

fn push(out: &mut String, body: &str) {
    let checksum = body.bytes().fold(0, |sum, byte| sum ^ byte);
    // Writing into a text cannot fail.
    let _ = write!(out, "${body}*{checksum:02X}\r\n");
}

/// Year, month and day of a day counted from 1970-01-01 in the Gregorian calendar (Hinnant, `civil_from_days`).
#[must_use]
pub fn civil(days: i64) -> (i64, u32, u32) {
    let shifted = days + 719_468;
    let era = shifted.div_euclid(146_097);
    let day_of_era = shifted.rem_euclid(146_097);
    let year_of_era = (day_of_era - day_of_era / 1460 + day_of_era / 36_524 - day_of_era / 146_096) / 365;
    let day_of_year = day_of_era - (365 * year_of_era + year_of_era / 4 - year_of_era / 100);
    let month_shifted = (5 * day_of_year + 2) / 153;
    let day = (day_of_year - (153 * month_shifted + 2) / 5 + 1) as u32;
    let month = if month_shifted < 10 { month_shifted + 3 } else { month_shifted - 9 } as u32;
    (year_of_era + era * 400 + i64::from(month <= 2), month, day)
}
