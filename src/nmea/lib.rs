//! Epochs of a receiver from whatever bytes it sends.
//!
//! Bytes become sentences and frames of other protocols (`framing`), sentences become solutions (`sentence`), and all
//! that is said of one time of day becomes an epoch (`epochs`). Where a receiver says GGA or GNS, that is its solution;
//! RMC alone, or GLL alone, is one of a receiver that says no more. The number of dimensions is what GSA says, carried over
//! for as many epochs as it usually takes to the next one; a receiver without GSA has a fix of unknown dimensions. What
//! cannot be is an error and never a number.
//!
//! The crate knows no line and no clock of the host: bytes go in, epochs and counts come out.

mod active;
mod epoch;
mod epochs;
mod fault;
mod fields;
mod framing;
mod listener;
mod protocols;
mod sentence;
#[cfg(test)]
mod tests;

pub use epoch::{Epoch, Fix};
pub use fault::SentenceFault;
pub use listener::{Counts, Sentences};
pub use protocols::Protocol;

/// Epochs with a fix after which a receiver that said no GSA says none.
pub const DIMENSIONS_AFTER: usize = active::CARRIED_EPOCHS as usize;
