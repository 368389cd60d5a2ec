//! Analysis of the samples of a module: captures of them, the motions that captures are made of, and the figures.
//!
//! The crate never does any I/O and never judges: samples go in, figures or a typed refusal come out, so that a run and
//! its recomputation years later give the same result. It knows no board, no turntable, no limit and no record.

pub mod capture;
pub mod details;
pub mod figures;
pub mod heat;
pub mod host_clock;
pub mod motion;
