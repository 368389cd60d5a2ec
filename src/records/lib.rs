//! Records: what a run leaves behind, and what can be made of it. No other crate touches the records folder.

pub mod passport;
pub mod raw;
pub mod report;
pub mod resume;
pub mod store;
