//! Where the slave board is.

use std::fmt;
use std::path::PathBuf;

use gnc_protocol::can::BIT_RATE;

use crate::can::CanTarget;
use crate::memory::MemoryPort;

/// Which link reaches the board, and where it is.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Target {
    /// RS-422.
    Serial {
        /// The port.
        port: PathBuf,
        /// Its rate.
        rate_baud: u32,
    },
    /// CAN.
    Can(CanTarget),
    /// RS-422 by a cable in this program's memory; a bench file cannot name it.
    Memory(MemoryPort),
}

impl Target {
    /// The port or bus, as a bench file names it.
    #[must_use]
    pub fn port(&self) -> String {
        match self {
            Self::Serial { port, .. } => port.display().to_string(),
            Self::Memory(port) => port.to_string(),
            Self::Can(bus) => bus.to_string(),
        }
    }

    /// Bit rate of its line in bits per second.
    #[must_use]
    pub fn rate_bps(&self) -> u32 {
        match self {
            Self::Serial { rate_baud, .. } => *rate_baud,
            Self::Memory(port) => port.rate_baud(),
            Self::Can(_) => BIT_RATE,
        }
    }
}

impl fmt::Display for Target {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let kind = if matches!(self, Self::Can(_)) { "CAN " } else { "" };
        write!(f, "{kind}{} at {} bit/s", self.port(), self.rate_bps())
    }
}
