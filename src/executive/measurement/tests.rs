use super::*;
use crate::limit::MeasurementKind;
use crate::quantity::Dimension;

fn limit(text: &str, dimension: Dimension) -> Limit {
    Limit::parse(text, MeasurementKind::Number(dimension)).unwrap()
}

#[test]
fn a_measurement_is_recorded_in_the_unit_of_its_limit() {
    let limit = limit("0.49 A +- 5 %", Dimension::Current);
    let value = Value::number(468.0, Unit::Milliampere);
    let measurement =
        Measurement::judge("supply_current", &value, Unit::Milliampere, Some(&limit), Decision::Simple, "");
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
        let measurement = Measurement::judge(
            "t",
            &Value::number(number, Unit::Second),
            Unit::Second,
            Some(&limit),
            Decision::Simple,
            "",
        );
        assert_eq!(
            serde_json::to_string(&measurement).unwrap(),
            format!(
                r#"{{"name":"t","value":null,"raw":"{raw}","unit":"s","low":null,"high":2.0,"expected":null,"outcome":"errored"}}"#
            )
        );
        assert!(measurement.is_available());
        assert_eq!(measurement.value_text(), raw);
    }
    // A finite number that is too large for the limit's unit becomes infinite there.
    let measurement =
        Measurement::judge("t", &Value::number(1e308, Unit::Hour), Unit::Second, Some(&limit), Decision::Simple, "");
    assert_eq!((measurement.outcome, measurement.raw.as_deref()), (Some(Outcome::Errored), Some("inf")));
}

#[test]
fn without_a_limit_it_is_information() {
    let measurement =
        Measurement::judge("t", &Value::number(1.0, Unit::Second), Unit::Millisecond, None, Decision::Simple, "");
    assert_eq!((measurement.outcome, measurement.value_text()), (None, "1000 ms".to_owned()));
    let measurement =
        Measurement::judge("t", &Value::number(f64::NAN, Unit::Second), Unit::Second, None, Decision::Simple, "");
    assert_eq!((measurement.outcome, measurement.value.clone()), (None, Reading::Null));
    // A value of another dimension is shown in the procedure's unit.
    let measurement =
        Measurement::judge("t", &Value::number(1.0, Unit::Volt), Unit::Second, None, Decision::Simple, "");
    assert_eq!(measurement.value_text(), "1 V");
}

#[test]
fn kinds_that_do_not_fit_are_errored_never_passed() {
    let seconds = limit("<= 2 s", Dimension::Time);
    let text = Limit::parse("== none", MeasurementKind::Text).unwrap();
    for (value, limit) in [
        (Value::number(1.0, Unit::Volt), &seconds),
        (Value::text("1 s"), &seconds),
        (Value::NotAvailable("no CAN error counters over slcan".to_owned()), &seconds),
        (Value::count(0), &text),
        (Value::NotAvailable("no".to_owned()), &text),
    ] {
        let measurement = Measurement::judge("t", &value, Unit::Second, Some(limit), Decision::Simple, "");
        assert_eq!(measurement.outcome, Some(Outcome::Errored), "{value:?}");
    }
}

#[test]
fn the_scanned_serial_number_is_expected() {
    let limit = Limit::parse("== $serial_number", MeasurementKind::Text).unwrap();
    let judge = |text: &str| {
        Measurement::judge(
            "serial_number",
            &Value::text(text),
            Unit::Count,
            Some(&limit),
            Decision::Simple,
            "DEMO-1\u{1b}",
        )
    };
    assert_eq!(judge("DEMO-1\u{1b}").outcome, Some(Outcome::Passed));
    assert_eq!(judge("DEMO-2").outcome, Some(Outcome::Failed));
    assert_eq!(judge("DEMO-2\u{7}").value_text(), "DEMO-2\\u{7}");
    assert_eq!(judge("DEMO-2").limit_text(), "== DEMO-1\\u{1b}");
}

#[test]
fn numbers_come_back_exactly() {
    for number in [0.1 + 0.2, 1.0 / 3.0, 5e-324, f64::MAX, -0.0, 123_456_789.123_456_79] {
        let measurement =
            Measurement::judge("t", &Value::number(number, Unit::Second), Unit::Second, None, Decision::Simple, "");
        let json = serde_json::to_string(&measurement).unwrap();
        let back: Measurement = serde_json::from_str(&json).unwrap();
        let Reading::Number(back) = back.value else { panic!("{json}") };
        assert_eq!(back.to_bits(), number.to_bits(), "{json}");
    }
}

/// Interval and rule are recorded with the value, in the unit of its limit. So the judgement can be repeated.
#[test]
fn a_coverage_interval_is_recorded_and_counts() {
    let limit = limit("<= 10 deg/h", Dimension::AngularRate);
    let value = Value::estimate(0.0025, Unit::DegreePerSecond, Uncertainty::interval(0.00125, 0.00625, 0.95));
    let judge = |decision| Measurement::judge("b", &value, Unit::DegreePerHour, Some(&limit), decision, "");
    let measurement = judge(Decision::Simple);
    assert_eq!(
        serde_json::to_string(&measurement).unwrap(),
        r#"{"name":"b","value":9.0,"unit":"deg/h","low":null,"high":10.0,"uncertainty":{"low":4.5,"high":22.5,"probability":0.95},"decision":"simple","expected":null,"outcome":"marginal"}"#
    );
    assert_eq!((measurement.value_text(), measurement.uncertainty_text()), ("9 deg/h".into(), "4.5 .. 22.5".into()));
    assert_eq!(judge(Decision::GuardBand).outcome, Some(Outcome::Failed));
    // Half the width is 0.8 deg/h. The numbers do not show k, so it is recorded.
    let value = Value::estimate(9.0, Unit::DegreePerHour, Uncertainty::symmetric(9.0, 0.4, 2.0, 0.95));
    let measurement = Measurement::judge("b", &value, Unit::DegreePerHour, Some(&limit), Decision::GuardBand, "");
    assert_eq!((measurement.outcome, measurement.uncertainty_text()), (Some(Outcome::Passed), "+- 0.8".into()));
    let back: Measurement = serde_json::from_str(&serde_json::to_string(&measurement).unwrap()).unwrap();
    assert_eq!(back, measurement);
    // Without a known interval there is no judgement.
    let value = Value::estimate(9.0, Unit::DegreePerHour, Uncertainty::interval(f64::NAN, 10.0, 0.95));
    let measurement = Measurement::judge("b", &value, Unit::DegreePerHour, Some(&limit), Decision::Simple, "");
    assert_eq!((measurement.outcome, measurement.uncertainty), (Some(Outcome::Errored), None));
}

/// Records from before coverage intervals are read.
#[test]
fn old_records_are_read() {
    let old = r#"{"name":"t","value":1.0,"unit":"s","low":null,"high":2.0,"expected":null,"outcome":"passed"}"#;
    let measurement: Measurement = serde_json::from_str(old).unwrap();
    assert_eq!((measurement.uncertainty, measurement.decision), (None, None));
    assert_eq!(serde_json::to_string(&measurement).unwrap(), old);
}
