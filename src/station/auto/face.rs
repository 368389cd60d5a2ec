//! What `--auto` shows: lines as items end, progress meanwhile, the failing rows again at the end.

use std::io::{self, IsTerminal as _, Write};
use std::path::PathBuf;
use std::sync::mpsc::{Receiver, RecvTimeoutError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use gnc_executive::event::{Event, EventKind, Level};
use gnc_executive::printable::printable;
use gnc_executive::record::{ItemRecord, RunRecord};
use gnc_executive::state::RunState;
use gnc_executive::text;
use tokio::sync::watch;

use crate::board::Advance;
use crate::runner::{Doing, Live};

/// How often a bar moves.
const BAR_EVERY: Duration = Duration::from_millis(100);
/// How often a line says how far it is, where there is no terminal to draw a bar on.
const LINE_EVERY: Duration = Duration::from_secs(2);
const BAR_WIDTH: usize = 24;

/// The thread that writes.
#[derive(Debug)]
pub(super) struct Face {
    thread: JoinHandle<()>,
}

impl Face {
    pub(super) fn start(
        events: Receiver<Event>,
        live: &Live,
        events_to_stdout: bool,
        folder: PathBuf,
    ) -> io::Result<Self> {
        let writer = Writer {
            events_to_stdout,
            terminal: if events_to_stdout { io::stderr().is_terminal() } else { io::stdout().is_terminal() },
            doing: live.doing.subscribe(),
            advance: live.advance.subscribe(),
            began: Instant::now(),
            line_due: Instant::now() + LINE_EVERY,
            bar_drawn: false,
            shown: None,
            state: RunState::new(),
            folder,
        };
        let thread = std::thread::Builder::new().name("face".into()).spawn(move || writer.run(&events))?;
        Ok(Self { thread })
    }

    /// Waits until everything is written.
    pub(super) fn join(self) {
        let _ = self.thread.join();
    }
}

struct Writer {
    events_to_stdout: bool,
    terminal: bool,
    doing: watch::Receiver<Option<Doing>>,
    advance: watch::Receiver<Advance>,
    began: Instant,
    line_due: Instant,
    bar_drawn: bool,
    shown: Option<Doing>,
    state: RunState,
    folder: PathBuf,
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
        if self.events_to_stdout {
            let mut out = io::stdout().lock();
            // A reader that has gone is no reason to stop the test.
            let _ = serde_json::to_writer(&mut out, event).map_err(io::Error::from).and_then(|()| writeln!(out));
            let _ = out.flush();
        }
        // The journal took the same event before, so that it is in order.
        if self.state.apply(event).is_err() {
            return;
        }
        match &event.kind {
            EventKind::RunStarted { header, .. } => {
                let plan = &header.plan;
                self.say(&format!(
                    "{} {} for {} on station {}",
                    printable(&plan.name),
                    printable(&plan.version),
                    printable(&header.serial_number),
                    printable(&header.station)
                ));
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
            EventKind::Prompted { text, .. } if !self.answered_by_itself() => {
                self.say(&format!(">> please {}, then press Enter (n and Enter: not possible)", printable(text)));
            }
            EventKind::ItemEnded { item, .. } => {
                if let Some(row) = self.state.row(item) {
                    let line = text::item_line(&ItemRecord::from(row));
                    self.say(&line);
                }
            }
            EventKind::Note { level: Level::Warning | Level::Error, text, .. } => {
                self.say(&format!("note: {}", printable(text)));
            }
            EventKind::BoardRebooted { .. } => self.say("note: the slave board restarted"),
            EventKind::StopRequested { by, .. } => self.say(&format!("stopping: {} (again: at once)", printable(by))),
            EventKind::RunEnded { .. } => self.ended(),
            _ => {}
        }
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
        self.say("");
        self.say(&text::verdict_line(&record));
        for banner in text::banners(&record) {
            self.say(&banner);
        }
        self.say(&format!("record: {}", self.folder.display()));
    }

    /// A bar on a terminal, else a line now and then.
    fn progress(&mut self) {
        let doing = self.doing.borrow().clone();
        if doing != self.shown {
            self.began = Instant::now();
            self.line_due = self.began + LINE_EVERY;
            self.shown.clone_from(&doing);
        }
        let Some(doing) = doing else { return };
        let advance = *self.advance.borrow();
        let (item, elapsed) = (printable(&doing.item), text::duration(self.began.elapsed().as_secs_f64()));
        let known = advance.expected_ms > 0;
        if self.terminal {
            let filled = usize::from(advance.done_permille.min(1000)) * BAR_WIDTH / 1000;
            let (full, empty) = ("#".repeat(filled), "-".repeat(BAR_WIDTH - filled));
            let bar = if known { format!("[{full}{empty}] ") } else { String::new() };
            self.write(&format!("\r\x1b[K{bar}{item}  {elapsed}"));
            self.bar_drawn = true;
        } else if Instant::now() >= self.line_due {
            self.line_due = Instant::now() + LINE_EVERY;
            let share = if known { format!(", {} % of this step", advance.done_permille / 10) } else { String::new() };
            self.say(&format!("  {item} at work for {elapsed}{share}"));
        }
    }

    fn say(&mut self, line: &str) {
        self.wipe();
        self.write(&format!("{line}\n"));
    }

    fn wipe(&mut self) {
        if std::mem::take(&mut self.bar_drawn) {
            self.write("\r\x1b[K");
        }
    }

    /// A terminal that is gone is no reason to stop the test.
    fn write(&self, text: &str) {
        if self.events_to_stdout {
            let mut out = io::stderr().lock();
            let _ = out.write_all(text.as_bytes()).and_then(|()| out.flush());
        } else {
            let mut out = io::stdout().lock();
            let _ = out.write_all(text.as_bytes()).and_then(|()| out.flush());
        }
    }
}
