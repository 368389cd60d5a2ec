use super::*;
use crate::phrases::tried_in;

fn wording(lang: Lang, names: &[&str]) -> Wording {
    let mut wording = Wording::new(lang);
    wording.keep(names.iter().copied());
    wording
}

#[test]
fn english_stays_as_it_is() {
    for text in ["failed    sdram             1.75 s  x", "", "a\n\n  b  \n", "PASSED  A  b 1  1 passed  in 2 s"] {
        assert_eq!(wording(Lang::En, &[]).text(text), text);
    }
}

/// Cells begin where they begin in English, as a terminal counts columns, and names that look like words stay.
#[test]
fn rows_keep_their_columns_and_names() {
    let table = "failed    failed               1.75 s  attempt 2\nmarginal  imu                 11.75 s  attempt 2";
    let told = wording(Lang::Zh, &["failed", "imu"]).text(table);
    assert_eq!(
        told,
        "不合格    failed               1.75 s  第 2 次尝试\n临界      imu                 11.75 s  第 2 次尝试"
    );
    let columns: Vec<_> = told.lines().map(|line| width(&line[..line.find(" s ").expect("a time")])).collect();
    assert_eq!(columns[0], columns[1]);
    let told = wording(Lang::Ru, &["failed"]).text(table);
    assert!(told.starts_with("брак      failed               1.75 s  попытка 2\nна грани  imu"), "{told}");
    // What is longer than its column keeps two spaces.
    assert_eq!(wording(Lang::Ru, &[]).text("SKIPPED  A"), "ПРОПУСК  A");
    assert_eq!(wording(Lang::Ru, &[]).text("PASSED (simulated)  A"), "ГОДЕН (имитация)  A");
}

#[test]
fn lists_and_remarks_are_told_by_their_parts() {
    let mut wording = wording(Lang::Ru, &["identity", "functional"]);
    wording.measurements.extend(["firmware", "fault"].map(str::to_owned));
    let told = |text: &str| wording.text(text);
    // Behind the name of a measurement stands its value.
    assert_eq!(told("firmware 1.3.9 (== 1.4.0)"), "firmware 1.3.9 (== 1.4.0)");
    assert_eq!(told("functional 1.0 for A on station x"), "станция x: A, план functional 1.0");
    assert_eq!(told("ERRORED (simulated, selection)"), "СБОЙ (имитация, выборка)");
    assert_eq!(told("1 marginal, 2 failed"), "на грани: 1, брак: 2");
    assert_eq!(told("identity failed"), "identity брак");
    assert_eq!(told("SB-7, firmware 1.4.0, /dev/x at 921600 bit/s"), "SB-7, прошивка 1.4.0, /dev/x, 921600 бит/с");
    assert_eq!(told("supply_current 0.468 A (0.4655 .. 0.5145 A)"), "supply_current 0.468 A (0.4655 .. 0.5145 A)");
}

/// A line of a person's, however long and deep, is told at once or stays: the sum of the tries has a bound.
#[test]
fn a_hostile_line_costs_no_more_than_its_budget() {
    let wording = wording(Lang::Zh, &["x"]);
    let longest = |piece: &str| piece.repeat(LONGEST / piece.len());
    let nested = format!("{}{}", "a (".repeat(LONGEST / 4), ")".repeat(LONGEST / 4));
    let mut lines: Vec<String> =
        ["note: ", "DANGER: ", "a  ", "x ", "a, ", "x: ", "failed, ", "note: x: y; ", "*** "].map(longest).into();
    lines.push(nested);
    lines.push(format!("{}{}", longest("*** ").split_at(LONGEST / 2).0, " ***".repeat(LONGEST / 8)));
    for line in lines {
        let tried = tried_in(|| drop(wording.text(&line)));
        // An empty budget costs a try for each text that comes after it.
        let most = Tries::of_texts(TEXTS_OF_LINE).left() + LONGEST as u64;
        assert!(tried <= most, "{tried} for {}", &line[..20]);
    }
    // A line above the bound stays as it is, whatever it is made of.
    for piece in ["note: ", "a (", "a  ", "failed  "] {
        let line = piece.repeat(40_000);
        assert_eq!(wording.text(&line), line);
    }
    assert_eq!(wording.text("note: note: imu failed"), "注意：注意：imu failed");
}

/// A name stays, also where it is all that stands in a line.
#[test]
fn a_line_that_is_a_name_stays() {
    for lang in [Lang::Zh, Lang::Ru] {
        assert_eq!(wording(lang, &["failed"]).text("failed"), "failed");
        assert_ne!(wording(lang, &[]).text("failed"), "failed");
    }
}

/// A line for people has one way out. What stands here beside it writes JSON, or is in the language already.
#[test]
fn no_line_passes_by() {
    for (file, text, known) in [
        ("records.rs", include_str!("../records.rs"), 0),
        // JSON; CSV and JSON to standard output; and rows by their cells.
        ("records/list.rs", include_str!("../records/list.rs"), 4),
        ("export.rs", include_str!("../export.rs"), 0),
        ("recompute.rs", include_str!("../recompute.rs"), 0),
        ("check.rs", include_str!("../check.rs"), 0),
        // Findings, by their parts.
        ("doctor.rs", include_str!("../doctor.rs"), 1),
        // Ports, by their parts.
        ("ports.rs", include_str!("../ports.rs"), 1),
        // The standing.
        ("auto.rs", include_str!("../auto.rs"), 1),
        // Whether it is a terminal and how wide; events; questions in the plan's own words.
        ("auto/face.rs", include_str!("../auto/face.rs"), 5),
        // The way out itself.
        ("auto/speaker.rs", include_str!("../auto/speaker.rs"), 4),
        // The table of figures; JSON; errors.
        ("compute.rs", include_str!("../compute.rs"), 4),
        // Lines of the table, to a text.
        ("compute/report.rs", include_str!("../compute/report.rs"), 5),
    ] {
        let ways = ["println!", "writeln!", "print!", "write_all", "io::stdout()", "say_as_it_is", "write_as_it_is"];
        let found: usize = ways.iter().map(|way| text.matches(way).count()).sum();
        assert_eq!(found, known, "{file}");
    }
}
