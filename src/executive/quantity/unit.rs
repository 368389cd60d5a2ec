//! The units and their exact sizes.

use std::f64::consts::PI;
use std::fmt;

use serde::{Deserialize, Deserializer, Serialize, Serializer, de};

use super::{Dimension, spelling};

/// A unit that plans and measurements may use.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[allow(missing_docs, reason = "each is its symbol in words")]
pub enum Unit {
    Count,
    Percent,
    PartsPerMillion,
    Nanosecond,
    Microsecond,
    Millisecond,
    Second,
    Minute,
    Hour,
    Hertz,
    Kilohertz,
    Megahertz,
    Microvolt,
    Millivolt,
    Volt,
    Milliampere,
    Ampere,
    Millimetre,
    Metre,
    Kilometre,
    MetrePerSecond,
    Degree,
    Radian,
    DegreePerSecond,
    MillidegreePerSecond,
    DegreePerHour,
    RadianPerSecond,
    Microgravity,
    Milligravity,
    Gravity,
    MetrePerSecondSquared,
    Gauss,
    Milligauss,
    Tesla,
    Millitesla,
    Microtesla,
    Nanotesla,
    DegreeCelsius,
    BitPerSecond,
    KilobitPerSecond,
    Byte,
    DegreePerSecondPerGravity,
    DegreePerHourPerGravity,
    DegreePerRootHour,
    DegreePerSecondPerRootHertz,
    MillidegreePerSecondPerRootHertz,
    DegreePerHourPerRootHertz,
    MetrePerSecondPerRootHour,
    MilligravityPerRootHertz,
    MicrogravityPerRootHertz,
}

/// Size of a unit in the SI unit of its dimension: `numerator / denominator`, times pi if `pi`.
struct Scale {
    numerator: u64,
    denominator: u64,
    pi: bool,
}

impl Unit {
    /// Every unit.
    pub(crate) const ALL: [Unit; 50] = [
        Unit::Count,
        Unit::Percent,
        Unit::PartsPerMillion,
        Unit::Nanosecond,
        Unit::Microsecond,
        Unit::Millisecond,
        Unit::Second,
        Unit::Minute,
        Unit::Hour,
        Unit::Hertz,
        Unit::Kilohertz,
        Unit::Megahertz,
        Unit::Microvolt,
        Unit::Millivolt,
        Unit::Volt,
        Unit::Milliampere,
        Unit::Ampere,
        Unit::Millimetre,
        Unit::Metre,
        Unit::Kilometre,
        Unit::MetrePerSecond,
        Unit::Degree,
        Unit::Radian,
        Unit::DegreePerSecond,
        Unit::MillidegreePerSecond,
        Unit::DegreePerHour,
        Unit::RadianPerSecond,
        Unit::Microgravity,
        Unit::Milligravity,
        Unit::Gravity,
        Unit::MetrePerSecondSquared,
        Unit::Gauss,
        Unit::Milligauss,
        Unit::Tesla,
        Unit::Millitesla,
        Unit::Microtesla,
        Unit::Nanotesla,
        Unit::DegreeCelsius,
        Unit::BitPerSecond,
        Unit::KilobitPerSecond,
        Unit::Byte,
        Unit::DegreePerSecondPerGravity,
        Unit::DegreePerHourPerGravity,
        Unit::DegreePerRootHour,
        Unit::DegreePerSecondPerRootHertz,
        Unit::MillidegreePerSecondPerRootHertz,
        Unit::DegreePerHourPerRootHertz,
        Unit::MetrePerSecondPerRootHour,
        Unit::MilligravityPerRootHertz,
        Unit::MicrogravityPerRootHertz,
    ];

    /// The symbol as plans write it; empty for a count.
    pub fn symbol(self) -> &'static str {
        self.table().0
    }

    /// The dimension that the unit measures.
    pub fn dimension(self) -> Dimension {
        self.table().1
    }

    /// Reads a unit as data sheets and loggers write it: `°/√h`, `µg/√Hz`, `m/s²`, `dps`, `[mg]`, `mGs`. Signs and
    /// letters that look alike count as the same. A text with an unknown word is not a unit. An empty text is a count.
    pub fn parse(text: &str) -> Option<Unit> {
        Unit::from_symbol(text.trim()).or_else(|| spelling::read(text))
    }

    /// The unit with exactly this symbol, as in records.
    pub(crate) fn from_symbol(symbol: &str) -> Option<Unit> {
        Unit::ALL.into_iter().find(|unit| unit.symbol() == symbol)
    }

    /// Converts a number from this unit to another; `None` if the other unit measures another dimension.
    pub fn convert(self, number: f64, to: Unit) -> Option<f64> {
        if self == to {
            return Some(number);
        }
        if self.dimension() != to.dimension() {
            return None;
        }
        let (from, to) = (self.scale(), to.scale());
        let up = u128::from(from.numerator) * u128::from(to.denominator);
        let down = u128::from(from.denominator) * u128::from(to.numerator);
        let common = gcd(up, down);
        // After reduction both are below 2^53 for every pair of the table, so both are exact. If one of them is 1, at
        // most one step rounds.
        let (up, down) = ((up / common) as f64, (down / common) as f64);
        let number = match (from.pi, to.pi) {
            (true, false) => number * PI,
            (false, true) => number / PI,
            _ => number,
        };
        Some(number * up / down)
    }

    /// A number of this unit in the SI unit of the dimension (degC for temperatures).
    pub(super) fn si(self, number: f64) -> f64 {
        let scale = self.scale();
        let number = number * scale.numerator as f64 / scale.denominator as f64;
        if scale.pi { number * PI } else { number }
    }

    fn scale(self) -> Scale {
        let (_, _, numerator, denominator, pi) = self.table();
        Scale { numerator, denominator, pi }
    }

    /// Symbol, dimension, size in SI (numerator, denominator, times pi).
    fn table(self) -> (&'static str, Dimension, u64, u64, bool) {
        match self {
            Unit::Count => ("", Dimension::Count, 1, 1, false),
            Unit::Percent => ("%", Dimension::Ratio, 1, 100, false),
            Unit::PartsPerMillion => ("ppm", Dimension::Ratio, 1, 1_000_000, false),
            Unit::Nanosecond => ("ns", Dimension::Time, 1, 1_000_000_000, false),
            Unit::Microsecond => ("us", Dimension::Time, 1, 1_000_000, false),
            Unit::Millisecond => ("ms", Dimension::Time, 1, 1000, false),
            Unit::Second => ("s", Dimension::Time, 1, 1, false),
            Unit::Minute => ("min", Dimension::Time, 60, 1, false),
            Unit::Hour => ("h", Dimension::Time, 3600, 1, false),
            Unit::Hertz => ("Hz", Dimension::Frequency, 1, 1, false),
            Unit::Kilohertz => ("kHz", Dimension::Frequency, 1000, 1, false),
            Unit::Megahertz => ("MHz", Dimension::Frequency, 1_000_000, 1, false),
            Unit::Microvolt => ("uV", Dimension::Voltage, 1, 1_000_000, false),
            Unit::Millivolt => ("mV", Dimension::Voltage, 1, 1000, false),
            Unit::Volt => ("V", Dimension::Voltage, 1, 1, false),
            Unit::Milliampere => ("mA", Dimension::Current, 1, 1000, false),
            Unit::Ampere => ("A", Dimension::Current, 1, 1, false),
            Unit::Millimetre => ("mm", Dimension::Length, 1, 1000, false),
            Unit::Metre => ("m", Dimension::Length, 1, 1, false),
            Unit::Kilometre => ("km", Dimension::Length, 1000, 1, false),
            Unit::MetrePerSecond => ("m/s", Dimension::Speed, 1, 1, false),
            Unit::Degree => ("deg", Dimension::Angle, 1, 180, true),
            Unit::Radian => ("rad", Dimension::Angle, 1, 1, false),
            Unit::DegreePerSecond => ("deg/s", Dimension::AngularRate, 1, 180, true),
            Unit::MillidegreePerSecond => ("mdeg/s", Dimension::AngularRate, 1, 180_000, true),
            Unit::DegreePerHour => ("deg/h", Dimension::AngularRate, 1, 180 * 3600, true),
            Unit::RadianPerSecond => ("rad/s", Dimension::AngularRate, 1, 1, false),
            // Standard gravity, exactly 9.80665 m/s^2 (3rd CGPM, 1901). Local gravity stands in the bench file.
            Unit::Gravity => ("g", Dimension::Acceleration, 980_665, 100_000, false),
            Unit::Milligravity => ("mg", Dimension::Acceleration, 980_665, 100_000_000, false),
            Unit::Microgravity => ("ug", Dimension::Acceleration, 980_665, 100_000_000_000, false),
            Unit::MetrePerSecondSquared => ("m/s^2", Dimension::Acceleration, 1, 1, false),
            Unit::Gauss => ("gauss", Dimension::MagneticField, 1, 10_000, false),
            Unit::Milligauss => ("mgauss", Dimension::MagneticField, 1, 10_000_000, false),
            Unit::Tesla => ("T", Dimension::MagneticField, 1, 1, false),
            Unit::Millitesla => ("mT", Dimension::MagneticField, 1, 1000, false),
            Unit::Microtesla => ("uT", Dimension::MagneticField, 1, 1_000_000, false),
            Unit::Nanotesla => ("nT", Dimension::MagneticField, 1, 1_000_000_000, false),
            Unit::DegreeCelsius => ("degC", Dimension::Temperature, 1, 1, false),
            Unit::BitPerSecond => ("bit/s", Dimension::BitRate, 1, 1, false),
            Unit::KilobitPerSecond => ("kbit/s", Dimension::BitRate, 1000, 1, false),
            Unit::Byte => ("bytes", Dimension::Data, 1, 1, false),
            Unit::DegreePerSecondPerGravity => ("deg/s/g", Dimension::GSensitivity, 100_000, 180 * 980_665, true),
            Unit::DegreePerHourPerGravity => ("deg/h/g", Dimension::GSensitivity, 100_000, 648_000 * 980_665, true),
            // The square root of an hour is the square root of 3600 s: 60.
            Unit::DegreePerRootHour => ("deg/sqrt(h)", Dimension::AngleRandomWalk, 1, 180 * 60, true),
            Unit::DegreePerSecondPerRootHertz => ("deg/s/sqrt(Hz)", Dimension::AngleRandomWalk, 1, 180, true),
            Unit::MillidegreePerSecondPerRootHertz => ("mdeg/s/sqrt(Hz)", Dimension::AngleRandomWalk, 1, 180_000, true),
            Unit::DegreePerHourPerRootHertz => ("deg/h/sqrt(Hz)", Dimension::AngleRandomWalk, 1, 180 * 3600, true),
            Unit::MetrePerSecondPerRootHour => ("m/s/sqrt(h)", Dimension::VelocityRandomWalk, 1, 60, false),
            Unit::MilligravityPerRootHertz => {
                ("mg/sqrt(Hz)", Dimension::VelocityRandomWalk, 980_665, 100_000_000, false)
            }
            Unit::MicrogravityPerRootHertz => {
                ("ug/sqrt(Hz)", Dimension::VelocityRandomWalk, 980_665, 100_000_000_000, false)
            }
        }
    }
}

impl fmt::Display for Unit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.symbol())
    }
}

impl Serialize for Unit {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self.symbol())
    }
}

impl<'de> Deserialize<'de> for Unit {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let symbol = String::deserialize(deserializer)?;
        Unit::from_symbol(&symbol).ok_or_else(|| de::Error::unknown_variant(&symbol, &["the symbol of a unit"]))
    }
}

fn gcd(mut a: u128, mut b: u128) -> u128 {
    while b != 0 {
        (a, b) = (b, a % b);
    }
    a
}
