//! CAN by interfaces of the kernel. `GNC_CAN` names the station's interface, and behind a comma the board's if it is
//! another one: `GNC_CAN=vcan0` or `GNC_CAN=can0,can1`. Without it these tests fail: they are built only when asked
//! for, and nobody shall take what did not run for what passed.

#![expect(clippy::expect_used, reason = "what cannot be set up fails the test that needs it")]

use std::sync::{Mutex, MutexGuard};

use gnc_tests::{Place, bad_items};
use serde_json::Value;

const STATION: &str = env!("CARGO_BIN_EXE_station-under-test");
/// One bus carries one bench at a time.
static BUS: Mutex<()> = Mutex::new(());

fn interfaces() -> (String, MutexGuard<'static, ()>) {
    let names = std::env::var("GNC_CAN").expect("GNC_CAN names the interfaces, as in GNC_CAN=vcan0");
    (names, BUS.lock().unwrap_or_else(std::sync::PoisonError::into_inner))
}

fn item<'a>(record: &'a Value, id: &str) -> &'a Value {
    record["items"].as_array().into_iter().flatten().find(|item| item["id"] == id).expect("an item")
}

fn passes(link: &str, speed: &str, passed: usize) {
    let (names, _bus) = interfaces();
    let place = Place::new(STATION);
    let run = place.functional("--sim", &["--sim-link", link, "--sim-can", &names, "--sim-speed", speed]);
    assert_eq!(run.code, Some(0), "{}{}", run.stdout, run.stderr);
    let record = place.record();
    let items = record["items"].as_array().expect("items");
    assert_eq!(items.iter().filter(|item| item["outcome"] == "passed").count(), passed, "{record}");
    let can = item(&record, "can")["attempts"][0]["measurements"].as_array().expect("measurements").clone();
    let errors = can.iter().find(|measurement| measurement["name"] == "adapter_errors").expect("adapter_errors");
    assert_eq!(errors["value"], 0.0, "the kernel tells of error frames, and there were none");
}

#[test]
fn can_alone_at_full_speed() {
    passes("can", "max", 13);
}

#[test]
fn can_alone_at_true_speed() {
    passes("can", "1", 13);
}

#[test]
fn can_beside_rs422() {
    passes("rs422", "1", 14);
}

#[test]
fn altered_frames_fail_the_item() {
    let (names, _bus) = interfaces();
    let place = Place::new(STATION);
    let run =
        place.functional("--sim=can-flips-bits", &["--sim-link", "can", "--sim-can", &names, "--sim-speed", "max"]);
    assert_eq!(run.code, Some(1), "{}{}", run.stdout, run.stderr);
    assert_eq!(bad_items(&place.record()), ["can"]);
}
