//! Text for people. Every crate that shows text to people is built on this one.
//!
//! It knows nothing of tests, boards or records.

mod causes;
mod printable;

pub use causes::with_causes;
pub use printable::{printable, quoted, shortened};
