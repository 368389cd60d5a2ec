use proptest::prelude::*;

use super::*;

fn number(dimension: Dimension) -> MeasurementKind {
    MeasurementKind::Number(dimension)
}

#[track_caller]
fn range(text: &str, dimension: Dimension) -> Range {
    match Limit::parse(text, number(dimension)).unwrap() {
        Limit::Range(range) => range,
        Limit::Text(_) | Limit::OneOf(_) | Limit::Matches(_) => panic!("{text} is a text limit"),
    }
}

/// Bounds worked out by hand.
#[test]
fn the_grammar() {
    use Dimension::{Acceleration, AngularRate, Count, Current, Ratio, Temperature, Time};
    for (text, dimension, low, high, unit) in [
        ("<= 2 s", Time, None, Some(2.0), Unit::Second),
        (">= 3", Count, Some(3.0), None, Unit::Count),
        ("== 0", Count, Some(0.0), Some(0.0), Unit::Count),
        ("0 .. 3", Count, Some(0.0), Some(3.0), Unit::Count),
        ("0 +- 2 deg/s", AngularRate, Some(-2.0), Some(2.0), Unit::DegreePerSecond),
        ("-10 .. 60 degC", Temperature, Some(-10.0), Some(60.0), Unit::DegreeCelsius),
        ("500 us +- 0.2 %", Time, Some(499.0), Some(501.0), Unit::Microsecond),
        ("0.49 A +- 5 %", Current, Some(0.4655), Some(0.5145), Unit::Ampere),
        ("-1 g +- 5 %", Acceleration, Some(-1.05), Some(-0.95), Unit::Gravity),
        ("1 g +- 10 mg", Acceleration, Some(0.99), Some(1.01), Unit::Gravity),
        ("500 us .. 2 ms", Time, Some(500.0), Some(2000.0), Unit::Microsecond),
        ("-0.5 % .. 0.5 %", Ratio, Some(-0.5), Some(0.5), Unit::Percent),
        ("<=5%", Ratio, None, Some(5.0), Unit::Percent),
        ("1.5..2.5 s", Time, Some(1.5), Some(2.5), Unit::Second),
    ] {
        assert_eq!(range(text, dimension), Range { unit, low, high, marginal: None }, "{text}");
    }
    let text = |text| Limit::parse(text, MeasurementKind::Text).unwrap();
    assert_eq!(text("== 3D"), Limit::Text(Expected::Literal("3D".to_owned())));
    assert_eq!(text("==  two words "), Limit::Text(Expected::Literal("two words".to_owned())));
    assert_eq!(text("== $serial_number"), Limit::Text(Expected::SerialNumber));
}

/// Every refusal, as the writer of a plan sees it.
#[test]
fn refusals() {
    let mut out = String::new();
    for (text, kind) in [
        ("", number(Dimension::Time)),
        ("2 s", number(Dimension::Time)),
        ("< 2 s", number(Dimension::Time)),
        ("<= 2", number(Dimension::Time)),
        ("<= 2 V", number(Dimension::Time)),
        ("<= 2 mn", number(Dimension::Time)),
        ("<= 2 parsec", number(Dimension::AngularRate)),
        ("<= two", number(Dimension::Time)),
        ("<= NaN s", number(Dimension::Time)),
        ("2 s .. 1 s", number(Dimension::Time)),
        ("1 s .. 500 ms", number(Dimension::Time)),
        ("1 s +- -2 s", number(Dimension::Time)),
        ("0 s +- 5 %", number(Dimension::Time)),
        ("5 % +- 5 %", number(Dimension::Ratio)),
        ("500 us +- 2", number(Dimension::Time)),
        ("1e308 s +- 100 %", number(Dimension::Time)),
        ("== 5 V", number(Dimension::Voltage)),
        ("<= 3 V", number(Dimension::Count)),
        ("<= 3", MeasurementKind::Text),
        ("==", MeasurementKind::Text),
        ("== $serial", MeasurementKind::Text),
    ] {
        let error = Limit::parse(text, kind).unwrap_err();
        out.push_str(&format!("{text}\n    {error}\n    try: {}\n", error.hint()));
    }
    for (limit, marginal) in
        [("0 +- 2 s", "0 s"), ("0 +- 2 s", "-1 s"), ("0 +- 2 s", "3 s"), ("0 +- 2 s", "1"), ("0 +- 2 s", "10 %")]
    {
        let limit = Limit::parse(limit, number(Dimension::Time)).unwrap();
        let error = limit.clone().with_marginal(marginal).unwrap_err();
        out.push_str(&format!("{limit}, marginal {marginal}\n    {error}\n    try: {}\n", error.hint()));
    }
    let error = Limit::parse("== x", MeasurementKind::Text).unwrap().with_marginal("1 s").unwrap_err();
    out.push_str(&format!("== x, marginal 1 s\n    {error}\n    try: {}\n", error.hint()));
    insta::assert_snapshot!(out, @r#"

        "" is not a limit
        try: a limit is one of: <= Q, >= Q, Q .. Q, Q +- Q, Q +- N %, == text
    2 s
        "2 s" is not a limit
        try: a limit is one of: <= Q, >= Q, Q .. Q, Q +- Q, Q +- N %, == text
    < 2 s
        "< 2 s" is not a limit
        try: a limit is one of: <= Q, >= Q, Q .. Q, Q +- Q, Q +- N %, == text
    <= 2
        2 has no unit
        try: a time is written in ns, us, ms, s, min, h
    <= 2 V
        2 V is a voltage, but this measurement is a time
        try: a time is written in ns, us, ms, s, min, h
    <= 2 mn
        unknown unit "mn"
        try: did you mean "min"?
    <= 2 parsec
        unknown unit "parsec"
        try: an angular rate is written in deg/s, mdeg/s, deg/h, rad/s
    <= two
        "two" does not begin with a number
        try: write a number and its unit, such as "0.49 A"
    <= NaN s
        "NaN s" does not begin with a number
        try: write a number and its unit, such as "0.49 A"
    2 s .. 1 s
        the low bound 2 s is above the high bound 1 s
        try: write the smaller one first
    1 s .. 500 ms
        the low bound 1 s is above the high bound 0.5 s
        try: write the smaller one first
    1 s +- -2 s
        the tolerance -2 s is below zero
        try: a tolerance counts in both directions; write it positive
    0 s +- 5 %
        a tolerance in % of 0 leaves no room
        try: write both bounds: "-0.5 % .. 0.5 %" for a ratio, "-2 .. 2 deg/s" for a rate
    5 % +- 5 %
        % after +- is ambiguous: it could mean a part of the value, or a value in %
        try: write both bounds: "-0.5 % .. 0.5 %" for a ratio, "-2 .. 2 deg/s" for a rate
    500 us +- 2
        2 has no unit
        try: a time is written in ns, us, ms, s, min, h
    1e308 s +- 100 %
        a bound is too large
        try: the largest number is about 1.8e308
    == 5 V
        a measured voltage never equals a number exactly
        try: give it a tolerance: Q +- Q
    <= 3 V
        3 V is a voltage, but this measurement is a plain number
        try: write a plain number without a unit
    <= 3
        "<= 3" is a limit for numbers, but this measurement is a text
        try: write == and the text, or == $serial_number for the scanned one
    ==
        there is no text after ==
        try: write == and the text, or == $serial_number for the scanned one
    == $serial
        unknown placeholder "$serial"
        try: the only placeholder is $serial_number
    -2 .. 2 s, marginal 0 s
        the marginal band 0 s is not above zero
        try: leave the band out if no value is to be marginal
    -2 .. 2 s, marginal -1 s
        the marginal band -1 s is not above zero
        try: leave the band out if no value is to be marginal
    -2 .. 2 s, marginal 3 s
        with a marginal band of 3 s every good value would be marginal
        try: make it less than half the width of the limit
    -2 .. 2 s, marginal 1
        1 has no unit
        try: a time is written in ns, us, ms, s, min, h
    -2 .. 2 s, marginal 10 %
        10 % is a ratio, but this measurement is a time
        try: a time is written in ns, us, ms, s, min, h
    == x, marginal 1 s
        a text has no marginal band
        try: leave the marginal band out
    "#);
}

#[test]
fn bounds_belong_to_the_limit_and_nan_to_nobody() {
    let limit = range("0 +- 2 deg/s", Dimension::AngularRate);
    for (value, expected) in [
        (2.0, Outcome::Passed),
        (-2.0, Outcome::Passed),
        (2.0f64.next_up(), Outcome::Failed),
        (-2.0f64.next_up(), Outcome::Failed),
        (f64::NAN, Outcome::Errored),
        (f64::INFINITY, Outcome::Errored),
        (f64::NEG_INFINITY, Outcome::Errored),
    ] {
        assert_eq!(limit.judge(value), expected, "{value}");
    }
}

#[test]
fn the_marginal_band_lies_inside() {
    let limit = Limit::parse("1 g +- 5 %", number(Dimension::Acceleration)).unwrap().with_marginal("1 mg").unwrap();
    let Limit::Range(range) = limit else { panic!() };
    assert_eq!((range.marginal_low(), range.marginal_high()), (Some(0.951), Some(1.049)));
    for (value, expected) in [
        (0.9499, Outcome::Failed),
        (0.95, Outcome::Marginal),
        (0.9509, Outcome::Marginal),
        (0.951, Outcome::Passed),
        (1.049, Outcome::Passed),
        (1.0491, Outcome::Marginal),
        (1.05, Outcome::Marginal),
        (1.0501, Outcome::Failed),
        (f64::NAN, Outcome::Errored),
    ] {
        assert_eq!(range.judge(value), expected, "{value}");
    }
}

#[test]
fn limits_print_as_they_are_judged() {
    for (text, dimension, expected) in [
        ("0.49 A +- 5 %", Dimension::Current, "0.4655 .. 0.5145 A"),
        ("<= 2 s", Dimension::Time, "<= 2 s"),
        ("== 0", Dimension::Count, "== 0"),
        ("0 .. 0", Dimension::Count, "== 0"),
        (">= 1e-9 s", Dimension::Time, ">= 1e-9 s"),
    ] {
        assert_eq!(Limit::parse(text, number(dimension)).unwrap().to_string(), expected);
    }
}

proptest! {
    #[test]
    fn any_text_is_a_limit_or_an_error_with_a_hint(text in "\\PC{0,40}", is_text in any::<bool>()) {
        let kind = if is_text { MeasurementKind::Text } else { number(Dimension::Time) };
        if let Err(error) = Limit::parse(&text, kind) {
            prop_assert!(!error.hint().is_empty());
        }
    }

    /// The judgement is compared with one in whole milliseconds, where nothing is rounded.
    #[test]
    fn judgement_agrees_with_whole_numbers(
        low in -1000i64..1000,
        width in 0i64..1000,
        band in 1i64..400,
        value in -1500i64..2500,
        form in 0..4,
    ) {
        let high = low + width;
        let (text, bottom, top) = match form {
            0 => (format!("{low} .. {high} ms"), Some(low), Some(high)),
            1 => (format!("<= {high} ms"), None, Some(high)),
            2 => (format!(">= {low} ms"), Some(low), None),
            _ => (format!("{low} ms +- {width} ms"), Some(low - width), Some(low + width)),
        };
        let limit = Limit::parse(&text, number(Dimension::Time)).unwrap();
        let inside = bottom.is_none_or(|bottom| value >= bottom) && top.is_none_or(|top| value <= top);
        let near = bottom.is_some_and(|bottom| value - bottom < band) || top.is_some_and(|top| top - value < band);
        let judge = |limit: &Limit| match limit {
            Limit::Range(range) => range.judge(value as f64),
            Limit::Text(_) | Limit::OneOf(_) | Limit::Matches(_) => Outcome::Errored,
        };
        prop_assert_eq!(judge(&limit), if inside { Outcome::Passed } else { Outcome::Failed });
        if let Ok(limit) = limit.with_marginal(&format!("{band} ms")) {
            let expected = if !inside { Outcome::Failed } else if near { Outcome::Marginal } else { Outcome::Passed };
            prop_assert_eq!(judge(&limit), expected);
        }
    }
}
