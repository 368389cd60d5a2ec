//! The slave board: its clock, the requests that run on it, its streams, its restarts.
//!
//! Bench time counts nanoseconds of the board's oscillator since the bench was started and never goes back; board
//! time is bench time since the board's last start. True time differs from bench time by the oscillator's error.

mod feed;
mod finish;

use std::collections::VecDeque;
use std::time::Duration;

use gnc_protocol::error::NakCode;
use gnc_protocol::message::{
    Flash, IdentityReply, LinkCountersReply, Progress, Request, StreamStart, StreamStopReply, capability,
};
use gnc_protocol::slave::{BoardIdentity, BoardOutput, RequestRefusal, SlaveBoard};
use gnc_protocol::stream::StreamId;
use gnc_protocol::wire::text;

use crate::breaches::Breaches;
use crate::module::Module;
use crate::noise::{Dice, RandomStream};
use crate::oscillator::Oscillator;
use crate::personality::{Personality, RebootTrigger};
use crate::records::ErrorLog;
use crate::requests::{
    self, MS, Task, Work, check, check_can_load, check_load, device, needs_power, one_sample_a_frame, prepare,
    unanswered, uses,
};
use crate::sampling::SamplingFaults;
use crate::streams::{RunningStream, stream_bytes};
use crate::world::{Influence, World};

/// Resolution of the board's capture timer.
const CAPTURE_NS: u64 = 10;
/// A pattern over a RAM advances in pieces of this much board time, so that the board stays able to answer.
const PIECE_NS: u64 = 2 * MS;
/// Time from a restart to the first answer.
const BOOT_NS: u64 = 200 * MS;
/// Supply that the board accepts when it switches power on, in microvolts.
const SUPPLY_UV: std::ops::RangeInclusive<u32> = 4_500_000..=5_500_000;

#[derive(Debug)]
struct Job {
    /// The host's request; `None` after the host gave it up. The device still finishes.
    request: Option<u16>,
    message: u16,
    uses: u32,
    started_ns: u64,
    expected_ns: u64,
    ends_ns: u64,
    task: Task,
}

/// The links by which a host reaches the board.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum BoardPort {
    Serial,
    Can,
}

/// A slave board with a module in its socket, in a world.
#[derive(Debug)]
pub(crate) struct SimulatedBoard {
    /// The world around it.
    pub world: World,
    /// The module.
    pub module: Module,
    /// Counters of the link. The owner of the link keeps them up to date.
    pub link_counters: LinkCountersReply,
    /// What acts on the module in a step of time in which it is still.
    still: Option<(i64, Influence)>,
    /// Whether too many samples wait for the line: new ones are dropped and counted.
    pub line_full: bool,
    /// Bytes of samples that the line takes now. The owner of the link sets it before each look at the outputs.
    pub line_room: usize,
    now_ns: u64,
    booted_ns: u64,
    /// Bench time at which the board's clock began.
    clock_from_ns: u64,
    boot_id: u32,
    boot_dice: Dice,
    pub(crate) oscillator: Oscillator,
    sampling: SamplingFaults,
    /// How it breaks the interface document.
    breaches: Breaches,
    /// Whether making safe leaves the module on power until [`SimulatedBoard::finish_power_off`].
    pub(crate) power_off_waits: bool,
    power_off_begun: bool,
    power_off_at_ns: Option<u64>,
    /// Stream frames made, for those that get lost on the board.
    frames_made: u32,
    rate_baud: u32,
    /// The link of the session, which carries the streams.
    carrier: BoardPort,
    powered: bool,
    /// Whether the board answers an identity request with the module's earlier answer.
    caches_identity: bool,
    identity_cache: Option<IdentityReply>,
    jobs: Vec<Job>,
    streams: Vec<RunningStream>,
    ended: Vec<(StreamId, StreamStopReply)>,
    log: ErrorLog,
    outputs: VecDeque<BoardOutput>,
    /// Samples, and results that must keep their place among them. All other output goes ahead of these.
    samples: VecDeque<BoardOutput>,
    reboot: Option<RebootTrigger>,
    triggers_seen: u32,
    reboot_at_ns: Option<u64>,
    restarted: bool,
    restarts: u32,
    serial: String,
    firmware: String,
}

impl SimulatedBoard {
    /// A board that has just started.
    #[must_use]
    pub(crate) fn new(personality: &Personality, serial_number: &str, world: World, rate_baud: u32, seed: u64) -> Self {
        let mut boot_dice = Dice::new(seed, RandomStream::Boot);
        let model = &personality.model;
        let at_time = |trigger: &RebootTrigger| trigger.at_board_time_s.map(|time_s| (time_s * 1e9) as u64);
        let mut board = Self {
            module: Module::new(personality, serial_number, seed),
            world,
            link_counters: LinkCountersReply::default(),
            still: None,
            line_full: false,
            line_room: usize::MAX,
            now_ns: 0,
            booted_ns: 0,
            boot_id: boot_dice.word(),
            boot_dice,
            oscillator: model.oscillator,
            sampling: model.sampling,
            breaches: model.breaches.clone(),
            power_off_waits: false,
            power_off_begun: false,
            power_off_at_ns: None,
            frames_made: 0,
            clock_from_ns: 0,
            rate_baud,
            carrier: BoardPort::Serial,
            powered: false,
            caches_identity: model.caches_identity,
            identity_cache: None,
            jobs: Vec::new(),
            streams: Vec::new(),
            ended: Vec::new(),
            log: ErrorLog::default(),
            outputs: VecDeque::new(),
            samples: VecDeque::new(),
            reboot_at_ns: model.reboot.as_ref().and_then(at_time),
            reboot: model.reboot.clone(),
            triggers_seen: 0,
            restarted: false,
            restarts: 0,
            serial: model.board_serial.clone(),
            firmware: model.board_firmware.clone(),
        };
        board.set_power(board.breaches.hello.no_power_switch);
        board
    }

    /// Begins a session on a link.
    pub(crate) fn set_carrier(&mut self, carrier: BoardPort) {
        self.carrier = carrier;
    }

    /// Bench time, ns.
    #[must_use]
    pub(crate) fn now_ns(&self) -> u64 {
        self.now_ns
    }

    /// True seconds since the bench was started.
    #[must_use]
    pub(crate) fn true_s(&self, bench_ns: u64) -> f64 {
        self.oscillator.true_s(bench_ns)
    }

    /// Bench time of a true moment.
    pub(crate) fn bench_ns(&self, true_s: f64) -> f64 {
        self.oscillator.count_ns(true_s)
    }

    /// Whether the module is under power.
    #[must_use]
    pub(crate) fn is_powered(&self) -> bool {
        self.powered
    }

    /// Whether any work is under way that needs time to pass.
    #[must_use]
    pub(crate) fn has_work(&self) -> bool {
        !self.jobs.is_empty() || !self.streams.is_empty() || self.is_booting()
    }

    /// Whether samples of the IMU are streamed and nothing else is under way.
    #[must_use]
    pub(crate) fn only_streams(&self) -> bool {
        let samples = |stream: &RunningStream| matches!(stream.id, StreamId::Imu | StreamId::Compensated);
        self.streams.iter().any(samples) && self.jobs.is_empty() && !self.is_booting() && self.outputs.is_empty()
    }

    /// Whether the board is still booting after a restart and does not listen.
    #[must_use]
    pub(crate) fn is_booting(&self) -> bool {
        self.restarts > 0 && self.now_ns < self.booted_ns + BOOT_NS
    }

    /// Restarts since the bench was started.
    #[must_use]
    pub(crate) fn restarts(&self) -> u32 {
        self.restarts
    }

    /// Whether the board restarted since the last call.
    pub(crate) fn take_restarted(&mut self) -> bool {
        std::mem::take(&mut self.restarted)
    }

    /// The bench time of the next event.
    #[must_use]
    pub(crate) fn next_event_ns(&self) -> Option<u64> {
        let job = |job: &Job| match job.task {
            Task::Pattern { .. } => job.ends_ns.min(self.now_ns + PIECE_NS),
            _ => job.ends_ns,
        };
        let boot = self.is_booting().then_some(self.booted_ns + BOOT_NS);
        let streams = self.streams.iter().map(|stream| self.stream_due_ns(stream));
        self.jobs.iter().map(job).chain(streams).chain(boot).chain(self.reboot_at_ns).chain(self.power_off_at_ns).min()
    }

    /// Lets time pass up to `to_ns`: everything that is due until then happens in its order.
    pub(crate) fn advance(&mut self, to_ns: u64) {
        while let Some(next_ns) = self.next_event_ns().filter(|next_ns| *next_ns <= to_ns) {
            self.now_ns = self.now_ns.max(next_ns);
            self.happen();
        }
        self.now_ns = self.now_ns.max(to_ns);
    }

    /// Carries out what is due now.
    fn happen(&mut self) {
        if self.reboot_at_ns.is_some_and(|at_ns| at_ns <= self.now_ns) {
            self.restart();
            return;
        }
        self.run_streams();
        if self.power_off_at_ns.is_some_and(|at_ns| at_ns <= self.now_ns) {
            self.power_off_at_ns = None;
            self.close_streams();
            self.set_power(false);
        }
        self.run_patterns();
        while let Some(index) = self.jobs.iter().position(|job| job.ends_ns <= self.now_ns) {
            let job = self.jobs.swap_remove(index);
            self.finish(job);
        }
    }

    /// Restarts the board after a supply loss or a watchdog timeout.
    fn restart(&mut self) {
        self.reboot_at_ns = None;
        self.cut_off_jobs();
        self.streams.clear();
        self.ended.clear();
        self.outputs.clear();
        self.samples.clear();
        self.log = ErrorLog::default();
        self.identity_cache = None;
        self.set_power(false);
        let boot_id = self.boot_dice.word();
        if !self.breaches.restarts.keeps_boot_id {
            self.boot_id = boot_id;
        }
        self.booted_ns = self.now_ns;
        if !self.breaches.restarts.clock_runs_on {
            self.clock_from_ns = self.now_ns;
        }
        self.restarted = true;
        self.restarts += 1;
    }

    /// Ends all requests at once. A busy flash is left in the middle of its work.
    fn cut_off_jobs(&mut self) {
        for job in std::mem::take(&mut self.jobs) {
            match job.task {
                Task::Flash { request: Request::FlashErase(erase), .. } => {
                    if let Some(flash) = Flash::from_number(erase.flash) {
                        self.module.flash(flash).interrupt_erase(erase.sector);
                    }
                }
                Task::Flash { request: Request::CalibrationCommit(_), .. } => {
                    self.module.calibration.interrupt_commit();
                }
                _ => {}
            }
        }
    }

    /// Switches off what MAKE_SAFE left on.
    pub(crate) fn finish_power_off(&mut self) {
        if std::mem::take(&mut self.power_off_begun) {
            self.set_power(false);
        }
    }

    fn set_power(&mut self, on: bool) {
        self.power_off_begun = false;
        let on = on || self.breaches.hello.no_power_switch;
        if on == self.powered {
            return;
        }
        self.powered = on;
        let after_ns = |span: Duration| self.now_ns + u64::try_from(span.as_nanos()).unwrap_or(u64::MAX / 2);
        self.power_off_at_ns = self.breaches.state.powers_off_after.filter(|_| on).map(after_ns);
        let now_s = self.true_s(self.now_ns);
        self.still = None;
        self.world.set_powered(on, now_s);
        if on {
            self.module.power_on(now_s);
        }
    }

    /// The progress of a request that is done, but whose result waits behind samples.
    fn waiting_behind_samples(&self, request: u16) -> Progress {
        let elapsed_us = |output: &BoardOutput| match output {
            BoardOutput::Done(done) if done.request == request => Some(done.elapsed_us),
            _ => None,
        };
        let elapsed_ms = self.samples.iter().find_map(elapsed_us).map(|elapsed_us| elapsed_us / 1000);
        elapsed_ms.map_or_else(Progress::default, |elapsed_ms| Progress { done_permille: 999, elapsed_ms })
    }

    fn board_us(&self, bench_ns: u64) -> u64 {
        self.board_ns(bench_ns) / 1000
    }

    /// What the board's clock shows at a bench time.
    fn board_ns(&self, bench_ns: u64) -> u64 {
        self.breaches.restarts.shown_ns(bench_ns.saturating_sub(self.clock_from_ns))
    }

    fn arm_reboot(&mut self, request: &Request) {
        let Some(trigger) = &self.reboot else { return };
        if trigger.on.as_deref() != Some(device(request)) {
            return;
        }
        self.triggers_seen += 1;
        if trigger.nth.is_none_or(|nth| nth == self.triggers_seen) {
            self.reboot_at_ns = Some(self.now_ns + (trigger.after_ms * MS as f64) as u64);
        }
    }

    fn begin(&mut self, request: u16, mut what: Request) -> Result<u32, RequestRefusal> {
        let asks_module =
            needs_power(&what) && !(self.identity_cache.is_some() && matches!(what, Request::Identity(_)));
        if !self.powered && asks_module {
            return Err(RequestRefusal::new(NakCode::NotPowered, "switch the module's supply on first"));
        }
        if let Some(refusal) = self.breaches.hello.lacks(&what) {
            return Err(refusal);
        }
        let message = what.id();
        let trigger = what.clone();
        // Check the stream before random numbers are drawn or devices are reserved.
        if let Request::StreamStart(start) = &mut what {
            if self.carrier == BoardPort::Can {
                one_sample_a_frame(start)?;
            }
            self.check_stream(start)?;
        }
        let held = self.jobs.iter().fold(0, |held, job| held | job.uses);
        let wanted = check(&what, &mut self.module)?;
        if held & wanted != 0 {
            let why = format!("in use by another request: {}", uses::names(held & wanted));
            return Err(RequestRefusal::new(NakCode::Busy, &why));
        }
        let is_up = self.module.start.is_up(self.true_s(self.now_ns));
        let Work { expected_ns, takes_ns, task } =
            if asks_module && !is_up { unanswered() } else { prepare(what, &mut self.module) };
        let (started_ns, ends_ns) = (self.now_ns, self.now_ns + takes_ns);
        self.jobs.push(Job { request: Some(request), message, uses: wanted, started_ns, expected_ns, ends_ns, task });
        self.arm_reboot(&trigger);
        Ok(u32::try_from(expected_ns.div_ceil(MS)).unwrap_or(u32::MAX))
    }

    fn check_stream(&self, start: &StreamStart) -> Result<u32, RequestRefusal> {
        let id = requests::stream_of(start.stream)?;
        if self.streams.iter().any(|stream| stream.id == id) {
            return Err(RequestRefusal::new(NakCode::Busy, "this stream is running"));
        }
        let taken = self.streams.iter().map(|stream| stream.load_permille).sum();
        match self.carrier {
            BoardPort::Serial => check_load(start, taken, self.rate_baud),
            BoardPort::Can => check_can_load(start, taken),
        }
    }

    /// Whether a memory test is running, which costs real computing time.
    pub(crate) fn is_computing(&self) -> bool {
        self.jobs.iter().any(|job| matches!(job.task, Task::Pattern { .. }))
    }

    fn run_patterns(&mut self) {
        for job in &mut self.jobs {
            let Task::Pattern { ram, run, done, accesses } = &mut job.task else { continue };
            let span_ns = job.ends_ns.saturating_sub(job.started_ns).max(1);
            let passed_ns = self.now_ns.min(job.ends_ns).saturating_sub(job.started_ns);
            let target = (u128::from(*accesses) * u128::from(passed_ns) / u128::from(span_ns)) as u64;
            let memory = self.module.ram(*ram);
            while !run.is_done() && (*done < target || passed_ns == span_ns) {
                *done += run.run(memory, 4096);
            }
        }
    }
}

impl SlaveBoard for SimulatedBoard {
    fn identity(&self) -> BoardIdentity {
        BoardIdentity {
            boot_id: self.boot_id,
            capabilities: self.breaches.hello.left_of(capability::POWER | capability::CAN | capability::CALIBRATION),
            serial: text(&self.serial),
            firmware: text(&self.firmware),
        }
    }

    fn start(&mut self, request: u16, what: Request) -> Result<u32, RequestRefusal> {
        self.begin(request, what)
    }

    fn poll(&mut self) -> Option<BoardOutput> {
        if let Some(output) = self.outputs.pop_front() {
            return Some(output);
        }
        if self.line_room == 0 {
            return None;
        }
        let output = self.samples.pop_front()?;
        if let BoardOutput::Stream(_, frame) = &output {
            self.line_room = self.line_room.saturating_sub(stream_bytes(frame));
        }
        Some(output)
    }

    fn progress(&self, request: u16) -> Progress {
        let Some(job) = self.jobs.iter().find(|job| job.request == Some(request)) else {
            return self.waiting_behind_samples(request);
        };
        let passed_ns = self.now_ns - job.started_ns;
        // A job that takes longer than expected shows just below 100 %.
        let done_permille = (passed_ns * 1000 / job.expected_ns.max(1)).min(999) as u16;
        Progress { done_permille, elapsed_ms: u32::try_from(passed_ns / MS).unwrap_or(u32::MAX) }
    }

    fn abort(&mut self, request: u16) {
        for job in &mut self.jobs {
            if job.request == Some(request) {
                job.request = None;
            }
        }
        // A flash cannot be stopped in an erase; all other jobs can be stopped.
        self.jobs.retain(|job| job.request.is_some() || matches!(job.task, Task::Flash { .. }));
    }

    fn make_safe(&mut self) {
        self.cut_off_jobs();
        self.outputs.clear();
        self.drop_streams();
        if self.breaches.state.safe_keeps_power {
            return;
        }
        if self.power_off_waits {
            self.power_off_begun = true;
        } else {
            self.set_power(false);
        }
    }

    fn new_session(&mut self) {
        self.log = ErrorLog::default();
        self.ended.clear();
    }

    fn board_time_us(&self) -> u64 {
        self.board_us(self.now_ns)
    }

    fn state_bits(&self) -> u8 {
        u8::from(self.powered) << 1 | u8::from(!self.streams.is_empty()) << 3
    }
}
