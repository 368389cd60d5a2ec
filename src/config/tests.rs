//! Each kind of value, right and wrong, with the place of each mistake.

use crate::{SourceText, TomlEntry, TomlTable, read};

/// The value that a reader returns for a text, or all mistakes as line, column, what is wrong and what can be tried.
fn told<T>(text: &str, reader: impl FnOnce(&TomlTable<'_, '_>) -> T) -> Result<T, Vec<String>> {
    let source = SourceText { name: "a.toml".to_owned(), text: text.to_owned() };
    read(&source, reader).map_err(|mistakes| {
        let line = |mistake: &crate::Mistake| {
            let (line, column) = mistake.place.as_ref().map_or((0, 0), |place| (place.line, place.column));
            format!("{line}:{column}: {} [{}]", mistake.what, mistake.hint)
        };
        mistakes.iter().map(line).collect()
    })
}

#[track_caller]
fn refused<T: std::fmt::Debug>(found: Result<T, Vec<String>>, expected: &[&str]) {
    assert_eq!(found.unwrap_err(), expected);
}

#[test]
fn numbers_may_be_written_in_any_way_and_lie_within_bounds() {
    let number = |text: &str, bounds| told(&format!("x = {text}\n"), |table| table.number("x", bounds));
    for (text, expected) in [("3", 3.0), ("-0.5", -0.5), ("1_000.0", 1000.0), ("1e3", 1000.0), ("0x10", 16.0)] {
        assert_eq!(number(text, (-1.0, 1000.0)), Ok(Some(expected)), "{text}");
    }
    assert_eq!(number("-inf", (f64::NEG_INFINITY, 0.0)), Ok(Some(f64::NEG_INFINITY)));
    refused(number("inf", (0.0, 5.0)), &["1:5: x is inf, and must be 0 to 5 []"]);
    refused(number("nan", (f64::NEG_INFINITY, f64::INFINITY)), &["1:5: x is nan, and must be -inf to inf []"]);
    refused(number("\"3\"", (0.0, 5.0)), &["1:5: \"x\" is a text, and must be a number []"]);
    assert_eq!(told("", |table| table.number("x", (0.0, 1.0))), Ok(None));
}

#[test]
fn whole_numbers_are_whole() {
    let integer = |text: &str| told(&format!("n = {text}\n"), |table| table.integer("n", (1, 9), 4));
    assert_eq!([integer("0b11"), integer("9")], [Ok(3), Ok(9)]);
    refused(integer("9.0"), &["1:5: \"n\" is a decimal number, and must be a whole number []"]);
    refused(integer("10"), &["1:5: n is 10, and must be 1 to 9 []"]);
    refused(integer("99999999999999999999"), &["1:5: n is 99999999999999999999, and must be 1 to 9 []"]);
    assert_eq!(told("", |table| table.integer("n", (1, 9), 4)), Ok(4));
}

#[test]
fn a_mistake_in_a_list_is_at_its_element() {
    let pair = |entry: TomlEntry<'_, '_>| entry.array::<2>("two numbers").map(|pair| pair.map(|n| n.integer((0, 3))));
    let read = |text: &str| told(text, |table| table.entry("pair").and_then(pair));
    assert_eq!(read("pair = [1, 2]\n"), Ok(Some([Some(1), Some(2)])));
    refused(
        read("pair = [9, 8]\n"),
        &["1:9: pair is 9, and must be 0 to 3 []", "1:12: pair is 8, and must be 0 to 3 []"],
    );
    refused(read("pair = [1]\n"), &["1:8: \"pair\" has 1 elements, and must be two numbers []"]);
    refused(read("pair = 1\n"), &["1:8: \"pair\" is a whole number, and must be two numbers []"]);
    let names = |text: &str| told(text, |table| table.texts("names").len());
    refused(
        names("names = [\"a\", 1]\n"),
        &["1:15: \"names\" is a whole number, and must be a list of texts in quotes []"],
    );
}

#[test]
fn tables_refuse_what_nobody_took_in_the_order_of_the_file() {
    let text = "zeal = 1\n[oven]\ncelsius = 20\nzone = 2\n[[item]]\nid = \"a\"\n[[item]]\nkey = 3\n";
    let found = told(text, |root| {
        let celsius = root.within("oven", |oven| oven.integer("celsius", (0, 10), 0));
        let ids = |table: TomlTable<'_, '_>| table.read(|table| table.required_text("id", "name it").is_some());
        (celsius, root.tables("item").into_iter().map(ids).collect::<Vec<bool>>())
    });
    refused(
        found,
        &[
            "1:1: unknown key \"zeal\" [the keys are item, oven]",
            "3:11: celsius is 20, and must be 0 to 10 []",
            "4:1: unknown key \"zone\" [the keys are celsius]",
            "7:1: \"id\" is missing [name it]",
            "8:1: unknown key \"key\" [the keys are id]",
        ],
    );
    // A value that must be a table and is not gets a message. So does each such element of a list of tables.
    refused(
        told("oven = 3\n", |root| root.within("oven", |_| ())),
        &["1:8: \"oven\" is a whole number, and must be a table []"],
    );
    refused(
        told("item = [3]\n", |root| root.tables("item").len()),
        &["1:9: \"item\" is a whole number, and must be a table []"],
    );
}

#[test]
fn syntax_stands_alone() {
    refused(
        told("a = 1\nb = \nzeal = 2\n", |_| ()),
        &["2:5: this is not a text in quotes, a number, true or false \
           [write texts in quotes: name = \"functional\"]"],
    );
}
