//! Numbers beside the serial number, which a plan or a bench file asks for: of an order, of sub-units, of anything else.
//!
//! ```toml
//! [numbers.order]
//! kind = "order"                     # stays until it is changed; "subunit": is in one module only; else for each module
//! label = "Order"                    # or { en = "Order", zh = "订单", ru = "Заказ" }
//! pattern = "PO-[0-9]{4}"            # a regular expression that the whole number matches
//! required = true                    # no run begins without it
//! ```

use std::fmt;

use gnc_config::{TomlTable, did_you_mean};
use gnc_text::{printable, quoted};
use serde::{Deserialize, Serialize};

use crate::serial_number::{SerialNumberPattern, pattern};

/// Most numbers that one file asks for: they must fit on a screen.
const MAX_FIELDS: usize = 8;
/// Characters of a key and of a label: they stand beside the number.
const KEY_CHARACTERS: usize = 24;
/// Characters of a number, as of serial numbers.
pub const NUMBER_CHARACTERS: usize = 64;

/// What a number belongs to.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum NumberKind {
    /// To an order or a batch of many modules.
    Order,
    /// To a part that is built into one module.
    Subunit,
    /// To the module.
    #[default]
    Free,
}

/// A number that is asked for.
#[derive(Clone, Debug, PartialEq)]
pub struct NumberField {
    /// Its name in records and on the command line.
    pub key: String,
    /// What it belongs to.
    pub kind: NumberKind,
    /// Its name for people.
    pub label: NumberLabel,
    /// What the whole number must match.
    pub pattern: Option<SerialNumberPattern>,
    /// Whether no run begins without it.
    pub required: bool,
}

/// The name of a number for people, in the languages of the screen.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct NumberLabel {
    /// English; also the name in records.
    pub en: String,
    /// Chinese.
    pub zh: String,
    /// Russian.
    pub ru: String,
}

/// A number as it was given for a run.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct GivenNumber {
    /// Its key in plan or bench file.
    pub key: String,
    /// What it belongs to.
    pub kind: NumberKind,
    /// Its name for people.
    pub label: String,
    /// The number.
    pub value: String,
}

/// Why the numbers of a run are refused.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum NumberError {
    /// Nobody asks for it.
    #[error("neither plan nor bench asks for the number {}", quoted(key))]
    Unknown {
        /// The key that was given.
        key: String,
        /// What to write instead.
        hint: String,
    },
    /// It is required.
    #[error("the number {label} is missing, and the {of} requires it")]
    Missing {
        /// Its key.
        key: String,
        /// Its name for people.
        label: String,
        /// "plan" or "bench".
        of: &'static str,
    },
    /// It has another form.
    #[error("{label} {} does not fit the pattern {} of the {of}", quoted(value), printable(pattern))]
    Misfit {
        /// Its key.
        key: String,
        /// Its name for people.
        label: String,
        /// The number.
        value: String,
        /// What it must match.
        pattern: String,
        /// "plan" or "bench".
        of: &'static str,
    },
    /// It cannot be a number of anything.
    #[error("{} as {key} {why}", quoted(value))]
    Unfit {
        /// Its key.
        key: String,
        /// The text.
        value: String,
        /// Why.
        why: String,
    },
    /// It is given twice.
    #[error("the number {} is given twice", quoted(key))]
    Twice {
        /// Its key.
        key: String,
    },
}

impl NumberError {
    /// What people can try.
    pub fn try_this(&self) -> String {
        match self {
            Self::Unknown { hint, .. } => hint.clone(),
            Self::Missing { key, .. } => format!("give it on the form of F2, or with --number {key}=..."),
            Self::Misfit { .. } => "scan the label again; if it is right, correct the pattern".to_owned(),
            Self::Unfit { .. } => "scan the label again".to_owned(),
            Self::Twice { .. } => "give it once".to_owned(),
        }
    }
}

/// Reads `[numbers.*]` at the top of a plan or a bench file.
pub(crate) fn read(root: &TomlTable<'_, '_>) -> Vec<NumberField> {
    let Some(table) = root.table("numbers") else { return Vec::new() };
    let mut fields = Vec::new();
    for entry in table.entries() {
        let key = entry.key();
        let fit = |byte: u8| byte.is_ascii_lowercase() || byte.is_ascii_digit() || matches!(byte, b'-' | b'_');
        if key.is_empty() || key.len() > KEY_CHARACTERS || !key.bytes().all(fit) {
            let hint = format!("small letters, digits, - and _ are allowed, 1 to {KEY_CHARACTERS} of them");
            entry.key_mistake(format!("{} cannot be the key of a number", quoted(key)), hint);
        }
        if fields.len() == MAX_FIELDS {
            entry.key_mistake(format!("more than {MAX_FIELDS} numbers are asked for"), "remove some of them");
            break;
        }
        let Some(table) = entry.table() else { continue };
        let field = table.read(|table| NumberField {
            key: key.to_owned(),
            kind: kind(table),
            label: label(table, key),
            pattern: pattern(table, "pattern", "PO-[0-9]{4}"),
            required: table.flag("required"),
        });
        fields.push(field);
    }
    fields
}

fn kind(table: &TomlTable<'_, '_>) -> NumberKind {
    match table.text("kind") {
        None | Some(("free", _)) => NumberKind::Free,
        Some(("order", _)) => NumberKind::Order,
        Some(("subunit", _)) => NumberKind::Subunit,
        Some((text, span)) => {
            let hint =
                "\"order\" stays until it is changed, \"subunit\" is in one module only, \"free\" is of the module";
            table.mistake_at(span, format!("kind is {}", quoted(text)), hint);
            NumberKind::Free
        }
    }
}

/// A label is a text for all languages, or a text for each. English stands in for a language that is not given, and the key for
/// English.
fn label(table: &TomlTable<'_, '_>, key: &str) -> NumberLabel {
    let alone = |text: &str| NumberLabel { en: text.to_owned(), zh: text.to_owned(), ru: text.to_owned() };
    let Some(entry) = table.entry("label") else { return alone(key) };
    let checked = |text: &str| {
        let unfit =
            text.trim().is_empty() || text.chars().count() > KEY_CHARACTERS || text.chars().any(char::is_control);
        if unfit {
            let hint = format!("write 1 to {KEY_CHARACTERS} characters on one line");
            entry.mistake(format!("{} cannot be the label of a number", quoted(text)), hint);
        }
        text.to_owned()
    };
    if entry.value().as_table().is_none() {
        return entry.text().map_or_else(|| alone(key), |text| alone(&checked(text)));
    }
    let Some(languages) = entry.table() else { return alone(key) };
    languages.read(|languages| {
        let of = |name: &'static str| languages.text(name).map(|(text, _)| checked(text));
        let (en, zh, ru) = (of("en").unwrap_or_else(|| key.to_owned()), of("zh"), of("ru"));
        NumberLabel { zh: zh.unwrap_or_else(|| en.clone()), ru: ru.unwrap_or_else(|| en.clone()), en }
    })
}

/// All numbers that bench and plan ask for, in their order. What both ask for stands once, as the plan has it.
pub fn asked<'a>(bench: &'a [NumberField], plan: &'a [NumberField]) -> Vec<&'a NumberField> {
    let of_bench = bench.iter().map(|field| plan.iter().find(|other| other.key == field.key).unwrap_or(field));
    let of_plan = plan.iter().filter(|field| !bench.iter().any(|other| other.key == field.key));
    of_bench.chain(of_plan).collect()
}

/// Checks what was given, as key and number, against what bench and plan ask for. What both ask for must be right for both.
///
/// # Errors
/// [`NumberError`]: the first thing that is wrong.
pub fn check(
    bench: &[NumberField],
    plan: &[NumberField],
    given: &[(String, String)],
) -> Result<Vec<GivenNumber>, NumberError> {
    let fields = asked(bench, plan);
    for (index, (key, _)) in given.iter().enumerate() {
        if !fields.iter().any(|field| field.key == *key) {
            let keys = || fields.iter().map(|field| field.key.as_str());
            let hint = did_you_mean(key, keys(), || match fields.is_empty() {
                true => "plan and bench ask for no numbers".to_owned(),
                false => format!("they are {}", keys().collect::<Vec<_>>().join(", ")),
            });
            return Err(NumberError::Unknown { key: key.clone(), hint });
        }
        if given[..index].iter().any(|(other, _)| other == key) {
            return Err(NumberError::Twice { key: key.clone() });
        }
    }
    let mut numbers = Vec::new();
    for field in fields {
        let value = given.iter().find(|(key, _)| *key == field.key).map_or("", |(_, value)| value.trim());
        let (key, label) = (field.key.clone(), field.label.en.clone());
        let each = [("bench", bench), ("plan", plan)];
        let askers =
            || each.into_iter().filter_map(|(of, all)| Some((of, all.iter().find(|other| other.key == field.key)?)));
        if value.is_empty() {
            match askers().find(|(_, field)| field.required) {
                Some((of, _)) => return Err(NumberError::Missing { key, label, of }),
                None => continue,
            }
        }
        check_form(bench, plan, field, value)?;
        numbers.push(GivenNumber { key, kind: field.kind, label, value: value.to_owned() });
    }
    Ok(numbers)
}

/// Checks the form of one number that is given.
///
/// # Errors
/// [`NumberError::Unfit`] and [`NumberError::Misfit`].
pub fn check_form(
    bench: &[NumberField],
    plan: &[NumberField],
    field: &NumberField,
    value: &str,
) -> Result<(), NumberError> {
    let key = field.key.clone();
    if let Some(why) = unfit(value) {
        return Err(NumberError::Unfit { key, value: value.to_owned(), why });
    }
    let askers = [("bench", bench), ("plan", plan)].map(|(of, all)| (of, all.iter().find(|other| other.key == key)));
    for (of, asker) in askers {
        let pattern = asker.and_then(|asker| asker.pattern.as_ref());
        if let Some(pattern) = pattern.filter(|pattern| !pattern.fits(value)) {
            let (label, value, pattern) = (field.label.en.clone(), value.to_owned(), pattern.to_string());
            return Err(NumberError::Misfit { key, label, value, pattern, of });
        }
    }
    Ok(())
}

fn unfit(value: &str) -> Option<String> {
    let characters = value.chars().count();
    if characters > NUMBER_CHARACTERS {
        return Some(format!("has {characters} characters, at most {NUMBER_CHARACTERS} are allowed"));
    }
    value.chars().any(char::is_control).then(|| "has control characters".to_owned())
}

/// "Order PO-1234".
impl fmt::Display for GivenNumber {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} {}", printable(&self.label), printable(&self.value))
    }
}

#[cfg(test)]
mod tests {
    use gnc_config::{SourceText, read as read_toml};

    use super::*;

    fn fields(text: &str) -> Vec<NumberField> {
        let source = SourceText { name: "x.toml".to_owned(), text: text.to_owned() };
        read_toml(&source, read).unwrap_or_else(|mistakes| panic!("{mistakes}"))
    }

    fn given(pairs: &[(&str, &str)]) -> Vec<(String, String)> {
        pairs.iter().map(|(key, value)| ((*key).to_owned(), (*value).to_owned())).collect()
    }

    const PLAN: &str = r#"
[numbers.order]
kind = "order"
label = { en = "Order", ru = "Заказ" }
pattern = "PO-[0-9]{4}"
required = true
[numbers.gps]
kind = "subunit"
"#;

    #[test]
    fn a_number_is_taken_as_it_is_asked_for() {
        let plan = fields(PLAN);
        let label = &plan[0].label;
        assert_eq!((label.en.as_str(), label.zh.as_str(), label.ru.as_str()), ("Order", "Order", "Заказ"));
        let taken = check(&[], &plan, &given(&[("gps", "GB-1"), ("order", " PO-0001 ")])).unwrap();
        let told: Vec<(&str, NumberKind, String)> =
            taken.iter().map(|number| (number.key.as_str(), number.kind, number.to_string())).collect();
        let order = ("order", NumberKind::Order, "Order PO-0001".to_owned());
        assert_eq!(told, [order, ("gps", NumberKind::Subunit, "gps GB-1".to_owned())]);
        assert_eq!(check(&[], &plan, &given(&[("order", "PO-0001"), ("gps", "")])).unwrap().len(), 1);
    }

    #[test]
    fn what_is_wrong_is_told_in_the_words_of_the_pattern() {
        let plan = fields(PLAN);
        for (pairs, told) in [
            (vec![("order", "PO-1")], "Order \"PO-1\" does not fit the pattern PO-[0-9]{4} of the plan"),
            (vec![("order", "")], "the number Order is missing, and the plan requires it"),
            (vec![("gps", "x")], "the number Order is missing, and the plan requires it"),
            (vec![("ordr", "PO-0001")], "neither plan nor bench asks for the number \"ordr\""),
            (vec![("order", "PO-0001"), ("order", "PO-0002")], "the number \"order\" is given twice"),
            (vec![("order", "PO-0001"), ("gps", "a\tb")], "\"a\\tb\" as gps has control characters"),
        ] {
            let error = check(&[], &plan, &given(&pairs)).unwrap_err();
            assert_eq!(error.to_string(), told);
            assert!(!error.try_this().is_empty());
        }
    }

    #[test]
    fn a_number_of_bench_and_plan_must_be_right_for_both() {
        let (bench, plan) = (
            fields("[numbers.order]\npattern = \"PO-.*\"\nrequired = true\n"),
            fields("[numbers.order]\npattern = \".*7\"\n"),
        );
        assert_eq!(asked(&bench, &plan).len(), 1);
        assert!(check(&bench, &plan, &given(&[("order", "PO-7")])).is_ok());
        for (value, of) in [("PO-8", "plan"), ("X-7", "bench"), ("", "bench")] {
            let error = check(&bench, &plan, &given(&[("order", value)])).unwrap_err().to_string();
            assert!(error.contains(&format!("the {of}")), "{value}: {error}");
        }
    }

    #[test]
    fn mistakes_in_fields() {
        let text = "[numbers.Order]\nkind = \"batch\"\nlabel = \"\"\npattern = \"(\"\nrequird = true\n[numbers.x]\nlabel = { de = \"x\" }\n";
        let source = SourceText { name: "x.toml".to_owned(), text: text.to_owned() };
        let told = read_toml(&source, read).unwrap_err().to_string();
        for what in [
            "\"Order\" cannot be the key of a number",
            "kind is \"batch\"",
            "\"\" cannot be the label of a number",
            "the pattern \"(\" cannot be read",
            "unknown key \"requird\"",
            "unknown key \"de\"",
        ] {
            assert!(told.contains(what), "{what}: {told}");
        }
    }
}
