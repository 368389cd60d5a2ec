//! Plans that a bench file pins by their digests: a bench runs these texts and no others under these names.
//!
//! A plan with a loosened limit keeps its name and its version. Its digest changes.

use std::collections::BTreeMap;
use std::fmt;

use gnc_config::TomlTable;
use gnc_text::{printable, quoted};

use crate::plan::Plan;

/// What stands before the digits.
const SCHEME: &str = "sha256:";
/// Digits of a SHA-256.
const DIGITS: usize = 64;
/// Largest number of pinned plans: more than a station has.
const MAX_PLANS: usize = 256;
/// Digits of a digest in a sentence: two of 48 bits do not come alike by chance.
const SHOWN_DIGITS: usize = 12;

/// The digests of plans by the plans' names; empty if the bench runs any plan.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct PinnedPlans(BTreeMap<String, String>);

/// Why a bench does not run a plan.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum PinError {
    /// The texts are others than those that were pinned.
    #[error(
        "the bench file pins plan {} to {pinned}, and this one has {found}: its text or that of a file that it includes was changed",
        printable(plan)
    )]
    Changed {
        /// Name of the plan.
        plan: String,
        /// The digest of the bench file.
        pinned: ShortDigest,
        /// The digest of the plan.
        found: ShortDigest,
    },
    /// The bench file pins others.
    #[error("the bench file pins the plans of this bench, and plan {} is none of them ({found})", printable(plan))]
    NotPinned {
        /// Name of the plan.
        plan: String,
        /// The digest of the plan.
        found: ShortDigest,
    },
    /// The bench file pins others than the plan requires: a pass by any text under that name would do.
    #[error(
        "plan {} requires a pass of {}, and the bench file pins plans but not that one",
        printable(plan),
        printable(required)
    )]
    RequiredNotPinned {
        /// Name of the plan.
        plan: String,
        /// Name of the plan that it requires.
        required: String,
    },
}

impl PinError {
    /// What the operator can try.
    pub fn try_this(&self) -> &'static str {
        match self {
            Self::Changed { .. } => {
                "bring back the plan as it was released; if the new text is released, `gnc-station plan check --sim` prints the line for [plans]"
            }
            Self::NotPinned { .. } => {
                "run a plan of this bench; if this one is released, `gnc-station plan check --sim` prints the line for [plans]"
            }
            Self::RequiredNotPinned { .. } => {
                "pin the required plan too: `gnc-station plan check --sim` prints its line for [plans]"
            }
        }
    }
}

/// The first digits of a digest.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ShortDigest(String);

impl ShortDigest {
    /// The first digits of a digest in hexadecimal digits.
    pub fn of(sha256: &str) -> Self {
        Self(sha256.chars().take(SHOWN_DIGITS).collect())
    }
}

impl fmt::Display for ShortDigest {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&printable(&self.0))
    }
}

impl PinnedPlans {
    /// Whether the bench runs any plan.
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// How many plans are pinned.
    pub fn len(&self) -> usize {
        self.0.len()
    }

    /// The digest of the plan with this name.
    pub fn of(&self, plan: &str) -> Option<&str> {
        self.0.get(plan).map(String::as_str)
    }

    /// Whether the bench runs the plan with this digest. Where plans are pinned, each plan that it requires is, too.
    ///
    /// # Errors
    /// [`PinError`]: it runs others.
    pub fn check(&self, plan: &Plan, sha256: &str) -> Result<(), PinError> {
        self.check_text(&plan.name, sha256)?;
        let open = plan.requires_plan.iter().find(|required| !self.is_empty() && self.of(required).is_none());
        open.map_or(Ok(()), |required| {
            Err(PinError::RequiredNotPinned { plan: plan.name.clone(), required: required.clone() })
        })
    }

    fn check_text(&self, plan: &str, sha256: &str) -> Result<(), PinError> {
        let (name, found) = (|| plan.to_owned(), || ShortDigest::of(sha256));
        match self.of(plan) {
            Some(pinned) if pinned == sha256 => Ok(()),
            Some(pinned) => Err(PinError::Changed { plan: name(), pinned: ShortDigest::of(pinned), found: found() }),
            None if self.is_empty() => Ok(()),
            None => Err(PinError::NotPinned { plan: name(), found: found() }),
        }
    }

    /// The line for the table of a bench file.
    pub fn line(plan: &str, sha256: &str) -> String {
        // A name of a plan has no sign that a basic text of TOML could not hold as JSON writes it.
        let is_bare = |byte: u8| byte.is_ascii_alphanumeric() || matches!(byte, b'-' | b'_');
        match plan.bytes().all(is_bare) {
            true => format!("{plan} = \"{SCHEME}{sha256}\""),
            false => format!("{} = \"{SCHEME}{sha256}\"", serde_json::Value::from(plan)),
        }
    }
}

/// Reads the table [plans].
pub(super) fn plans(root: &TomlTable<'_, '_>) -> PinnedPlans {
    let mut pinned = BTreeMap::new();
    let Some(table) = root.table("plans") else { return PinnedPlans::default() };
    let entries = table.entries();
    if entries.is_empty() {
        // It reads as if something were pinned.
        table.mistake("the table [plans] is empty", "write a line of `gnc-station plan check` into it, or remove it");
    }
    for entry in entries {
        if pinned.len() == MAX_PLANS {
            entry.key_mistake(format!("more than {MAX_PLANS} plans are pinned"), "remove some of them");
            break;
        }
        let Some(text) = entry.text() else { continue };
        let digits = text.strip_prefix(SCHEME).unwrap_or_default();
        let is_digit = |byte: u8| byte.is_ascii_digit() || (b'a'..=b'f').contains(&byte);
        if digits.len() == DIGITS && digits.bytes().all(is_digit) {
            pinned.insert(entry.key().to_owned(), digits.to_owned());
        } else {
            entry.mistake(
                format!("{} is no digest of a plan", quoted(text)),
                "`gnc-station plan check --sim` prints the line: sha256: and 64 hexadecimal digits in small letters",
            );
        }
    }
    PinnedPlans(pinned)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bench::BenchFile;

    const STATION: &str = "[station]\nid = \"line-2\"\n";

    fn file(plans: &str) -> Result<PinnedPlans, String> {
        let text = format!("{plans}{STATION}");
        BenchFile::read("bench.toml", text.into_bytes()).map(|file| file.plans).map_err(|mistakes| mistakes.to_string())
    }

    fn check(pinned: &PinnedPlans, plan: &str, digit: &str) -> Result<(), PinError> {
        pinned.check_text(plan, &digit.repeat(64))
    }

    #[test]
    fn a_pinned_plan_is_its_text_and_not_its_name() {
        let pinned = file(&format!("plans = {{ acceptance = \"sha256:{}\" }}\n", "a".repeat(64))).unwrap();
        assert_eq!(check(&pinned, "acceptance", "a"), Ok(()));
        let loosened = check(&pinned, "acceptance", "b").unwrap_err();
        insta::assert_snapshot!(loosened, @"the bench file pins plan acceptance to aaaaaaaaaaaa, and this one has bbbbbbbbbbbb: its text or that of a file that it includes was changed");
        // An added plan is as good as a loosened one, and a name in other letters is another name.
        for name in ["functional", "Acceptance"] {
            assert!(matches!(check(&pinned, name, "a"), Err(PinError::NotPinned { .. })), "{name}");
        }
        let added = check(&pinned, "functional", "a").unwrap_err();
        insta::assert_snapshot!(added, @"the bench file pins the plans of this bench, and plan functional is none of them (aaaaaaaaaaaa)");
        assert_eq!(check(&PinnedPlans::default(), "acceptance", "b"), Ok(()), "nothing is pinned");
        assert_eq!(file(""), Ok(PinnedPlans::default()));
    }

    /// A plan without a pin passes with any text.
    #[test]
    fn a_plan_that_a_pinned_one_requires_is_pinned_too() {
        let requires = |plans: &str| {
            let text = format!(
                "name = \"final\"\nversion = \"1\"\nrequires_plan = [{plans}]\n[[item]]\nid = \"cpu\"\nlimits.core1_register_errors = \"<= 0\"\n"
            );
            Plan::read("plan.toml", text.into_bytes(), &mut |_| Err(String::new())).unwrap()
        };
        let sha256 = "a".repeat(64);
        let both =
            file(&format!("plans = {{ final = \"sha256:{sha256}\", incoming = \"sha256:{sha256}\" }}\n")).unwrap();
        let alone = file(&format!("plans = {{ final = \"sha256:{sha256}\" }}\n")).unwrap();
        assert_eq!(both.check(&requires("\"incoming\""), &sha256), Ok(()));
        assert_eq!(alone.check(&requires(""), &sha256), Ok(()));
        for pinned in [&both, &alone] {
            let open = pinned.check(&requires("\"incoming\", \"burn-in\""), &sha256).unwrap_err();
            assert!(matches!(open, PinError::RequiredNotPinned { .. }), "{open}");
        }
        let open = alone.check(&requires("\"incoming\""), &sha256).unwrap_err();
        insta::assert_snapshot!(open, @"plan final requires a pass of incoming, and the bench file pins plans but not that one");
        assert_eq!(PinnedPlans::default().check(&requires("\"incoming\""), &sha256), Ok(()), "nothing is pinned");
    }

    #[test]
    fn the_line_of_a_plan_pins_it() {
        for name in ["acceptance", "cold-1", "приёмка 2", "a.b", "with \"quotes\""] {
            let pinned = file(&format!("[plans]\n{}\n", PinnedPlans::line(name, &"c".repeat(64)))).unwrap();
            assert_eq!(check(&pinned, name, "c"), Ok(()), "{name}");
        }
    }

    #[test]
    fn what_is_no_digest_is_a_mistake() {
        let refused = |plans: &str| file(plans).unwrap_err();
        let short = format!("sha256:{}", "a".repeat(63));
        let capital = format!("sha256:{}", "A".repeat(64));
        for digest in [short.as_str(), capital.as_str(), "", &"a".repeat(64), "md5:00"] {
            let told = refused(&format!("[plans]\nacceptance = \"{digest}\"\n"));
            assert!(told.contains("is no digest of a plan"), "{told}");
        }
        assert!(refused("[plans]\n").contains("the table [plans] is empty"));
        assert!(refused("[plans]\nacceptance = 1\n").contains("acceptance"));
        assert!(refused("plan = { acceptance = \"a\" }\n").contains("plans"), "did you mean");
    }
}
