//! What is said of plans, in every language.

use std::collections::BTreeSet;
use std::fs;

use gnc_executive::catalogue::ItemId;

use super::*;
use crate::locale::Lang;
use crate::phrases::english::{self, latin};

/// Tests of the language of plans. Their raw strings are plans with every mistake.
const TESTS_OF_PLANS: [&str; 4] = [
    include_str!("../../executive/plan/tests/mistakes.rs"),
    include_str!("../../executive/plan/tests/parts.rs"),
    include_str!("../../executive/plan/tests/includes.rs"),
    include_str!("../../executive/plan/question/tests.rs"),
];

/// A bench that can do nothing.
const NOTHING: BenchAbilities = BenchAbilities { rs422: false, can: false, operator: false };

/// Words that no language changes, with the reason.
const NAMES: [(&str, &str); 4] = [
    (
        "units and what they stand behind",
        "Hz kHz deg/s deg/h ns us ms min mA mV degC ug mg m/s ppm MB LSB RS-422 CAN HDOP",
    ),
    ("files of the station and of plans", "docs/items.md docs/plans.md plan.toml bench.toml"),
    ("options and commands", "gnc-station plan check part revision REV answer sim bench FILE NAME VALUE"),
    (
        "what people write in a plan",
        "TOML UTF-8 true false SN 0xff setup teardown version text name requires_part os error imu.gyro_x",
    ),
];

fn said(plan: &Path, bench: Option<BenchAbilities>, part: Option<&PartName>, lang: Lang) -> String {
    let mut out = Vec::new();
    let bench = bench.map(|abilities| CheckedAgainst { abilities, plans: PinnedPlans::default() });
    check(
        (&[plan.to_owned()], gnc_files::Reach::Folder),
        bench.as_ref(),
        part,
        &mut Lines::in_language(&mut out, lang),
    );
    String::from_utf8(out).expect("UTF-8")
}

/// The lines but those of the plan itself, which are shown as they are written.
fn own_lines(said: &str) -> String {
    let is_own = |line: &&str| !line.contains(" | ");
    said.lines().filter(is_own).map(|line| format!("{line}\n")).collect()
}

/// Checks what is said of a plan; returns it in English. What the plan and the catalogue name is no English.
#[track_caller]
fn speaks_all(plan: &Path, bench: Option<BenchAbilities>, part: Option<&PartName>) -> String {
    // With the plans beside it, which it may include.
    let beside = plan.parent().and_then(|folder| fs::read_dir(folder).ok()).into_iter().flatten().flatten();
    let plans = beside.filter(|file| file.path().extension().is_some_and(|end| end == "toml"));
    let read = plans.filter_map(|file| {
        let bytes = fs::read(file.path()).ok()?;
        Some(format!("{}\n{}\n", file.path().display(), String::from_utf8_lossy(&bytes)))
    });
    let text: String = read.collect();
    let path = plan.display().to_string();
    let catalogue = ItemId::ALL.into_iter().flat_map(|id| {
        let (measurements, params) = (id.spec().measurements.iter(), id.spec().params.iter());
        [id.as_str()].into_iter().chain(measurements.map(|one| one.name)).chain(params.map(|one| one.name))
    });
    let mut names: BTreeSet<&str> = catalogue.chain(latin(&text)).chain(latin(&path)).collect();
    let part_shown = part.map(ToString::to_string).unwrap_or_default();
    names.extend(latin(&part_shown));
    names.extend(NAMES.iter().flat_map(|(_, names)| names.split(' ')));
    let english = said(plan, bench, part, Lang::En);
    for lang in [Lang::Zh, Lang::Ru] {
        let other = own_lines(&said(plan, bench, part, lang));
        english::holds_none(&own_lines(&english), &other, lang, &|word| names.contains(word));
    }
    english
}

/// The raw strings of a source file that are no snapshots.
fn raw_strings(source: &str) -> Vec<&str> {
    let pieces = source.split("r#\"").zip(source.split("r#\"").skip(1));
    let plans = pieces.filter(|(before, _)| !before.ends_with('@')).filter_map(|(_, text)| text.split("\"#").next());
    plans.collect()
}

#[test]
fn mistakes_of_plans_in_every_language() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("plan.toml");
    let mut told = 0;
    let head = "name = \"p\"\nversion = \"1\"\n";
    for text in TESTS_OF_PLANS.iter().flat_map(|source| raw_strings(source)) {
        for text in [text.to_owned(), format!("{head}{text}")] {
            // What the reader of TOML says of its grammar are no sentences of the station.
            if toml::from_str::<toml::Table>(&text).is_err() {
                continue;
            }
            fs::write(&path, text).expect("a file");
            told += speaks_all(&path, Some(NOTHING), None).matches("try:").count();
        }
    }
    assert!(told > 60, "the plans of the tests have mistakes: {told}");
    let no_plan: [&[u8]; 3] = [
        b"",
        &[0xff, 0xfe, 0x31, 0x00],
        b"name = \"p\"\nversion = \"1\"\ninclude = [\"plan.toml\", \"../gone.toml\"]\n",
    ];
    for bytes in no_plan {
        fs::write(&path, bytes).expect("a file");
        speaks_all(&path, None, None);
    }
    speaks_all(&folder.path().join("none.toml"), None, None);
    speaks_all(folder.path(), None, None);
}

#[test]
fn good_plans_in_every_language() {
    let plans = Path::new(env!("CARGO_MANIFEST_DIR")).ancestors().nth(2).expect("the repository").join("test-plans");
    let mut told = 0;
    for plan in fs::read_dir(plans).expect("plans").flatten().map(|entry| entry.path()) {
        for bench in [None, Some(setup::SIMULATED), Some(NOTHING)] {
            let part = PartName::new("GNC-POP-26B", None);
            speaks_all(&plan, bench, Some(&part));
            told += speaks_all(&plan, bench, None).matches("of bench time").count();
        }
    }
    assert!(told > 10, "captures take time: {told}");
}

const PARTS: &str = r#"name = "p"
version = "1"
[[item]]
id = "imu"
[item.limits]
gyro_x = "0 +- 2 deg/s"
gyro_y = "0 +- 2 deg/s"
accel_norm = { limit = "1 g +- 3 %", marginal = "5 mg" }
accel_x = { limit = "0 +- 1 g", marginal = "5 mg" }
accel_y = { limit = "0 +- 1 g", marginal = "5 mg" }
[part.A.limits.imu]
gyro_x = { limit = "0 +- 1 deg/s", marginal = "0.1 deg/s" }
gyro_z = { limit = "0 +- 2 deg/s", marginal = "0.1 deg/s" }
accel_norm = { limit = "1 g +- 3 %", marginal = "2 mg" }
accel_x = "0 +- 1 g"
accel_z = "<= 2 g"
[part.A.revision.C.limits.imu]
gyro_y = "0 +- 1 deg/s"
"#;

/// A band that a part has, loses or changes is shown; two limits may differ in nothing else.
#[test]
fn the_limits_of_a_part_have_their_marginal_bands() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("plan.toml");
    fs::write(&path, PARTS).expect("a file");
    let limits = |revision| {
        let said = speaks_all(&path, None, Some(&PartName::new("A", revision)));
        said.lines().skip(2).map(str::to_owned).collect::<Vec<_>>()
    };
    assert_eq!(
        limits(Some("C")),
        [
            "  limits: part A rev C",
            "    imu gyro_x -1 .. 1 deg/s, marginal within 0.1 deg/s of a bound (the item has -2 .. 2 deg/s)",
            "    imu gyro_y -1 .. 1 deg/s (the item has -2 .. 2 deg/s)",
            "    imu gyro_z -2 .. 2 deg/s, marginal within 0.1 deg/s of a bound (the item has none)",
            "    imu accel_x -1 .. 1 g (the item has -1 .. 1 g, marginal within 0.005 g of a bound)",
            "    imu accel_y -1 .. 1 g, marginal within 0.005 g of a bound",
            "    imu accel_z <= 2 g (the item has none)",
            "    imu accel_norm 0.97 .. 1.03 g, marginal within 0.002 g of a bound (the item has 0.97 .. 1.03 g, marginal within 0.005 g of a \
             bound)",
        ]
    );
    // Without a revision it is not known which limits count.
    let asked = speaks_all(&path, None, Some(&PartName::new("A", None)));
    assert!(asked.contains("depend on its revision"), "{asked}");
    let other = speaks_all(&path, None, Some(&PartName::new("B", None)));
    assert!(other.contains("it has none of its own for part B"), "{other}");
    fs::write(&path, format!("requires_part = true\n{PARTS}")).expect("a file");
    speaks_all(&path, None, Some(&PartName::new("B", Some("D"))));
}

/// Files and items keep their names, whatever these read like.
#[test]
fn names_of_files_and_items_stay() {
    let folder = tempfile::tempdir().expect("a folder");
    for name in ["board", "memory: failed", "x: x: x: board"] {
        let path = folder.path().join(name);
        let item = "[[item]]\nid = \"six-position\"\nname = \"temperature\"\nlimits.residual_rms = \"<= 5 mg\"\n";
        fs::write(&path, format!("name = \"p\"\nversion = \"1\"\n{item}")).expect("a file");
        for lang in [Lang::Zh, Lang::Ru] {
            let said = said(&path, None, None, lang);
            let shown = path.display().to_string();
            assert!(said.starts_with(&shown), "{lang:?}: {said}");
            assert!(
                said.contains("\n  temperature") && !said.contains("items") && !said.contains("takes"),
                "{lang:?}: {said}"
            );
        }
    }
}

/// The repeats of an item and the cycles within each are told before the run, with the longest time of all of them.
#[test]
fn repeats_are_told_with_their_time() {
    let folder = tempfile::tempdir().expect("a folder");
    let plan = folder.path().join("plan.toml");
    let item = |id: &str, more: &str| format!("[[item]]\nid = \"{id}\"\nrepeats = 1000\ntimeout = \"2 h\"\n{more}");
    let cycles = "params = { cycles = 100 }\n[item.limits]\ncycles_done = \">= 1\"\n";
    let text = format!(
        "name = \"p\"\nversion = \"1\"\n{}{}",
        item("identity", "[item.limits]\nprotocol = \"== 1\"\n"),
        item("power-cycle", cycles)
    );
    fs::write(&plan, text).expect("a file");
    let said = speaks_all(&plan, None, None);
    let time = motion::DisplayDuration(7200.0);
    assert!(said.contains(&format!("1000 repeats and at most {time} for all of them")), "{said}");
    assert!(said.contains(&format!("1000 repeats of 100 cycles and at most {time} for all of them")), "{said}");
}
