use std::collections::HashMap;

use proptest::prelude::*;

use super::*;
use crate::fixture::{FUNCTIONAL, plan};
use crate::limit::{Expected, Range};

/// Reads the first file; the others can be included.
fn read(files: &[(&str, &str)]) -> Result<Plan, Mistakes> {
    let stored: HashMap<&str, &str> = files.iter().copied().collect();
    let (name, text) = files[0];
    Plan::read(name, text.into(), &mut |name| {
        stored.get(name).map(|text| text.as_bytes().to_vec()).ok_or_else(|| "no such file".to_owned())
    })
}

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
    assert_eq!((cpu.requires.as_slice(), cpu.limits().len()), ([0].as_slice(), 8));
    assert_eq!(cpu.params.integer("operand_sets"), Ok(32));
    let timers = &plan.items()[2];
    assert_eq!(timers.params.integers("timers"), Ok([0, 2].as_slice()));
    // Timer 1 is switched off, so the pattern leaves it out; the exact name counts more than the pattern.
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

/// The mistakes that plans really have, each as its writer reads it.
#[test]
fn all_mistakes_of_meaning_at_once() {
    let text = r#"name = "Functional Test"
on_fail = "halt"
verison = "1.0"

[[item]]
id = "sdram"
atempts = 3
attempts = 99
timeout = "30"
requires = ["cpu", "imu", "sdram", "spdram"]
params = { patterns = ["solid", "marchc", "solid"], pattern = [] }
[item.limits]
mismatches_sold = "== 0"
mismatches_address = "== 0"
test_time = "<= 2 V"
words_tested = 5
"foo_*" = "== 0"

[[item]]
id = "imu"
phase = "before"
optional = "yes"
retry_failed = true
prompt = ""
params = { samples = 10, rate = "5 kHz", speed = 1 }
[item.limits]
gyro_x = "2 deg/s"
gyro_y = "<= 2"
gyro_z = "2 .. 1 deg/s"
accel_x = "<= 1 gs"
"gyro_*" = "<= 9 deg/s"
accel_norm = { limit = "1 g +- 5 %", marginal = "1 deg/s", margin = 1 }
stuck_channels = "<= 0"

[[item]]
id = "imu"
[item.limits]

[[item]]
id = "gnss"
params = { start = "warmish", timeout = 60 }
[item.limits]
fix_type = "=="

[[item]]
id = "imu"
requires = ["imu"]
name = "imu-again"
[item.limits]
gyro_x = "<= 1 deg/s"
"#;
    insta::assert_snapshot!(mistakes(text), @r#"
    plan.toml:1:1: "version" is missing
     1 | name = "Functional Test"
       | ^
       = try: write version = "1.0" at the top

    plan.toml:1:8: "Functional Test" is not fit for a folder's name
     1 | name = "Functional Test"
       |        ^^^^^^^^^^^^^^^^^
       = try: small letters, digits, - _ and . are allowed, at most 64 of them, a letter or digit first

    plan.toml:2:11: on_fail is "halt"
     2 | on_fail = "halt"
       |           ^^^^^^
       = try: "continue" runs the remaining items, "stop" skips them

    plan.toml:3:1: unknown key "verison"
     3 | verison = "1.0"
       | ^^^^^^^
       = try: did you mean "version"?

    plan.toml:7:1: unknown key "atempts"
     7 | atempts = 3
       | ^^^^^^^
       = try: did you mean "attempts"?

    plan.toml:8:12: attempts is 99, and must be 1 to 10
     8 | attempts = 99
       |            ^^

    plan.toml:9:11: "30" has no unit
     9 | timeout = "30"
       |           ^^^^
       = try: a time is written in ns, us, ms, s, min, h

    plan.toml:10:13: no item has the name "cpu"
     10 | requires = ["cpu", "imu", "sdram", "spdram"]
        |             ^^^^^
        = try: add that item before this one, or remove the name here

    plan.toml:10:20: "imu" runs after the item that requires it
     10 | requires = ["cpu", "imu", "sdram", "spdram"]
        |                    ^^^^^
        = try: move it up: items run in the order of the plan, setup first and teardown last

    plan.toml:10:27: "sdram" requires itself
     10 | requires = ["cpu", "imu", "sdram", "spdram"]
        |                           ^^^^^^^

    plan.toml:10:36: no item has the name "spdram"
     10 | requires = ["cpu", "imu", "sdram", "spdram"]
        |                                    ^^^^^^^^
        = try: did you mean "sdram"?

    plan.toml:11:33: patterns cannot hold "marchc"
     11 | params = { patterns = ["solid", "marchc", "solid"], pattern = [] }
        |                                 ^^^^^^^^
        = try: did you mean "march-c"?

    plan.toml:11:43: "solid" stands twice in patterns
     11 | params = { patterns = ["solid", "marchc", "solid"], pattern = [] }
        |                                           ^^^^^^^

    plan.toml:11:53: sdram has no parameter "pattern"
     11 | params = { patterns = ["solid", "marchc", "solid"], pattern = [] }
        |                                                     ^^^^^^^
        = try: did you mean "patterns"?

    plan.toml:13:1: sdram does not measure "mismatches_sold"
     13 | mismatches_sold = "== 0"
        | ^^^^^^^^^^^^^^^
        = try: did you mean "mismatches_solid"?

    plan.toml:14:1: "mismatches_address" is not measured with these parameters
     14 | mismatches_address = "== 0"
        | ^^^^^^^^^^^^^^^^^^
        = try: change the parameters, or leave the limit out

    plan.toml:15:13: 2 V is a voltage, but this measurement is a time
     15 | test_time = "<= 2 V"
        |             ^^^^^^^^
        = try: a time is written in ns, us, ms, s, min, h

    plan.toml:16:16: the limit of "words_tested" is not a text in quotes
     16 | words_tested = 5
        |                ^
        = try: a limit is one of: "<= Q", ">= Q", "Q .. Q", "Q +- Q", "Q +- N %", "== text"

    plan.toml:17:1: "foo_*" matches no measurement of sdram
     17 | "foo_*" = "== 0"
        | ^^^^^^^
        = try: it measures mismatches_solid, mismatches_checkerboard, mismatches_walking_ones, mismatches_address, mismatches_march_c, words_tested, test_time

    plan.toml:21:9: unknown phase "before"
     21 | phase = "before"
        |         ^^^^^^^^
        = try: "setup" comes before all tests, "teardown" after them, and "test" is the usual one

    plan.toml:22:12: "optional" is a text, and must be true or false
     22 | optional = "yes"
        |            ^^^^^

    plan.toml:23:16: retry_failed without further attempts changes nothing
     23 | retry_failed = true
        |                ^^^^
        = try: write attempts = 2 beside it

    plan.toml:24:10: the prompt has 0 characters
     24 | prompt = ""
        |          ^^
        = try: write 1 to 500, or leave it out

    plan.toml:25:22: samples is 10, and must be 50 to 10000
     25 | params = { samples = 10, rate = "5 kHz", speed = 1 }
        |                      ^^

    plan.toml:25:33: rate is 5 kHz
     25 | params = { samples = 10, rate = "5 kHz", speed = 1 }
        |                                 ^^^^^^^
        = try: it may be 1 Hz to 1000 Hz

    plan.toml:25:42: imu has no parameter "speed"
     25 | params = { samples = 10, rate = "5 kHz", speed = 1 }
        |                                          ^^^^^
        = try: its parameters are samples, rate

    plan.toml:27:10: "2 deg/s" is not a limit
     27 | gyro_x = "2 deg/s"
        |          ^^^^^^^^^
        = try: a limit is one of: <= Q, >= Q, Q .. Q, Q +- Q, Q +- N %, == text

    plan.toml:28:10: 2 has no unit
     28 | gyro_y = "<= 2"
        |          ^^^^^^
        = try: write "2 deg/s", if that is the unit you mean

    plan.toml:29:10: the low bound 2 deg/s is above the high bound 1 deg/s
     29 | gyro_z = "2 .. 1 deg/s"
        |          ^^^^^^^^^^^^^^
        = try: write the smaller one first

    plan.toml:30:11: unknown unit "gs"
     30 | accel_x = "<= 1 gs"
        |           ^^^^^^^^^
        = try: an acceleration is written in ug, mg, g, m/s^2

    plan.toml:31:12: "gyro_*" is for gyro_temperature too, and there 9 deg/s is an angular rate, but this measurement is a temperature
     31 | "gyro_*" = "<= 9 deg/s"
        |            ^^^^^^^^^^^^
        = try: a temperature is written in degC

    plan.toml:32:49: 1 deg/s is an angular rate, but this measurement is an acceleration
     32 | accel_norm = { limit = "1 g +- 5 %", marginal = "1 deg/s", margin = 1 }
        |                                                 ^^^^^^^^^
        = try: an acceleration is written in ug, mg, g, m/s^2

    plan.toml:32:60: unknown key "margin"
     32 | accel_norm = { limit = "1 g +- 5 %", marginal = "1 deg/s", margin = 1 }
        |                                                            ^^^^^^
        = try: did you mean "marginal"?

    plan.toml:33:18: "<= 0" is a limit for numbers, but this measurement is a text
     33 | stuck_channels = "<= 0"
        |                  ^^^^^^
        = try: write == and the text, or == $serial_number for the scanned one

    plan.toml:36:6: "imu" has no limits: nothing would be judged
     36 | id = "imu"
        |      ^^^^^
        = try: write them below a line [item.limits]

    plan.toml:36:6: the name "imu" stands twice, first at plan.toml:20
     36 | id = "imu"
        |      ^^^^^
        = try: give one of them a name of its own: name = "..."

    plan.toml:41:20: start cannot be "warmish"
     41 | params = { start = "warmish", timeout = 60 }
        |                    ^^^^^^^^^
        = try: it may be "hot", "warm", "cold", "as-is"

    plan.toml:41:41: "timeout" is a whole number, and must be a number and its unit in quotes, such as "1 s"
     41 | params = { start = "warmish", timeout = 60 }
        |                                         ^^

    plan.toml:43:12: nothing stands after ==
     43 | fix_type = "=="
        |            ^^^^
        = try: write == and the text, or == $serial_number for the scanned one
    "#);
}

/// What cannot be read must not make mistakes of what depends on it.
#[test]
fn one_slip_is_one_mistake() {
    let text = FUNCTIONAL.replace("id = \"identity\"", "id = \"idnetity\"");
    insta::assert_snapshot!(mistakes(&text), @r#"
    plan.toml:7:6: unknown item "idnetity"
     7 | id = "idnetity"
       |      ^^^^^^^^^^
       = try: did you mean "identity"?
    "#);
}

#[test]
fn syntax_errors_stand_alone() {
    let mut out = String::new();
    for text in [
        "name = functional\nverison = 1",
        "name = \"a\"\nname = \"b\"",
        "[[item]\nid = \"imu\"",
        "name = \"unclosed\nversion = \"1\"",
        "a = \u{1b}[31m",
        "a = 1\u{0}",
        &format!("a = {}", "[".repeat(1000)),
        &format!("{}x = 1", "a.".repeat(1000)),
    ] {
        out.push_str(&mistakes(text));
        out.push_str("\n\n");
    }
    insta::assert_snapshot!(out, @r#"
    plan.toml:1:8: this is no text in quotes, no number, and neither true nor false
     1 | name = functional
       |        ^^^^^^^^^^
       = try: texts stand in quotes: name = "functional"

    plan.toml:2:1: this key stands twice
     2 | name = "b"
       | ^^^^
       = try: remove one of them, or begin the next item with [[item]]

    plan.toml:1:8: unclosed array table, expected `]`
     1 | [[item]
       |        ^
       = try: texts stand in quotes, a table begins with [name], a list item with [[name]]

    plan.toml:1:17: invalid basic string, expected `"`
     1 | name = "unclosed
       |                 ^
       = try: a text ends with the quote that it began with, in the same line

    plan.toml:1:6: unexpected key or value, expected newline, `#`
     1 | a =  [31m
       |      ^
       = try: texts stand in quotes, a table begins with [name], a list item with [[name]]

    plan.toml:1:5: this is no text in quotes, no number, and neither true nor false
     1 | a = 1 
       |     ^^
       = try: texts stand in quotes: name = "functional"

    plan.toml:1:85: values lie too deep in each other
     1 | [[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[
       |                          ^
       = try: at most 80 levels are read

    plan.toml:1:1: values lie too deep in each other
     1 | a.a.a.a.a.a.a.a.a.a.a.a.a.a.a.a.a.a.a.a.a.a.a.a.a.a.a.a.a.a.a.a.a.a.a.a.a.a.a.a.a.a.a.a.a.a.a.a.a.a.
       | ^
       = try: at most 80 levels are read
    "#);
}

#[test]
fn what_is_no_plan_at_all() {
    let mut out = mistakes("");
    for bytes in [vec![b'#'; MAX_PLAN_BYTES + 1], b"name = \"a\"\nversion = \"\xff1\"".to_vec(), vec![0xff, 0xfe, 0, 0]]
    {
        out.push_str("\n\n");
        out.push_str(&Plan::read("pl\u{1b}an.toml", bytes, &mut |_| Err(String::new())).unwrap_err().to_string());
    }
    let crlf = "name = \"a\"\r\nversion = \"1\"\r\nitem = 5\r\ninclude = \"b.toml\"\r\n";
    out.push_str("\n\n");
    out.push_str(&mistakes(crlf));
    let long = format!("name = \"a\"\nversion = \"1\"\n{} = 1\n", "x".repeat(100_000));
    out.push_str("\n\n");
    out.push_str(&mistakes(&long));
    let far = format!("name = \"a\"\nversion = \"1\"\nx = [{}], unexpected = 2\n", "1, ".repeat(1000));
    out.push_str("\n\n");
    out.push_str(&mistakes(&far));
    insta::assert_snapshot!(out, @r#"
    plan.toml:1:1: "name" is missing
     1 | 
       | ^
       = try: write name = "functional" at the top

    plan.toml:1:1: "version" is missing
     1 | 
       | ^
       = try: write version = "1.0" at the top

    plan.toml:1:1: the plan has no items
     1 | 
       | ^
       = try: begin each item with a line [[item]]

    "pl\u{1b}an.toml" has more than 4194304 bytes
      try: is this the right file?

    pl\u{1b}an.toml:2:12: byte 0xff is not UTF-8
     2 | version = "�1"
       |            ^
       = try: save the file with the encoding UTF-8

    pl\u{1b}an.toml:1:1: byte 0xff is not UTF-8
     1 | ��  
       | ^
       = try: save the file with the encoding UTF-8

    plan.toml:3:8: "item" is a whole number, and must be a list of tables, each beginning with [[item]]
     3 | item = 5
       |        ^

    plan.toml:4:11: "include" is a text, and must be a list of texts in brackets
     4 | include = "b.toml"
       |           ^^^^^^^^

    plan.toml:1:1: the plan has no items
     1 | name = "a"
       | ^
       = try: begin each item with a line [[item]]

    plan.toml:3:1: unknown key "xxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxx…"
     3 | xxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxx
       | ^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^
       = try: the keys are description, include, item, name, on_fail, version

    plan.toml:3:3007: unexpected key or value, expected newline, `#`
     3 | 1, 1, 1, 1, 1, 1, 1, 1, ], unexpected = 2
       |                          ^
       = try: texts stand in quotes, a table begins with [name], a list item with [[name]]
    "#);
}

const IDENTITY: &str = "[[item]]\nid = \"identity\"\n[item.limits]\nprotocol = \"== 1\"\n";

#[test]
fn includes_come_first_and_are_part_of_the_digest() {
    let root = "name = \"root\"\nversion = \"1\"\ninclude = [\"../common/a.toml\", \"b.toml\"]\n[[item]]\nid = \"io\"\nrequires = [\"identity\"]\n[item.limits]\nwrong_reads = \"== 0\"\n";
    let a = format!("name = \"a\"\nversion = \"1\"\ninclude = [\"./c.toml\"]\n{IDENTITY}");
    let b = "name = \"b\"\nversion = \"1\"\n[[item]]\nid = \"spi\"\nphase = \"setup\"\n";
    let c = "name = \"c\"\nversion = \"1\"\n[[item]]\nid = \"cpu\"\n[item.limits]\n\"*\" = \"== 0\"\n";
    let plan = read(&[
        ("plans/line/root.toml", root),
        ("plans/common/a.toml", &a),
        ("plans/line/b.toml", b),
        ("plans/common/c.toml", c),
    ])
    .unwrap_or_else(|mistakes| panic!("{mistakes}"));
    assert_eq!(plan.name, "root");
    let names: Vec<&str> = plan.items().iter().map(|item| item.name.as_str()).collect();
    // Setup runs before tests, wherever it stands.
    assert_eq!(names, ["spi", "cpu", "identity", "io"]);
    assert_eq!(plan.items()[3].requires, [2]);
    let files: Vec<(&str, &[u8])> = plan.files().collect();
    assert_eq!(files[0], ("plans/line/root.toml", root.as_bytes()));
    let order: Vec<&str> = files.iter().map(|(name, _)| *name).collect();
    assert_eq!(order, ["plans/line/root.toml", "plans/common/a.toml", "plans/common/c.toml", "plans/line/b.toml"]);
}

#[test]
fn includes_that_are_refused() {
    let plan = |include: &str| format!("name = \"p\"\nversion = \"1\"\ninclude = [{include}]\n{IDENTITY}");
    let mut out = String::new();
    for files in [
        vec![("a.toml", plan("\"b.toml\"")), ("b.toml", plan("\"a.toml\""))],
        vec![("a.toml", plan("\"a.toml\""))],
        vec![("a.toml", plan("\"missing.toml\", \"/etc/passwd\", \"\", \"x\\u001b.toml\""))],
        vec![("dir/a.toml", plan("\"b.toml\", \"./b.toml\"")), ("dir/b.toml", plan(""))],
        vec![("a.toml", plan("\"b.toml\"")), ("b.toml", "name = ".to_owned())],
        vec![("a.toml", plan("5")), ("b.toml", String::new())],
    ] {
        let files: Vec<(&str, &str)> = files.iter().map(|(name, text)| (*name, text.as_str())).collect();
        out.push_str(&read(&files).unwrap_err().to_string());
        out.push_str("\n\n");
    }
    insta::assert_snapshot!(out, @r#"
    b.toml:3:12: the include runs in a circle: "a.toml" > "b.toml" > "a.toml"
     3 | include = ["a.toml"]
       |            ^^^^^^^^
       = try: remove one of them

    a.toml:5:6: the name "identity" stands twice, first at b.toml:5
     5 | id = "identity"
       |      ^^^^^^^^^^
       = try: give one of them a name of its own: name = "..."

    a.toml:3:12: the include runs in a circle: "a.toml" > "a.toml"
     3 | include = ["a.toml"]
       |            ^^^^^^^^
       = try: remove one of them

    a.toml:3:12: "missing.toml" cannot be read: no such file
     3 | include = ["missing.toml", "/etc/passwd", "", "x\u001b.toml"]
       |            ^^^^^^^^^^^^^^
       = try: the path is relative to the file that includes it

    a.toml:3:28: "/etc/passwd" is not a path beside this plan
     3 | include = ["missing.toml", "/etc/passwd", "", "x\u001b.toml"]
       |                            ^^^^^^^^^^^^^
       = try: write it relative to this file, with / between folders

    a.toml:3:43: "" is not a path beside this plan
     3 | include = ["missing.toml", "/etc/passwd", "", "x\u001b.toml"]
       |                                           ^^
       = try: write it relative to this file, with / between folders

    a.toml:3:47: "x\u{1b}.toml" is not a path beside this plan
     3 | include = ["missing.toml", "/etc/passwd", "", "x\u001b.toml"]
       |                                               ^^^^^^^^^^^^^^
       = try: write it relative to this file, with / between folders

    dir/a.toml:3:22: "dir/b.toml" is included twice
     3 | include = ["b.toml", "./b.toml"]
       |                      ^^^^^^^^^^
       = try: remove one of them

    dir/a.toml:5:6: the name "identity" stands twice, first at dir/b.toml:5
     5 | id = "identity"
       |      ^^^^^^^^^^
       = try: give one of them a name of its own: name = "..."

    b.toml:1:8: this is no text in quotes, no number, and neither true nor false
     1 | name = 
       |        ^
       = try: texts stand in quotes: name = "functional"

    a.toml:3:12: "include" is a whole number, and must be a list of texts in quotes
     3 | include = [5]
       |            ^
    "#);
}

#[test]
fn includes_are_bounded() {
    // A chain that never ends, and a fan that never ends.
    let mut asked = 0;
    let mut chain = |name: &str| {
        asked += 1;
        let next = name.trim_end_matches(".toml").parse::<u32>().unwrap_or(0) + 1;
        Ok(format!("name = \"p\"\nversion = \"1\"\ninclude = [\"{next}.toml\"]").into_bytes())
    };
    let root = chain("0.toml").unwrap();
    let text = Plan::read("0.toml", root, &mut chain).unwrap_err().to_string();
    assert!(text.contains("includes lie more than 8 deep in each other"), "{text}");
    assert!(asked <= 10);
    let names: Vec<String> = (0..1000).map(|index| format!("\"{index}.toml\"")).collect();
    let root = format!("name = \"p\"\nversion = \"1\"\ninclude = [{}]", names.join(", "));
    let mut asked = 0;
    let mistakes = Plan::read("root.toml", root.into_bytes(), &mut |_| {
        asked += 1;
        Ok(b"name = \"p\"\nversion = \"1\"\n[[item]]\nid = \"io\"\nphase = \"setup\"\n".to_vec())
    })
    .unwrap_err();
    assert_eq!(asked, 31);
    assert!(mistakes.to_string().contains("the plan has more than 32 files"), "{mistakes}");
    assert_eq!(mistakes.iter().count(), crate::mistake::MAX_MISTAKES);
    assert!(mistakes.to_string().ends_with(&format!("and {} more", mistakes.count() - 50)), "{mistakes}");
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
    // What never came, or is not available, cannot be told.
    assert_eq!(judged(gnss, std::slice::from_ref(&fix)), Outcome::Errored);
    assert_eq!(judged(gnss, &[]), Outcome::Errored);
    let unavailable = ("height", Value::NotAvailable("no fix".to_owned()));
    assert_eq!(judged(gnss, &[fix, unavailable.clone()]), Outcome::Errored);
    // But without a fix there is no height, and that there is no fix is a violation.
    let no_fix = ("fix_type", Value::text("none"));
    assert_eq!(judged(gnss, std::slice::from_ref(&no_fix)), Outcome::Failed);
    assert_eq!(judged(gnss, &[no_fix.clone(), unavailable]), Outcome::Failed);
    // NaN is a number that the station could not make sense of: it says nothing about the module.
    assert_eq!(judged(gnss, &[no_fix, height(f64::NAN)]), Outcome::Errored);
    // Information alone is never a pass, except where nothing is tested.
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

    /// The realistic plan with one piece of it replaced: the text that a slip of the hand makes.
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

/// An item that uses another one's captures is skipped unless that one is good, and needs it before itself.
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

    plan.toml:21:17: "gyro-still" makes no captures that gyro-still can use
     21 | params = { of = "gyro-still" }
        |                 ^^^^^^^^^^^^
        = try: name an item that is six-position
    "#);
}

/// Who works with a calibration has one before it; the accelerometers alone need no gyroscope's.
#[test]
fn calibrations_that_are_needed() {
    let head = "name = \"p\"\nversion = \"1\"\n";
    let six = "[[item]]\nid = \"six-position\"\n[item.limits]\n\"bias_*\" = \"0 +- 50 mg\"\n";
    let hour = |params: &str| {
        format!("[[item]]\nid = \"bias-stability\"\n{params}[item.limits]\n\"*_accel_x\" = \"<= 2 mg\"\n")
    };
    assert!(read(&[("plan.toml", &format!("{head}{six}{}", hour("params = { sensors = [\"accel\"] }\n")))]).is_ok());
    insta::assert_snapshot!(mistakes(&format!("{head}{}{six}", hour(""))), @r#"
    plan.toml:4:6: "bias-stability" works with what six-position finds, and no six-position stands before it
     4 | id = "bias-stability"
       |      ^^^^^^^^^^^^^^^^
       = try: put an item with id = "six-position" before it

    plan.toml:4:6: "bias-stability" works with what gyro-still finds, and no gyro-still stands before it
     4 | id = "bias-stability"
       |      ^^^^^^^^^^^^^^^^
       = try: put an item with id = "gyro-still" before it

    plan.toml:4:6: "bias-stability" works with what rotation finds, and no rotation stands before it
     4 | id = "bias-stability"
       |      ^^^^^^^^^^^^^^^^
       = try: put an item with id = "rotation" before it
    "#);
}
