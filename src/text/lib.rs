//! Text for people, below every crate that says something to them.
//!
//! It knows nothing of tests, boards or records.

mod causes;
mod printable;

pub use causes::with_causes;
pub use printable::{printable, quoted, shortened};
