//! The sentences that the crate uses: GGA, GNS, RMC, GLL, GSA, VTG, ZDA of any talker.

use chrono::NaiveDate;

use super::fault::SentenceFault;
use super::fields::{Fields, Time};

const KNOT_MPS: f64 = 1852.0 / 3600.0;
/// Satellites of GSA before version 2.3 of NMEA 0183, and of nearly all receivers since.
const GSA_SLOTS: usize = 12;

/// The kind of sentence that holds a solution, the fullest first.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Source {
    Gga,
    Gns,
    Rmc,
    Gll,
}

impl Source {
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Gga => "GGA",
            Self::Gns => "GNS",
            Self::Rmc => "RMC",
            Self::Gll => "GLL",
        }
    }
}

/// Where a solution comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Quality {
    /// There is no solution, or it is void.
    None,
    /// Satellites, with corrections or without.
    Satellites,
    /// Dead reckoning.
    Estimated,
    /// A position that was typed in.
    Manual,
    /// A simulator within the receiver.
    Simulated,
}

/// One solution as a sentence states it.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Solution {
    pub(super) source: Source,
    pub(super) talker: [u8; 2],
    pub(super) time: Option<Time>,
    pub(super) quality: Quality,
    /// Latitude and longitude, degrees.
    pub(super) place: Option<(f64, f64)>,
    pub(super) satellites: Option<u32>,
    pub(super) hdop: Option<f64>,
    /// Above mean sea level.
    pub(super) altitude_m: Option<f64>,
    /// Height of the geoid above the ellipsoid.
    pub(super) geoid_m: Option<f64>,
    pub(super) speed_mps: Option<f64>,
    pub(super) date: Option<NaiveDate>,
}

/// The satellites in use, of one system or of all.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Active {
    /// Talker, and the system if the sentence states it (version 4.11).
    pub(super) system: ([u8; 2], Option<u32>),
    /// 1 none, 2 or 3.
    pub(super) dimensions: u32,
    pub(super) satellites: Vec<u32>,
    pub(super) hdop: Option<f64>,
    pub(super) vdop: Option<f64>,
}

/// A sentence that the crate uses.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Sentence {
    Solution(Solution),
    Active(Active),
    /// Speed over ground, m/s; it belongs to the epoch under way.
    Speed(f64),
    /// Day with all digits of its year; it belongs to the epoch under way.
    Date(NaiveDate),
}

/// Reads the text between `$` and `*`. `None` if the crate does not use this sentence.
pub(super) fn read(body: &str) -> Result<Option<Sentence>, SentenceFault> {
    let (address, text) = body.split_once(',').unwrap_or((body, ""));
    let Ok([talker @ .., _, _, _]) = <&[u8; 5]>::try_from(address.as_bytes()) else { return Ok(None) };
    match &address[2..] {
        "GGA" => gga(*talker, text).map(Some),
        "GNS" => gns(*talker, text).map(Some),
        "RMC" => rmc(*talker, text).map(Some),
        "GLL" => gll(*talker, text).map(Some),
        "GSA" => gsa(*talker, text),
        "VTG" => vtg(text),
        "ZDA" => zda(text),
        _ => Ok(None),
    }
}

/// GGA: time, place, quality, satellites, dilution, altitude M, geoid M.
fn gga(talker: [u8; 2], text: &str) -> Result<Sentence, SentenceFault> {
    let fields = Fields::new("GGA", text, 6)?;
    let quality = match fields.whole(5, "quality")? {
        // 9 is a fix with corrections from satellites (NovAtel).
        Some(1..=5 | 9) => Quality::Satellites,
        Some(6) => Quality::Estimated,
        Some(7) => Quality::Manual,
        Some(8) => Quality::Simulated,
        _ => Quality::None,
    };
    Ok(Sentence::Solution(Solution {
        quality,
        place: place(&fields, 1, quality)?,
        satellites: fields.whole(6, "satellites")?,
        hdop: fields.amount(7, "HDOP")?,
        altitude_m: fields.metres(8, "altitude")?,
        geoid_m: fields.metres(10, "geoid separation")?,
        ..empty(Source::Gga, talker, fields.time(0)?)
    }))
}

/// GNS: time, place, a letter for each system, satellites, dilution, altitude, geoid.
fn gns(talker: [u8; 2], text: &str) -> Result<Sentence, SentenceFault> {
    let fields = Fields::new("GNS", text, 6)?;
    let quality = modes(fields.get(5));
    Ok(Sentence::Solution(Solution {
        quality,
        place: place(&fields, 1, quality)?,
        satellites: fields.whole(6, "satellites")?,
        hdop: fields.amount(7, "HDOP")?,
        altitude_m: fields.number(8, "altitude")?,
        geoid_m: fields.number(9, "geoid separation")?,
        ..empty(Source::Gns, talker, fields.time(0)?)
    }))
}

/// RMC: time, status, place, knots, course, date, variation, mode.
fn rmc(talker: [u8; 2], text: &str) -> Result<Sentence, SentenceFault> {
    let fields = Fields::new("RMC", text, 9)?;
    let quality = status(fields.letter(1), fields.get(11));
    Ok(Sentence::Solution(Solution {
        quality,
        place: place(&fields, 2, quality)?,
        speed_mps: fields.amount(6, "speed")?.map(|knots| knots * KNOT_MPS),
        date: told(fields.date(8), quality)?,
        ..empty(Source::Rmc, talker, fields.time(0)?)
    }))
}

/// GLL: place, time, status, mode.
fn gll(talker: [u8; 2], text: &str) -> Result<Sentence, SentenceFault> {
    let fields = Fields::new("GLL", text, 4)?;
    let quality = status(fields.letter(5), fields.get(6));
    Ok(Sentence::Solution(Solution {
        quality,
        place: place(&fields, 0, quality)?,
        ..empty(Source::Gll, talker, fields.time(4)?)
    }))
}

fn place(fields: &Fields<'_>, at: usize, quality: Quality) -> Result<Option<(f64, f64)>, SentenceFault> {
    told(fields.place(at), quality)
}

/// A field that is not checked without a fix: before its first fix a receiver may send any place and any date.
fn told<T>(field: Result<Option<T>, SentenceFault>, quality: Quality) -> Result<Option<T>, SentenceFault> {
    if quality == Quality::None { Ok(field.ok().flatten()) } else { field }
}

fn empty(source: Source, talker: [u8; 2], time: Option<Time>) -> Solution {
    Solution {
        source,
        talker,
        time,
        quality: Quality::None,
        place: None,
        satellites: None,
        hdop: None,
        altitude_m: None,
        geoid_m: None,
        speed_mps: None,
        date: None,
    }
}

/// GSA: selection, dimensions, satellites, three dilutions, and since version 4.11 the system.
fn gsa(talker: [u8; 2], text: &str) -> Result<Option<Sentence>, SentenceFault> {
    let fields = Fields::new("GSA", text, 2)?;
    let dimensions = match fields.whole(1, "dimensions")? {
        Some(dimensions @ 1..=3) => dimensions,
        None => return Ok(None),
        Some(_) => return Err(fields.wrong("dimensions", fields.get(1))),
    };
    // Some receivers list more than twelve satellites. A dilution has a decimal point, and the number of a system has
    // not.
    let (last, slots) = (fields.len() - 1, |others| fields.len().saturating_sub(others).max(GSA_SLOTS));
    let has_system = last == 17 || (last > 17 && !fields.get(last).is_empty() && !fields.get(last).contains('.'));
    let slots = if has_system { slots(6) } else { slots(5) };
    let satellites = (2..2 + slots).map(|at| fields.whole(at, "satellite"));
    let satellites = satellites.filter_map(Result::transpose).collect::<Result<Vec<u32>, SentenceFault>>()?;
    let dilution = |index: usize, what| fields.amount(2 + slots + index, what);
    dilution(0, "PDOP")?;
    Ok(Some(Sentence::Active(Active {
        // One digit; it is hexadecimal if there are more than ten systems.
        system: (talker, fields.letter(5 + slots).and_then(|digit| digit.to_digit(16))),
        dimensions,
        satellites: satellites.into_iter().filter(|number| *number > 0).collect(),
        hdop: dilution(1, "HDOP")?,
        vdop: dilution(2, "VDOP")?,
    })))
}

/// VTG: course T, course M, knots N, km/h K.
fn vtg(text: &str) -> Result<Option<Sentence>, SentenceFault> {
    let fields = Fields::new("VTG", text, 1)?;
    if fields.letter(5) != Some('N') {
        return Ok(None);
    }
    Ok(fields.amount(4, "speed")?.map(|knots| Sentence::Speed(knots * KNOT_MPS)))
}

/// ZDA: time, day, month, year.
fn zda(text: &str) -> Result<Option<Sentence>, SentenceFault> {
    let fields = Fields::new("ZDA", text, 1)?;
    let [day, month, year] = [(1, "day"), (2, "month"), (3, "year")].map(|(at, what)| fields.whole(at, what));
    let (Some(day), Some(month), Some(year)) = (day?, month?, year?) else { return Ok(None) };
    // A receiver that does not know the date yet sends zeros.
    let date = i32::try_from(year).ok().and_then(|year| NaiveDate::from_ymd_opt(year, month, day));
    Ok(date.map(Sentence::Date))
}

fn status(status: Option<char>, mode: &str) -> Quality {
    match status {
        // A valid status stays valid under a mode that no standard knows.
        Some('A' | 'D') => match modes(mode) {
            Quality::None if !mode.contains(['N', 'U']) => Quality::Satellites,
            quality => quality,
        },
        _ => Quality::None,
    }
}

/// Reads one letter, or one for each system: autonomous, differential, precise, RTK and its float, estimated, manual,
/// simulator.
fn modes(letters: &str) -> Quality {
    let any = |of: &[char]| letters.contains(of);
    if any(&['A', 'D', 'P', 'R', 'F']) {
        Quality::Satellites
    } else if any(&['E']) {
        Quality::Estimated
    } else if any(&['M']) {
        Quality::Manual
    } else if any(&['S']) {
        Quality::Simulated
    } else {
        Quality::None
    }
}
