//! Records: the journal of a run, its raw captures, digests and chain, and the report and the passport made of them.
//!
//! No other crate opens a file in the records folder. This one knows no board and no link: events and samples come in, files
//! go out, and files are read back.

pub mod passport;
pub mod raw;
pub mod report;
pub mod resume;
pub mod store;
