use super::*;
use crate::limit::Kind;
use crate::quantity::Dimension;

fn limit(text: &str, dimension: Dimension) -> Limit {
    Limit::parse(text, Kind::Number(dimension)).unwrap()
}

#[test]
fn a_measurement_is_recorded_in_the_unit_of_its_limit() {
    let limit = limit("0.49 A +- 5 %", Dimension::Current);
    let value = Value::number(468.0, Unit::Milliampere);
    let measurement = Measurement::judge("supply_current", &value, Unit::Milliampere, Some(&limit), "");
    assert_eq!(
        serde_json::to_string(&measurement).unwrap(),
        r#"{"name":"supply_current","value":0.468,"unit":"A","low":0.4655,"high":0.5145,"expected":null,"outcome":"passed"}"#
    );
    assert_eq!(measurement.value_text(), "0.468 A");
    assert_eq!(measurement.limit_text(), "0.4655 .. 0.5145 A");
}

#[test]
fn what_is_not_a_number_is_errored_and_keeps_its_name() {
    let limit = limit("<= 2 s", Dimension::Time);
    for (number, raw) in [(f64::NAN, "NaN"), (f64::INFINITY, "inf"), (f64::NEG_INFINITY, "-inf")] {
        let measurement = Measurement::judge("t", &Value::number(number, Unit::Second), Unit::Second, Some(&limit), "");
        assert_eq!(
            serde_json::to_string(&measurement).unwrap(),
            format!(
                r#"{{"name":"t","value":null,"raw":"{raw}","unit":"s","low":null,"high":2.0,"expected":null,"outcome":"errored"}}"#
            )
        );
        assert!(measurement.is_available());
        assert_eq!(measurement.value_text(), raw);
    }
    // A finite number that is too large for the limit's unit is no number there either.
    let measurement = Measurement::judge("t", &Value::number(1e308, Unit::Hour), Unit::Second, Some(&limit), "");
    assert_eq!((measurement.outcome, measurement.raw.as_deref()), (Some(Outcome::Errored), Some("inf")));
}

#[test]
fn without_a_limit_it_is_information() {
    let measurement = Measurement::judge("t", &Value::number(1.0, Unit::Second), Unit::Millisecond, None, "");
    assert_eq!((measurement.outcome, measurement.value_text()), (None, "1000 ms".to_owned()));
    let measurement = Measurement::judge("t", &Value::number(f64::NAN, Unit::Second), Unit::Second, None, "");
    assert_eq!((measurement.outcome, measurement.value.clone()), (None, Reading::Null));
    // A procedure that yields another dimension is shown as it is.
    let measurement = Measurement::judge("t", &Value::number(1.0, Unit::Volt), Unit::Second, None, "");
    assert_eq!(measurement.value_text(), "1 V");
}

#[test]
fn kinds_that_do_not_fit_are_errored_never_passed() {
    let seconds = limit("<= 2 s", Dimension::Time);
    let text = Limit::parse("== none", Kind::Text).unwrap();
    for (value, limit) in [
        (Value::number(1.0, Unit::Volt), &seconds),
        (Value::text("1 s"), &seconds),
        (Value::NotAvailable("no CAN error counters over slcan".to_owned()), &seconds),
        (Value::count(0), &text),
        (Value::NotAvailable("no".to_owned()), &text),
    ] {
        let measurement = Measurement::judge("t", &value, Unit::Second, Some(limit), "");
        assert_eq!(measurement.outcome, Some(Outcome::Errored), "{value:?}");
    }
}

#[test]
fn the_scanned_serial_number_is_expected() {
    let limit = Limit::parse("== $serial_number", Kind::Text).unwrap();
    let judge =
        |text: &str| Measurement::judge("serial_number", &Value::text(text), Unit::Count, Some(&limit), "DEMO-1\u{1b}");
    assert_eq!(judge("DEMO-1\u{1b}").outcome, Some(Outcome::Passed));
    assert_eq!(judge("DEMO-2").outcome, Some(Outcome::Failed));
    assert_eq!(judge("DEMO-2\u{7}").value_text(), "DEMO-2\\u{7}");
    assert_eq!(judge("DEMO-2").limit_text(), "== DEMO-1\\u{1b}");
}

#[test]
fn numbers_come_back_exactly() {
    for number in [0.1 + 0.2, 1.0 / 3.0, 5e-324, f64::MAX, -0.0, 123_456_789.123_456_79] {
        let measurement = Measurement::judge("t", &Value::number(number, Unit::Second), Unit::Second, None, "");
        let json = serde_json::to_string(&measurement).unwrap();
        let back: Measurement = serde_json::from_str(&json).unwrap();
        let Reading::Number(back) = back.value else { panic!("{json}") };
        assert_eq!(back.to_bits(), number.to_bits(), "{json}");
    }
}
