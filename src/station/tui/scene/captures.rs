//! Scenes of a plan that captures: a calibration on the simulated turntable.

use std::sync::Arc;
use std::time::Duration;

use gnc_executive::event::{EventKind, PlannedItem};
use gnc_executive::plan::{Phase, Plan, PlanItem};

use super::Scene;
use crate::guidance::{Guidance, Stage};
use crate::motion;
use crate::tui::lang::Lang;
use crate::tui::model::{Loaded, PlanView, ProgramView, Progress};
use crate::tui::update::{Msg, update};

/// Captured board time of the capture in the middle of which a scene stands.
const CAPTURED_S: f64 = 87.4;

impl Scene {
    /// A run of the calibration plan that stands in the middle of a capture: `item` is at work, and so many of its
    /// captures are finished.
    ///
    /// # Errors
    /// As [`Scene::new`]; the plan of the repository is good.
    pub fn capturing(lang: Lang, (width, height): (u16, u16), item: &str, finished: usize) -> std::io::Result<Self> {
        let mut scene = Self::calibration(lang, width, height)?;
        scene.start("DEMO-1");
        scene.passes(&["identity", "imu"]);
        scene.event(EventKind::ItemStarted { item: item.into(), attempt: 1 });
        scene.pass_time(Duration::from_secs(700));
        let guidance = scene.guidance(item, finished, CAPTURED_S);
        scene.guided(item, guidance);
        Ok(scene)
    }

    /// An idle screen with the calibration plan.
    pub(crate) fn calibration(lang: Lang, width: u16, height: u16) -> std::io::Result<Self> {
        let mut scene = Self::new(lang, width, height)?;
        let plan = plan()?;
        let items: Vec<PlannedItem> = plan.items().iter().map(planned).collect();
        scene.plan = ("calibration", items.clone());
        let view = PlanView {
            name: "calibration".into(),
            version: "1.0".into(),
            items,
            programs: plan.items().iter().filter_map(ProgramView::of).collect(),
            part: Some("GNC-POP-26".into()),
            expected_s: None,
        };
        let path = "test-plans/calibration.toml".into();
        update(&mut scene.model, Msg::Plan { path, plan: Loaded::Ready(view) });
        Ok(scene)
    }

    /// The way through an item's program with so many captures finished and the next one under way.
    pub(crate) fn guidance(&self, item: &str, finished: usize, captured_s: f64) -> Guidance {
        let plan = plan().ok();
        let found = plan.iter().flat_map(Plan::items).find(|other| other.name == item);
        let program = found.and_then(|item| motion::program(item.id, &item.params).ok().flatten()).unwrap_or_default();
        let mut guidance = Guidance::new(&program);
        for step in &program.steps {
            guidance.begin(step);
            if guidance.stage == Stage::Capturing && guidance.finished == finished {
                guidance.captured_s = captured_s.min(step.span_s() / 2.0);
                break;
            }
            guidance.end(step);
        }
        guidance
    }

    /// The item at work says how far it is.
    pub(crate) fn guided(&mut self, item: &str, guidance: Guidance) {
        let progress = Progress {
            item: item.into(),
            done_permille: Some(((1.0 - guidance.left_s() / guidance.whole_s) * 1e3) as u16),
            elapsed: Duration::from_secs(700),
            guidance: Some(Arc::new(guidance)),
        };
        self.tell(Msg::Progress(vec![progress]));
    }
}

fn plan() -> std::io::Result<Plan> {
    let text = include_str!("../../../../test-plans/calibration.toml");
    let none = &mut |_: &str| Err("it includes nothing".to_owned());
    Plan::read("calibration.toml", text.into(), none).map_err(std::io::Error::other)
}

fn planned(item: &PlanItem) -> PlannedItem {
    PlannedItem {
        name: item.name.clone(),
        id: item.id,
        title: item.id.spec().title.to_owned(),
        phase: Phase::Test,
        optional: item.optional,
        selected: true,
    }
}
