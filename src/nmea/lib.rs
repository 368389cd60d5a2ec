//! Epochs of a receiver from whatever bytes it sends.
//!
//! Bytes become sentences and frames of other protocols (`framing`), sentences become solutions (`sentence`), and all
//! that is said of one time of day becomes an epoch (`epochs`). Where a receiver says GGA or GNS, that is its solution;
//! RMC alone, or GLL alone, is one of a receiver that says no more. The number of dimensions is what GSA says, carried over
//! for as many epochs as it usually takes to the next one; a receiver without GSA has a fix of unknown dimensions. What
//! cannot be is an error and never a number.

mod active;
mod epochs;
mod fault;
mod fields;
mod framing;
mod protocols;
mod sentence;
#[cfg(test)]
mod tests;

use chrono::NaiveDate;

use epochs::Epochs;
pub use fault::Fault;
use framing::{Framer, Piece};
pub use protocols::Protocol;

/// Epochs with a fix after which a receiver that said no GSA says none.
pub const DIMENSIONS_AFTER: usize = active::CARRIED_EPOCHS as usize;

/// What a position is made of.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Fix {
    /// Nothing.
    #[default]
    None,
    /// Dead reckoning, which is no fix.
    Estimated,
    /// A position that was typed in, which is no fix.
    Manual,
    /// A simulator within the receiver, which is no fix.
    Simulated,
    /// Satellites; no GSA tells with how many dimensions.
    DimensionsUnknown,
    /// Satellites, without height.
    TwoD,
    /// Satellites, with height.
    ThreeD,
}

impl Fix {
    /// As plans and screens call it.
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
    /// What it is made of.
    pub fix: Fix,
    /// North positive.
    pub latitude_deg: Option<f64>,
    /// East positive.
    pub longitude_deg: Option<f64>,
    /// Above mean sea level.
    pub altitude_m: Option<f64>,
    /// Above the WGS-84 ellipsoid: that above the sea and the geoid's, where the receiver says both.
    pub height_m: Option<f64>,
    /// Over ground.
    pub ground_speed_mps: Option<f64>,
    /// In the solution.
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

/// Finds sentences in bytes and epochs in sentences.
#[derive(Debug, Default)]
pub struct Sentences {
    framer: Framer,
    heard: Heard,
}

/// What came of the pieces so far.
#[derive(Debug, Default)]
struct Heard {
    epochs: Epochs,
    counts: Counts,
    fault: Option<Fault>,
    foreign: [u32; Protocol::ALL.len()],
}

/// What was heard beside the epochs.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Counts {
    /// Sentences with a wrong checksum, spoilt, or of which a field cannot be; and bytes that are nothing.
    pub errors: u32,
    /// Those of them with a right checksum: errors of the receiver.
    pub faults: u32,
    /// Epochs of the time of the one before: said again, or a clock that stands. They are none of their own.
    pub repeated: u32,
    /// Frames of other protocols.
    pub foreign: u32,
    /// Sentences of a receiver that says no checksums.
    pub unchecked: u32,
}

impl Sentences {
    /// Takes bytes as they come; gives the epochs that ended in them.
    pub fn push(&mut self, bytes: &[u8]) -> Vec<Epoch> {
        self.hear(|framer, found| framer.push(bytes, found))
    }

    /// No more bytes come: gives the epochs that ended in those that seemed to be under way. The last epoch did not end.
    pub fn finish(&mut self) -> Vec<Epoch> {
        self.hear(|framer, found| framer.finish(found))
    }

    fn hear(&mut self, listen: impl FnOnce(&mut Framer, &mut dyn FnMut(Piece<'_>))) -> Vec<Epoch> {
        let Self { framer, heard } = self;
        let mut ended = Vec::new();
        listen(framer, &mut |piece| ended.extend(heard.piece(&piece)));
        ended
    }

    /// What was heard beside the epochs.
    #[must_use]
    pub fn counts(&self) -> Counts {
        let (repeated, unchecked) = (self.heard.epochs.repeated(), self.framer.unchecked());
        Counts { repeated, unchecked, ..self.heard.counts }
    }

    /// The first error of the receiver itself.
    #[must_use]
    pub fn fault(&self) -> Option<&Fault> {
        self.heard.fault.as_ref()
    }

    /// The other protocols with the number of their frames, as `12 UBX, 3 RTCM 3`; empty for none.
    #[must_use]
    pub fn foreign(&self) -> String {
        let heard = Protocol::ALL.iter().zip(self.heard.foreign).filter(|(_, frames)| *frames > 0);
        heard.map(|(protocol, frames)| format!("{frames} {}", protocol.name())).collect::<Vec<_>>().join(", ")
    }
}

impl Heard {
    /// Takes a piece; gives the epoch that ended with it.
    fn piece(&mut self, piece: &Piece<'_>) -> Option<Epoch> {
        match piece {
            Piece::Sentence(body) => match sentence::read(body) {
                Ok(sentence) => match self.epochs.add(sentence?)? {
                    Ok(epoch) => return Some(epoch),
                    Err(fault) => {
                        self.faulty(fault);
                        return Some(Epoch::default());
                    }
                },
                Err(fault) => {
                    self.epochs.faulty(body);
                    self.faulty(fault);
                }
            },
            Piece::Foreign(protocol) => {
                self.counts.foreign = self.counts.foreign.saturating_add(1);
                let frames = &mut self.foreign[*protocol as usize];
                *frames = frames.saturating_add(1);
            }
            Piece::Broken => {
                self.counts.errors = self.counts.errors.saturating_add(1);
                self.epochs.broken();
            }
        }
        None
    }

    fn faulty(&mut self, fault: Fault) {
        self.counts.errors = self.counts.errors.saturating_add(1);
        self.counts.faults = self.counts.faults.saturating_add(1);
        self.fault.get_or_insert(fault);
    }
}
