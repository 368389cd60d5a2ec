//! Text for people. Every crate that shows text to people is built on this one.
//!
//! It knows nothing of tests, boards or records.

mod causes;
mod exact;
mod joined;
mod printable;

pub use causes::with_causes;
pub use exact::{exact, shown_path};
pub use printable::{is_hidden, printable, printable_lines, quoted, shortened};
