#![allow(clippy::unwrap_used, clippy::panic, reason = "a test may end with a panic")]

use gnc_executive::catalogue::ItemId;
use gnc_executive::uncertainty::Uncertainty as Known;
use serde_json::json;

use super::*;

fn estimate(value: f64, unit: Unit, u: f64, k: f64) -> Value {
    Value::estimate(value, unit, Known::symmetric(value, u, k, 0.95))
}

/// Findings as the items make them, with round numbers.
fn found() -> Vec<(String, Findings)> {
    // 160,000 counts for a g and 20,000 for one deg/s are nominal: a tenth of a percent more on the first axis.
    let accel = |factor: f64| 9.80665 / 160_000.0 / factor;
    let gyro = |factor: f64| 20_000.0 * 180.0 / std::f64::consts::PI * factor;
    let findings = |details: serde_json::Value, measured: Vec<(&str, Value)>| Findings {
        measured: measured.into_iter().map(|(name, value)| (name.to_owned(), value)).collect(),
        details,
    };
    let six = findings(
        json!({ "calibration": { "accel": {
            "matrix": [[accel(1.001), 0.0, 0.0], [0.0, accel(1.0), 0.0], [0.0, 0.0, accel(1.0)]], "offset": [0.0, 0.0, 0.0],
        } } }),
        vec![
            ("bias_x", estimate(5.0, Unit::Milligravity, 0.01, 2.0)),
            ("bias_y", estimate(-8.0, Unit::Milligravity, 0.02, 2.2)),
            ("bias_z", estimate(6.0, Unit::Milligravity, 0.01, 2.0)),
            ("temperature", Value::number(25.0, Unit::DegreeCelsius)),
            ("temperature_drift", Value::number(1.0, Unit::DegreeCelsius)),
        ],
    );
    let rotation = findings(
        json!({ "calibration": { "gyro_scale": {
            "response": [[gyro(1.001), 0.0, 0.0], [0.0, gyro(1.0), 0.0], [0.0, 0.0, gyro(1.0)]],
            "matrix": [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
        } } }),
        vec![("temperature", Value::number(26.0, Unit::DegreeCelsius))],
    );
    let names = ["xx", "xy", "xz", "yx", "yy", "yz", "zx", "zy", "zz"].map(|pair| format!("g_sensitivity_{pair}"));
    let mut measured: Vec<(&str, Value)> = names
        .iter()
        .zip([36.0, -72.0, 18.0, 3.6, 7.2, 3.6, 0.0, 0.0, -36.0])
        .map(|(name, value)| (name.as_str(), estimate(value, Unit::DegreePerHourPerGravity, 0.1, 2.0)))
        .collect();
    for (name, value) in [("bias_x", 0.08), ("bias_y", -0.05), ("bias_z", 0.06)] {
        measured.push((name, estimate(value, Unit::DegreePerSecond, 1e-4, 2.5)));
    }
    let nothing = [0.0; 3];
    let still = findings(
        json!({ "calibration": { "gyro_still": { "bias": [0.0, 0.0, 0.0], "per_force": [nothing, nothing, nothing] } } }),
        measured,
    );
    let allan = findings(
        json!({}),
        vec![
            ("angle_random_walk_x", Value::number(0.15, Unit::DegreePerRootHour)),
            ("angle_random_walk_y", Value::number(0.3, Unit::DegreePerRootHour)),
            ("angle_random_walk_z", Value::number(0.12, Unit::DegreePerRootHour)),
            ("bias_instability_gyro_x", Value::number(3.0, Unit::DegreePerHour)),
            ("bias_instability_gyro_y", Value::NotAvailable("the record shows no flat part".into())),
            ("bias_instability_gyro_z", Value::number(3.0, Unit::DegreePerHour)),
            ("velocity_random_walk_x", Value::number(0.06, Unit::MetrePerSecondPerRootHour)),
            ("velocity_random_walk_y", Value::number(0.05, Unit::MetrePerSecondPerRootHour)),
            ("velocity_random_walk_z", Value::number(0.05, Unit::MetrePerSecondPerRootHour)),
        ],
    );
    vec![("six".into(), six), ("rotation".into(), rotation), ("still".into(), still), ("allan".into(), allan)]
}

#[test]
fn the_published_keys_hold_what_was_found() {
    let origin = Origin { date: "2026-11-22T10:00:00+08:00".into(), ..Origin::default() };
    let passport = Passport::of("SN-1", Some(5.01), origin, &found()).unwrap();
    let written = serde_json::to_value(&passport).unwrap();
    let near = |pointer: &str, truth: f64| {
        let value = written.pointer(pointer).and_then(serde_json::Value::as_f64);
        assert!(
            value.is_some_and(|value| (value - truth).abs() <= 1e-9 * truth.abs()),
            "{pointer}: {value:?}, {truth}"
        );
    };
    assert_eq!(written["device_id"], "SN-1");
    assert_eq!(written["conditions"]["temperature_range_C"], json!([24.5, 26.0]));
    near("/conditions/supply_V", 5.01);
    near("/accel/M_a/0/0", 1.001);
    near("/accel/M_a/1/1", 1.0);
    near("/accel/b_a_mg/1", -8.0);
    assert!(written["accel"]["temp_coeff"]["b_a_mg_per_C"].is_null());
    // 0.06 m/s/sqrt(h) is a sixtieth in one second.
    near("/accel/VRW_mps2_per_sqrtHz", 0.001);
    near("/gyro/M_g/0/0", 1.001);
    near("/gyro/b_g_dps/0", 0.08);
    // Signed, the largest of each row: -72 deg/h/g are -0.02 deg/s/g.
    near("/gyro/K_g_dps_per_g/0", -0.02);
    near("/gyro/K_g_dps_per_g/2", -0.01);
    near("/gyro/K_g_full_dps_per_g/0/0", 0.01);
    // 0.3 deg/sqrt(h) are 0.005 deg/s/sqrt(Hz).
    near("/gyro/ARW_dps_per_sqrtHz", 0.005);
    assert!(written["gyro"]["bias_instability_dph"].is_null(), "an axis without a flat part");
    // One k for both: the larger.
    near("/uncertainty/k", 2.5);
    near("/uncertainty/U_accel_mg", 2.5 * 0.02);
    near("/uncertainty/U_gyro_dps", 2.5e-4);
    assert!(written["magnetometer"].is_null());
    let back: Passport = serde_json::from_value(written).unwrap();
    assert_eq!(back.device_id, "SN-1");
}

/// The schema names exactly the keys that are written, everywhere.
#[test]
fn the_schema_has_the_same_keys() {
    fn compare(schema: &serde_json::Value, written: &serde_json::Value, place: &str) {
        let Some(object) = written.as_object() else { return };
        let properties =
            schema["properties"].as_object().unwrap_or_else(|| panic!("{place} is no object in the schema"));
        let keys = |map: &serde_json::Map<String, serde_json::Value>| map.keys().cloned().collect::<Vec<_>>();
        assert_eq!(keys(properties), keys(object), "{place}");
        assert_eq!(schema["additionalProperties"], false, "{place}");
        for (key, value) in object {
            assert!(properties[key]["description"].is_string(), "{place}/{key} has no description");
            compare(&properties[key], value, &format!("{place}/{key}"));
        }
    }
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs/passport.schema.json");
    let schema: serde_json::Value = serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap();
    let mut all = found();
    all[0].1.details["calibration"]["mag"] = json!({ "dx": 0.0, "dy": 0.0, "ky": 1.0, "sin_alpha": 0.0 });
    let passport = Passport::of("SN-1", None, Origin::default(), &all).unwrap();
    compare(&schema, &serde_json::to_value(&passport).unwrap(), "");
}

#[test]
fn what_is_missing_is_named() {
    for (left_out, item) in [(0, ItemId::SixPosition), (1, ItemId::Rotation), (2, ItemId::GyroStill)] {
        let mut some = found();
        some.remove(left_out);
        assert_eq!(Passport::of("SN-1", None, Origin::default(), &some), Err(FigureError::NotCalibrated { item }));
    }
}
