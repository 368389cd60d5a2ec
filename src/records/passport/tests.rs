#![allow(clippy::unwrap_used, clippy::panic, reason = "a test may end with a panic")]

use gnc_analysis::details::AxesDetails;
use gnc_analysis::figures::{FigureError, Findings};
use gnc_executive::catalogue::ItemId;
use gnc_executive::measurement::Value;
use gnc_executive::quantity::Unit;
use gnc_executive::uncertainty::Uncertainty as Known;
use serde_json::json;

use super::of_run::of;
use super::*;

fn estimate(value: f64, unit: Unit, u: f64, k: f64) -> Value {
    Value::estimate(value, unit, Known::symmetric(value, u, k, 0.95))
}

/// Findings as the items make them, with round numbers.
fn found() -> Vec<(String, Findings)> {
    // 160,000 counts for a g and 20,000 for one deg/s are nominal. The first axis has a tenth of a percent more.
    let accel = |factor: f64| 9.80665 / 160_000.0 / factor;
    let gyro = |factor: f64| 20_000.0 * 180.0 / std::f64::consts::PI * factor;
    let findings = |details: serde_json::Value, measured: Vec<(&'static str, Value)>| Findings {
        measured,
        details: details.into(),
    };
    let frames = AxesDetails {
        coupling_to_table: [[0.0; 3]; 3],
        coupling_to_seat: [[0.0; 3]; 3],
        nonorthogonality_rad: [1e-4, -2e-4, 3e-4],
        mounting_deg: Some([0.01, -0.02, 0.0]),
        mounting_u_deg: 0.002,
        label: "the mounting of the seat is that of the bench file".to_owned(),
    };
    let six = findings(
        json!({ "calibration": { "accel": {
            "matrix": [[accel(1.001), 0.0, 0.0], [0.0, accel(1.0), 0.0], [0.0, 0.0, accel(1.0)]], "offset": [0.0, 0.0, 0.0],
        } }, "frames": frames }),
        vec![
            ("nonorthogonality_xy", estimate(100.0, Unit::PartsPerMillion, 1.0, 2.0)),
            ("nonorthogonality_xz", estimate(-200.0, Unit::PartsPerMillion, 1.0, 2.0)),
            ("nonorthogonality_yz", estimate(300.0, Unit::PartsPerMillion, 1.0, 2.0)),
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
        vec![
            ("temperature", Value::number(26.0, Unit::DegreeCelsius)),
            ("nonorthogonality_xy", estimate(1.0, Unit::PartsPerMillion, 1.0, 2.0)),
            ("nonorthogonality_xz", estimate(2.0, Unit::PartsPerMillion, 1.0, 2.0)),
            ("nonorthogonality_yz", estimate(-3.0, Unit::PartsPerMillion, 1.0, 2.0)),
        ],
    );
    let names = [
        "g_sensitivity_xx",
        "g_sensitivity_xy",
        "g_sensitivity_xz",
        "g_sensitivity_yx",
        "g_sensitivity_yy",
        "g_sensitivity_yz",
        "g_sensitivity_zx",
        "g_sensitivity_zy",
        "g_sensitivity_zz",
    ];
    let mut measured: Vec<(&'static str, Value)> = names
        .into_iter()
        .zip([36.0, -72.0, 18.0, 3.6, 7.2, 3.6, 0.0, 0.0, -36.0])
        .map(|(name, value)| (name, estimate(value, Unit::DegreePerHourPerGravity, 0.1, 2.0)))
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
    let passport = of("SN-1", Some(5.01), origin, &found()).unwrap();
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
    // The largest of each row, with its sign: -72 deg/h/g are -0.02 deg/s/g.
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
    near("/alignment/mounting_deg/1", -0.02);
    near("/alignment/mounting_u_deg", 0.002);
    near("/alignment/nonorthogonality_accel_ppm/2", 300.0);
    near("/alignment/nonorthogonality_gyro_ppm/0", 1.0);
    let back: Passport = serde_json::from_value(written).unwrap();
    assert_eq!(back.device_id, "SN-1");
}

/// The schema names exactly the keys that are written, at every level.
#[test]
fn the_schema_has_the_same_keys() {
    fn compare(schema: &serde_json::Value, written: &serde_json::Value, place: &str) {
        let Some(object) = written.as_object() else { return };
        let schema = if schema["properties"].is_object() { schema } else { &schema["items"] };
        let properties =
            schema["properties"].as_object().unwrap_or_else(|| panic!("{place} is no object in the schema"));
        let keys = |map: &serde_json::Map<String, serde_json::Value>| map.keys().cloned().collect::<Vec<_>>();
        assert_eq!(keys(properties), keys(object), "{place}");
        assert_eq!(schema["additionalProperties"], false, "{place}");
        for (key, value) in object {
            assert!(properties[key]["description"].is_string(), "{place}/{key} has no description");
            let inner = value.as_array().and_then(|values| values.first()).unwrap_or(value);
            compare(&properties[key], inner, &format!("{place}/{key}"));
        }
    }
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs/passport.schema.json");
    let schema: serde_json::Value = serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap();
    let mut all = found();
    all[0].1.details.to_mut()["budget"] = budget();
    all[0].1.details.to_mut()["calibration"]["mag"] = json!({ "dx": 0.0, "dy": 0.0, "ky": 1.0, "sin_alpha": 0.0 });
    let number = PassportNumber { key: "order".into(), label: "Order".into(), value: "PO-1".into() };
    let chain = Some(format!("12 {}", "0".repeat(64)));
    let origin = Origin { numbers: vec![number], chain, ..Origin::default() };
    let passport = of("SN-1", None, origin, &all).unwrap();
    compare(&schema, &serde_json::to_value(&passport).unwrap(), "");
}

#[test]
fn what_is_missing_is_named() {
    for (left_out, item) in [(0, ItemId::SixPosition), (1, ItemId::Rotation), (2, ItemId::GyroStill)] {
        let mut some = found();
        some.remove(left_out);
        assert_eq!(
            of("SN-1", None, Origin::default(), &some),
            Err(NoPassport::Figures(FigureError::NotCalibrated { item }))
        );
    }
}

/// A budget as an item writes it.
fn budget() -> serde_json::Value {
    json!({ "bias_x": {
        "unit": "mg", "u": 0.03, "dof": 33.1, "k": 2.03, "U": 0.061, "probability": 0.95,
        "contributions": [
            { "name": "noise of the positions' means", "type": "A", "value": 0.025, "unit": "mg", "distribution": "t",
              "dof": 15.0, "sensitivity": 1.0, "u": 0.025 },
            { "name": "attitudes", "type": "B", "value": 5.2e-5, "unit": "rad", "distribution": "normal", "dof": null,
              "sensitivity": 333.0, "u": 0.0173 },
        ],
    } })
}

#[test]
fn the_budget_of_the_calibration_is_in_it() {
    let mut all = found();
    all[0].1.details.to_mut()["budget"] = budget();
    // The budget of another item does not belong to the calibration.
    all[3].1.details.to_mut()["budget"] = budget();
    let passport = of("SN-1", None, Origin::default(), &all).unwrap();
    let [PassportBudget { item, figure, k, dof, expanded, contributions, .. }] = &passport.uncertainty.budget[..]
    else {
        panic!("{:?}", passport.uncertainty.budget)
    };
    assert_eq!(
        (item.as_str(), figure.as_str(), *k, *dof, *expanded),
        ("six", "bias_x", Some(2.03), Some(33.1), Some(0.061))
    );
    assert_eq!((contributions.len(), contributions[1].dof), (2, None));
}

/// NaN would be written as null where a reader expects a number.
#[test]
fn a_passport_without_a_number_is_none() {
    let mut all = found();
    for (name, value) in &mut all[2].1.measured {
        if *name == "bias_y" {
            *value = Value::NotAvailable("no".into());
        }
    }
    assert_eq!(of("SN-1", None, Origin::default(), &all), Err(NoPassport::NotANumber { key: "b_g_dps" }));
}

/// XML read back by the rules of `xml`, guided by the JSON beside it.
fn read_back(text: &str, like: &serde_json::Value) -> serde_json::Value {
    use quick_xml::events::Event;
    struct Node {
        name: String,
        nil: bool,
        text: String,
        children: Vec<Node>,
    }
    let mut reader = quick_xml::Reader::from_str(text);
    let node = |start: &quick_xml::events::BytesStart<'_>| Node {
        name: start.name().as_ref().to_owned(),
        nil: start.attributes().any(|attribute| attribute.unwrap().key.as_ref() == "xsi:nil"),
        text: String::new(),
        children: Vec::new(),
    };
    let mut open = vec![Node { name: String::new(), nil: false, text: String::new(), children: Vec::new() }];
    loop {
        match reader.read_event().unwrap() {
            Event::Start(start) => open.push(node(&start)),
            Event::Empty(start) => open.last_mut().unwrap().children.push(node(&start)),
            Event::Text(text) => open.last_mut().unwrap().text.push_str(&text.xml10_content()),
            Event::GeneralRef(reference) => {
                let name = format!("&{};", &*reference);
                open.last_mut().unwrap().text.push_str(&quick_xml::escape::unescape(&name).unwrap());
            }
            Event::End(_) => {
                let closed = open.pop().unwrap();
                open.last_mut().unwrap().children.push(closed);
            }
            Event::Eof => break,
            _ => {}
        }
    }
    fn value(node: &Node, like: &serde_json::Value) -> serde_json::Value {
        match like {
            _ if node.nil => serde_json::Value::Null,
            serde_json::Value::Object(map) => {
                node.children.iter().map(|child| (child.name.clone(), value(child, &map[&child.name]))).collect()
            }
            serde_json::Value::Array(values) if values.iter().any(|value| !value.is_number()) => {
                node.children.iter().zip(values).map(|(child, like)| value(child, like)).collect()
            }
            serde_json::Value::Array(_) => {
                node.text.split_whitespace().map(|word| word.parse::<f64>().unwrap()).collect::<Vec<_>>().into()
            }
            serde_json::Value::Number(_) => node.text.parse::<f64>().unwrap().into(),
            serde_json::Value::Bool(_) => node.text.parse::<bool>().unwrap().into(),
            _ => node.text.clone().into(),
        }
    }
    value(&open.pop().unwrap().children[0], like)
}

/// Both files have the same content to the last bit, for any texts.
#[test]
fn xml_says_what_json_says() {
    let mut all = found();
    all[0].1.details.to_mut()["budget"] = budget();
    all[0].1.details.to_mut()["calibration"]["mag"] =
        json!({ "dx": 1e-300, "dy": -0.1, "ky": 1.0 / 3.0, "sin_alpha": 0.0 });
    for hostile in
        ["SN-1", "<a href='x'>&amp;\"]]>", "  two  spaces ", "µ模块\u{202e}", "<!--", "\u{1b}[2J\r\n\u{ffff}\0"]
    {
        let origin = Origin { means: hostile.to_owned(), ..Origin::default() };
        let origin = Origin { means: of_run::plain(&origin.means), ..origin };
        let passport = of(hostile, Some(5.0), origin, &all).unwrap();
        let json = serde_json::to_value(&passport).unwrap();
        let text = String::from_utf8(xml(&passport).unwrap()).unwrap();
        assert_eq!(read_back(&text, &json), json, "{text}");
        assert!(
            !text.contains("<a ") && !text.contains("<!--") && !text.contains(['\u{1b}', '\0', '\u{ffff}']),
            "{text}"
        );
    }
}

/// The XML schema names the same keys as the JSON schema, and the same keys may be null.
#[test]
fn both_schemas_name_the_same_keys() {
    fn keys(schema: &serde_json::Value, found: &mut Vec<(String, bool)>) {
        for (key, property) in schema["properties"].as_object().into_iter().flatten() {
            let null = property["type"].as_array().is_some_and(|types| types.contains(&json!("null")));
            found.push((key.clone(), null));
            keys(property, found);
            keys(&property["items"], found);
        }
    }
    let read =
        |name: &str| std::fs::read_to_string(format!("{}/../../docs/{name}", env!("CARGO_MANIFEST_DIR"))).unwrap();
    let mut in_json = Vec::new();
    keys(&serde_json::from_str(&read("passport.schema.json")).unwrap(), &mut in_json);
    let xsd = read("passport.xsd");
    let elements = xsd.split("<xs:element name=\"").skip(1).map(|rest| {
        let tag = rest.split('>').next().unwrap();
        (tag.split('"').next().unwrap().to_owned(), tag.contains("nillable=\"true\""))
    });
    let is_form = |name: &str| matches!(name, "passport" | "row" | "entry");
    let mut in_xml: Vec<(String, bool)> = elements.filter(|(name, _)| !is_form(name)).collect();
    in_json.sort();
    in_xml.sort();
    assert_eq!(in_json, in_xml);
}
