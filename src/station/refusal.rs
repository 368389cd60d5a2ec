//! Why nothing was done, for people.

use std::process::ExitCode;

use gnc_text::printable;

use crate::exit_code::USAGE;
use crate::locale::Environment;
use crate::phrases::in_language;

/// Why nothing was run.
#[derive(Debug)]
pub(crate) struct CommandRefusal {
    pub what: String,
    pub try_this: String,
}

impl CommandRefusal {
    pub(crate) fn new(what: impl std::fmt::Display, try_this: &str) -> Self {
        Self { what: what.to_string(), try_this: try_this.to_owned() }
    }
}

/// Says why nothing was done.
pub(crate) fn refuse(what: impl std::fmt::Display, try_this: &str) -> ExitCode {
    complain(what, try_this);
    ExitCode::from(USAGE)
}

/// An error for people, on standard error, in the language of the locale: what went wrong, and what can be tried.
pub(crate) fn complain(what: impl std::fmt::Display, try_this: &str) {
    use std::io::Write as _;
    let lang = Environment::read().language(None);
    let mut lines = format!("gnc-station: {what}");
    if !try_this.is_empty() {
        lines.push_str("\n  try: ");
        lines.push_str(try_this);
    }
    // A mistake in a file has several lines, each with a sentence of its own.
    for line in lines.lines() {
        // Ignore the error: without standard error there is no other place for the message.
        let _ = writeln!(std::io::stderr(), "{}", printable(&in_language(line, lang)));
    }
}
