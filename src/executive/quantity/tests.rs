use proptest::prelude::*;

use super::*;

fn parsed(text: &str) -> String {
    match Quantity::parse(text) {
        Ok(quantity) => format!("{:?} {:?}", quantity.number, quantity.unit),
        Err(error) => format!("{error}; {}", error.hint(Dimension::AngularRate)),
    }
}

#[test]
fn quantities_are_read_with_their_unit() {
    for (text, expected) in [
        ("2 mg", "2.0 Milligravity"),
        ("0.49 A", "0.49 Ampere"),
        ("20 deg/h", "20.0 DegreePerHour"),
        ("20deg/h", "20.0 DegreePerHour"),
        ("5 %", "5.0 Percent"),
        ("12", "12.0 Count"),
        (" -1.5e-3  m/s^2 ", "-0.0015 MetrePerSecondSquared"),
        ("1e6 Hz", "1000000.0 Hertz"),
        (".5 V", "0.5 Volt"),
        ("+3 s", "3.0 Second"),
        ("1 e", "unknown unit \"e\"; an angular rate is written in deg/s, mdeg/s, deg/h, rad/s"),
        ("2 µs", "2.0 Microsecond"),
        ("2\u{a0}dps", "2.0 DegreePerSecond"),
        ("−0.2 °/√h", "-0.2 DegreePerRootHour"),
        ("2 Deg/S", "unknown unit \"Deg/S\"; did you mean \"deg/s\"?"),
        ("", "\"\" does not begin with a number; write a number and its unit, such as \"0.49 A\""),
        ("nan", "\"nan\" does not begin with a number; write a number and its unit, such as \"0.49 A\""),
        ("inf V", "\"inf V\" does not begin with a number; write a number and its unit, such as \"0.49 A\""),
        ("−-2 V", "\"−-2 V\" does not begin with a number; write a number and its unit, such as \"0.49 A\""),
        ("- V", "\"- V\" does not begin with a number; write a number and its unit, such as \"0.49 A\""),
        ("1e999 V", "the number \"1e999\" is too large; the largest number is about 1.8e308"),
        ("1 \u{1b}[2J", "unknown unit \"\\u{1b}[2J\"; an angular rate is written in deg/s, mdeg/s, deg/h, rad/s"),
    ] {
        assert_eq!(parsed(text), expected, "{text}");
    }
}

/// Sizes worked out by hand, from the SI brochure and the definition of standard gravity.
#[test]
fn units_have_their_size() {
    for (text, si) in [
        ("1 g", 9.80665),
        ("1 mg", 0.00980665),
        ("180 deg", std::f64::consts::PI),
        ("3600 deg/h", std::f64::consts::PI / 180.0),
        ("1 gauss", 1e-4),
        ("180 deg/s/g", std::f64::consts::PI / 9.80665),
        ("60 m/s/sqrt(h)", 1.0),
        ("1 deg/sqrt(h)", std::f64::consts::PI / 10_800.0),
        ("1000 ug/sqrt(Hz)", 0.00980665),
        ("60 deg/h/√Hz", std::f64::consts::PI / 10_800.0),
        ("1000 µg", 0.00980665),
        ("1000 mdps", std::f64::consts::PI / 180.0),
        ("1 mT", 1e-3),
        ("1 mgauss", 1e-7),
        ("1 nT", 1e-9),
        ("5 %", 0.05),
        ("1 ppm", 1e-6),
        ("1 h", 3600.0),
        ("1 us", 1e-6),
        ("115.2 kbit/s", 115_200.0),
        ("1 MHz", 1e6),
        ("1 km", 1000.0),
        ("25 degC", 25.0),
    ] {
        let found = Quantity::parse(text).unwrap().si();
        assert!((found - si).abs() <= si.abs() * 1e-15, "{text}: {found} {si}");
    }
}

/// A hint names a unit of the wanted dimension, even if a unit of another dimension is more similar.
#[test]
fn hints_look_among_the_units_of_the_dimension() {
    let hint = |text: &str, wanted| Quantity::parse(text).unwrap_err().hint(wanted);
    for (text, wanted, expected) in [
        ("2 deg/√H", Dimension::AngleRandomWalk, "did you mean \"deg/sqrt(h)\"?"),
        ("2 °/√H", Dimension::AngleRandomWalk, "did you mean \"deg/sqrt(h)\"?"),
        ("2 deg/S", Dimension::AngularRate, "did you mean \"deg/s\"?"),
        ("2 MG", Dimension::Acceleration, "did you mean \"mg\"?"),
        ("2 mgaus", Dimension::MagneticField, "did you mean \"mgauss\"?"),
        ("2 Mgauss", Dimension::MagneticField, "did you mean \"mgauss\"?"),
        ("2 v", Dimension::Voltage, "did you mean \"V\"?"),
        ("2 C", Dimension::Temperature, "did you mean \"degC\"?"),
        ("2 baud", Dimension::BitRate, "did you mean \"bit/s\"?"),
        ("2 ug/sqrt(kHz)", Dimension::VelocityRandomWalk, "did you mean \"ug/sqrt(Hz)\"?"),
        ("2 furlong", Dimension::Speed, "a speed is written in m/s"),
        ("0,49 A", Dimension::Current, "decimals have a point, such as \"0.49 A\""),
        ("2 pieces", Dimension::Count, "write a plain number without a unit"),
    ] {
        assert_eq!(hint(text, wanted), expected, "{text}");
    }
}

/// Conversions between decimal units are exact: a value equal to its limit stays equal.
#[test]
fn conversions_do_not_move_a_value() {
    for (text, unit, expected) in [
        ("1 g", Unit::Milligravity, 1000.0),
        ("1 mg", Unit::Gravity, 0.001),
        ("500 us", Unit::Millisecond, 0.5),
        ("0.5 ms", Unit::Microsecond, 500.0),
        ("0.3 s", Unit::Millisecond, 300.0),
        ("3600 deg/h", Unit::DegreePerSecond, 1.0),
        ("0.49 A", Unit::Milliampere, 490.0),
        ("0.5 gauss", Unit::Microtesla, 50.0),
        ("0.2 %", Unit::PartsPerMillion, 2000.0),
    ] {
        assert_eq!(Quantity::parse(text).unwrap().in_unit(unit), Some(expected), "{text}");
    }
    assert_eq!(Quantity::parse("1 g").unwrap().in_unit(Unit::Gauss), None);
}

#[test]
fn every_unit_is_listed_and_read_back() {
    for (index, unit) in Unit::ALL.into_iter().enumerate() {
        assert_eq!(Unit::ALL.iter().position(|other| other.symbol() == unit.symbol()), Some(index), "{unit:?}");
        assert_eq!(Quantity::parse(&format!("2 {unit}")).unwrap(), Quantity::new(2.0, unit));
        let json = serde_json::to_string(&unit).unwrap();
        assert_eq!(serde_json::from_str::<Unit>(&json).unwrap(), unit);
        for other in unit.dimension().units() {
            let there = unit.convert(1.0, other).unwrap();
            let back = other.convert(there, unit).unwrap();
            assert!((back - 1.0).abs() < 1e-14, "{unit:?} {other:?}");
            // The same ratio is computed from the sizes in SI.
            let expected = Quantity::new(1.0, unit).si() / Quantity::new(1.0, other).si();
            assert!((there / expected - 1.0).abs() < 1e-14, "{unit:?} {other:?}");
        }
    }
}

proptest! {
    #[test]
    fn any_text_is_a_finite_quantity_or_an_error(text in "\\PC*") {
        if let Ok(quantity) = Quantity::parse(&text) {
            prop_assert!(quantity.number.is_finite());
        }
    }

    #[test]
    fn nearly_quantities_never_panic(text in "[-+0-9.eE µ°√²⁻·a-z/%^()\\[\\]−]{0,14}") {
        match Quantity::parse(&text) {
            Ok(quantity) => prop_assert!(quantity.number.is_finite()),
            Err(error) => prop_assert!(!error.hint(Dimension::Time).is_empty()),
        }
    }
}
