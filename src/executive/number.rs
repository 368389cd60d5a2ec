//! Numbers printed for people: few digits, but enough that a value does not seem to be on the other side of its limit.

use std::cmp::Ordering;

/// Number of digits after which an `f64` has no further information.
const ALL_DIGITS: usize = 17;

/// Significant digits that survive one or two roundings of an `f64`; the digits after them are noise.
const ARITHMETIC_DIGITS: usize = 12;

/// Significant digits of an uncertainty. It is itself known only to a few percent.
pub(crate) const INTERVAL_DIGITS: usize = 2;

/// Least number of digits of the ends of an interval.
const END_DIGITS: usize = 3;

/// The ends of an interval, with as many digits as its width needs: the ends look alike only if they are equal.
pub(crate) fn interval(low: f64, high: f64) -> (String, String) {
    let width = high - low;
    let end = |number: f64| {
        if !(width > 0.0 && width.is_finite()) || number == 0.0 {
            return plain(number, END_DIGITS);
        }
        let above = decimal_exponent(number, END_DIGITS) - decimal_exponent(width, INTERVAL_DIGITS);
        let needed = usize::try_from(above).unwrap_or(0) + INTERVAL_DIGITS;
        plain(number, needed.clamp(END_DIGITS, ALL_DIGITS))
    };
    (end(low), end(high))
}

/// A number with about this many significant digits, without trailing zeros. An integer is always printed in full.
pub(crate) fn plain(number: f64, digits: usize) -> String {
    if !number.is_finite() {
        return non_finite(number).to_owned();
    }
    if number == 0.0 {
        return "0".to_owned();
    }
    let exponent = decimal_exponent(number, digits);
    if !(-5..15).contains(&exponent) {
        let text = format!("{number:.*e}", digits.saturating_sub(1));
        let (mantissa, exponent) = text.split_once('e').unwrap_or((&text, "0"));
        return format!("{}e{exponent}", trimmed(mantissa));
    }
    let decimals = usize::try_from(digits as i64 - 1 - i64::from(exponent)).unwrap_or(0);
    let text = trimmed(&format!("{number:.decimals$}")).to_owned();
    if text == "-0" { "0".to_owned() } else { text }
}

/// A number beside its bounds, with enough digits to stay on its side of every bound.
pub(crate) fn beside(number: f64, digits: usize, bounds: &[f64]) -> String {
    let faithful = |text: &str| {
        let printed: f64 = text.parse().unwrap_or(f64::NAN);
        bounds.iter().all(|bound| order(printed, *bound) == order(number, *bound))
    };
    (digits..ALL_DIGITS)
        .map(|digits| plain(number, digits))
        .find(|text| faithful(text))
        .unwrap_or_else(|| exact(number))
}

/// A bound, exactly as in the plan.
pub(crate) fn exact(number: f64) -> String {
    if number != 0.0 && !(1e-5..1e15).contains(&number.abs()) { format!("{number:e}") } else { format!("{number}") }
}

/// A number without the noise of arithmetic: 0.49 x 1.05 becomes 0.5145 instead of 0.5145000000000001.
pub(crate) fn denoised(number: f64) -> f64 {
    format!("{number:.*e}", ARITHMETIC_DIGITS - 1).parse().unwrap_or(number)
}

/// The name of a number that is not finite.
pub(crate) fn non_finite(number: f64) -> &'static str {
    if number.is_nan() {
        "NaN"
    } else if number > 0.0 {
        "inf"
    } else {
        "-inf"
    }
}

fn order(a: f64, b: f64) -> Option<Ordering> {
    a.partial_cmp(&b)
}

/// Position of the first digit after rounding: 0 for 1..10, -1 for 0.1..1.
fn decimal_exponent(number: f64, digits: usize) -> i32 {
    let text = format!("{number:.*e}", digits.saturating_sub(1));
    text.split_once('e').and_then(|(_, exponent)| exponent.parse().ok()).unwrap_or(0)
}

fn trimmed(text: &str) -> &str {
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.') } else { text }
}

#[cfg(test)]
mod tests;
