//! Mistakes in plans, each as the writer sees it.

use super::*;

/// The mistakes that plans really have, each as the writer sees it.
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

    plan.toml:1:8: "Functional Test" cannot be used as the name of a folder
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

    plan.toml:11:43: "solid" appears twice in patterns
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
        = try: it measures mismatches_solid, mismatches_checkerboard, mismatches_walking_ones, mismatches_address, mismatches_march_c, words_tested, fault, test_time

    plan.toml:21:9: unknown phase "before"
     21 | phase = "before"
        |         ^^^^^^^^
        = try: "setup" comes before all tests, "teardown" after them, and "test" is the usual one

    plan.toml:22:12: "optional" is a text, and must be true or false
     22 | optional = "yes"
        |            ^^^^^

    plan.toml:23:16: retry_failed has no effect with one attempt
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

    plan.toml:31:12: "gyro_*" also limits gyro_temperature: 9 deg/s is an angular rate, but this measurement is a temperature
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

    plan.toml:36:6: "imu" has no limits, so the station could not judge it
     36 | id = "imu"
        |      ^^^^^
        = try: write them below a line [item.limits]

    plan.toml:36:6: the name "imu" appears twice, first at plan.toml:20
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

    plan.toml:43:12: there is no text after ==
     43 | fix_type = "=="
        |            ^^^^
        = try: write == and the text, or == $serial_number for the scanned one
    "#);
}

/// An unreadable item must not cause mistakes in items that depend on it.
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
    plan.toml:1:8: this is not a text in quotes, a number, true or false
     1 | name = functional
       |        ^^^^^^^^^^
       = try: write texts in quotes: name = "functional"

    plan.toml:2:1: this key appears twice
     2 | name = "b"
       | ^^^^
       = try: remove one of them, or begin the next item with [[item]]

    plan.toml:1:8: unclosed array table, expected `]`
     1 | [[item]
       |        ^
       = try: write texts in quotes; begin a table with [name], a list item with [[name]]

    plan.toml:1:17: invalid basic string, expected `"`
     1 | name = "unclosed
       |                 ^
       = try: end the text on the same line, with the quote that it begins with

    plan.toml:1:6: unexpected key or value, expected newline, `#`
     1 | a =  [31m
       |      ^
       = try: write texts in quotes; begin a table with [name], a list item with [[name]]

    plan.toml:1:5: this is not a text in quotes, a number, true or false
     1 | a = 1 
       |     ^^
       = try: write texts in quotes: name = "functional"

    plan.toml:1:85: values are nested too deeply
     1 | [[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[
       |                          ^
       = try: use at most 80 levels

    plan.toml:1:1: values are nested too deeply
     1 | a.a.a.a.a.a.a.a.a.a.a.a.a.a.a.a.a.a.a.a.a.a.a.a.a.a.a.a.a.a.a.a.a.a.a.a.a.a.a.a.a.a.a.a.a.a.a.a.a.a.
       | ^
       = try: use at most 80 levels
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
       = try: the keys are description, include, item, name, numbers, on_fail, part, requires_part, requires_plan, resume, serial_number, valid_days, version

    plan.toml:3:3007: unexpected key or value, expected newline, `#`
     3 | 1, 1, 1, 1, 1, 1, 1, 1, ], unexpected = 2
       |                          ^
       = try: write texts in quotes; begin a table with [name], a list item with [[name]]
    "#);
}

/// An empty list is no plan either: its run would have nothing to judge.
#[test]
fn a_plan_without_an_item_is_refused() {
    for text in ["item = []\n", "include = []\n"] {
        let plan = format!("name = \"a\"\nversion = \"1\"\n{text}");
        assert_eq!(mistakes(&plan), "the plan has no items\n  try: begin each item with a line [[item]]");
    }
}

/// The plans that must come before, and how long a pass counts.
#[test]
fn required_plans_are_checked() {
    let item = "\n[[item]]\nid = \"cpu\"\nlimits.core1_register_errors = \"<= 0\"\n";
    let good =
        plan(&format!("name = \"f\"\nversion = \"1\"\nrequires_plan = [\"incoming\", \"a.b\"]\nvalid_days = 7{item}"));
    assert_eq!((good.requires_plan, good.valid_days), (vec!["incoming".to_owned(), "a.b".to_owned()], 7));
    let silent = plan(&format!("name = \"f\"\nversion = \"1\"{item}"));
    assert_eq!((silent.requires_plan, silent.valid_days), (Vec::new(), 30));
    let wrong =
        "requires_plan = [\"incoming\", \"In coming\", \"f\", \"incoming\", 3]\nvalid_days = 0\nrequire_plan = []";
    insta::assert_snapshot!(mistakes(&format!("name = \"f\"\nversion = \"1\"\n{wrong}{item}")), @r#"
    plan.toml:3:30: "In coming" cannot be used as the name of a folder
     3 | requires_plan = ["incoming", "In coming", "f", "incoming", 3]
       |                              ^^^^^^^^^^^
       = try: small letters, digits, - _ and . are allowed, at most 64 of them, a letter or digit first

    plan.toml:3:43: the plan requires itself
     3 | requires_plan = ["incoming", "In coming", "f", "incoming", 3]
       |                                           ^^^
       = try: name another plan, or remove this name

    plan.toml:3:48: "incoming" is required twice
     3 | requires_plan = ["incoming", "In coming", "f", "incoming", 3]
       |                                                ^^^^^^^^^^
       = try: remove one of them

    plan.toml:3:60: "requires_plan" is a whole number, and must be a list of texts in quotes
     3 | requires_plan = ["incoming", "In coming", "f", "incoming", 3]
       |                                                            ^

    plan.toml:4:14: valid_days is 0, and must be 1 to 3653
     4 | valid_days = 0
       |              ^

    plan.toml:5:1: unknown key "require_plan"
     5 | require_plan = []
       | ^^^^^^^^^^^^
       = try: did you mean "requires_plan"?
    "#);
}

/// The pattern of serial numbers is held when the plan is read.
#[test]
fn a_pattern_of_serial_numbers() {
    let plan = |pattern: &str| format!("name = \"p\"\nversion = \"1\"\nserial_number = {pattern}\n{IDENTITY}");
    let good = read(&[("p.toml", &plan("\"SN-[0-9]{4}\""))]).unwrap();
    assert!(good.serial_number.is_some_and(|pattern| pattern.fits("SN-0001") && !pattern.fits("SN-00010")));
    insta::assert_snapshot!(mistakes(&plan("\"SN-[0-9\"")), @r#"
    plan.toml:3:17: the pattern "SN-[0-9" cannot be read: found unclosed character class
     3 | serial_number = "SN-[0-9"
       |                 ^^^^^^^^^
       = try: write a regular expression, like "SN-[0-9]{4}"
    "#);
    insta::assert_snapshot!(mistakes(&plan("4")), @r#"
    plan.toml:3:17: "serial_number" is a whole number, and must be a text in quotes
     3 | serial_number = 4
       |                 ^
    "#);
}
