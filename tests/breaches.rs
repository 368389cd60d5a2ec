//! Boards that break one rule of the interface document each, with good and bad modules, over RS-422 and over CAN. No breach
//! fails a good module or passes a bad one, and the record names what it sees with the section.

use std::time::Duration;

use gnc_executive::event::NoteLevel;
use gnc_executive::outcome::Outcome;
use gnc_tests::Place;
use gnc_tests::campaign::{
    BREACHES, Breach, Case, Disturbance, Link, Over, Ran, Verdict, looks_like_a_bad_sensor, run,
};

fn case(board: &'static str, link: Link, keys: &str) -> Case {
    Case {
        seed: 7,
        number: 0,
        board,
        link,
        faults: format!("[board]\n{keys}\n"),
        kinds: vec!["breach"],
        breach: "",
        disturbance: Disturbance::None,
        moment: (1, Duration::ZERO),
    }
}

fn sections(ran: &Ran) -> Vec<u8> {
    ran.record.iter().flat_map(|record| &record.board_breaches).map(|breach| breach.section).collect()
}

/// What a run says, for the message of a test that fails.
fn told(ran: &Ran) -> String {
    let Some(record) = &ran.record else { return format!("{:?}", ran.problems) };
    let items = record.items.iter().filter(|item| !item.outcome.is_good() && item.outcome != Outcome::NotRun);
    let items = items.map(|item| format!("{} {}: {}", item.name, item.outcome, gnc_executive::text::reason(item)));
    let notes =
        record.notes.iter().filter(|note| note.level > NoteLevel::Info).map(|note| format!("note: {}", note.text));
    let breaches = gnc_executive::text::breach_lines(record);
    items.chain(notes).chain(breaches).map(|line| format!("  {line}\n")).collect()
}

/// Items that a run failed.
fn failed(ran: &Ran) -> Vec<&str> {
    let items = ran.record.iter().flat_map(|record| &record.items);
    items.filter(|item| item.outcome == Outcome::Failed).map(|item| item.name.as_str()).collect()
}

/// Runs a breach with a good module; returns what is wrong.
fn good_module((keys, rs422, can): &Breach, link: Link) -> Option<String> {
    let (verdict, expected) = if link == Link::Can { can } else { rs422 };
    if looks_like_a_bad_sensor(keys, link) {
        return None;
    }
    let ran = run(&case("good", link, keys), Over::Memory, None);
    let named = sections(&ran);
    let missing: Vec<&u8> = expected.iter().filter(|section| !named.contains(section)).collect();
    let outcome = match ran.outcome() {
        Some(outcome) if outcome.is_good() => Some(Verdict::Passed),
        Some(Outcome::Errored) => Some(Verdict::Errored),
        _ => None,
    };
    // Nothing is said of a board where a run passes without a breach that it can see.
    let untrue = expected.is_empty() && *verdict == Verdict::Passed && !named.is_empty();
    let wrong = outcome != Some(*verdict) || !missing.is_empty() || untrue || !failed(&ran).is_empty();
    wrong.then(|| {
        format!("{link:?} {}: {:?}, missing {missing:?}\n{}", keys.replace('\n', " "), ran.outcome(), told(&ran))
    })
}

/// Runs a breach with a module that fails one item; returns what is wrong.
fn bad_module((board, item): (&'static str, &str), (keys, ..): &Breach, link: Link) -> Option<String> {
    let ran = run(&case(board, link, keys), Over::Memory, None);
    let passed = ran.outcome().is_none_or(Outcome::is_good);
    let others = failed(&ran).iter().any(|failed| *failed != item) && !looks_like_a_bad_sensor(keys, link);
    (passed || others)
        .then(|| format!("{board} {link:?} {}: {:?}\n{}", keys.replace('\n', " "), ran.outcome(), told(&ran)))
}

fn all_hold(wrong: &[String]) {
    assert!(wrong.is_empty(), "{} wrong:\n\n{}", wrong.len(), wrong.join("\n"));
}

#[test]
fn a_good_module_is_never_failed_and_the_breach_is_named_on_rs422() {
    let wrong: Vec<String> = BREACHES.iter().filter_map(|breach| good_module(breach, Link::Rs422)).collect();
    all_hold(&wrong);
}

#[test]
fn a_good_module_is_never_failed_and_the_breach_is_named_on_can() {
    let wrong: Vec<String> = BREACHES.iter().filter_map(|breach| good_module(breach, Link::Can)).collect();
    all_hold(&wrong);
}

/// Each breach with one of the modules on one of the links; with `GNC_LONG` set, with both on both.
#[test]
fn a_bad_module_is_never_passed() {
    let long = std::env::var_os("GNC_LONG").is_some();
    let (rs422, can) = (Link::Rs422, Link::Can);
    let (gyro, sdram) = (("gyro-stuck", "imu"), ("sdram-data-line-stuck", "sdram"));
    let all = [(gyro, rs422), (sdram, can), (gyro, can), (sdram, rs422)];
    let mut wrong = Vec::new();
    for (number, breach) in BREACHES.iter().enumerate() {
        let some = if long { &all[..] } else { &all[number % all.len()..][..1] };
        wrong.extend(some.iter().filter_map(|(module, link)| bad_module(*module, breach, *link)));
    }
    all_hold(&wrong);
}

/// A module with a short is failed, on whatever board that gets so far.
#[test]
fn a_short_is_failed_at_power_on() {
    for keys in ["over_current_at_power_on = true", "[reboot]\non = \"power\"\nafter_ms = 5.0"] {
        for link in [Link::Rs422, Link::Can] {
            let ran = run(&case("good", link, keys), Over::Memory, None);
            assert_eq!(ran.outcome(), Some(Outcome::Failed), "{keys}: {}", told(&ran));
        }
    }
    let shorted = "over_current_at_power_on = true\n";
    let mut failed = 0;
    for (keys, ..) in BREACHES {
        let ran = run(&case("good", Link::Rs422, &format!("{shorted}{keys}")), Over::Memory, None);
        assert!(ran.outcome().is_some_and(|outcome| !outcome.is_good()), "{keys}: {}", told(&ran));
        failed += u32::from(ran.outcome() == Some(Outcome::Failed));
    }
    assert!(failed * 4 > BREACHES.len() as u32 * 3, "only {failed} shorts were failed");
}

/// A board without a key breaks nothing.
#[test]
fn nothing_is_said_of_a_board_that_keeps_the_document() {
    for link in [Link::Rs422, Link::Can] {
        let ran = run(&case("good", link, ""), Over::Memory, None);
        assert_eq!((ran.outcome(), sections(&ran)), (Some(Outcome::Passed), Vec::new()), "{}", told(&ran));
    }
}

const STATION: &str = env!("CARGO_BIN_EXE_station-under-test");

/// A plan run by the whole program on a board of this text: the exit code, and what it printed.
fn whole_program(board: &str, plan: &str) -> (Option<i32>, String, Place) {
    let place = Place::new(STATION);
    let board = place.write("board.toml", board);
    let plan = place.write("plan.toml", &format!("name = \"p\"\nversion = \"1\"\n{plan}"));
    let (sim, plan) = (format!("--sim={}", board.display()), plan.display().to_string());
    let run = place.run(["--auto", &plan, &sim, "--sim-speed", "max", "--serial-number", "T-1"]);
    (run.code, format!("{}{}", run.stdout, run.stderr), place)
}

/// A restart is seen by the clock, whatever the boot id says.
#[test]
fn a_restart_that_keeps_the_boot_id_is_a_restart() {
    let board = "keeps_boot_id = true\n[reboot]\non = \"sdram\"\nnth = 1\nafter_ms = 5.0";
    for link in [Link::Rs422, Link::Can] {
        let ran = run(&case("good", link, board), Over::Memory, None);
        assert_eq!((ran.outcome(), failed(&ran)), (Some(Outcome::Failed), vec!["sdram"]), "{}", told(&ran));
        assert!(sections(&ran).contains(&6), "{}", told(&ran));
    }
}

/// HELLO says what the board can do, so the plan is refused, or its optional items are skipped, before power-on.
#[test]
fn hello_decides_what_can_run() {
    let cpu = "[[item]]\nid = \"cpu\"\n[item.limits]\n\"*_errors\" = \"<= 0\"\n";
    let identity =
        |limits: &str| format!("[[item]]\nid = \"identity\"\n[item.limits]\nserial_number = \"== T-1\"\n{limits}{cpu}");
    let no_switch = "description = \"no switch\"\n[board]\nno_power_switch = true\n";

    let (code, text, place) = whole_program(no_switch, &identity(""));
    assert_eq!(code, Some(0), "the module counts as powered: {text}");
    let items = &place.record()["items"];
    let named = |name: &str| {
        items[0]["attempts"][0]["measurements"].as_array().expect("measurements").iter().any(|m| m["name"] == name)
    };
    assert!(named("serial_number") && named("supply_voltage"), "{items}");

    let (code, text, place) = whole_program(no_switch, &identity("supply_voltage = \"5 V +- 5 %\"\n"));
    assert_eq!(code, Some(3), "{text}");
    assert!(
        text.contains("the module was not switched on: \"identity\" cannot run: there is no slave board that switches"),
        "{text}"
    );
    assert_eq!(place.record()["items"][0]["outcome"], "not_run");

    let cycle = "[[item]]\nid = \"power-cycle\"\n[item.limits]\ncycles_done = \">= 1\"\n";
    let (code, text, _place) = whole_program(no_switch, &format!("{cpu}{cycle}"));
    assert_eq!(code, Some(3), "{text}");
    let optional = cycle.replace("[item.limits]", "optional = true\n[item.limits]");
    let (code, text, place) = whole_program(no_switch, &format!("{cpu}{optional}"));
    assert_eq!(code, Some(0), "{text}");
    assert_eq!(place.record()["items"][1]["outcome"], "skipped", "{text}");
}

/// The record, the log and the report name the board's breach with its section, and the schema knows it.
#[test]
fn a_breach_stands_in_every_record() {
    let board = "description = \"late\"\n[board]\nserial = \"B\\u0000\"\n";
    let cpu = "[[item]]\nid = \"cpu\"\n[item.limits]\n\"*_errors\" = \"<= 0\"\n";
    let (code, text, place) = whole_program(board, cpu);
    assert_eq!(code, Some(0), "{text}");
    assert!(
        text.contains("note: the board does not keep section 5 of the interface document: a text holds NUL (once; "),
        "{text}"
    );
    let breach = &place.record()["board_breaches"][0];
    assert_eq!(
        (&breach["section"], &breach["count"], &breach["safety"]),
        (&5.into(), &1.into(), &false.into()),
        "{breach}"
    );
    assert!(breach["first_at"].as_str().expect("a time").len() > 20 && breach["worst"].is_string(), "{breach}");
    let file = |name: &str| std::fs::read_to_string(place.runs()[0].join(name)).expect(name);
    assert!(file("log.txt").contains("The board and the interface document"), "{}", file("log.txt"));
    assert!(file("report.html").contains("a text holds NUL"));
    assert!(file("events.jsonl").contains("\"kind\":\"board_breach\""));
}

/// The module is still under power after the run: said at once, and beside the verdict.
#[test]
fn a_module_that_stays_under_power_is_a_danger() {
    let cpu = "[[item]]\nid = \"cpu\"\n[item.limits]\n\"*_errors\" = \"<= 0\"\n";
    let (_, text, place) = whole_program("description = \"hot\"\n[board]\nsafe_keeps_power = true\n", cpu);
    assert_eq!(text.matches("DANGER: the module is still under power after MAKE_SAFE").count(), 2, "{text}");
    assert_eq!(place.record()["board_breaches"][0]["safety"], true);
}

/// What a test engineer reads of boards that fail in different ways, each told apart from the others.
#[test]
fn each_fault_of_a_board_has_words_of_its_own() {
    let boards = [
        ("deaf to HELLO", "deaf_to_hello = true"),
        ("another nonce", "wrong_nonce = true"),
        ("HELLO too long", "hello_extra_bytes = 1"),
        ("HELLO late", "hello_after_ms = 3000.0"),
        ("another version", "hello_chosen = 2"),
        ("checksum", "checksum = \"big-endian\""),
        ("never accepts the message", "wrong_message_id = true"),
        ("ids of two requests swapped", "swaps_request_ids = true"),
        ("header of another version", "header_version = 2"),
        ("over-current", "over_current_at_power_on = true"),
        ("watchdog", "watchdog_ms = 300.0"),
        ("no power", "powers_off_after_s = 3.0"),
        ("text", "debug_text = \"adc ok\\r\\n\"\ndebug_every_ms = 200.0"),
        ("no module's values", "supply_uv_times = 1000.0"),
    ];
    let mut page = String::new();
    for (name, keys) in boards {
        for link in [Link::Rs422, Link::Can] {
            let ran = run(&case("good", link, keys), Over::Memory, None);
            let outcome = ran.outcome().map_or_else(|| "no outcome".to_owned(), |outcome| outcome.to_string());
            page += &format!("{name}, {}: {outcome}\n{}\n", format!("{link:?}").to_lowercase(), told(&ran));
        }
    }
    insta::assert_snapshot!(page);
}
