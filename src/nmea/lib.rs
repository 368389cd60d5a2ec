//! Makes epochs from the bytes of a receiver, whatever these bytes are.
//!
//! Bytes become sentences and frames of other protocols (`framing`). Sentences become solutions (`sentence`). All
//! solutions of one time of day become an epoch (`epochs`). If a receiver sends GGA or GNS, that is its solution; RMC
//! alone or GLL alone is a solution only if the receiver sends no fuller sentence. GSA gives the number of dimensions.
//! This number is carried over for as many epochs as it usually takes to the next GSA; a receiver without GSA has a fix
//! of unknown dimensions. An impossible value is an error and never a number.
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

/// The number of epochs with a fix after which a receiver without a GSA so far counts as one that sends no GSA.
pub const DIMENSIONS_AFTER: usize = active::CARRIED_EPOCHS as usize;
