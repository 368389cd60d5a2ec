//! The loop of the screen: messages and keys change the model, and it is drawn when something changed, at most thirty
//! times a second.

use std::time::{Duration, Instant};

use chrono::Local;
use gnc_bench::runner::Doing;
use gnc_board::Readings;
use nix::sys::signal::{Signal, raise};
use ratatui::Terminal;
use ratatui::backend::Backend;
use ratatui::layout::{Position, Rect};
use tokio::sync::{mpsc, watch};

use super::input::Input;
use super::model::{Now, Progress, ScreenModel};
use super::pictures::PictureWanted;
use super::update::{Effect, Msg, update};
use super::view;

/// Time between two drawings.
const FRAME: Duration = Duration::from_millis(33);
/// How often moving parts are drawn: bars, times, curves.
const TICK: Duration = Duration::from_millis(100);
/// Largest number of messages that are taken before a drawing, so that a screen far behind catches up in few drawings.
const BATCH: usize = 4096;

/// The inputs of the loop.
#[derive(Debug)]
pub(crate) struct Inbox {
    pub messages: mpsc::Receiver<Msg>,
    pub keys: mpsc::Receiver<Vec<Input>>,
    /// The terminal has another size, or has to be drawn anew.
    pub resized: watch::Receiver<u64>,
    pub doing: watch::Receiver<Vec<Doing>>,
    pub readings: watch::Receiver<Readings>,
    pub line_lost: watch::Receiver<bool>,
}

/// The clock of the screen.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ScreenClock {
    pub began: Instant,
}

impl ScreenClock {
    pub(crate) fn now(&self) -> Now {
        Now { at: Local::now().fixed_offset(), since_start: self.began.elapsed() }
    }
}

/// Why the loop ended.
#[derive(Debug, PartialEq, Eq)]
pub(crate) enum LoopEnd {
    /// The operator left, or the session behind the screen has ended.
    Left,
    /// The terminal gives no keys any more.
    TerminalLost,
}

/// Shows the model until the operator leaves, or the terminal is no longer `ours`. `ring` has the terminal ring.
pub(crate) async fn show<B: Backend>(
    terminal: &mut Terminal<B>,
    model: &mut ScreenModel,
    mut inbox: Inbox,
    commands: &mpsc::Sender<Effect>,
    clock: ScreenClock,
    ours: impl Fn() -> bool,
    ring: impl Fn(),
) -> Result<LoopEnd, B::Error> {
    let mut drawn = Instant::now();
    measure(terminal, model);
    terminal.draw(|frame| view::draw(model, frame))?;
    let (mut changed, mut anew) = (false, false);
    loop {
        let due = if changed { drawn + FRAME } else { drawn + rest(model) };
        let mut arrived = Vec::new();
        tokio::select! {
            biased;
            count = inbox.messages.recv_many(&mut arrived, BATCH) => {
                if count == 0 {
                    return Ok(LoopEnd::Left);
                }
            }
            keys = inbox.keys.recv() => match keys {
                Some(keys) => arrived.extend(keys.into_iter().map(Msg::from)),
                None => return Ok(LoopEnd::TerminalLost),
            },
            resized = inbox.resized.changed() => {
                if resized.is_err() {
                    return Ok(LoopEnd::Left);
                }
                anew = true;
            }
            () = tokio::time::sleep_until(due.into()) => {}
        }
        // Another thread has given the terminal back after a serious error; its message stands there.
        if !ours() {
            return Ok(LoopEnd::Left);
        }
        update(model, Msg::Time(clock.now()));
        if model.is_running() {
            arrived.push(Msg::Progress(progress(&inbox.doing.borrow())));
            arrived.push(Msg::LineLost(*inbox.line_lost.borrow()));
        }
        if inbox.readings.has_changed().unwrap_or(false) {
            arrived.push(Msg::Readings(Box::new(inbox.readings.borrow_and_update().clone())));
        }
        for msg in arrived {
            let Some(command) = update(model, msg) else { continue };
            if command == Effect::Raise {
                // Without a signal the program goes on as it did.
                let _ = raise(Signal::SIGINT);
                continue;
            }
            let leaves = command == Effect::Leave;
            if commands.send(command).await.is_err() || leaves {
                return Ok(LoopEnd::Left);
            }
        }
        if std::mem::take(&mut model.ring) {
            ring();
        }
        changed = true;
        if Instant::now() >= drawn + FRAME {
            drawn = Instant::now();
            if std::mem::take(&mut anew) || std::mem::take(&mut model.redraw) {
                // Take the present size and draw every cell again. (`clear` would ask the terminal for its cursor
                // position, and the answer would arrive among the keys.)
                let size = terminal.size()?;
                terminal.resize(Rect::from((Position::ORIGIN, size)))?;
                measure(terminal, model);
            }
            let area = terminal.draw(|frame| view::draw(model, frame))?.area;
            changed = false;
            if let Some(picture) = next_picture(model, area)
                && commands.send(Effect::Draw(picture)).await.is_err()
            {
                return Ok(LoopEnd::Left);
            }
        }
    }
}

/// Takes the size of a cell in pixels. The kernel knows it; the terminal itself is not asked.
fn measure<B: Backend>(terminal: &mut Terminal<B>, model: &mut ScreenModel) {
    let size = terminal.backend_mut().window_size().ok();
    let (cells, pixels) = size.map(|size| (size.columns_rows, size.pixels)).unwrap_or_default();
    model.pictures.window(cells, pixels);
}

/// The picture of the question on the screen, if it is to be made.
pub(super) fn next_picture(model: &mut ScreenModel, area: Rect) -> Option<PictureWanted> {
    let is_asked = model.run.as_ref().is_some_and(|run| run.prompt.is_some());
    let wanted = view::picture_wanted(model, area);
    model.pictures.next(is_asked, wanted)
}

/// How long the drawing stays valid if nothing happens.
fn rest(model: &ScreenModel) -> Duration {
    use chrono::Timelike as _;
    if model.moves() {
        return TICK;
    }
    // The time of day is shown in minutes.
    let minute = Duration::from_secs(u64::from(60 - model.now.at.second().min(59)));
    model.message_left().map_or(minute, |left| left.min(minute))
}

fn progress(doing: &[Doing]) -> Vec<Progress> {
    let each = doing.iter().map(|doing| {
        let advance = *doing.advance.borrow();
        Progress {
            item: doing.item.clone(),
            done_permille: (advance.expected_ms > 0).then(|| advance.done_permille.min(1000)),
            elapsed: doing.began.elapsed(),
            guidance: doing.guidance.borrow().clone(),
        }
    });
    each.collect()
}
