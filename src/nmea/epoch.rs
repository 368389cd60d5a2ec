//! One solution of the receiver, and where its position comes from.

use chrono::NaiveDate;

/// Where a position comes from.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Fix {
    /// There is no position.
    #[default]
    None,
    /// Dead reckoning. This is not a fix.
    Estimated,
    /// A position that was typed in. This is not a fix.
    Manual,
    /// A simulator within the receiver. This is not a fix.
    Simulated,
    /// Satellites; no GSA tells the number of dimensions.
    DimensionsUnknown,
    /// Satellites, without height.
    TwoD,
    /// Satellites, with height.
    ThreeD,
}

impl Fix {
    /// The name in plans and on screens.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::None => "none",
            Self::Estimated => "none (estimated)",
            Self::Manual => "none (entered by hand)",
            Self::Simulated => "none (simulated)",
            Self::DimensionsUnknown => "dimensions unknown",
            Self::TwoD => "2D",
            Self::ThreeD => "3D",
        }
    }

    /// Whether satellites give the position.
    #[must_use]
    pub fn is_fix(self) -> bool {
        matches!(self, Self::DimensionsUnknown | Self::TwoD | Self::ThreeD)
    }
}

/// One solution of the receiver.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Epoch {
    /// Where the position comes from.
    pub fix: Fix,
    /// North positive.
    pub latitude_deg: Option<f64>,
    /// East positive.
    pub longitude_deg: Option<f64>,
    /// Above mean sea level.
    pub altitude_m: Option<f64>,
    /// Above the WGS-84 ellipsoid: height above the sea plus height of the geoid, if the receiver sends both.
    pub height_m: Option<f64>,
    /// Over ground.
    pub ground_speed_mps: Option<f64>,
    /// Satellites in the solution.
    pub satellites_used: Option<u32>,
    /// Horizontal dilution of precision.
    pub hdop: Option<f64>,
    /// Vertical dilution of precision.
    pub vdop: Option<f64>,
    /// Day by the receiver's calendar.
    pub date: Option<NaiveDate>,
}

impl Epoch {
    /// Whether there is a position from satellites.
    #[must_use]
    pub fn has_fix(&self) -> bool {
        self.fix.is_fix() && self.latitude_deg.is_some() && self.longitude_deg.is_some()
    }
}
