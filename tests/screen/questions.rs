//! The questions of a plan, at the screen and at the terminal: the simulated bench turns its module by itself, and asks
//! the person all the same.

use gnc_tests::{Place, read_json};
use serde_json::Value;

use crate::terminal::Terminal;
use crate::{F2, F5, F6, F10, STATION, open};

const PLAN: &str = r#"
name = "by-hand"
version = "1"
[[item]]
id = "prompt"
name = "by-hand"
[[item.ask]]
name = "tp4"
en = "What does the meter at TP4 read?"
kind = "number"
unit = "V"
picture = "tp4.png"
[[item.ask]]
name = "gps_board"
en = "Scan the GPS board."
kind = "text"
pattern = "GPS-[0-9]{5}"
[item.limits]
tp4 = "4.9 V .. 5.1 V"
"#;

fn place() -> Place {
    let place = Place::new(STATION);
    place.write("p.toml", PLAN);
    place.write("tp4.png", "a picture");
    place
}

/// Values and outcomes of the measurements of the only run.
fn measured(place: &Place) -> Vec<(Value, Value)> {
    let attempt = place.record()["items"][0]["attempts"][0].clone();
    let all = attempt["measurements"].as_array().expect("measurements").clone();
    all.into_iter().map(|measured| (measured["value"].clone(), measured["outcome"].clone())).collect()
}

fn ends_well(terminal: Terminal) {
    let (status, restored) = terminal.end();
    assert!(restored && status.code() == Some(0), "{status}");
}

/// A typed answer with a decimal comma, a scanned one with its line end, and one that is taken back.
#[test]
fn the_screen_asks_and_files() {
    let place = place();
    let mut terminal = open(&place, &["--sim", "--sim-speed", "max", "--plan", "p.toml"], 80, 24);
    terminal.wait_for("by-hand 1");
    terminal.types(b"Q-1\r");
    terminal.wait_for("Q-1: F5 starts the test.");
    terminal.types(F5);
    terminal.wait_for("What does the meter at TP4 read?");
    terminal.wait_for("Picture: tp4.png.");
    terminal.types(F2);
    terminal.wait_for("the answer is empty");
    terminal.types(b"\x1b[200~ 50,1 V \x1b[201~");
    terminal.wait_for("50,1 V _");
    terminal.types(F2);
    terminal.wait_for("Scan the GPS board.");
    terminal.types(F6);
    terminal.wait_for("What does the meter at TP4 read?");
    // A scanner at work: its line end files nothing.
    terminal.types(b"5,01\r\n");
    terminal.wait_for("Answer: 5,01_");
    terminal.types(F2);
    terminal.wait_for("Scan the GPS board.");
    terminal.types(b"GPS-00042\r\n");
    terminal.wait_for("Answer: GPS-00042_");
    terminal.types(F2);
    terminal.wait_for("gps_board: GPS-00042.");
    terminal.types(F2);
    terminal.wait_for("F4 Repeat");
    terminal.types(F10);
    ends_well(terminal);
    let passed = || Value::from("passed");
    assert_eq!(measured(&place), [(5.01.into(), passed()), ("GPS-00042".into(), passed())]);
    let run = read_json(&place.runs()[0].join("run.json"));
    let answer = &run["items"][0]["attempts"][0]["details"][0]["answers"][0];
    assert_eq!((&answer["answered before"], &answer["by"]), (&"50,1 V".into(), &"the operator, at the screen".into()));
}

/// `--auto` asks at the terminal, says why an answer is none, and goes back.
#[test]
fn auto_asks_at_the_terminal() {
    let place = place();
    let args = ["--auto", "p.toml", "--sim", "--sim-speed", "max", "--serial-number", "Q-1"];
    let mut terminal = open(&place, &args, 200, 50);
    terminal.wait_for("What does the meter at TP4 read? A number in V. Limit: 4.9 .. 5.1 V. Picture: tp4.png.");
    terminal.types(b"about five\r");
    terminal.wait_for(">> No: \"about five\" is not a number; write a number, such as 3.3.");
    terminal.types(b"50,1\r");
    terminal.wait_for("Scan the GPS board.");
    terminal.types(b"<\r");
    terminal.wait_until("the first question again", |screen| screen.contents().matches("Limit: 4.9").count() == 3);
    terminal.types(b"5.01 V\r");
    terminal.wait_until("the second question again", |screen| screen.contents().matches("GPS board").count() == 2);
    // A scanner that ends its line with CR LF: the second line confirms nothing.
    terminal.types(b"GPS-00042\r\n");
    terminal.wait_for("Look over what is filed: tp4: 5.01 V. gps_board: GPS-00042. Press y, Enter if it is right.");
    terminal.types(b"5.02\r");
    terminal.wait_for(">> No: \"5.02\" neither confirms nor corrects; y confirms, < goes back. Look over");
    terminal.types(b"y\r");
    terminal.wait_for("PASSED (simulated)");
    ends_well(terminal);
    let passed = || Value::from("passed");
    assert_eq!(measured(&place), [(5.01.into(), passed()), ("GPS-00042".into(), passed())]);
    let run = place.record();
    let answer = &run["items"][0]["attempts"][0]["details"][0]["answers"][0];
    assert_eq!((&answer["answered before"], &answer["by"]), (&"50,1".into(), &"the operator, at the terminal".into()));
}

/// Choices that are named as the commands of the terminal are answers, and Enter does not say "done".
#[test]
fn auto_takes_choices_before_commands() {
    let place = Place::new(STATION);
    let asks = "[[item.ask]]\nname = \"lid\"\nen = \"Close the lid.\"\nkind = \"done\"\n[[item.ask]]\nname = \"sealed\"\n\
                en = \"Is it sealed?\"\nkind = \"choice\"\nchoices = [\"Y\", \"N\"]\ngood = [\"N\"]\n";
    let head = "name = \"by-hand\"\nversion = \"1\"\n[[item]]\nid = \"prompt\"\nname = \"by-hand\"\n";
    place.write("p.toml", &format!("{head}{asks}"));
    let args = ["--auto", "p.toml", "--sim", "--sim-speed", "max", "--serial-number", "Q-1"];
    let mut terminal = open(&place, &args, 200, 50);
    terminal.wait_for("Close the lid. Press y, Enter when it is done. (n: not possible)");
    terminal.types(b"\r");
    terminal.wait_for(">> No: \"\" is not done; write done. Close the lid.");
    terminal.types(b"y\r");
    terminal.wait_for("1 Y, 2 N. Limit: == N. Press Enter when it is typed. (/n: not possible; <: back)");
    terminal.types(b"n\r");
    terminal.wait_for("Look over what is filed: sealed: N.");
    terminal.types(b"done\r");
    terminal.wait_for("PASSED (simulated)");
    ends_well(terminal);
    let passed = || Value::from("passed");
    assert_eq!(measured(&place), [("done".into(), passed()), ("N".into(), passed())]);
}
