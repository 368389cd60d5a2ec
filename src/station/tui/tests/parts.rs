//! What the screen says of the limits for a part.

use gnc_executive::event::EventKind;
use gnc_executive::limit::{Limit, MeasurementKind};
use gnc_executive::part::{LimitsChosen, PartName};
use gnc_executive::quantity::Dimension;

use super::*;
use crate::tui::model::{DriftLimits, Loaded, PlanAsks};

#[test]
fn the_operator_sees_which_limits_count_in_each_language() {
    for lang in Lang::ALL {
        let mut scene = Scene::new(lang, 80, 24).expect("a scene");
        scene.start("DEMO-1");
        let module = PartName::new("GNC-POP-26B", Some("C"));
        let part = Some(PartName::new("GNC-POP-26B", None));
        scene.event(EventKind::LimitsChosen(LimitsChosen { part, module: module.clone() }));
        let of_part = scene.text();
        assert!(
            of_part.lines().any(|line| line.contains("GNC-POP-26B.") || line.contains("GNC-POP-26B ")),
            "{of_part}"
        );
        scene.event(EventKind::LimitsChosen(LimitsChosen { part: None, module }));
        let of_plan = scene.text();
        assert!(of_plan.contains("GNC-POP-26B / C"), "{lang:?}: {of_plan}");
    }
}

#[test]
fn the_drift_on_the_screen_has_the_limit_of_the_part() {
    let limit = |text: &str| Limit::parse(text, MeasurementKind::Number(Dimension::Temperature)).expect("a limit");
    let scene = Scene::new(Lang::En, 80, 24).expect("a scene");
    let mut plan = scene.model.plan.ready().expect("a plan").clone();
    let item = "six-position";
    plan.programs = vec![crate::tui::model::ProgramView {
        item: item.into(),
        captures: 1,
        lays: 1,
        span_s: 1.0,
        anew_s: 1.0,
        drift_limit: Some(limit("<= 2 degC")),
    }];
    let part = PartName::new("A", None);
    let limits = DriftLimits { part: part.clone(), limits: vec![(item.into(), Some(limit("<= 1 degC")))] };
    plan.asks = std::sync::Arc::new(PlanAsks { drift_limits: vec![limits], ..PlanAsks::default() });
    let module = PartName::new("A", Some("B"));
    let of = |part| Some(LimitsChosen { part, module: module.clone() });
    assert_eq!(plan.drift_limit(item, None), Some(&limit("<= 2 degC")));
    assert_eq!(plan.drift_limit(item, of(None).as_ref()), Some(&limit("<= 2 degC")));
    assert_eq!(plan.drift_limit(item, of(Some(part)).as_ref()), Some(&limit("<= 1 degC")));
}

/// A screen whose plan has limits for a part.
fn with_parts(lang: Lang) -> Scene {
    let mut scene = Scene::new(lang, 80, 24).expect("a scene");
    let Loaded::Ready(plan) = &mut scene.model.plan else { panic!("a plan") };
    let parts = vec![PartName::new("GNC/1.2", None), PartName::new("GNC/1.2", Some("C"))];
    plan.asks = std::sync::Arc::new(PlanAsks { parts, ..PlanAsks::default() });
    scene
}

fn scan(scene: &mut Scene, code: &str) {
    let scanned = crate::tui::input::Scanned { bytes: code.as_bytes().to_vec(), ended: true, ..Default::default() };
    scene.tell(Msg::Scan(scanned));
}

#[test]
fn a_scan_of_a_part_that_the_plan_names_is_no_serial_number() {
    for lang in Lang::ALL {
        let mut scene = with_parts(lang);
        scan(&mut scene, "SN-1");
        scan(&mut scene, "]C1gnc/1.2\r");
        assert!(scene.text().contains("gnc/1.2"), "{lang:?}: {}", scene.text());
        assert_eq!(scene.model.scan.current.as_deref(), Some("SN-1"));
        assert_eq!(scene.model.part, ["gnc/1.2", ""]);
        // It stays for the next module, and another part is a serial number as ever.
        scan(&mut scene, "GNC/1.3");
        assert_eq!((scene.model.scan.current.as_deref(), scene.model.part[0].as_str()), (Some("GNC/1.3"), "gnc/1.2"));
    }
}

#[test]
fn part_and_revision_are_typed_on_the_form() {
    let mut scene = with_parts(Lang::En);
    scan(&mut scene, "SN-1");
    scene.key(Key::F(2));
    // Below plan, bench and operator.
    (0..3).for_each(|_| drop(scene.key(Key::Down)));
    scene.types("GNC/1.2");
    scene.key(Key::Down);
    scene.types("C");
    let text = scene.text();
    assert!(text.contains("Part number") && text.contains("GNC/1.2") && text.contains("Revision"), "{text}");
    // A scan goes into the form as well. It says nothing of the revision, so what was typed for this part stays.
    scan(&mut scene, "gnc/1.2 ");
    assert_eq!(scene.model.part, ["gnc/1.2", ""]);
    scene.key(Key::Enter);
    assert_eq!(scene.model.part, ["gnc/1.2", "C"]);
}

/// A revision of no part would judge nothing, so it is told, and the form stays until there is a part or no revision.
#[test]
fn a_revision_without_a_part_is_refused() {
    for lang in Lang::ALL {
        let mut scene = with_parts(lang);
        scan(&mut scene, "SN-1");
        scene.key(Key::F(2));
        (0..4).for_each(|_| drop(scene.key(Key::Down)));
        scene.types(" C");
        scene.key(Key::Enter);
        let told = lang.texts().revision_alone.replace("{}", "C");
        assert!(scene.text().contains(&told), "{lang:?}: {}", scene.text());
        assert_eq!(scene.model.part, ["", ""], "{lang:?}");
        // It waits for its part, which may be scanned.
        scan(&mut scene, "GNC/1.2");
        scene.key(Key::Enter);
        assert_eq!((scene.model.part.clone(), scene.model.over.len()), (["GNC/1.2".into(), "C".into()], 0), "{lang:?}");
        // Neither is right, too.
        scene.key(Key::F(2));
        (0..3).for_each(|_| drop(scene.key(Key::Down)));
        (0..9).for_each(|_| drop(scene.key(Key::Backspace)));
        scene.key(Key::Enter);
        assert_eq!(scene.model.part, ["GNC/1.2", "C"], "{lang:?}");
        scene.key(Key::Down);
        (0..9).for_each(|_| drop(scene.key(Key::Backspace)));
        scene.key(Key::Enter);
        assert_eq!(scene.model.part, ["", ""], "{lang:?}");
    }
}

/// The command line refuses it, too.
#[test]
fn a_revision_without_a_part_starts_nothing() {
    let refused = crate::args::asked_part(None, Some("C")).expect_err("it has no part");
    assert_eq!(refused.what, "the revision \"C\" has no part number");
    for lang in [Lang::Zh, Lang::Ru] {
        for said in [&refused.what, &refused.try_this] {
            assert_ne!(crate::phrases::in_language(said, lang), said.as_str(), "{lang:?}");
        }
    }
}

/// The label of the same part takes nothing away. That of another one takes the revision away, and says so.
#[test]
fn a_scan_of_a_part_keeps_the_revision_or_tells_that_it_is_gone() {
    for lang in Lang::ALL {
        for form in [false, true] {
            let mut scene = with_parts(lang);
            let Loaded::Ready(plan) = &mut scene.model.plan else { panic!("a plan") };
            let parts = vec![PartName::new("GNC/1.2", Some("C")), PartName::new("GNC/2.0", Some("A"))];
            plan.asks = std::sync::Arc::new(PlanAsks { parts, ..PlanAsks::default() });
            scene.model.part = ["GNC/1.2".into(), "C".into()];
            if form {
                scene.key(Key::F(2));
            }
            let gone = lang.texts().revision_gone.replacen("{}", "GNC/2.0", 1).replace("{}", "C");
            scan(&mut scene, "gnc/1.2");
            assert_eq!(scene.model.part, ["gnc/1.2", "C"], "{lang:?}");
            assert!(!scene.text().contains(&gone), "{}", scene.text());
            scan(&mut scene, "GNC/2.0");
            assert_eq!(scene.model.part, ["GNC/2.0", ""], "{lang:?}");
            assert!(scene.text().contains(&gone), "{lang:?}: {}", scene.text());
            if form {
                scene.key(Key::Enter);
                assert_eq!(scene.model.part, ["GNC/2.0", ""], "{lang:?}");
            }
            // There is nothing more to lose.
            scan(&mut scene, "GNC/1.2");
            assert!(scene.text().contains("GNC/1.2") && !scene.text().contains(&gone), "{}", scene.text());
        }
    }
}

#[test]
fn a_plan_without_parts_has_no_line_for_them() {
    let mut scene = Scene::new(Lang::En, 80, 24).expect("a scene");
    scene.key(Key::F(2));
    assert!(!scene.text().contains("Part number"), "{}", scene.text());
}
