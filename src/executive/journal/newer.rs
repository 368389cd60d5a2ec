//! Content that a later version of the station may have written, as opposed to damage.

use std::fmt;

use gnc_text::printable;
use serde_json::Value;

use crate::event::{EventKind, SELECTION_SCHEMA};

/// The beginning of serde's message about an unknown name of an enum.
const UNKNOWN_NAME: &str = "unknown variant `";

/// Something in a journal that this version of the station does not know. The texts are from outside.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Unknown {
    /// The first event names a later schema.
    Schema(String),
    /// A kind of event.
    Event(String),
    /// A value in an event of a known kind.
    Value {
        /// The value.
        value: String,
        /// The kind of event.
        event: String,
    },
}

impl fmt::Display for Unknown {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Schema(schema) => write!(f, "schema `{}`", printable(schema)),
            Self::Event(event) => write!(f, "event `{}`", printable(event)),
            Self::Value { value, event } => {
                write!(f, "value `{}` in event `{}`", printable(value), printable(event))
            }
        }
    }
}

/// A schema with a higher number than the highest of this version; `None` if this version has it, or the station never
/// had it.
pub(super) fn schema(schema: &str) -> Option<Unknown> {
    let (ours, version) = SELECTION_SCHEMA.rsplit_once('/')?;
    let later: u32 = schema.strip_prefix(ours)?.strip_prefix('/')?.parse().ok()?;
    (later > version.parse().ok()?).then(|| Unknown::Schema(schema.to_owned()))
}

/// The content that this version does not know in a line that it cannot read; `None` if the line is damaged.
///
/// The line must be whole and have the parts of every event: the number that is due, both times and a kind.
pub(super) fn unknown(line: &[u8], error: &serde_json::Error, due_seq: u64) -> Option<Unknown> {
    let event: Value = serde_json::from_slice(line).ok()?;
    let is_event = event["seq"] == due_seq && event["at"].is_string() && event["elapsed_us"].is_u64();
    let kind = event["kind"].as_str().filter(|_| is_event)?;
    if let Some(later) = event["header"]["schema"].as_str().and_then(schema) {
        return Some(later);
    }
    if !EventKind::NAMES.contains(&kind) {
        return Some(Unknown::Event(kind.to_owned()));
    }
    let told = error.to_string();
    let (value, _) = told.strip_prefix(UNKNOWN_NAME)?.split_once('`')?;
    Some(Unknown::Value { value: value.to_owned(), event: kind.to_owned() })
}
