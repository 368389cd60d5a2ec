//! Scenes of a plan that captures: a calibration on the simulated turntable.

use std::sync::Arc;
use std::time::Duration;

use gnc_analysis::motion;
use gnc_bench::guidance::allan::AllanSoFar;
use gnc_bench::guidance::field::FieldSoFar;
use gnc_bench::guidance::{Guidance, Picture, Stage};
use gnc_executive::event::{EventKind, PlannedItem};
use gnc_executive::plan::{Phase, Plan, PlanItem};
use gnc_protocol::stream::{ImuSample, MAG_LSB_PER_GAUSS};

use super::Scene;
use crate::tui::lang::Lang;
use crate::tui::model::{Loaded, PlanView, ProgramView, Progress};
use crate::tui::update::{Msg, update};

/// Board time that a scene has captured of the present capture.
const CAPTURED_S: f64 = 87.4;

impl Scene {
    /// A screen in the middle of a capture of the calibration plan: `item` is at work, and `finished` of its captures
    /// are finished.
    ///
    /// # Errors
    /// An error of the terminal in memory; the plan of the scene is always good.
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

    /// A screen in the first spin of the magnetometer, after `samples` samples of a field that draws an ellipse.
    ///
    /// # Errors
    /// As [`Scene::capturing`].
    pub fn spinning(lang: Lang, size: (u16, u16), samples: u32) -> std::io::Result<Self> {
        let mut scene = Self::capturing(lang, size, "magnetometer-ellipse", 0)?;
        let mut field = FieldSoFar::new(2);
        (0..samples).for_each(|index| field.take(&[spun(index)]));
        scene.shows("magnetometer-ellipse", Picture::Field(Arc::new(field.look())));
        Ok(scene)
    }

    /// A screen in the hour at rest, after `samples` samples.
    ///
    /// # Errors
    /// As [`Scene::capturing`].
    pub fn resting(lang: Lang, size: (u16, u16), samples: u32) -> std::io::Result<Self> {
        let mut scene = Self::capturing(lang, size, "bias-stability", 0)?;
        let mut allan = AllanSoFar::new(200);
        let mut noise = Noise(7);
        (0..samples).for_each(|_| allan.take(&[noise.rested()]));
        scene.shows("bias-stability", Picture::Allan(Arc::new(allan.look())));
        Ok(scene)
    }

    fn shows(&mut self, item: &str, picture: Picture) {
        let mut guidance = self.guidance(item, 0, CAPTURED_S);
        guidance.picture = Some(picture);
        self.guided(item, guidance);
    }

    /// The captures so far had these temperatures.
    #[cfg(test)]
    pub(crate) fn warm(&mut self, item: &str, heat: gnc_bench::guidance::heat::HeatView) {
        let mut guidance = self.guidance(item, 2, CAPTURED_S);
        guidance.heat = Some(heat);
        self.guided(item, guidance);
    }

    /// An idle screen with a calibration plan that ends with an hour at rest.
    pub(crate) fn calibration(lang: Lang, width: u16, height: u16) -> std::io::Result<Self> {
        let mut scene = Self::new(lang, width, height)?;
        let plan = plan()?;
        let items: Vec<PlannedItem> = plan.items().iter().map(planned).collect();
        scene.plan = ("calibration", items.clone());
        let view = PlanView {
            name: "calibration".into(),
            version: "1.0".into(),
            sha256: "00".repeat(32),
            is_pinned: false,
            items,
            programs: plan.items().iter().filter_map(ProgramView::of).collect(),
            part: Some("GNC-POP-26".into()),
            serial_number: None,
            asks: std::sync::Arc::default(),
            expected_s: None,
        };
        let path = "test-plans/calibration.toml".into();
        update(&mut scene.model, Msg::Plan { path, plan: Loaded::Ready(view) });
        Ok(scene)
    }

    /// The guidance of an item with `finished` captures finished and the next one under way.
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

    /// Reports the progress of the item at work.
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

pub(crate) fn plan() -> std::io::Result<Plan> {
    let text = include_str!("calibration.toml");
    let none = &mut |_: &str| Err("it includes nothing".to_owned());
    Plan::read("calibration.toml", text.into(), none).map_err(std::io::Error::other)
}

/// A module that spins at 15 turns a second, 1000 samples a second: zeros, two sensitivities, axes two degrees off.
fn spun(index: u32) -> ImuSample {
    let (sin, cos) = (f64::from(index) * 0.015 * std::f64::consts::TAU).sin_cos();
    let (x, y) = (0.05 + 0.30 * cos - 0.01 * sin, -0.03 - 0.27 * sin);
    let counts = |gauss: f64| (gauss * MAG_LSB_PER_GAUSS).round() as i32;
    ImuSample { mag: [counts(x), counts(y), 0], ..ImuSample::default() }
}

/// Pseudo-random numbers (Knuth's linear congruence), the same in every picture.
struct Noise(u64);

impl Noise {
    fn counts(&mut self, width: f64) -> i32 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (((self.0 >> 33) as f64 / f64::from(1_u32 << 31) - 0.5) * width) as i32
    }

    /// A sample of a module that lies still.
    fn rested(&mut self) -> ImuSample {
        let mut all = |width: f64| [width, 1.5 * width, 2.5 * width].map(|width| self.counts(width));
        ImuSample { gyro: all(700.0), accel: all(400.0), ..ImuSample::default() }
    }
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
