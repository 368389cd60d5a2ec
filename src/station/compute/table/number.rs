//! Numbers as people and programs write them: decimal comma or point, groups of thousands, `D` exponents, cells without
//! a value.

use std::borrow::Cow;

/// Longest field that can be a number.
const LONGEST: usize = 64;

/// The sign before the decimals.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub(in crate::compute) enum Decimal {
    /// `1.234,5` is 1234.5
    Comma,
    /// `1,234.5` is 1234.5
    Point,
}

/// How the numbers of a file are written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Form {
    Known(Decimal),
    /// No number has shown the form: a point is read as the decimal point, a comma is refused.
    Open,
}

/// Why a field is not a number.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum NoNumber {
    /// An empty cell, or a word for it.
    Missing,
    /// A comma that may stand before decimals or between thousands.
    Ambiguous,
    Text,
}

/// What one number shows about the decimals of its file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Evidence {
    Proves(Decimal),
    /// `1,234`.
    Either,
    /// `12`, and `1.234`, which is read with a decimal point unless others prove a comma.
    None,
}

/// Words for a cell without a value.
const MISSING: [&str; 9] = ["n/a", "na", "#n/a", "#nv", "null", "none", "-", "--", "n.a."];

/// Reads a field; blanks and quotes around it are allowed.
pub(super) fn read(field: &[u8], form: Form) -> Result<f64, NoNumber> {
    if form != Form::Known(Decimal::Comma)
        && let Ok(value) = fast_float2::parse(field)
    {
        return Ok(value);
    }
    slow(field, form)
}

/// The rest of [`read`], in a function of its own so that the usual case is small.
#[inline(never)]
fn slow(field: &[u8], form: Form) -> Result<f64, NoNumber> {
    let text = decoded(unquoted(field));
    let text = text.trim();
    if text.is_empty() || MISSING.iter().any(|m| text.eq_ignore_ascii_case(m)) {
        return Err(NoNumber::Missing);
    }
    let Some(parts) = Parts::of(text) else {
        // Words of the standard: nan, inf.
        return fast_float2::parse(text).map_err(|_| NoNumber::Text);
    };
    let decimal = match form {
        Form::Known(decimal) => decimal,
        Form::Open if parts.body.contains(',') => return Err(NoNumber::Ambiguous),
        Form::Open => Decimal::Point,
    };
    parts.value(decimal).ok_or(NoNumber::Text)
}

/// Whether a field is a number in one of the two forms.
pub(super) fn is_number(field: &[u8]) -> bool {
    [Form::Known(Decimal::Point), Form::Known(Decimal::Comma)].iter().any(|form| read(field, *form).is_ok())
}

/// What a field shows about the decimals, and whether its thousands have separators.
pub(super) fn evidence(field: &[u8]) -> (Evidence, bool) {
    let text = decoded(unquoted(field));
    let Some(parts) = Parts::of(text.trim()) else { return (Evidence::None, false) };
    let [by_comma, by_point] = [Decimal::Comma, Decimal::Point].map(|d| parts.value(d).is_some());
    let divided = parts.grouped || parts.body.matches([',', '.']).count() > 1;
    let evidence = match (by_comma, by_point) {
        (true, false) => Evidence::Proves(Decimal::Comma),
        (false, true) => Evidence::Proves(Decimal::Point),
        (true, true) if parts.body.contains(',') => Evidence::Either,
        _ => Evidence::None,
    };
    (evidence, divided)
}

/// A number taken apart: sign, digits with points and commas, exponent.
struct Parts {
    sign: &'static str,
    body: String,
    exponent: String,
    /// The thousands have blanks or apostrophes between them.
    grouped: bool,
}

impl Parts {
    fn of(text: &str) -> Option<Self> {
        if text.len() > LONGEST {
            return None;
        }
        let (sign, text) = match text.strip_prefix(['-', '\u{2212}']) {
            Some(rest) => ("-", rest),
            None => ("", text.strip_prefix('+').unwrap_or(text)),
        };
        let (body, exponent) = match text.split_once(['e', 'E', 'd', 'D']) {
            Some((body, exponent)) => {
                let digits = exponent.strip_prefix(['+', '-']).unwrap_or(exponent);
                if digits.is_empty() || !digits.bytes().all(|b| b.is_ascii_digit()) {
                    return None;
                }
                (body, format!("e{exponent}"))
            }
            None => (text, String::new()),
        };
        let (body, grouped) = joined(body)?;
        let plain = body.bytes().all(|b| b.is_ascii_digit() || b == b'.' || b == b',');
        (plain && body.bytes().any(|b| b.is_ascii_digit())).then_some(Self { sign, body, exponent, grouped })
    }

    /// The value, if the number is well formed with these decimals. The other sign may separate thousands. A number
    /// with such groups does not begin with 0 and has no exponent.
    fn value(&self, decimal: Decimal) -> Option<f64> {
        let (point, other) = match decimal {
            Decimal::Comma => (',', '.'),
            Decimal::Point => ('.', ','),
        };
        let (whole, fraction) = self.body.split_once(point).unwrap_or((&self.body, ""));
        if fraction.contains([point, other]) {
            return None;
        }
        let whole = if whole.contains(other) {
            if self.grouped || !self.exponent.is_empty() || !in_thousands(whole.split(other)) {
                return None;
            }
            Cow::Owned(whole.replace(other, ""))
        } else {
            Cow::Borrowed(whole)
        };
        fast_float2::parse(format!("{}{whole}.{fraction}{}", self.sign, self.exponent)).ok()
    }
}

/// Digits without the blanks and apostrophes that separate thousands.
fn joined(body: &str) -> Option<(String, bool)> {
    let divides = |c: char| matches!(c, ' ' | '\'' | '\u{a0}' | '\u{202f}' | '\u{2009}' | '\u{2019}');
    let Some(divider) = body.chars().find(|c| divides(*c)) else { return Some((body.to_owned(), false)) };
    let end = body.find(['.', ',']).unwrap_or(body.len());
    let (whole, rest) = body.split_at(end);
    (!rest.contains(divides) && in_thousands(whole.split(divider))).then(|| (whole.replace(divider, "") + rest, true))
}

/// One to three digits, the first not 0, then groups of three.
fn in_thousands<'a>(mut groups: impl Iterator<Item = &'a str>) -> bool {
    let digits = |group: &str| group.bytes().all(|b| b.is_ascii_digit());
    let first = groups.next().unwrap_or("");
    (1..=3).contains(&first.len())
        && !first.starts_with('0')
        && digits(first)
        && groups.all(|g| g.len() == 3 && digits(g))
}

/// A field without the blanks and quotes around it.
pub(super) fn unquoted(field: &[u8]) -> &[u8] {
    let field = field.trim_ascii();
    match field {
        [b'"', inner @ .., b'"'] => inner.trim_ascii(),
        _ => field,
    }
}

/// Text in UTF-8, or else in Windows-1252, whose letters, `°` and `µ` are those of Latin-1.
pub(super) fn decoded(bytes: &[u8]) -> Cow<'_, str> {
    match std::str::from_utf8(bytes) {
        Ok(text) => Cow::Borrowed(text),
        Err(_) => Cow::Owned(bytes.iter().map(|b| char::from(*b)).collect()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const COMMA: Form = Form::Known(Decimal::Comma);
    const POINT: Form = Form::Known(Decimal::Point);

    #[test]
    fn numbers_in_every_dress() {
        let check = |text: &str, form, expected| assert_eq!(read(text.as_bytes(), form), expected, "{text} {form:?}");
        for (text, form, value) in [
            ("0,5", COMMA, 0.5),
            ("-1.234,5", COMMA, -1234.5),
            ("1.234", COMMA, 1234.0),
            ("1,234.5", POINT, 1234.5),
            ("\"1,234\"", POINT, 1234.0),
            ("1 234,25", COMMA, 1234.25),
            ("1\u{202f}234\u{202f}567,5", COMMA, 1_234_567.5),
            ("1'234.5", POINT, 1234.5),
            ("1.5D-03", POINT, 1.5e-3),
            ("1,5d2", COMMA, 150.0),
            ("\u{2212}2.5", POINT, -2.5),
            (" \"2.5\" ", Form::Open, 2.5),
            (",5", COMMA, 0.5),
            ("5,", COMMA, 5.0),
        ] {
            check(text, form, Ok(value));
        }
        for text in ["", "  ", "\"\"", "N/A", "n/a", "#NV", "-", "null"] {
            check(text, POINT, Err(NoNumber::Missing));
            check(text, COMMA, Err(NoNumber::Missing));
        }
        check("1,234", Form::Open, Err(NoNumber::Ambiguous));
        for text in ["abc", "1.2.3", "0.5", "12.34", "1.2345,0", "1 23", "1,2,3", "e5", "1e", "0.123"] {
            check(text, COMMA, Err(NoNumber::Text));
        }
        for text in ["1,23", "0,123", "1,2345", "1,234e5", "12:30", "1 2 3"] {
            check(text, POINT, Err(NoNumber::Text));
        }
        assert!(read(b"nan", COMMA).unwrap().is_nan() && read(b"NaN", POINT).unwrap().is_nan());
    }

    #[test]
    fn what_a_number_proves() {
        use Evidence::{Either, None, Proves};
        let check = |text: &str, expected| assert_eq!(evidence(text.as_bytes()).0, expected, "{text}");
        check("0,5", Proves(Decimal::Comma));
        check("0,500", Proves(Decimal::Comma));
        check("1234,567", Proves(Decimal::Comma));
        check("1,234e5", Proves(Decimal::Comma));
        check("1.234.567", Proves(Decimal::Comma));
        check("1.234,567", Proves(Decimal::Comma));
        check("1,234", Either);
        check("1,234,567", Proves(Decimal::Point));
        check("1,234.567", Proves(Decimal::Point));
        check("0.5", Proves(Decimal::Point));
        check("1.234", None);
        check("12", None);
        check("05.10.2024", None);
        check("10:00:00,123", None);
    }
}
