//! Names of columns and their units, as headers write them: `w`, `W`, `w [deg/s]`, `w (dps)`, `w / (°/s)`, `w_dps`.

use std::collections::HashSet;
use std::path::{Path, PathBuf};

use gnc_executive::quantity::Unit;
use gnc_text::shortened;

use super::TableError;

/// A column of a header.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Name {
    /// The name as it stands in the header.
    pub(super) text: String,
    /// The name without its unit.
    base: String,
    /// The unit as it is written, beside the name or in the row of units.
    pub(super) unit: Option<String>,
}

/// Names of the columns.
#[derive(Debug, Clone)]
pub(super) struct Header {
    path: PathBuf,
    pub(super) line: usize,
    pub(super) names: Vec<Name>,
}

/// Units at the end of a name, as in `w_dps`. Shorter units would also match names that mean something else.
const SUFFIXES: [(&str, &str); 22] = [
    ("rps", "rad/s"),
    ("radps", "rad/s"),
    ("rad_s", "rad/s"),
    ("dps", "deg/s"),
    ("degps", "deg/s"),
    ("deg_s", "deg/s"),
    ("dph", "deg/h"),
    ("deg_h", "deg/h"),
    ("mps2", "m/s^2"),
    ("m_s2", "m/s^2"),
    ("ms2", "m/s^2"),
    ("mg", "mg"),
    ("g", "g"),
    ("gauss", "gauss"),
    ("mgauss", "mgauss"),
    ("ut", "uT"),
    ("nt", "nT"),
    ("degc", "degC"),
    ("lsb", "LSB"),
    ("counts", "LSB"),
    ("ms", "ms"),
    ("s", "s"),
];

/// Names of a header in a message; more hide what the message says. A bench has about a hundred channels.
const NAMES_IN_MESSAGE: usize = 100;
/// Characters of each.
const NAME_IN_MESSAGE: usize = 60;

/// Words for the counts of a converter.
const COUNTS: [&str; 10] = ["lsb", "lsbs", "count", "counts", "cts", "digit", "digits", "adc", "raw", "code"];

impl Header {
    /// Makes a header from its fields and those of a row of units.
    pub(super) fn new(
        path: &Path,
        line: usize,
        texts: Vec<String>,
        units: Option<Vec<String>>,
    ) -> Result<Self, TableError> {
        let mut units = units.unwrap_or_default();
        units.resize(texts.len(), String::new());
        let mut known = HashSet::with_capacity(texts.len());
        for (i, name) in texts.iter().enumerate() {
            if !name.is_empty() && !known.insert(name.as_str()) {
                let column = 1 + texts[..i].iter().map(|t| t.len() + 1).sum::<usize>();
                return Err(TableError::Doubled { path: path.to_owned(), line, column, name: name.clone() });
            }
        }
        let names = texts.into_iter().zip(units).map(|(text, unit)| Name::of(text, unbracketed(&unit))).collect();
        Ok(Self { path: path.to_owned(), line, names })
    }

    /// Finds the place of a column by its name: ignoring case, then without the unit, then without a unit at the end.
    pub(super) fn find(&self, wanted: &str) -> Result<Option<usize>, TableError> {
        let same = |name: &Name| name.text.eq_ignore_ascii_case(wanted);
        let base = |name: &Name| name.base.eq_ignore_ascii_case(wanted);
        let suffixed = |name: &Name| {
            let (stem, _) = suffix(&name.text).unwrap_or_default();
            stem.eq_ignore_ascii_case(wanted)
        };
        for fits in [&same as &dyn Fn(&Name) -> bool, &base, &suffixed] {
            let places: Vec<usize> = (0..self.names.len()).filter(|&i| fits(&self.names[i])).collect();
            match places.as_slice() {
                [] => {}
                [place] => return Ok(Some(*place)),
                // `t` and `T` are time and temperature.
                many if wanted.len() == 1 && wanted.eq_ignore_ascii_case("t") => {
                    return Ok(many.iter().copied().find(|&i| self.names[i].text == wanted));
                }
                many => {
                    let columns: Vec<String> = many.iter().map(|&i| format!("`{}`", self.names[i].text)).collect();
                    let (path, name) = (self.path.clone(), wanted.to_owned());
                    return Err(TableError::Unclear { path, line: self.line, name, columns: columns.join(" or ") });
                }
            }
        }
        Ok(None)
    }

    /// The place of a column that must exist.
    pub(super) fn column(&self, wanted: &str) -> Result<usize, TableError> {
        self.find(wanted)?.ok_or_else(|| TableError::NoColumn {
            path: self.path.clone(),
            line: self.line,
            name: wanted.to_owned(),
            header: self.in_short(),
        })
    }

    /// The first names, for a message.
    fn in_short(&self) -> String {
        let names = self.names.iter().take(NAMES_IN_MESSAGE).map(|n| shortened(&n.text, NAME_IN_MESSAGE));
        let names = names.collect::<Vec<_>>().join(", ");
        if self.names.len() > NAMES_IN_MESSAGE { format!("{names}, …") } else { names }
    }

    /// The names as they stand in the header.
    pub(super) fn texts(&self) -> Vec<String> {
        self.names.iter().map(|n| n.text.clone()).collect()
    }
}

impl Name {
    fn of(text: String, in_row: Option<String>) -> Self {
        let (base, beside) = taken_apart(&text);
        let unit = in_row.or(beside).or_else(|| suffix(&text).map(|(_, unit)| unit.to_owned()));
        Self { text, base, unit }
    }
}

/// Splits a name from a unit in brackets or behind a slash.
fn taken_apart(text: &str) -> (String, Option<String>) {
    let whole = text.trim();
    for (open, close) in [('[', ']'), ('(', ')')] {
        if let Some(inner) = whole.strip_suffix(close)
            && let Some((base, unit)) = inner.rsplit_once(open)
            && !base.trim().is_empty()
        {
            let base = base.trim().trim_end_matches('/').trim_end();
            return (base.to_owned(), Some(unit.trim().to_owned()).filter(|u| !u.is_empty()));
        }
    }
    if let Some((base, unit)) = whole.split_once(" / ")
        && known(unit)
    {
        return (base.trim().to_owned(), Some(unit.trim().to_owned()));
    }
    (whole.to_owned(), None)
}

/// Splits a name from a unit at its end.
fn suffix(text: &str) -> Option<(&str, &'static str)> {
    SUFFIXES.iter().find_map(|(end, unit)| {
        let split = text.len().checked_sub(end.len() + 1).filter(|&at| text.is_char_boundary(at))?;
        let (stem, rest) = text.split_at(split);
        (!stem.is_empty() && rest.strip_prefix('_').is_some_and(|r| r.eq_ignore_ascii_case(end)))
            .then_some((stem, *unit))
    })
}

/// A unit from a row of units, which may be in brackets.
fn unbracketed(text: &str) -> Option<String> {
    let text = text.trim();
    let inner =
        [('[', ']'), ('(', ')')].iter().find_map(|(open, close)| text.strip_prefix(*open)?.strip_suffix(*close));
    Some(inner.unwrap_or(text).trim().to_owned()).filter(|u| !u.is_empty() && u != "-")
}

/// Whether every field of a row is a unit or empty, and at least one is a unit.
pub(super) fn is_units_row(texts: &[String]) -> bool {
    let fits = |text: &String| {
        let inner = unbracketed(text);
        inner.as_ref().is_none_or(|inner| known(inner) || *inner != text.trim() || is_time_word(inner))
    };
    texts.iter().all(fits) && texts.iter().any(|text| unbracketed(text).is_some())
}

fn is_time_word(text: &str) -> bool {
    super::time::unit_s(text).is_some()
}

fn known(text: &str) -> bool {
    is_count(text) || unit(text).is_some()
}

/// Whether a unit means counts of a converter.
pub(super) fn is_count(text: &str) -> bool {
    COUNTS.iter().any(|count| text.trim().eq_ignore_ascii_case(count))
}

/// The unit that a text names, if it names one.
pub(super) fn unit(text: &str) -> Option<Unit> {
    Unit::parse(text).filter(|unit| *unit != Unit::Count)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn header(names: &[&str]) -> Header {
        Header::new(Path::new("r.csv"), 1, names.iter().map(|n| (*n).to_owned()).collect(), None).unwrap()
    }

    #[test]
    fn columns_are_found_by_what_people_call_them() {
        let check = |names: &[&str], wanted: &str, place: usize, unit: Option<&str>| {
            let header = header(names);
            let found = header.column(wanted).unwrap_or_else(|e| panic!("{e}"));
            assert_eq!((found, header.names[found].unit.as_deref()), (place, unit), "{names:?}");
        };
        check(&["t", "X"], "x", 1, None);
        check(&["Time [s]", "x [deg/s]"], "x", 1, Some("deg/s"));
        check(&["Time [s]", "x (deg/s)"], "x (deg/s)", 1, Some("deg/s"));
        check(&["t / s", "w / (deg/s)"], "w", 1, Some("deg/s"));
        check(&["t / s", "w / deg/s"], "w", 1, Some("deg/s"));
        check(&["t", "w_dps"], "w", 1, Some("deg/s"));
        check(&["t", "w_dps"], "w_dps", 1, Some("deg/s"));
        check(&["x", "x_raw [LSB]"], "x", 0, None);
        check(&["t", "T"], "T", 1, None);
    }

    #[test]
    fn names_that_fit_twice_are_refused() {
        let check = |names: &[&str], wanted: &str, expected: &str| {
            assert_eq!(header(names).column(wanted).unwrap_err().to_string(), expected);
        };
        check(&["X", "x"], "x", "r.csv:1:1: column `x` is ambiguous: it may be `X` or `x`");
        check(&["x [mg]", "x [deg/s]"], "x", "r.csv:1:1: column `x` is ambiguous: it may be `x [mg]` or `x [deg/s]`");
        check(&["y"], "x", "r.csv:1:1: no column `x`; the header has y");
    }

    /// As many names as the first bytes of a text can hold, and more. Each compared with all before it would take an hour.
    #[test]
    fn a_long_header_is_read_once() {
        let mut texts: Vec<String> = (0..400_000).map(|k| format!("{k}\n")).collect();
        let message =
            Header::new(Path::new("r.csv"), 1, texts.clone(), None).unwrap().column("x").unwrap_err().to_string();
        assert!(message.ends_with("98\\n, 99\\n, …"), "{}", message.len());
        texts.push("399999\n".to_owned());
        let doubled = Header::new(Path::new("r.csv"), 1, texts, None).unwrap_err();
        assert!(matches!(&doubled, TableError::Doubled { name, .. } if name == "399999\n"), "{doubled}");
    }

    #[test]
    fn a_row_of_units() {
        let check = |texts: &[&str], expected| {
            assert_eq!(is_units_row(&texts.iter().map(|t| (*t).to_owned()).collect::<Vec<_>>()), expected, "{texts:?}");
        };
        check(&["s", "deg/s"], true);
        check(&["[s]", "[whatever]"], true);
        check(&["s", "", "LSB"], true);
        check(&["s", "w"], false);
        check(&["", ""], false);
    }
}
