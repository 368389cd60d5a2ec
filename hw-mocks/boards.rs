//! The personalities that come with the library.

/// Name and text of every embedded personality, the good module first.
pub(crate) const BOARDS: &[(&str, &str)] = &[("good", include_str!("boards/good.toml"))];
