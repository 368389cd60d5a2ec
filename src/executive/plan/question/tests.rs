use crate::measurement::{Measurement, Value};
use crate::outcome::Outcome;
use crate::plan::{Plan, PlanItem};
use crate::quantity::{Quantity, Unit};

const HEAD: &str = "name = \"p\"\nversion = \"1\"\n[[item]]\nid = \"prompt\"\n";
const ALL: &str = r#"
[[item.ask]]
name = "tp4"
en = "What does the meter at TP4 read?"
kind = "number"
unit = "V"
picture = "pictures/tp4.png"
[[item.ask]]
name = "gps_board"
en = "Scan the GPS board."
ru = "Отсканируйте плату."
kind = "text"
pattern = "GPS-[0-9]{5}"
[[item.ask]]
name = "look"
en = "How does the housing look?"
kind = "choice"
choices = ["clean", "worn", "scratched"]
good = ["clean", "worn"]
[[item.ask]]
name = "lid"
en = "Close the lid."
kind = "done"
[[item.ask]]
name = "remark"
en = "What else?"
kind = "text"
[item.limits]
tp4 = { limit = "4.9 V .. 5.1 V", marginal = "20 mV" }
"#;

fn plan(text: &str) -> Result<Plan, String> {
    let text = format!("{HEAD}{text}").into_bytes();
    Plan::read("plans/p.toml", text, &mut |_| Err("no include".to_owned())).map_err(|mistakes| mistakes.to_string())
}

fn item() -> PlanItem {
    plan(ALL).expect("a plan").items()[0].clone()
}

/// The value of an answer, or why it is none with what to try.
fn read(item: &PlanItem, name: &str, typed: &str) -> Result<Value, String> {
    let question = item.questions.iter().find(|question| question.name == name).expect("a question");
    question.read(typed).map_err(|error| format!("{error}: {}", error.try_this()))
}

fn judged(item: &PlanItem, name: &str, typed: &str) -> Measurement {
    item.judge(name, &read(item, name, typed).expect("an answer"), 1, "SN-1")
}

/// As a person types it, pastes it, or as an input method writes it.
#[test]
fn numbers_are_read_as_people_write_them() {
    let item = item();
    for (typed, number, unit) in [
        ("3.3", 3.3, Unit::Volt),
        ("3,3", 3.3, Unit::Volt),
        (" 3,3 V\r\n", 3.3, Unit::Volt),
        ("3.3V", 3.3, Unit::Volt),
        ("4950 mV", 4950.0, Unit::Millivolt),
        ("4950,5mV", 4950.5, Unit::Millivolt),
        ("\u{a0}5\u{202f}V", 5.0, Unit::Volt),
        ("３．３Ｖ", 3.3, Unit::Volt),
        ("５，０１", 5.01, Unit::Volt),
        ("\u{2212}1,25", -1.25, Unit::Volt),
        ("-0,125", -0.125, Unit::Volt),
        ("+5", 5.0, Unit::Volt),
        ("1.234", 1.234, Unit::Volt),
        ("1,2345", 1.2345, Unit::Volt),
        ("5e-3", 5e-3, Unit::Volt),
    ] {
        assert_eq!(read(&item, "tp4", typed), Ok(Value::Number(Quantity::new(number, unit))), "{typed:?}");
    }
}

/// A comma that could be either is asked again, not guessed: the two readings differ by a factor of a thousand.
#[test]
fn what_is_no_number_is_told() {
    let item = item();
    for (typed, said) in [
        ("", "the answer is empty"),
        ("  \r\n", "the answer is empty"),
        ("abc", "\"abc\" is not a number"),
        ("V", "\"V\" is not a number"),
        ("nan", "\"nan\" is not a number"),
        ("inf", "\"inf\" is not a number"),
        ("-inf V", "\"-inf V\" is not a number"),
        ("0x10", "\"0x10\" is not in V"),
        ("1,234", "\"1,234\" could be 1.234 or 1234"),
        ("1,234.5", "\"1,234.5\" is not a number"),
        ("1.234,5", "\"1.234,5\" is not a number"),
        ("1,234,567", "\"1,234,567\" is not a number"),
        ("1 000", "\"1 000\" is not in V"),
        ("3.3 A", "\"3.3 A\" is not in V"),
        ("3.3 volts or so", "\"3.3 volts or so\" is not in V"),
        ("1e999", "the number \"1e999\" is too large"),
        ("9007199254740992", "the number \"9007199254740992\" is too large"),
        ("-9007199254740993", "the number \"-9007199254740993\" is too large"),
        ("9007199254740992 mV", "the number \"9007199254740992 mV\" is too large"),
        ("4.9\u{7}", "the answer has control characters"),
    ] {
        let error = read(&item, "tp4", typed).expect_err(typed);
        assert!(error.starts_with(said), "{typed:?}: {error}");
    }
    let long = "5".repeat(201);
    assert!(read(&item, "tp4", &long).expect_err("long").starts_with("the answer has 201 characters"));
}

#[test]
fn a_number_is_judged_by_the_limit_of_the_plan() {
    let item = item();
    for (typed, outcome) in [
        ("4,9", Outcome::Marginal),
        ("5 V", Outcome::Passed),
        ("5000 mV", Outcome::Passed),
        ("5.101", Outcome::Failed),
        ("3.3", Outcome::Failed),
    ] {
        let measurement = judged(&item, "tp4", typed);
        assert_eq!((measurement.unit, measurement.outcome), (Some(Unit::Volt), Some(outcome)), "{typed}");
        assert_eq!((measurement.low, measurement.high), (Some(4.9), Some(5.1)));
    }
}

#[test]
fn texts_and_choices_are_judged() {
    let item = item();
    let gps = judged(&item, "gps_board", " GPS-00042\r\n");
    assert_eq!((gps.pattern.as_deref(), gps.outcome), (Some("GPS-[0-9]{5}"), Some(Outcome::Passed)));
    assert_eq!(gps.limit_text(), "=~ GPS-[0-9]{5}");
    for typed in ["GPS-0042", "GPS-00042x", "gps-00042"] {
        assert!(read(&item, "gps_board", typed).expect_err(typed).contains("does not match GPS-[0-9]{5}"), "{typed}");
    }
    for (typed, value, outcome) in [
        ("clean", "clean", Outcome::Passed),
        ("2", "worn", Outcome::Passed),
        ("Scratched", "scratched", Outcome::Failed),
        ("3", "scratched", Outcome::Failed),
    ] {
        let look = judged(&item, "look", typed);
        assert_eq!((look.value_text().as_str(), look.outcome), (value, Some(outcome)), "{typed}");
        assert_eq!(look.limit_text(), "== clean | worn");
    }
    for typed in ["", "0", "4", "dirty", "1.0", "-1"] {
        read(&item, "look", typed).expect_err(typed);
    }
    for typed in ["done", "Y", " DONE\r\n"] {
        assert_eq!(judged(&item, "lid", typed).outcome, Some(Outcome::Passed), "{typed:?}");
    }
    // A variable of a script that is not set gives an empty answer.
    for typed in ["", "  ", "yes", "no", "n", "0", "undone"] {
        let error = read(&item, "lid", typed).expect_err(typed);
        assert!(error.ends_with(" is not done: write done"), "{typed:?}: {error}");
    }
    assert_eq!(judged(&item, "remark", "none").outcome, None);
}

/// A count, a code or a ratio has no unit.
#[test]
fn a_plain_number_has_an_empty_unit() {
    let text = "[[item.ask]]\nname = \"pins\"\nen = \"How many?\"\nkind = \"number\"\nunit = \"\"\n[item.limits]\npins = \"4 .. 6\"\n";
    let plan = plan(text).expect("a plan");
    let item = &plan.items()[0];
    assert_eq!(read(item, "pins", "5"), Ok(Value::Number(Quantity::new(5.0, Unit::Count))));
    assert_eq!(judged(item, "pins", "5").outcome, Some(Outcome::Passed));
    assert_eq!(judged(item, "pins", "7").outcome, Some(Outcome::Failed));
    assert_eq!(read(item, "pins", "5 V"), Err("\"5 V\" is not a plain number: write the number alone".to_owned()));
}

/// Each question with a limit must be answered; one without is information.
#[test]
fn an_item_passes_only_with_all_its_answers() {
    let item = item();
    let mut all: Vec<Measurement> = [("tp4", "5"), ("gps_board", "GPS-00042"), ("look", "1"), ("lid", "done")]
        .map(|(name, typed)| judged(&item, name, typed))
        .into();
    assert_eq!(item.attempt_outcome(&all), Outcome::Passed);
    all.pop();
    assert_eq!(item.attempt_outcome(&all), Outcome::Errored);
    assert_eq!(item.missing(&all).collect::<Vec<_>>(), ["lid"]);
    assert_eq!(item.attempt_outcome(&[judged(&item, "tp4", "3.3")]), Outcome::Failed);
    assert_eq!(item.attempt_outcome(&[judged(&item, "remark", "fine")]), Outcome::Errored);
}

/// A picture is found from where the plan was found.
#[test]
fn a_picture_stands_beside_its_plan() {
    assert_eq!(item().questions[0].picture.as_deref(), Some("plans/pictures/tp4.png"));
}

#[test]
fn mistakes_in_questions_are_told() {
    let ask = |name: &str, more: &str| format!("[[item.ask]]\nname = \"{name}\"\nen = \"What?\"\n{more}\n");
    let number = ask("a", "kind = \"number\"\nunit = \"V\"");
    let choice = ask("a", "kind = \"choice\"\nchoices = [\"clean\", \"worn\"]");
    for (text, said) in [
        (String::new(), "the item asks nothing"),
        (ask("a", "kind = \"numbr\""), "unknown kind \"numbr\""),
        (ask("a", ""), "write kind = \"number\""),
        (ask("A b", "kind = \"done\""), "cannot be used as the name of a question"),
        (ask("a", "kind = \"number\""), "write unit = \"V\""),
        (ask("a", "kind = \"number\"\nunit = \"Vlots\""), "unknown unit \"Vlots\""),
        (ask("a", "kind = \"text\"\npattern = \"[0-9\""), "the pattern \"[0-9\" cannot be read"),
        (ask("a", "kind = \"choice\"\nchoices = []"), "the question has 0 choices"),
        (ask("a", "kind = \"choice\"\nchoices = [\"x\"]"), "the question has 1 choices"),
        (ask("a", "kind = \"choice\"\nchoices = [\"x\", \"X\"]\ngood = [\"x\"]"), "stands twice"),
        (ask("a", "kind = \"choice\"\nchoices = [\"1\", \"2\"]\ngood = [\"1\"]"), "the choice \"1\" is a number"),
        (ask("a", "kind = \"choice\"\nchoices = [\"x\", \"y\"]\ngood = [\"z\"]"), "\"z\" is no choice"),
        (ask("a", "kind = \"choice\"\nchoices = [\"x\", \"y\"]\ngood = []"), "no choice is good"),
        (ask("a", "kind = \"done\"\nunit = \"V\""), "unit"),
        (ask("a", "kind = \"done\"\npicture = \"/etc/p.png\""), "is not a path beside this plan"),
        (
            format!("{}{}", ask("a", "kind = \"done\""), ask("a", "kind = \"done\"")),
            "two questions have the name \"a\"",
        ),
        (number.clone(), "has no limits"),
        (ask("a", "kind = \"text\""), "has no limits"),
        (format!("{number}[item.limits]\na = \"<= 5\"\n"), "5 has no unit"),
        (format!("{number}[item.limits]\na = \"<= 5 A\"\n"), "current"),
        (format!("{number}[item.limits]\nb = \"<= 5 V\"\n"), "the item does not ask \"b\""),
        (format!("{}[item.limits]\na = \"== yes\"\n", ask("a", "kind = \"done\"")), "has another limit already"),
        (format!("{choice}[item.limits]\na = \"== Clean\"\n"), "did you mean \"clean\"?"),
        (format!("{choice}[item.limits]\na = \"== Clean\"\n"), "\"Clean\" is no choice"),
        (format!("{choice}[item.limits]\na = \"== rust\"\n"), "it may be clean, worn"),
        (format!("timeout = \"5 s\"\n{}", ask("a", "kind = \"done\"")), "a question has no time limit"),
        (format!("{}zh = \"\"\n", ask("a", "kind = \"done\"")), "the question has 0 characters"),
    ] {
        let mistakes = plan(&text).expect_err(&text);
        assert!(mistakes.contains(said), "{text}\n{mistakes}");
    }
    // Other items ask nothing.
    let text = "name = \"p\"\nversion = \"1\"\n[[item]]\nid = \"io\"\n[item.limits]\nwrong_reads = \"== 0\"\n[[item.ask]]\nname = \"a\"\n";
    let mistakes = Plan::read("p.toml", text.as_bytes().to_vec(), &mut |_| Err(String::new())).expect_err("asks");
    assert!(mistakes.to_string().contains("ask"), "{mistakes}");
}

/// Names are unique in the whole plan, since an answer on the command line names its question alone.
#[test]
fn questions_of_two_items_have_different_names() {
    let one = "[[item.ask]]\nname = \"lid\"\nen = \"Close the lid.\"\nkind = \"done\"\n";
    let mistakes = plan(&format!("{one}[[item]]\nid = \"prompt\"\nname = \"again\"\n{one}")).expect_err("twice");
    assert!(mistakes.contains("two questions have the name \"lid\"") && mistakes.contains(":13:"), "{mistakes}");
}

/// A limit can name the module: the label on the box must have the same number.
#[test]
fn an_answer_can_be_held_against_the_serial_number() {
    let text = "[[item.ask]]\nname = \"box\"\nen = \"Scan the label on the box.\"\nkind = \"text\"\n[item.limits]\nbox = \"== $serial_number\"\n";
    let item = plan(text).expect("a plan").items()[0].clone();
    assert_eq!(judged(&item, "box", "SN-1").outcome, Some(Outcome::Passed));
    assert_eq!(judged(&item, "box", "SN-2").outcome, Some(Outcome::Failed));
}

/// A choice without good ones is judged by a limit that names one of them.
#[test]
fn a_limit_names_a_choice() {
    let text = "[[item.ask]]\nname = \"look\"\nen = \"How does it look?\"\nkind = \"choice\"\nchoices = [\"clean\", \"worn\"]\n[item.limits]\nlook = \"== clean\"\n";
    let item = plan(text).expect("a plan").items()[0].clone();
    assert_eq!(judged(&item, "look", "1").outcome, Some(Outcome::Passed));
    assert_eq!(judged(&item, "look", "worn").outcome, Some(Outcome::Failed));
}
