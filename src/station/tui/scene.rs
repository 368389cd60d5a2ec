//! A screen in memory that plays a run, for snapshots and benchmarks. Its clock stands still unless the scene moves it.

pub(crate) mod captures;

use std::sync::Arc;
use std::time::Duration;

use chrono::{DateTime, FixedOffset, TimeDelta};
use gnc_board::{Readings, StreamReading};
use gnc_executive::bench::DrawPictures;
use gnc_executive::catalogue::ItemId;
use gnc_executive::event::{
    BenchInfo, BenchKind, BoardInfo, EVENTS_SCHEMA, EarlierRun, Event, EventKind, PlanInfo, PlannedItem, Power,
    ProgramVersion, RunHeader, events_form,
};
use gnc_executive::measurement::{Measurement, Reading};
use gnc_executive::outcome::Outcome;
use gnc_executive::plan::Phase;
use gnc_executive::quantity::Unit;
use gnc_nmea::{Epoch, Fix};
use gnc_protocol::stream::{ACCEL_LSB_PER_G, GYRO_LSB_PER_DPS, ImuSample, MAG_LSB_PER_GAUSS, StreamId};
use ratatui::Terminal;
use ratatui::backend::TestBackend;

use super::decode::Key;
use super::lang::Lang;
use super::model::{BenchView, Glyphs, Loaded, Look, Now, PlanView, Progress, ScreenModel};
use super::pending::Prepared;
use super::update::{Effect, Msg, update};
use super::view;

/// A screen in memory.
#[derive(Debug)]
pub struct Scene {
    pub(crate) model: ScreenModel,
    /// Name and items of the plan that is run.
    plan: (&'static str, Vec<PlannedItem>),
    terminal: Terminal<TestBackend>,
    now: Now,
    run_began: Duration,
    seq: u64,
    /// The runs that are played were judged again.
    pub(crate) rejudged: bool,
}

impl Scene {
    /// An idle screen of a simulated bench with the table of single-function tests.
    ///
    /// # Errors
    /// A terminal in memory never fails; only its type allows an error.
    pub(crate) fn new(lang: Lang, width: u16, height: u16) -> std::io::Result<Self> {
        let look = Look { colour: true, glyphs: Glyphs::Unicode, poor: false };
        let now = Now { at: noon(), since_start: Duration::ZERO };
        let mut model = ScreenModel::new(lang, look, now);
        let bench = BenchView {
            station: "line-2".into(),
            kind: BenchKind::Simulated,
            unproven: None,
            name: "good".into(),
            link: String::new(),
            records: "records".into(),
            operator: None,
            operator_required: false,
            bell: false,
            pictures: DrawPictures::Auto,
            serial_number: None,
            numbers: Arc::default(),
        };
        let plan = PlanView {
            name: "functional".into(),
            version: "1.0".into(),
            sha256: "00".repeat(32),
            is_pinned: false,
            items: items(),
            programs: Vec::new(),
            part: Some("GNC-POP-26".into()),
            serial_number: None,
            asks: Arc::default(),
            expected_s: Some(4.8),
        };
        update(&mut model, Msg::Bench { path: "sim:good".into(), bench: Loaded::Ready(bench) });
        update(&mut model, Msg::Plan { path: "test-plans/functional.toml".into(), plan: Loaded::Ready(plan) });
        let terminal = Terminal::new(TestBackend::new(width, height)).map_err(std::io::Error::other)?;
        let plan = ("functional", items());
        Ok(Self { model, plan, terminal, now, run_began: Duration::ZERO, seq: 0, rejudged: false })
    }

    /// The bench is one that does not prove its board.
    #[cfg(test)]
    pub(crate) fn unproven(&mut self) {
        if let Loaded::Ready(bench) = &mut self.model.bench {
            bench.kind = BenchKind::Unproven;
            bench.unproven = Some("port /dev/pts/7 is a pseudo-terminal".to_owned());
        }
    }

    /// A screen in the middle of a run: three items at work, curves of a minute on the live page.
    ///
    /// # Errors
    /// An error of the terminal in memory.
    pub fn at_work(lang: Lang, width: u16, height: u16) -> std::io::Result<Self> {
        let mut scene = Self::new(lang, width, height)?;
        scene.start("DEMO-1");
        scene.passes(&["identity", "cpu", "timers", "internal-ram"]);
        for item in ["imu", "gnss", "sdram"] {
            scene.event(EventKind::ItemStarted { item: item.into(), attempt: 1 });
        }
        scene.pass_time(Duration::from_millis(1300));
        scene.progress(&[("imu", Some(430)), ("gnss", None), ("sdram", Some(800))]);
        scene.readings(600);
        Ok(scene)
    }

    /// Draws the screen.
    ///
    /// # Errors
    /// An error of the terminal in memory.
    pub fn draw(&mut self) -> std::io::Result<()> {
        let model = &self.model;
        self.terminal.draw(|frame| view::draw(model, frame)).map(drop).map_err(std::io::Error::other)
    }

    /// Adds another sample of all sensors, a tenth of a second later.
    pub fn next_sample(&mut self) {
        self.pass_time(Duration::from_millis(100));
        self.readings(1);
    }

    /// Turns to the next page.
    pub fn next_page(&mut self) {
        self.key(Key::F(9));
    }

    pub(crate) fn key(&mut self, key: Key) -> Option<Effect> {
        update(&mut self.model, Msg::Key(key))
    }

    pub(crate) fn types(&mut self, text: &str) {
        text.chars().for_each(|character| drop(self.key(Key::Char(character))));
    }

    /// Scans a code whose line end came.
    #[cfg(test)]
    pub(crate) fn scans(&mut self, code: &str) -> Option<Effect> {
        let scanned = super::input::Scanned { bytes: code.into(), ended: true, ..Default::default() };
        self.tell(Msg::Scan(scanned))
    }

    pub(crate) fn tell(&mut self, msg: Msg) -> Option<Effect> {
        update(&mut self.model, msg)
    }

    pub(crate) fn pass_time(&mut self, time: Duration) {
        self.now.since_start += time;
        self.now.at += TimeDelta::from_std(time).unwrap_or_default();
        update(&mut self.model, Msg::Time(self.now));
    }

    /// Scans a number, starts, and lets the board answer.
    pub(crate) fn start(&mut self, serial_number: &str) {
        self.start_with(serial_number, None);
    }

    /// The same with chosen items.
    #[cfg(test)]
    pub(crate) fn start_selection(&mut self, serial_number: &str, names: &[&str]) {
        self.start_with(serial_number, Some(names.iter().map(|name| (*name).to_owned()).collect()));
    }

    /// Scans a number and starts; no board answers yet.
    #[cfg(test)]
    pub(crate) fn start_without_board(&mut self, serial_number: &str) {
        self.begin(serial_number, None);
    }

    fn start_with(&mut self, serial_number: &str, selection: Option<Vec<String>>) {
        self.begin(serial_number, selection);
        self.board_answers();
    }

    fn begin(&mut self, serial_number: &str, selection: Option<Vec<String>>) {
        self.types(serial_number);
        self.key(Key::Enter);
        self.key(Key::F(5));
        let serial = serial_number.to_owned();
        let prepared = Prepared { serial_number: serial, changed: Vec::new(), standing: None, resume: None };
        self.tell(Msg::Prepared(Box::new(prepared)));
        self.run_began = self.now.since_start;
        self.seq = 0;
        let (plan, mut items) = self.plan.clone();
        for item in &mut items {
            item.selected = selection.as_ref().is_none_or(|names| names.contains(&item.name));
        }
        let schema = events_form(selection.as_deref()).to_owned();
        let recomputed =
            self.rejudged.then(|| EarlierRun { run: "140500-functional".to_owned(), journal_sha256: "00".repeat(32) });
        let mut header = RunHeader { schema, selection, recomputed, ..header(serial_number, plan) };
        if matches!(&self.model.bench, Loaded::Ready(bench) if bench.kind == BenchKind::Unproven) {
            header.bench = BenchInfo::real().in_doubt(Some("port /dev/pts/7 is a pseudo-terminal".to_owned()));
        }
        let header = Box::new(header);
        self.event(EventKind::RunStarted { header, items });
        self.tell(Msg::RoundBegins { folder: "records/2026-11-22/DEMO-1/143000-functional".into() });
    }

    /// The board answers, and switches the module on.
    fn board_answers(&mut self) {
        self.event(EventKind::BoardFound(BoardInfo {
            board_serial: "SIM-BOARD-1".into(),
            firmware: "sim 1.0.0".into(),
            protocol: 1,
            boot_id: "0000002a".into(),
            link: "/dev/pts/7 at 921600 bit/s".into(),
        }));
        let supply = "slave board".to_owned();
        self.event(EventKind::Power(Power {
            on: true,
            supply,
            voltage_v: Some(5.01),
            current_a: Some(0.487),
            calibration: None,
        }));
    }

    pub(crate) fn event(&mut self, kind: EventKind) {
        let elapsed = self.now.since_start.saturating_sub(self.run_began);
        let elapsed_us = u64::try_from(elapsed.as_micros()).unwrap_or(u64::MAX);
        let event = Event { seq: self.seq, at: self.now.at, elapsed_us, kind };
        self.seq += 1;
        update(&mut self.model, Msg::Event(Box::new(event)));
    }

    pub(crate) fn passes(&mut self, names: &[&str]) {
        for name in names {
            let item = (*name).to_owned();
            self.event(EventKind::ItemStarted { item: item.clone(), attempt: 1 });
            self.pass_time(Duration::from_millis(140));
            let measurement = measured("measured", 1.25, Outcome::Passed);
            self.event(EventKind::Measured { item: item.clone(), attempt: 1, measurement });
            self.ends(&item, Outcome::Passed);
        }
    }

    pub(crate) fn ends(&mut self, item: &str, outcome: Outcome) {
        let item = item.to_owned();
        self.event(EventKind::AttemptEnded { item: item.clone(), attempt: 1, outcome, error: None });
        self.event(EventKind::ItemEnded { item, outcome, cause: None });
    }

    #[cfg(test)]
    pub(crate) fn run_ends(&mut self, outcome: Outcome) {
        let supply = "slave board".to_owned();
        let off = Power { on: false, supply, voltage_v: None, current_a: None, calibration: None };
        self.event(EventKind::Power(off));
        self.run_ends_at_once(outcome);
    }

    /// Ends without the board: whether the module is off is not known.
    #[cfg(test)]
    pub(crate) fn run_ends_at_once(&mut self, outcome: Outcome) {
        let is_selection = self.model.run.as_ref().is_some_and(|run| run.state.is_selection());
        self.event(EventKind::RunEnded(gnc_executive::verdict::Verdict::new(outcome, is_selection)));
        self.tell(Msg::RunOver { verdict: None, store_error: None, refusal: None });
    }

    pub(crate) fn progress(&mut self, items: &[(&str, Option<u16>)]) {
        let each = items.iter().map(|(item, done_permille)| Progress {
            item: (*item).to_owned(),
            done_permille: *done_permille,
            elapsed: Duration::from_millis(1300),
            guidance: None,
        });
        self.tell(Msg::Progress(each.collect()));
    }

    /// Adds `count` readings, one for each tenth of a second.
    pub(crate) fn readings(&mut self, count: u32) {
        for index in 0..count {
            if count > 1 {
                self.pass_time(Duration::from_millis(100));
            }
            let phase = self.now.since_start.as_secs_f64() + f64::from(index % 2) * 0.01;
            self.tell(Msg::Readings(Box::new(readings(phase))));
        }
    }

    /// Readings of a calibrated module, whose own roll angle comes beside the raw samples.
    #[cfg(test)]
    pub(crate) fn readings_of_a_calibrated_module(&mut self) {
        use gnc_metrology::ellipse::Correction;
        use gnc_protocol::calibration::CompensatedSample;
        let mut readings = readings(1.0);
        readings.correction = Some(Correction { dx: 0.01, dy: -0.02, ky: 1.02, sin_alpha: 0.03 });
        let sample = CompensatedSample { roll: -100_000_000, ..CompensatedSample::default() };
        readings.compensated = Some((1_000_000, sample));
        let streams = [(StreamId::Pps, 1.0), (StreamId::Compensated, 50.0)];
        readings.streams.extend(streams.map(|(id, rate_hz)| StreamReading {
            id,
            rate_hz,
            received: 50,
            on_board: 0,
            on_line: 0,
        }));
        self.tell(Msg::Readings(Box::new(readings)));
    }

    /// The screen as lines of text; the second half of a wide character is left out.
    #[cfg(test)]
    pub(crate) fn text(&mut self) -> String {
        self.draw().expect("memory");
        let buffer = self.terminal.backend().buffer();
        let mut out = String::new();
        for row in buffer.content.chunks(usize::from(buffer.area.width)) {
            let mut hidden = 0;
            for cell in row {
                if hidden > 0 {
                    hidden -= 1;
                    continue;
                }
                out.push_str(cell.symbol());
                hidden = view::text_width(cell.symbol()).saturating_sub(1);
            }
            out.truncate(out.trim_end().len());
            out.push('\n');
        }
        out
    }

    /// The next drawing, cell by cell, as it is compared with the one before.
    #[cfg(test)]
    pub(crate) fn frame(&mut self) -> ratatui::buffer::Buffer {
        let model = &self.model;
        self.terminal.draw(|frame| view::draw(model, frame)).expect("memory").buffer.clone()
    }

    /// Cells with a colour.
    #[cfg(test)]
    pub(crate) fn colours(&mut self) -> usize {
        use ratatui::style::Color;
        self.draw().expect("memory");
        let cells = self.terminal.backend().buffer().content.iter();
        cells.filter(|cell| cell.fg != Color::Reset || cell.bg != Color::Reset).count()
    }

    /// The colour of the first letter of a word on the screen as it was drawn last.
    #[cfg(test)]
    pub(crate) fn colour_of(&self, word: &str) -> Option<ratatui::style::Color> {
        let buffer = self.terminal.backend().buffer();
        let symbols: Vec<&str> = buffer.content.iter().map(ratatui::buffer::Cell::symbol).collect();
        let first = word.chars().next()?.to_string();
        let wanted: String = word.chars().collect();
        let at = (0..symbols.len()).find(|at| {
            symbols[*at] == first && symbols[*at..].concat().replace(' ', "").starts_with(&wanted.replace(' ', ""))
        })?;
        Some(buffer.content[at].fg)
    }

    /// Leaves an event out, so that the screen misses it.
    #[cfg(test)]
    pub(crate) fn miss_an_event(&mut self) {
        self.seq += 1;
    }

    #[cfg(test)]
    pub(crate) fn resize(&mut self, width: u16, height: u16) {
        self.terminal.backend_mut().resize(width, height);
    }
}

fn noon() -> DateTime<FixedOffset> {
    let offset = FixedOffset::east_opt(8 * 3600);
    let at = DateTime::from_timestamp(1_795_329_000, 0).unwrap_or_default();
    offset.map_or_else(|| at.fixed_offset(), |offset| at.with_timezone(&offset))
}

fn items() -> Vec<PlannedItem> {
    let each = ITEMS.into_iter().map(|id| PlannedItem {
        name: id.as_str().to_owned(),
        id,
        title: id.spec().title.to_owned(),
        phase: Phase::Test,
        optional: id == ItemId::Can,
        selected: true,
    });
    each.collect()
}

/// Items of the plan that is played. It is the scene's own, so that a new item of the catalogue or of a plan changes no
/// picture.
pub(crate) const ITEMS: [ItemId; 14] = [
    ItemId::Identity,
    ItemId::Cpu,
    ItemId::Timers,
    ItemId::InternalRam,
    ItemId::Sdram,
    ItemId::SpiFlash,
    ItemId::InternalFlash,
    ItemId::Imu,
    ItemId::Gnss,
    ItemId::Ad,
    ItemId::Io,
    ItemId::Spi,
    ItemId::Sci,
    ItemId::Can,
];

fn header(serial_number: &str, plan: &str) -> RunHeader {
    RunHeader {
        schema: EVENTS_SCHEMA.into(),
        serial_number: serial_number.into(),
        part: None,
        numbers: Vec::new(),
        operator: Some("Zhang Wei".into()),
        station: "line-2".into(),
        program: ProgramVersion { name: "gnc-station".into(), version: "0.1.0".into(), build: None },
        bench: BenchInfo::simulated("good", "1", 1),
        site: None,
        recomputed: None,
        resumed: None,
        plan: PlanInfo { name: plan.into(), version: "1.0".into(), sha256: "00".repeat(32) },
        selection: None,
        looped: None,
    }
}

/// A value in deg/s with limits of one on both sides.
pub(crate) fn measured(name: &str, value: f64, outcome: Outcome) -> Measurement {
    Measurement {
        name: name.into(),
        repeat: None,
        value: Reading::Number(value),
        raw: None,
        unit: Some(Unit::DegreePerSecond),
        low: Some(-1.0),
        high: Some(if outcome.is_good() { 2.0 } else { 1.0 }),
        marginal_low: None,
        marginal_high: None,
        uncertainty: None,
        decision: None,
        expected: None,
        one_of: Vec::new(),
        pattern: None,
        outcome: Some(outcome),
    }
}

/// A module that swings slowly on its table.
fn readings(phase: f64) -> Readings {
    let counts = |value: f64, scale: f64| (value * scale).round() as i32;
    let (sin, cos) = phase.sin_cos();
    let sample = ImuSample {
        gyro: [2.0 * sin, -3.0 * cos, 0.1 * sin * cos].map(|rate| counts(rate, GYRO_LSB_PER_DPS)),
        accel: [0.05 * sin, 0.03 * cos, 1.0].map(|force| counts(force, ACCEL_LSB_PER_G)),
        mag: [0.3 * cos, 0.3 * sin, -0.42].map(|field| counts(field, MAG_LSB_PER_GAUSS)),
        gyro_temperature: 2364,
        accel_temperature: 2344,
    };
    let gnss = Epoch {
        fix: Fix::ThreeD,
        latitude_deg: Some(34.2321),
        longitude_deg: Some(108.9154),
        height_m: Some(412.3),
        ground_speed_mps: Some(0.02),
        satellites_used: Some(10),
        hdop: Some(0.9),
        ..Epoch::default()
    };
    let stream = |id, rate_hz, received, on_line| StreamReading { id, rate_hz, received, on_board: 0, on_line };
    Readings {
        imu: Some(((phase * 1e6) as u64, sample)),
        compensated: None,
        correction: None,
        gnss: Some(gnss),
        pulses: 3,
        ad_v: [2.51, 2.38, 2.35, 5.0, 3.3, 1.2, 0.0, 0.0].map(Some),
        streams: vec![stream(StreamId::Imu, 1000.0, 60_000, 0), stream(StreamId::Gnss, 2325.0, 9357, 4)],
    }
}
