//! A simulated board and the checks in one task, on one clock that moves when both wait. Between them a wire that can
//! change, delay, drop and add what passes, so that a board breaks one rule.

use std::collections::VecDeque;
use std::time::Duration;

use gnc_conformance::{CheckEvent, CheckOptions, Ended, NoBoard, run};
use gnc_link::can::{CanLink, MemoryEnd};
use gnc_link::memory::MemoryPort;
use gnc_link::{Link, Target};
use gnc_protocol::Frame;
use gnc_protocol::can::CanFrame;
use gnc_protocol::serial::{FrameDecoder, encode};
use hw_mocks::{BenchOptions, Personality, SimulatedBench, Speed};
use tokio::io::{AsyncReadExt as _, AsyncWriteExt as _, DuplexStream};
use tokio::sync::watch;
use tokio::time::{Instant, sleep_until};

/// Least step of the clock between two looks of the bench.
const LOOK: Duration = Duration::from_micros(100);

/// The link between the checks and the board.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Wire {
    Rs422,
    Can,
}

/// A frame on its way, and when: what passes instead of it, each with its delay.
pub(crate) type Change<T, O> = Box<dyn FnMut(T, Duration) -> Vec<(Duration, O)>>;

/// What passes instead of each frame.
#[derive(Default)]
pub(crate) struct Breach {
    /// From the board, RS-422: bytes for a frame.
    pub(crate) to_host: Option<Change<Frame, Vec<u8>>>,
    /// To the board, RS-422. Bytes that are no frame pass as they are.
    pub(crate) to_board: Option<Change<Frame, Vec<u8>>>,
    /// From the board, CAN.
    pub(crate) can_to_host: Option<Change<CanFrame, CanFrame>>,
    /// To the board, CAN.
    pub(crate) can_to_board: Option<fn(CanFrame) -> CanFrame>,
}

impl Breach {
    /// A board whose frames are changed.
    pub(crate) fn of_frames(mut change: impl FnMut(&mut Frame) + 'static) -> Self {
        Self::to_host(move |mut frame, _| {
            change(&mut frame);
            vec![(Duration::ZERO, encode(&frame).to_vec())]
        })
    }

    /// A board whose frames are replaced.
    pub(crate) fn to_host(change: impl FnMut(Frame, Duration) -> Vec<(Duration, Vec<u8>)> + 'static) -> Self {
        Self { to_host: Some(Box::new(change)), ..Self::default() }
    }

    /// A board that hears other frames than it was sent.
    pub(crate) fn to_board(change: impl FnMut(Frame, Duration) -> Vec<(Duration, Vec<u8>)> + 'static) -> Self {
        Self { to_board: Some(Box::new(change)), ..Self::default() }
    }

    /// A board whose frames on the bus are replaced.
    pub(crate) fn on_can(mut change: impl FnMut(CanFrame) -> Vec<CanFrame> + 'static) -> Self {
        let replace = move |frame, _| change(frame).into_iter().map(|frame| (Duration::ZERO, frame)).collect();
        Self { can_to_host: Some(Box::new(replace)), ..Self::default() }
    }
}

/// Checks a board of this personality.
pub(crate) fn check(personality: &str, wire: Wire, only: Option<&str>, breach: Breach) -> Result<Ended, NoBoard> {
    let personality = Personality::from_toml("test", personality).unwrap();
    checked(personality, wire, only, breach).0
}

/// The same, and the link time that the checks took.
pub(crate) fn checked(
    personality: Personality,
    wire: Wire,
    only: Option<&str>,
    breach: Breach,
) -> (Result<Ended, NoBoard>, Duration) {
    checked_until(personality, wire, only, breach, usize::MAX)
}

/// The same; a person stops the checks when so many have ended.
pub(crate) fn checked_until(
    personality: Personality,
    wire: Wire,
    only: Option<&str>,
    breach: Breach,
    stop_after: usize,
) -> (Result<Ended, NoBoard>, Duration) {
    let bench = BenchOptions { personality, speed: Speed::Times(1.0), seed: 13, ..BenchOptions::default() };
    println!("seed {}", bench.seed);
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().start_paused(true).build().unwrap();
    runtime.block_on(async {
        let began = Instant::now();
        let (stop, stopped) = watch::channel(false);
        let rate_bps = if wire == Wire::Can { 500_000 } else { bench.rate_baud };
        let options = CheckOptions { rate_bps, nonce: 77, simulated: true, only: only.map(str::to_owned) };
        let mut found = 0;
        let mut tell = |event: CheckEvent<'_>| {
            found += usize::from(matches!(event, CheckEvent::Found(_)));
            stop.send_replace(found >= stop_after);
        };
        let ended = match wire {
            Wire::Rs422 => {
                let port = MemoryPort::new("port", bench.rate_baud);
                let end = port.plug_in();
                let link = Link::open(&Target::Memory(port)).unwrap();
                tokio::select! {
                    biased;
                    ended = run(link, &options, stopped, &mut tell) => ended,
                    () = serve(SimulatedBench::new(&bench), end, breach) => unreachable!(),
                }
            }
            Wire::Can => {
                let (link, end) = CanLink::in_memory();
                tokio::select! {
                    biased;
                    ended = run(Link::Can(Box::new(link)), &options, stopped, &mut tell) => ended,
                    () = serve_can(SimulatedBench::new(&bench), end, breach) => unreachable!(),
                }
            }
        };
        (ended, began.elapsed())
    })
}

/// What waits for its moment, in the order in which it passes.
struct Later<T>(VecDeque<(Duration, T)>);

impl<T> Later<T> {
    fn push(&mut self, at: Duration, what: T) {
        let place = self.0.iter().position(|(due, _)| *due > at).unwrap_or(self.0.len());
        self.0.insert(place, (at, what));
    }

    fn pop(&mut self, now: Duration) -> Option<T> {
        let due = self.0.front().is_some_and(|(due, _)| *due <= now);
        if due { self.0.pop_front().map(|(_, what)| what) } else { None }
    }
}

/// Changes the good frames in bytes; the rest passes as it is.
fn changed(
    bytes: &[u8],
    decoder: &mut FrameDecoder,
    change: &mut Option<Change<Frame, Vec<u8>>>,
    now: Duration,
    later: &mut Later<Vec<u8>>,
) {
    let Some(change) = change else { return later.push(now, bytes.to_vec()) };
    // Pieces between delimiters, each with the one behind it.
    for piece in bytes.split_inclusive(|byte| *byte == 0) {
        let mut rest = piece;
        match decoder.next(&mut rest) {
            Some(Ok(frame)) => {
                for (delay, bytes) in change(frame, now) {
                    later.push(now + delay, bytes);
                }
            }
            Some(Err(_)) => later.push(now, piece.to_vec()),
            None => {}
        }
    }
}

async fn serve(mut bench: SimulatedBench, mut end: DuplexStream, mut breach: Breach) {
    let began = Instant::now();
    let mut buffer = [0; 4096];
    let (mut from_board, mut from_host) = (FrameDecoder::default(), FrameDecoder::default());
    let (mut to_host, mut to_board) = (Later::<Vec<u8>>(VecDeque::new()), Later::<Vec<u8>>(VecDeque::new()));
    loop {
        let now = began.elapsed();
        while let Some(bytes) = to_board.pop(now) {
            bench.receive(&bytes, now);
        }
        bench.advance(now);
        let bytes = bench.output(now).to_vec();
        bench.consume(bytes.len());
        changed(&bytes, &mut from_board, &mut breach.to_host, now, &mut to_host);
        while let Some(bytes) = to_host.pop(now) {
            end.write_all(&bytes).await.unwrap();
        }
        let waits = [to_host.0.front(), to_board.0.front()].into_iter().flatten().map(|(due, _)| *due).min();
        let due = bench.next_due(now).min(waits.unwrap_or(Duration::MAX)).max(now + LOOK);
        tokio::select! {
            biased;
            count = end.read(&mut buffer) => {
                let now = began.elapsed();
                changed(&buffer[..count.unwrap()], &mut from_host, &mut breach.to_board, now, &mut to_board);
            }
            () = sleep_until(began + due) => {}
        }
    }
}

async fn serve_can(mut bench: SimulatedBench, mut end: MemoryEnd, mut breach: Breach) {
    let began = Instant::now();
    loop {
        let now = began.elapsed();
        bench.advance(now);
        while let Some(frame) = bench.output_can() {
            let frames = match &mut breach.can_to_host {
                Some(change) => change(frame, now).into_iter().map(|(_, frame)| frame).collect(),
                None => vec![frame],
            };
            for frame in frames {
                end.to_host.send(frame).await.unwrap();
            }
        }
        let due = began + bench.next_due(now).max(now + LOOK);
        tokio::select! {
            biased;
            Some(frame) = end.from_host.recv() => {
                let frame = breach.can_to_board.map_or(frame, |change| change(frame));
                bench.receive_can(frame, began.elapsed());
            }
            () = sleep_until(due) => {}
        }
    }
}
