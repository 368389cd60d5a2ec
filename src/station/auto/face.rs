//! What `--auto` shows: lines as items end, progress meanwhile, the failing rows again at the end.

use std::io::{self, IsTerminal as _, Write};
use std::sync::mpsc::{Receiver, RecvTimeoutError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use gnc_analysis::heat::Warmth;
use gnc_bench::control::RunControl;
use gnc_bench::runner::{Doing, Live};
use gnc_executive::event::{Event, EventKind, NoteLevel};
use gnc_executive::record::{ItemRecord, RunRecord};
use gnc_executive::state::RunState;
use gnc_executive::text;
use gnc_records::store::RunFolder;
use gnc_text::printable;
use terminal_size::terminal_size_of;
use tokio::sync::watch;

use super::speaker::Speaker;
use crate::wording::width;

/// How often a bar moves.
const BAR_EVERY: Duration = Duration::from_millis(100);
/// How often a line reports the progress, if there is no terminal for a bar.
const LINE_EVERY: Duration = Duration::from_secs(2);
const BAR_WIDTH: usize = 12;

/// The thread that writes.
#[derive(Debug)]
pub(super) struct Face {
    thread: JoinHandle<()>,
}

impl Face {
    pub(super) fn start(
        events: Receiver<Event>,
        live: &Live,
        speaker: Speaker,
        bell: bool,
        folder: RunFolder,
    ) -> io::Result<Self> {
        let terminal = if speaker.events_to_stdout() { io::stderr().is_terminal() } else { io::stdout().is_terminal() };
        let writer = Writer {
            speaker,
            terminal,
            bell: bell && terminal,
            live: live.doing.subscribe(),
            line_due: Instant::now() + LINE_EVERY,
            bar_drawn: false,
            state: RunState::new(),
            folder,
        };
        let thread = std::thread::Builder::new().name("face".into()).spawn(move || writer.run(&events))?;
        Ok(Self { thread })
    }

    /// Waits until everything is written, or until the second request to stop: a blocked terminal may never finish.
    pub(super) async fn join(self, control: &RunControl) {
        let joined = tokio::task::spawn_blocking(move || self.thread.join());
        tokio::select! {
            _ = control.asked_times(2) => {}
            _ = joined => {}
        }
    }
}

struct Writer {
    speaker: Speaker,
    terminal: bool,
    /// Whether the terminal rings at verdicts and questions.
    bell: bool,
    live: watch::Receiver<Vec<Doing>>,
    line_due: Instant,
    bar_drawn: bool,
    state: RunState,
    folder: RunFolder,
}

impl Writer {
    fn run(mut self, events: &Receiver<Event>) {
        loop {
            match events.recv_timeout(BAR_EVERY) {
                Ok(event) => self.event(&event),
                Err(RecvTimeoutError::Timeout) => self.progress(),
                Err(RecvTimeoutError::Disconnected) => return self.wipe(),
            }
        }
    }

    fn event(&mut self, event: &Event) {
        if self.speaker.events_to_stdout() {
            let mut out = io::stdout().lock();
            // A reader that is gone must not stop the test.
            let _ = serde_json::to_writer(&mut out, event).map_err(io::Error::from).and_then(|()| writeln!(out));
            let _ = out.flush();
        }
        // The journal has accepted the same event before, so the event is in order.
        if self.state.apply(event).is_err() {
            return;
        }
        match &event.kind {
            EventKind::RunStarted { header, .. } => {
                if let Some(record) = RunRecord::from_state(&self.state) {
                    self.speaker.keep_names_of(&record);
                }
                let plan = &header.plan;
                self.say(&format!(
                    "{} {} for {} on station {}",
                    printable(&plan.name),
                    printable(&plan.version),
                    printable(&header.serial_number),
                    printable(&header.station)
                ));
                if let Some(earlier) = &header.resumed {
                    self.say(&format!(
                        "takes up the run {}: its complete captures are taken over, all else is done again",
                        printable(&earlier.run)
                    ));
                }
                if let Some(record) = RunRecord::from_state(&self.state) {
                    for banner in text::banners(&record).iter().filter(|banner| !banner.starts_with("INTERRUPTED")) {
                        self.say(banner);
                    }
                }
            }
            EventKind::BoardFound(board) => {
                self.say(&format!(
                    "board {} (firmware {}) on {}",
                    printable(&board.board_serial),
                    printable(&board.firmware),
                    printable(&board.link)
                ));
            }
            EventKind::LimitsChosen(chosen) => self.say(&format!("limits: {chosen}")),
            EventKind::Prompted { text, question: Some(name), .. } => {
                let asked = self.speaker.question(name, text);
                self.wipe();
                self.speaker.say_as_it_is(&format!(">> {asked}"));
                self.ring();
            }
            EventKind::Prompted { text, .. } if !self.answered_by_itself() => {
                let asked = self.speaker.request(text);
                self.wipe();
                self.speaker.say(&format!(">> {asked} (n and Enter: not possible)"));
                self.ring();
            }
            EventKind::ItemEnded { item, .. } => {
                if let Some(row) = self.state.row(item) {
                    let item = ItemRecord::from(row);
                    self.speaker.keep_names_of_item(&item);
                    self.say(&text::item_line(&item));
                }
            }
            EventKind::Note { level: NoteLevel::Warning | NoteLevel::Error, text, .. } => {
                self.say(&format!("note: {}", printable(text)));
            }
            EventKind::BoardBreach(breach) if breach.safety => {
                self.say(&format!("DANGER: {}", printable(&breach.what)));
            }
            // A person learns what is taken over before the first motion.
            EventKind::Note { level: NoteLevel::Info, text, item: Some(item) } if self.is_resumed() => {
                self.say(&format!("{}: {}", printable(item), printable(text)));
            }
            EventKind::BoardRebooted { .. } => self.say("note: the slave board restarted"),
            EventKind::StopRequested { by, .. } => {
                self.say(&format!("stopping: {} (repeat it to stop at once)", printable(by)));
            }
            EventKind::RunEnded(_) => {
                self.ended();
                self.ring();
            }
            _ => {}
        }
    }

    fn is_resumed(&self) -> bool {
        self.state.header().is_some_and(|header| header.resumed.is_some())
    }

    fn answered_by_itself(&self) -> bool {
        self.state.header().is_some_and(|header| header.bench.kind == gnc_executive::event::BenchKind::Simulated)
    }

    fn ended(&mut self) {
        let Some(record) = RunRecord::from_state(&self.state) else { return };
        let failing = text::failing_rows(&record);
        if !failing.is_empty() {
            self.say("");
            self.say(failing.trim_end());
        }
        for line in text::breach_lines(&record) {
            self.say(&format!("note: {line}"));
        }
        self.say("");
        self.say(&text::verdict_line(&record));
        for banner in text::banners(&record) {
            self.say(&banner);
        }
        self.say(&format!("record: {}", gnc_text::shown_path(self.folder.path())));
    }

    /// Draws a bar on a terminal; elsewhere it writes a line now and then.
    fn progress(&mut self) {
        let doing = self.live.borrow().clone();
        if doing.is_empty() {
            self.line_due = Instant::now() + LINE_EVERY;
            return self.wipe();
        }
        let each: Vec<String> = doing.iter().map(|doing| describe(doing, self.terminal)).collect();
        let line = each.join("   ");
        if self.terminal {
            // Keep to one line: more than one could not be wiped.
            let line = first_columns(&self.speaker.words(&line), self.columns());
            self.speaker.write(&format!("\r\x1b[K{line}"));
            self.bar_drawn = true;
        } else if Instant::now() >= self.line_due {
            self.line_due = Instant::now() + LINE_EVERY;
            self.say(&format!("  running: {line}"));
        }
    }

    fn columns(&self) -> usize {
        let size = if self.speaker.events_to_stdout() {
            terminal_size_of(io::stderr())
        } else {
            terminal_size_of(io::stdout())
        };
        size.map_or(80, |(width, _)| usize::from(width.0)).saturating_sub(1)
    }

    fn say(&mut self, line: &str) {
        self.wipe();
        self.speaker.say(line);
    }

    fn ring(&self) {
        if self.bell {
            self.speaker.write("\x07");
        }
    }

    fn wipe(&mut self) {
        if std::mem::take(&mut self.bar_drawn) {
            self.speaker.write("\r\x1b[K");
        }
    }
}

/// As much of a line as so many columns hold.
fn first_columns(line: &str, columns: usize) -> String {
    let mut left = columns;
    let fits = |character: &char| {
        let cells = width(character.encode_utf8(&mut [0; 4]));
        let fits = cells <= left;
        left = left.saturating_sub(cells);
        fits
    };
    line.chars().take_while(fits).collect()
}

/// A wait for the module's heat: "25.3 degC, waits for 28.0 degC, about 4 min 10 s".
fn warming(warmth: &Warmth) -> String {
    let left = match warmth.left_s.filter(|left_s| *left_s < warmth.bound_s) {
        Some(left_s) => format!("about {}", text::duration(left_s)),
        None => format!("at most {}", text::duration(warmth.bound_s)),
    };
    format!("{:.1} degC, waits for {:.1} degC, {left}", warmth.now.mean_c(), warmth.target.mean_c())
}

/// Describes an item that runs, with a bar or a percentage if its length is known.
fn describe(doing: &Doing, bar: bool) -> String {
    let advance = *doing.advance.borrow();
    let (item, elapsed) = (printable(&doing.item), text::duration(doing.began.elapsed().as_secs_f64()));
    let done = usize::from(advance.done_permille.min(1000));
    if let Some(warmth) = doing.guidance.borrow().as_ref().and_then(|guidance| guidance.warmth()) {
        return format!("{item} {elapsed}, {}", warming(&warmth));
    }
    if advance.expected_ms == 0 {
        format!("{item} {elapsed}")
    } else if bar {
        let filled = done * BAR_WIDTH / 1000;
        format!("[{}{}] {item} {elapsed}", "#".repeat(filled), "-".repeat(BAR_WIDTH - filled))
    } else {
        format!("{item} {elapsed}, {} % of this step", done / 10)
    }
}
