//! What the screen says of the limits for a part.

use gnc_executive::event::EventKind;
use gnc_executive::limit::{Limit, MeasurementKind};
use gnc_executive::part::{LimitsChosen, PartName};
use gnc_executive::quantity::Dimension;

use super::*;
use crate::tui::model::{DriftLimits, PlanAsks};

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
