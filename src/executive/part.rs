//! Part numbers and revisions, as plans, labels and modules write them.

use std::fmt;

use gnc_text::printable;
use serde::{Deserialize, Serialize};

/// Bytes of a part number, and of a revision: a module cannot say longer ones (interface document, 0x0010).
pub(crate) const MAX_NAME_BYTES: usize = 32;

/// A part number, with its revision if that is known or wanted.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct PartName {
    /// The part number.
    pub number: String,
    /// The revision; `None`: any, or not known. A module without one says an empty text or "-".
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub revision: Option<String>,
}

impl PartName {
    /// A part number with its revision.
    pub fn new(number: &str, revision: Option<&str>) -> Self {
        Self { number: number.to_owned(), revision: revision.map(str::to_owned) }
    }

    /// Whether a module that says this of itself is the part that was asked for.
    pub fn is_asked_for_by(&self, asked: &PartName) -> bool {
        let revision = asked.revision.as_deref().map(revision_key);
        key(&self.number) == key(&asked.number)
            && revision.is_none_or(|revision| revision == revision_key(self.revision.as_deref().unwrap_or_default()))
    }

    /// Whether there is no part number, only blanks or a dash in its place.
    pub fn is_blank(&self) -> bool {
        matches!(key(&self.number).as_str(), "" | "-")
    }

    /// Whether a module that says this of itself says that it is another part than was asked for. Without a part number it
    /// says at most another revision.
    pub fn contradicts(&self, asked: &PartName) -> bool {
        if !self.is_blank() {
            return !self.is_asked_for_by(asked);
        }
        let said = self.revision.as_deref().map(revision_key).filter(|revision| !revision.is_empty());
        asked.revision.as_deref().map(revision_key).zip(said).is_some_and(|(asked, said)| asked != said)
    }

    /// What two names have in common if they mean the same.
    pub(crate) fn key(&self) -> PartKey {
        PartKey { number: key(&self.number), revision: self.revision.as_deref().map(revision_key) }
    }
}

/// "GNC-POP-26B rev C", "GNC-POP-26B without revision", or the number alone if the revision is any.
impl fmt::Display for PartName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let number = self.number.trim();
        f.write_str(if number.is_empty() { "without number" } else { "" })?;
        f.write_str(&printable(number))?;
        match self.revision.as_deref() {
            None => Ok(()),
            Some(revision) if revision_key(revision).is_empty() => f.write_str(" without revision"),
            Some(revision) => write!(f, " rev {}", printable(revision.trim())),
        }
    }
}

/// A part number and a revision without what labels and plans write differently.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub(crate) struct PartKey {
    /// The number.
    pub number: String,
    /// The revision; empty: none; `None`: any.
    pub revision: Option<String>,
}

/// A name without what labels write differently: large and small letters, and how many spaces stand where.
fn key(name: &str) -> String {
    name.split_whitespace().collect::<Vec<_>>().join(" ").to_uppercase()
}

/// The same for a revision. A dash stands for none.
fn revision_key(revision: &str) -> String {
    let key = key(revision);
    if key == "-" { String::new() } else { key }
}

/// Why no module or label can have a name, and what to write instead; `None` if one can.
pub fn unfit(name: &str) -> Option<(&'static str, &'static str)> {
    if name.contains('*') {
        return Some((
            "is a pattern",
            "name each part by itself; * stands for any letters only in names of measurements",
        ));
    }
    if name.chars().any(|character| matches!(character, '\u{3000}' | '\u{ff00}'..='\u{ffef}')) {
        return Some((
            "has wide letters",
            "type it again with an English keyboard: modules and labels have narrow letters",
        ));
    }
    if name.chars().any(char::is_control) {
        return Some(("has characters that are no letters", "type it again as it stands on the label"));
    }
    (name.trim().len() > MAX_NAME_BYTES).then_some(("is longer than the 32 bytes that a module can say", "shorten it"))
}

/// Which limits of a plan judge a module, and the module that decided it.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct LimitsChosen {
    /// The table of the plan whose limits count, as the plan writes it; null: those of the items alone.
    pub part: Option<PartName>,
    /// What the module says that it is, or what was asked for if it says nothing.
    pub module: PartName,
}

/// "part GNC-POP-26B rev C", or "of the plan (no table for part X rev C)".
impl fmt::Display for LimitsChosen {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.part {
            Some(part) => write!(f, "part {part}"),
            None => write!(f, "of the plan (it has none of its own for part {})", self.module),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn labels_write_the_same_part_in_several_ways() {
        let module = PartName::new("GNC-POP-26B", Some("C"));
        for (number, revision, same) in [
            ("GNC-POP-26B", None, true),
            (" gnc-pop-26b ", Some("c"), true),
            ("GNC-POP-26B", Some("D"), false),
            ("GNC-POP-26B", Some("-"), false),
            ("GNC-POP-26", None, false),
            ("GNC POP 26B", None, false),
        ] {
            assert_eq!(module.is_asked_for_by(&PartName::new(number, revision)), same, "{number} {revision:?}");
        }
        // A module without a revision says nothing, or a dash.
        for says in ["", "-", " - "] {
            let module = PartName::new("A/1.2  x", Some(says));
            assert!(module.is_asked_for_by(&PartName::new("a/1.2 X", Some("-"))), "{says}");
            assert_eq!(module.to_string(), "A/1.2  x without revision");
        }
    }

    /// A module whose memory was never written says blanks.
    #[test]
    fn a_module_without_a_number_contradicts_at_most_a_revision() {
        for (number, revision, asked, contradicts) in [
            ("", None, Some("C"), false),
            ("  ", Some(""), Some("C"), false),
            (" ", Some("-"), None, false),
            ("", Some("c"), Some("C"), false),
            ("", Some("D"), Some("C"), true),
            ("X", Some("C"), Some("C"), true),
            ("A", Some("C"), None, false),
        ] {
            let (module, asked) = (PartName::new(number, revision), PartName::new("A", asked));
            assert_eq!(module.contradicts(&asked), contradicts, "{module} {asked}");
            assert_eq!(module.is_blank(), number.trim().is_empty());
        }
    }

    #[test]
    fn names_that_no_module_can_have() {
        for name in ["GNC-*", "ＧＮＣ-1", "GNC\u{3000}1", "GNC\t1", &"x".repeat(33)] {
            assert!(unfit(name).is_some(), "{name}");
        }
        for name in ["GNC-POP-26B", "A/1.2 \"x\"", "БИНС-26", &"x".repeat(32)] {
            assert!(unfit(name).is_none(), "{name}");
        }
    }
}
