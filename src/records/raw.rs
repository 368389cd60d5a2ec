//! Raw captures as MCAP: the samples of the sensors, readable for decades without this program.
//!
//! A file holds one attempt of an item. Messages are protobuf, each schema with its `FileDescriptorSet`
//! (`docs/raw.proto` has the same for people); times are the board's own clock in nanoseconds.
//!
//! | topic | message | one for each |
//! | --- | --- | --- |
//! | `/capture` | `gnc.CaptureMark` | begin and end of a capture: what it is of, and at its end what was lost where |
//! | `/imu` | `gnc.ImuSample` | sample: counts as they came; log time is its board time, sequence its number in the capture |
//! | `/compensated` | `gnc.CompensatedSample` | sample that the board compensated by the stored calibration |
//! | `/gnss` | `gnc.GnssBytes` | piece of the receiver's bytes |
//! | `/pps` | `gnc.PpsEdge` | edge of the 1PPS |
//!
//! A metadata record `gnc.run` before them names the run that the file is of ([`RawOrigin`]).
//!
//! Reading a file back gives the captures bit for bit.

mod budget;
mod ending;
mod mark;
mod origin;
mod proto;
mod reader;
mod sample;
mod schema;
mod writer;

pub(crate) use ending::{CutOff, Survey};
pub use origin::RawOrigin;
pub(crate) use reader::origin;
pub use reader::{RawError, RawRecord, Unfinished, read};
pub use writer::{Piece, RawWriter, pieces};

/// Numbers of the channels.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Topic {
    Capture = 1,
    Imu = 2,
    Gnss = 3,
    Pps = 4,
    Compensated = 5,
}

impl Topic {
    const ALL: [Topic; 5] = [Topic::Capture, Topic::Imu, Topic::Gnss, Topic::Pps, Topic::Compensated];

    fn name(self) -> &'static str {
        match self {
            Topic::Capture => "/capture",
            Topic::Imu => "/imu",
            Topic::Gnss => "/gnss",
            Topic::Pps => "/pps",
            Topic::Compensated => "/compensated",
        }
    }

    fn message(self) -> &'static str {
        match self {
            Topic::Capture => "gnc.CaptureMark",
            Topic::Imu => "gnc.ImuSample",
            Topic::Gnss => "gnc.GnssBytes",
            Topic::Pps => "gnc.PpsEdge",
            Topic::Compensated => "gnc.CompensatedSample",
        }
    }
}

#[cfg(test)]
mod tests;
