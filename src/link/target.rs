//! Where the slave board is.

use std::fmt;
use std::path::PathBuf;

use gnc_protocol::can::BIT_RATE;

use crate::can::CanTarget;
use crate::doubt::Doubt;
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

impl Target {
    /// Why the way to the board does not prove that a board is at its other end, by its name and before it is opened. An open
    /// link tells by itself: [`crate::Link::doubt`].
    #[must_use]
    pub fn doubt(&self) -> Option<Doubt> {
        match self {
            Self::Serial { port, .. } => Doubt::of_port(port),
            Self::Can(bus) => bus.doubt(),
            Self::Memory(_) => None,
        }
    }
}

impl fmt::Display for Target {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let kind = if matches!(self, Self::Can(_)) { "CAN " } else { "" };
        write!(f, "{kind}{} at {} bit/s", self.port(), self.rate_bps())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// RS-422 and an slcan adapter that a program plays.
    #[test]
    fn a_program_may_be_behind_a_pseudo_terminal() {
        let pty = nix::pty::openpty(None, None).expect("a pseudo-terminal");
        let port = nix::unistd::ttyname(&pty.slave).expect("its name");
        let doubt = Some(Doubt::PseudoTerminal(port.clone()));
        assert_eq!(Target::Can(CanTarget::Slcan(port.clone())).doubt(), doubt);
        assert_eq!(Target::Serial { port, rate_baud: 921_600 }.doubt(), doubt);
    }
}
