use super::*;

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

/// A line for people has one way out. What stands here beside it writes JSON.
#[test]
fn no_line_passes_by() {
    for (file, text, of_json) in [
        ("records.rs", include_str!("../records.rs"), 0),
        ("records/list.rs", include_str!("../records/list.rs"), 2),
        ("export.rs", include_str!("../export.rs"), 0),
        ("recompute.rs", include_str!("../recompute.rs"), 0),
        ("check.rs", include_str!("../check.rs"), 0),
        ("doctor.rs", include_str!("../doctor.rs"), 0),
        ("ports.rs", include_str!("../ports.rs"), 0),
        ("auto.rs", include_str!("../auto.rs"), 0),
        ("auto/face.rs", include_str!("../auto/face.rs"), 1),
    ] {
        let ways: usize = ["println!", "writeln!", "print!"].iter().map(|way| text.matches(way).count()).sum();
        assert_eq!(ways, of_json, "{file}");
    }
}
