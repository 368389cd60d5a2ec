//! Records: the journal of a run, its raw captures, digests and chain, and the report and passport made from them.
//!
//! No other crate opens a file in the records folder. This crate knows no board and no link: it takes events and
//! samples, writes files, and reads files back.

pub mod junit;
pub mod passport;
pub mod raw;
pub mod report;
pub mod resume;
pub mod reuse;
pub mod shift;
pub mod standing;
pub mod store;
