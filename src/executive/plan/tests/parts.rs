//! Limits by part number and revision.

use super::*;
use crate::part::PartName;

const HEAD: &str = "name = \"p\"\nversion = \"1\"\n";
const ITEMS: &str = r#"
[[item]]
id = "identity"
[item.limits]
protocol = "== 1"
supply_current = { limit = "<= 490 mA", marginal = "5 mA" }
[[item]]
id = "imu"
name = "imu-cold"
[item.limits]
"gyro_*_noise" = "<= 2 deg/s"
gyro_z_noise = "<= 3 deg/s"
"#;

fn with(parts: &str) -> Plan {
    plan(&format!("{HEAD}{ITEMS}{parts}"))
}

fn wrong(parts: &str) -> String {
    mistakes(&format!("{HEAD}{ITEMS}{parts}"))
}

/// The table that counts for a module, and the limits of `item` under it.
fn under(plan: &Plan, number: &str, revision: &str, item: &str) -> (String, Vec<String>) {
    let chosen = plan.choose_limits(&PartName::new(number, Some(revision))).unwrap_or_else(|error| panic!("{error}"));
    let judging = match &chosen.part {
        Some(part) => plan.with_limits_of(part).unwrap_or_else(|| panic!("no table {part}")),
        None => plan.clone(),
    };
    let item = judging.items().iter().find(|one| one.name == item).unwrap();
    (chosen.to_string(), item.limits().map(|(name, limit)| format!("{name} {limit}")).collect())
}

const REVISIONS: &str = r#"
[part.GNC-POP-26B.limits]
imu-cold."gyro_*_noise" = "<= 1 deg/s"
identity.supply_current = "<= 500 mA"
[part.GNC-POP-26B.revision.C.limits]
imu-cold.gyro_y_noise = "<= 5 deg/s"
imu-cold.accel_x = "<= 1 g"
"#;

#[test]
fn a_table_counts_more_than_the_items_and_a_revision_more_than_its_part() {
    let plan = with(REVISIONS);
    let current = |number, revision| under(&plan, number, revision, "identity").1[1].clone();
    assert_eq!(current("GNC-POP-26", "A"), "supply_current <= 490 mA");
    assert_eq!(current("GNC-POP-26B", "A"), "supply_current <= 500 mA");
    assert_eq!(current("GNC-POP-26B", "C"), "supply_current <= 500 mA");
    let imu = |number, revision| under(&plan, number, revision, "imu-cold");
    let (of, limits) = imu("GNC-POP-26", "A");
    assert_eq!(of, "of the plan (it has none of its own for part GNC-POP-26 rev A)");
    assert_eq!(limits, ["gyro_x_noise <= 2 deg/s", "gyro_y_noise <= 2 deg/s", "gyro_z_noise <= 3 deg/s"]);
    let (of, limits) = imu("GNC-POP-26B", "A");
    assert_eq!(of, "part GNC-POP-26B");
    // A pattern of the table counts more than an exact name of the item.
    assert!(limits.contains(&"gyro_z_noise <= 1 deg/s".to_owned()), "{limits:?}");
    let (of, limits) = imu("GNC-POP-26B", "C");
    assert_eq!(of, "part GNC-POP-26B rev C");
    for limit in ["gyro_x_noise <= 1 deg/s", "gyro_y_noise <= 5 deg/s", "accel_x <= 1 g"] {
        assert!(limits.contains(&limit.to_owned()), "{limit}: {limits:?}");
    }
    // The whole limit is replaced, with its marginal band.
    let chosen = plan.choose_limits(&PartName::new("GNC-POP-26B", None)).unwrap().part.unwrap();
    let Some(Limit::Range(range)) = plan.with_limits_of(&chosen).unwrap().items()[0].limit("supply_current").cloned()
    else {
        panic!("a range")
    };
    assert_eq!(range.marginal, None);
}

#[test]
fn the_judgement_of_a_value_follows_the_table() {
    let plan = with(REVISIONS);
    let rate = Value::number(4.0, Unit::DegreePerSecond);
    let of = |revision: &str| {
        let chosen = plan.choose_limits(&PartName::new("GNC-POP-26B", Some(revision))).unwrap().part.unwrap();
        plan.with_limits_of(&chosen).unwrap().items()[1].judge("gyro_y_noise", &rate, 1, "SN").outcome
    };
    assert_eq!(of("C"), Some(Outcome::Passed));
    assert_eq!(of("D"), Some(Outcome::Failed));
}

#[test]
fn modules_and_labels_write_names_in_their_own_way() {
    let plan = with(
        "[part.\"A/1.2 'x'\".limits]\nidentity.protocol = \"== 2\"\n[part.B.revision.\"-\".limits]\nidentity.protocol = \"== 3\"\n",
    );
    let of = |number, revision| under(&plan, number, revision, "identity").1[0].clone();
    for number in ["A/1.2 'x'", " a/1.2   'X' "] {
        assert_eq!(of(number, "C"), "protocol == 2", "{number}");
    }
    // A module without revision says nothing or a dash.
    for revision in ["", "-", " "] {
        assert_eq!(of("b", revision), "protocol == 3", "{revision:?}");
    }
    for (number, revision) in [("A/1.2x", "C"), ("B", "C")] {
        assert_eq!(of(number, revision), "protocol == 1", "{number} {revision}");
    }
    // A module without number may be any part: no limits are its own.
    for number in ["", " ", "-"] {
        let refused = plan.choose_limits(&PartName::new(number, Some("C"))).unwrap_err();
        assert!(refused.to_string().contains("the module says none"), "{number:?}: {refused}");
    }
}

#[test]
fn tables_of_included_files_are_joined_item_by_item() {
    let root = "name = \"r\"\nversion = \"1\"\ninclude = [\"a.toml\"]\n[[item]]\nid = \"io\"\n[item.limits]\nwrong_reads = \"== 0\"\n\
        [part.gnc-1.limits]\nio.wrong_reads = \"<= 1\"\nidentity.protocol = \"== 3\"\n";
    let a = format!(
        "name = \"a\"\nversion = \"1\"\n{ITEMS}[part.GNC-1.limits]\nidentity.protocol = \"== 2\"\nidentity.supply_current = \"<= 1 A\"\n"
    );
    let plan = read(&[("root.toml", root), ("a.toml", &a)]).unwrap_or_else(|mistakes| panic!("{mistakes}"));
    assert_eq!(under(&plan, "GNC-1", "", "identity").1, ["protocol == 3", "supply_current <= 1 A"]);
    assert_eq!(under(&plan, "GNC-1", "", "io").1, ["wrong_reads <= 1"]);
    assert_eq!(plan.parts().count(), 1);
    // By itself the included plan has its own limits, and cannot name items of the other.
    assert_eq!(under(&self::plan(&a), "GNC-1", "", "identity").1[0], "protocol == 2");
    let told = read(&[("a.toml", &format!("{a}io.wrong_reads = \"<= 1\"\n"))]).unwrap_err().to_string();
    assert!(told.contains("no item has the name \"io\""), "{told}");
}

#[test]
fn mistakes_in_tables_of_parts() {
    let out = wrong(
        r#"
[part.GNC-1.limits]
imu.gyro_x = "0 +- 1 deg/s"
gyro_x = "0 +- 1 deg/s"
identity.protocl = "== 2"
imu-cold.gyro_x = "2 .. 1 deg/s"
imu-cold.gyro_y = "<= 1 V"
[part.GNC-1.limts]
[part.gnc-1.limits]
identity.protocol = "== 2"
[part."GNC-*".limits]
[part."".limits]
[part."ＧＮＣ-1".limits]
[part.GNC-2.limits]
identity.protocol = "== 1"
[part.GNC-3.limits]
identity.protocol = "== 2"
[part.GNC-3.revision.B.limits]
identity.protocol = "== 2"
[part.GNC-4]
"#,
    );
    insta::assert_snapshot!(out);
}

#[test]
fn a_part_that_the_plan_does_not_name_is_refused_if_it_requires_one() {
    let text = |parts: &str| format!("{HEAD}requires_part = true\n{ITEMS}{parts}");
    let plan = self::plan(&text("[part.A]\n[part.B.revision.C.limits]\nidentity.protocol = \"== 3\"\n"));
    // An empty table says that the part may be tested by the plan's own limits.
    assert_eq!(under(&plan, "a", "X", "identity").0, "part A");
    assert_eq!(under(&plan, "B", "c", "identity").0, "part B rev C");
    for (number, revision) in [("B", "D"), ("C", "")] {
        let refused = plan.choose_limits(&PartName::new(number, Some(revision))).unwrap_err();
        assert!(!refused.try_this().is_empty());
        assert!(refused.to_string().contains("has no limits for part"), "{refused}");
    }
    let told = mistakes(&text(""));
    assert!(told.contains("requires a part that it names, and names none"), "{told}");
}

const ASKING: &str = r#"
name = "p"
version = "1"
[[item]]
id = "prompt"
name = "by-hand"
[[item.ask]]
name = "remark"
en = "What else?"
kind = "choice"
choices = ["none", "some"]
[[item.ask]]
name = "tp4"
en = "What does the meter at TP4 read?"
kind = "number"
unit = "V"
[[item.ask]]
name = "look"
en = "How does it look?"
kind = "choice"
choices = ["clean", "worn"]
good = ["clean"]
[item.limits]
tp4 = { limit = "4.9 V .. 5.1 V", marginal = "20 mV" }
[part.GNC-1.limits]
"#;

/// Answers are measurements, so a part and a revision have limits for them as for any other.
#[test]
fn a_part_has_limits_for_answers() {
    let plan = plan(&format!(
        "{ASKING}by-hand.tp4 = \"3.2 V .. 3.4 V\"\nby-hand.remark = \"== none\"\n\
         [part.GNC-1.revision.B.limits]\nby-hand.tp4 = \"1.7 V .. 1.9 V\"\n"
    ));
    let of = |number, revision| under(&plan, number, revision, "by-hand").1;
    assert_eq!(of("GNC-2", "A"), ["tp4 4.9 .. 5.1 V", "look == clean"]);
    assert_eq!(of("GNC-1", "A"), ["remark == none", "tp4 3.2 .. 3.4 V", "look == clean"]);
    assert_eq!(of("GNC-1", "B"), ["remark == none", "tp4 1.7 .. 1.9 V", "look == clean"]);
    let chosen = plan.choose_limits(&PartName::new("GNC-1", None)).unwrap().part.unwrap();
    let judging = plan.with_limits_of(&chosen).unwrap();
    let judged = |number| judging.items()[0].judge("tp4", &Value::number(number, Unit::Volt), 1, "SN").outcome;
    assert_eq!((judged(3.3), judged(5.0)), (Some(Outcome::Passed), Some(Outcome::Failed)));
}

/// The same checks as in the limits of the item.
#[test]
fn mistakes_in_limits_of_a_part_for_answers() {
    for (limit, said) in [
        ("tp5 = \"<= 5 V\"", "did you mean \"tp4\"?"),
        ("tp5 = \"<= 5 V\"", "the item does not ask \"tp5\""),
        ("tp4 = \"<= 5\"", "5 has no unit"),
        ("tp4 = \"<= 5 A\"", "current"),
        ("look = \"== worn\"", "\"look\" has another limit already"),
        ("remark = \"== None\"", "\"None\" is no choice"),
        ("tp4 = { limit = \"4.9 V .. 5.1 V\", marginal = \"20 mV\" }", "has the plan's own limits"),
    ] {
        let told = mistakes(&format!("{ASKING}by-hand.{limit}\n"));
        assert!(told.contains(said), "{limit}: {told}");
    }
}
