//! CAN: frozen vectors, ISO-TP, slcan, streams as raw frames, both ends of the link.
#![allow(clippy::unwrap_used, clippy::panic, reason = "a helper of a test fails as the test does")]

mod endpoint;
mod isotp;
mod slcan;
mod stream;
mod vectors;
