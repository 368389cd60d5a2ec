//! TOML files that people write: plans, bench files, personalities, budgets.
//!
//! A reader takes the keys of a table one by one and goes on after a mistake, so that the writer can mend ten mistakes
//! in one go. Each mistake has its line and column, and a hint if there is one. The crate knows no key and no unit of
//! any file, and never opens one.
//!
//! ```
//! use gnc_config::{SourceText, read};
//!
//! let source = SourceText { name: "oven.toml".to_owned(), text: "celsius = 400\ncolour = \"red\"\n".to_owned() };
//! let refused = read(&source, |table| table.number("celsius", (0.0, 300.0))).unwrap_err();
//! let places: Vec<usize> = refused.iter().filter_map(|mistake| Some(mistake.place.as_ref()?.line)).collect();
//! assert_eq!(places, [1, 2]);
//! ```

mod mistake;
mod suggest;
#[cfg(test)]
mod tests;
mod walk;

pub use mistake::{MAX_MISTAKES, Mistake, Mistakes, SourcePosition, SourceText};
pub use suggest::{did_you_mean, nearest};
pub use toml::de::DeValue as Value;
pub use walk::{Span, TomlEntry, TomlTable, Walk, parse, read};
