//! Numbers of orders and sub-units: asked for by plan and bench, refused with the words of the pattern, kept in all papers.

#![cfg(feature = "sim")]
#![expect(clippy::expect_used, clippy::panic, reason = "a test says what it expected")]

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

const PLAN: &str = r#"
name = "family"
version = "1"
[numbers.order]
kind = "order"
label = { en = "Order", zh = "订单", ru = "Заказ" }
pattern = "PO-[0-9]{4}"
required = true
[numbers.gps]
kind = "subunit"
pattern = "GB-[0-9]+"
[[item]]
id = "identity"
[item.limits]
protocol = "== 1"
"#;

/// A folder with the plan.
struct Place {
    folder: tempfile::TempDir,
}

impl Place {
    fn new() -> Self {
        let place = Self { folder: tempfile::tempdir().expect("a folder") };
        place.write("plan.toml", PLAN);
        place
    }

    fn write(&self, name: &str, text: &str) {
        std::fs::write(self.folder.path().join(name), text).expect("a file");
    }

    fn station(&self, words: &[&str]) -> Output {
        let mut command = Command::new(env!("CARGO_BIN_EXE_gnc-station"));
        command.current_dir(self.folder.path()).args(words).output().expect("a program")
    }

    fn auto(&self, serial_number: &str, numbers: &[&str]) -> Output {
        let mut words = vec!["--auto", "plan.toml", "--sim", "--sim-speed", "max", "--serial-number", serial_number];
        numbers.iter().for_each(|number| words.extend(["--number", number]));
        words.extend(["--junit", "j.xml"]);
        self.station(&words)
    }

    /// The folder of the newest run of a module.
    fn run(&self, serial_number: &str) -> PathBuf {
        let newest = |folder: &Path| {
            let entries = std::fs::read_dir(folder).unwrap_or_else(|error| panic!("{}: {error}", folder.display()));
            let folders = entries.filter_map(|entry| Some(entry.ok()?.path()).filter(|path| path.is_dir()));
            folders.max().expect("a folder")
        };
        newest(&newest(&self.folder.path().join("records")).join(serial_number))
    }
}

fn said(output: &Output) -> String {
    format!("{}{}", String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr))
}

#[test]
fn what_does_not_fit_is_refused_before_anything_is_switched_on() {
    let place = Place::new();
    for (numbers, told) in [
        (vec![], "the number Order is missing, and the plan requires it"),
        (vec!["order=PO-1"], "Order \"PO-1\" does not fit the pattern PO-[0-9]{4} of the plan"),
        (vec!["order=po-1234"], "does not fit the pattern"),
        (vec!["ordr=PO-1234"], "neither plan nor bench asks for the number \"ordr\""),
        (vec!["order=PO-1234", "order=PO-1235"], "is given twice"),
        (vec!["PO-1234"], "write KEY=NUMBER"),
    ] {
        let done = place.auto("SN-1", &numbers);
        assert_eq!(done.status.code(), Some(2), "{numbers:?}: {}", said(&done));
        assert!(said(&done).contains(told), "{numbers:?}: {}", said(&done));
    }
    assert!(!place.folder.path().join("records").exists());
}

#[test]
fn all_papers_have_the_numbers() {
    let place = Place::new();
    let done = place.auto("SN-1", &["order= PO-1234 ", "gps=GB-7"]);
    assert_eq!(done.status.code(), Some(0), "{}", said(&done));
    let run = place.run("SN-1");
    let read = |name: &str| std::fs::read_to_string(run.join(name)).expect("a file");
    let record: serde_json::Value = serde_json::from_str(&read("run.json")).expect("a record");
    let order = serde_json::json!({ "key": "order", "kind": "order", "label": "Order", "value": "PO-1234" });
    assert_eq!(record["numbers"][0], order);
    assert_eq!(record["numbers"][1]["value"], "GB-7");
    for paper in ["report.html", "log.txt", "events.jsonl"] {
        assert!(read(paper).contains("PO-1234") && read(paper).contains("GB-7"), "{paper}");
    }
    let junit = std::fs::read_to_string(place.folder.path().join("j.xml")).expect("a file");
    assert!(junit.contains("value=\"order=PO-1234\"") && junit.contains("value=\"gps=GB-7\""), "{junit}");
    let list = place.station(&["records", "list", "--json"]);
    let list: serde_json::Value = serde_json::from_slice(&list.stdout).expect("a list");
    assert_eq!(list[0]["numbers"], serde_json::json!({ "gps": "GB-7", "order": "PO-1234" }));
    let table = said(&place.station(&["records", "list", "--csv"]));
    assert!(table.contains("gps=GB-7;order=PO-1234"), "{table}");
    let same = place.station(&["recompute", &run.display().to_string()]);
    assert_eq!(same.status.code(), Some(0), "{}", said(&same));
}

#[test]
fn a_sub_unit_of_another_module_that_passed_is_told() {
    let place = Place::new();
    let run = |serial_number: &str, gps: &str| {
        let done = place.auto(serial_number, &["order=PO-1234", &format!("gps={gps}")]);
        assert_eq!(done.status.code(), Some(0), "{}", said(&done));
        said(&done)
    };
    let told = "gps GB-7 is in module SN-1 too, which passed with it";
    assert!(!run("SN-1", "GB-7").contains("is in module"));
    // The same module again is no doubt, and an order is of many modules.
    assert!(!run("SN-1", "GB-7").contains("is in module"));
    let text = run("SN-2", "GB-7");
    let at = place.run("SN-1").strip_prefix(place.folder.path().join("records")).expect("below").display().to_string();
    assert!(text.contains(told) && text.contains(&at), "{text}");
    assert!(std::fs::read_to_string(place.run("SN-2").join("log.txt")).expect("a log").contains(told));
    // The first module has another one since then.
    run("SN-1", "GB-8");
    assert!(!run("SN-3", "GB-7").contains("in module SN-1"));
}
