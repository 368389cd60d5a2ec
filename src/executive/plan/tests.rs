mod includes;
mod mistakes;
mod parts;

use std::collections::HashMap;

use proptest::prelude::*;

use super::*;
use crate::limit::{Expected, Range};
use crate::test_run::{FUNCTIONAL, plan};

/// Reads the first file; the others can be included.
fn read(files: &[(&str, &str)]) -> Result<Plan, Mistakes> {
    let stored: HashMap<&str, &str> = files.iter().copied().collect();
    let (name, text) = files[0];
    Plan::read(name, text.into(), &mut |name| {
        stored.get(name).map(|text| text.as_bytes().to_vec()).ok_or_else(|| "no such file".to_owned())
    })
}

const IDENTITY: &str = "[[item]]\nid = \"identity\"\n[item.limits]\nprotocol = \"== 1\"\n";

fn mistakes(text: &str) -> String {
    read(&[("plan.toml", text)]).unwrap_err().to_string()
}

#[test]
fn a_realistic_plan_is_read() {
    let plan = plan(FUNCTIONAL);
    assert_eq!((plan.name.as_str(), plan.version.as_str(), plan.on_fail), ("functional", "1.0", OnFail::Continue));
    let names: Vec<&str> = plan.items().iter().map(|item| item.name.as_str()).collect();
    assert_eq!(names, ["identity", "cpu", "timers", "sdram", "imu", "ad", "can"]);
    let identity = &plan.items()[0];
    assert_eq!(identity.limit("serial_number"), Some(&Limit::Text(Expected::SerialNumber)));
    let range = |low, high, unit, marginal| Limit::Range(Range { unit, low: Some(low), high: Some(high), marginal });
    assert_eq!(identity.limit("supply_current"), Some(&range(0.4655, 0.5145, Unit::Ampere, Some(0.005))));
    assert_eq!(identity.limit("hardware"), None);
    let cpu = &plan.items()[1];
    assert_eq!((cpu.requires.as_slice(), cpu.limits.len()), ([0].as_slice(), 8));
    assert_eq!(cpu.params.integer("operand_sets"), Ok(32));
    let timers = &plan.items()[2];
    assert_eq!(timers.params.integers("timers"), Ok([0, 2].as_slice()));
    // Timer 1 is switched off, so the pattern leaves it out. The exact name counts more than the pattern.
    assert_eq!(timers.limit("timer1_500us_mean"), None);
    assert_eq!(timers.limit("timer0_500us_mean"), Some(&range(499.0, 501.0, Unit::Microsecond, None)));
    assert_eq!(timers.limit("timer2_500us_mean"), Some(&range(0.49, 0.51, Unit::Millisecond, None)));
    let imu = &plan.items()[4];
    assert_eq!((imu.attempts, imu.retry_failed, imu.repeats, imu.timeout_s), (2, false, 1, 30.0));
    assert_eq!(imu.params.quantity("rate", Unit::Kilohertz), Ok(0.2));
    assert!(imu.params.integer("rate").is_err());
    assert_eq!(imu.limit("accel_z"), Some(&range(-1.05, -0.95, Unit::Gravity, None)));
    let ad = &plan.items()[5];
    assert!(ad.optional);
    assert_eq!(ad.devices().collect::<Vec<_>>(), [Device::Slave, Device::Operator]);
}

#[test]
fn later_patterns_override_earlier_ones_and_names_override_both() {
    let plan = plan(
        r#"
name = "p"
version = "1"
[[item]]
id = "timers"
[item.limits]
timer0_1ms_mean = "<= 1 ms"
"timer*_mean" = "<= 9 ms"
"timer*_5ms_mean" = "<= 2 ms"
"#,
    );
    let high = |name: &str| match plan.items()[0].limit(name) {
        Some(Limit::Range(range)) => range.high,
        _ => None,
    };
    let highs = ["timer0_1ms_mean", "timer1_1ms_mean", "timer1_5ms_mean"].map(high);
    assert_eq!(highs, [Some(1.0), Some(9.0), Some(2.0)]);
}

#[test]
fn a_plan_of_twenty_thousand_items_is_read() {
    let mut text = "name = \"long\"\nversion = \"1\"\n".to_owned();
    for index in 0..MAX_ITEMS {
        text.push_str(&format!(
            "[[item]]\nid = \"identity\"\nname = \"i{index}\"\n[item.limits]\nprotocol = \"== 1\"\n"
        ));
    }
    assert_eq!(plan(&text).items().len(), MAX_ITEMS);
    text.push_str(IDENTITY);
    assert_eq!(
        mistakes(&text),
        "the plan has 20001 items, and at most 20000 are run\n  try: use repeats, or a loop over a shorter plan"
    );
}

/// Four thousand items of a thousand repeats are what a record holds; one result more is refused.
#[test]
fn results_that_no_record_holds_are_refused() {
    let mut text = "name = \"long\"\nversion = \"1\"\n".to_owned();
    for index in 0..4000 {
        text.push_str(&format!(
            "[[item]]\nid = \"identity\"\nname = \"i{index}\"\nrepeats = 1000\n[item.limits]\nprotocol = \"== 1\"\n"
        ));
    }
    assert_eq!(plan(&text).items().len(), 4000);
    text.push_str(IDENTITY);
    assert_eq!(
        mistakes(&text),
        "the plan asks for 4000001 results with all repeats and at most 4000000 have room in a record\n  \
         try: lower repeats and run the plan in rounds: each round has a record of its own"
    );
}

/// Items that are too many are counted alone: each of these has mistakes of its own, and to look at all of them takes long.
#[test]
fn items_that_are_too_many_are_not_looked_at() {
    let text = format!("name = \"long\"\nversion = \"1\"\n{}", "[[item]]\nid = \"no\"\n".repeat(150_000));
    assert_eq!(
        mistakes(&text),
        "the plan has 150000 items, and at most 20000 are run\n  try: use repeats, or a loop over a shorter plan"
    );
}

fn judged(item: &PlanItem, values: &[(&str, Value)]) -> Outcome {
    let measurements: Vec<Measurement> =
        values.iter().map(|(name, value)| item.judge(name, value, 1, "DEMO-1")).collect();
    item.attempt_outcome(&measurements)
}

#[test]
fn an_attempt_is_judged_by_all_its_limits() {
    let plan = plan(
        r#"
name = "p"
version = "1"
[[item]]
id = "gnss"
[item.limits]
fix_type = "== 3D"
height = { limit = "40 .. 60 m", marginal = "1 m" }
[[item]]
id = "io"
phase = "setup"
[[item]]
id = "spi"
repeats = 2
[item.limits]
bits_tested = ">= 8"
"#,
    );
    let [io, gnss, spi] = plan.items() else { panic!() };
    let fix = ("fix_type", Value::text("3D"));
    let height = |height: f64| ("height", Value::number(height, Unit::Metre));
    assert_eq!(judged(gnss, &[fix.clone(), height(50.0)]), Outcome::Passed);
    assert_eq!(judged(gnss, &[fix.clone(), height(40.5)]), Outcome::Marginal);
    assert_eq!(judged(gnss, &[fix.clone(), height(39.0)]), Outcome::Failed);
    assert_eq!(judged(gnss, &[fix.clone(), height(f64::NAN)]), Outcome::Errored);
    // A measurement that never came, or is not available, cannot be judged.
    assert_eq!(judged(gnss, std::slice::from_ref(&fix)), Outcome::Errored);
    assert_eq!(judged(gnss, &[]), Outcome::Errored);
    let unavailable = ("height", Value::NotAvailable("no fix".to_owned()));
    assert_eq!(judged(gnss, &[fix, unavailable.clone()]), Outcome::Errored);
    // But without a fix there is no height, and the missing fix is a violation.
    let no_fix = ("fix_type", Value::text("none"));
    assert_eq!(judged(gnss, std::slice::from_ref(&no_fix)), Outcome::Failed);
    assert_eq!(judged(gnss, &[no_fix.clone(), unavailable]), Outcome::Failed);
    // NaN says nothing about the module: the station could not interpret the value.
    assert_eq!(judged(gnss, &[no_fix, height(f64::NAN)]), Outcome::Errored);
    // Information alone is never a pass, except if nothing is tested.
    assert_eq!(judged(gnss, &[("latitude", Value::number(1.0, Unit::Degree))]), Outcome::Errored);
    assert_eq!(judged(io, &[]), Outcome::Passed);
    let bits = ("bits_tested", Value::count(8));
    assert_eq!(judged(spi, std::slice::from_ref(&bits)), Outcome::Errored);
    assert_eq!(judged(spi, &[bits.clone(), bits]), Outcome::Passed);
    assert_eq!(gnss.missing(&[]).collect::<Vec<_>>(), ["fix_type", "height"]);
}

#[test]
fn the_stored_schema_is_the_generated_one() {
    let stored: serde_json::Value = serde_json::from_str(include_str!("../../../docs/plan.schema.json")).unwrap();
    assert_eq!(stored, plan_schema(), "run: cargo run -p gnc-executive --example plan_schema > docs/plan.schema.json");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(512))]

    #[test]
    fn any_bytes_are_a_plan_or_mistakes(bytes in proptest::collection::vec(any::<u8>(), 0..200)) {
        if let Err(mistakes) = Plan::read("p", bytes, &mut |_| Err(String::new())) {
            prop_assert!(mistakes.count() > 0);
            prop_assert!(!mistakes.to_string().contains(char::from(27)));
        }
    }

    /// The realistic plan with one piece replaced, as by a slip of the hand.
    #[test]
    fn any_slip_is_a_plan_or_mistakes(
        at in 0..FUNCTIONAL.len(),
        cut in 0usize..40,
        piece in prop_oneof![
            "\\PC{0,8}",
            proptest::sample::select(vec![
                "[", "]", "{", "}", "=", "\"", "'", "\n", ".", "*", "[[item]]", "true", "1e9", "-1", "nan",
                "1979-05-27", "\"== \"", "\u{202e}", "\u{0}", "99999999999999999999", "0x_", "\\u0000",
            ])
            .prop_map(str::to_owned),
        ],
    ) {
        let mut bytes = FUNCTIONAL.as_bytes().to_vec();
        let end = (at + cut).min(bytes.len());
        bytes.splice(at..end, piece.bytes());
        if let Err(mistakes) = Plan::read("p", bytes, &mut |_| Err(String::new())) {
            prop_assert!(mistakes.count() > 0);
            prop_assert!(!mistakes.to_string().chars().any(|c| c.is_control() && c != '\n'));
        }
    }
}

/// An item that uses another item's captures is skipped unless that one is good, and that one must stand before it.
#[test]
fn captures_of_another_item() {
    let head = "name = \"p\"\nversion = \"1\"\n";
    let six = "[[item]]\nid = \"six-position\"\n[item.limits]\n\"bias_*\" = \"0 +- 50 mg\"\n";
    let still = |of: &str| {
        format!(
            "[[item]]\nid = \"gyro-still\"\nparams = {{ of = {of} }}\n[item.limits]\n\"bias_*\" = \"0 +- 1 deg/s\"\n"
        )
    };
    let plan = plan(&format!("{head}{six}{}", still("\"six-position\"")));
    assert_eq!(plan.items()[1].requires, [0]);
    assert_eq!(plan.items()[1].params.source("of"), Ok(Some("six-position")));
    assert!(plan.items()[1].params.source("rate").is_err());
    let wrong =
        format!("{head}{six}{}", still("3")) + &still("\"six-postion\"").replace("still\"", "still\"\nname = \"b\"");
    let wrong = wrong + &still("\"gyro-still\"").replace("still\"\nparams", "still\"\nname = \"c\"\nparams");
    insta::assert_snapshot!(mistakes(&wrong), @r#"
    plan.toml:9:17: of cannot be 3
     9 | params = { of = 3 }
       |                 ^
       = try: write the name of an item before this one that is six-position

    plan.toml:15:17: no item has the name "six-postion"
     15 | params = { of = "six-postion" }
        |                 ^^^^^^^^^^^^^
        = try: did you mean "six-position"?

    plan.toml:21:17: "gyro-still" has no captures that gyro-still can use
     21 | params = { of = "gyro-still" }
        |                 ^^^^^^^^^^^^
        = try: name an item that is six-position
    "#);
}

/// An item that needs a calibration has one before it. The accelerometers alone do not need that of the gyroscopes.
#[test]
fn calibrations_that_are_needed() {
    let head = "name = \"p\"\nversion = \"1\"\n";
    let six = "[[item]]\nid = \"six-position\"\n[item.limits]\n\"bias_*\" = \"0 +- 50 mg\"\n";
    let hour = |params: &str| {
        format!("[[item]]\nid = \"bias-stability\"\n{params}[item.limits]\n\"*_accel_x\" = \"<= 2 mg\"\n")
    };
    assert!(read(&[("plan.toml", &format!("{head}{six}{}", hour("params = { sensors = [\"accel\"] }\n")))]).is_ok());
    insta::assert_snapshot!(mistakes(&format!("{head}{}{six}", hour(""))), @r#"
    plan.toml:4:6: "bias-stability" uses the results of six-position, and no six-position comes before it
     4 | id = "bias-stability"
       |      ^^^^^^^^^^^^^^^^
       = try: put an item with id = "six-position" before it

    plan.toml:4:6: "bias-stability" uses the results of gyro-still, and no gyro-still comes before it
     4 | id = "bias-stability"
       |      ^^^^^^^^^^^^^^^^
       = try: put an item with id = "gyro-still" before it

    plan.toml:4:6: "bias-stability" uses the results of rotation, and no rotation comes before it
     4 | id = "bias-stability"
       |      ^^^^^^^^^^^^^^^^
       = try: put an item with id = "rotation" before it
    "#);
}

#[test]
fn a_plan_says_how_long_a_resumed_run_waits() {
    let read = |resume: &str| {
        let text = format!("name = \"p\"\nversion = \"1\"\n{resume}\n[[item]]\nid = \"identity\"\nphase = \"setup\"\n");
        Plan::read("plan.toml", text.into_bytes(), &mut |_| Err("no includes".to_owned()))
    };
    let rules = |resume: &str| read(resume).unwrap_or_else(|mistakes| panic!("{mistakes}")).resume;
    assert_eq!(rules(""), ResumeRules { wait_s: 1800.0, within_k: 0.5 });
    let both = "[resume]\nwait = \"1 h\"\nwithin = \"0.2 degC\"";
    assert_eq!(rules(both), ResumeRules { wait_s: 3600.0, within_k: 0.2 });
    let wrong =
        read("[resume]\nwait = \"9 h\"\nwithin = \"0.2 s\"\nwithn = \"1 degC\"").map_err(|wrong| wrong.to_string());
    insta::assert_snapshot!(wrong.expect_err("three mistakes"), @r#"
    plan.toml:4:8: wait of 9 h is out of range
     4 | wait = "9 h"
       |        ^^^^^
       = try: write 0 s to 8 h

    plan.toml:5:10: "0.2 s" is a time, and "within" is a temperature
     5 | within = "0.2 s"
       |          ^^^^^^^
       = try: a temperature is written in degC

    plan.toml:6:1: unknown key "withn"
     6 | withn = "1 degC"
       | ^^^^^
       = try: did you mean "within"?
    "#);
}
