//! The slave board: its clock, the requests that run on it, its streams, its restarts.
//!
//! Bench time counts nanoseconds of the board's oscillator since the bench was started and never goes back; board
//! time is bench time since the board's last start. True time differs from bench time by the oscillator's error.

use std::collections::VecDeque;

use gnc_protocol::Payload;
use gnc_protocol::error::{FaultCode, NakCode};
use gnc_protocol::message::{AdReadReply, CpuFloatsReply, CpuIntegersReply, CpuWordsReply, Flash};
use gnc_protocol::message::{
    DurationReply, ErrorKind, FlashIdReply, GnssStart, IoTestReply, LinkCountersReply, MismatchReply, Progress,
    Request, SpiDirection, SpiTransferReply, StreamStart, StreamStartReply, StreamStopReply, capability,
};
use gnc_protocol::slave::{Board, BoardIdentity, Done, Fault, Output, Refusal};
use gnc_protocol::stream::{PpsCapture, StreamFrame, StreamId};
use gnc_protocol::wire::{Wire, text};

use crate::devices::gnss::{EPOCHS_HZ, LATENCY_S};
use crate::module::Module;
use crate::noise::{Dice, Source};
use crate::personality::{Personality, RebootTrigger};
use crate::records::{ErrorLog, Finder, Finding};
use crate::requests::{self, MS, Task, Work, check, check_load, device, needs_power, prepare, samples_per_frame, uses};
use crate::streams::{Stream, format_of};
use crate::world::World;

/// Resolution of the board's capture timer.
const CAPTURE_NS: u64 = 10;
/// A pattern over a RAM advances in pieces of this much board time, so that the board stays able to answer.
const PIECE_NS: u64 = 2 * MS;
/// From a restart to the first answer.
const BOOT_NS: u64 = 200 * MS;
/// Supply that the board finds right when it switches power on, in microvolts.
const SUPPLY_UV: std::ops::RangeInclusive<u32> = 4_500_000..=5_500_000;

#[derive(Debug)]
struct Job {
    /// `None` once the host gave it up: the device still finishes.
    request: Option<u16>,
    message: u16,
    uses: u32,
    started_ns: u64,
    expected_ns: u64,
    ends_ns: u64,
    task: Task,
}

/// A slave board with a module in its socket, in a world.
#[derive(Debug)]
pub struct SimulatedBoard {
    /// The world around it.
    pub world: World,
    /// The module.
    pub module: Module,
    /// Counters of the link, kept up to date by whoever owns the link.
    pub link_counters: LinkCountersReply,
    /// Whether the line has no room for samples: they are dropped and counted.
    pub line_full: bool,
    now_ns: u64,
    booted_ns: u64,
    boot_id: u32,
    boot_dice: Dice,
    clock_error_ppm: f64,
    rate_baud: u32,
    powered: bool,
    jobs: Vec<Job>,
    streams: Vec<Stream>,
    ended: Vec<(StreamId, StreamStopReply)>,
    log: ErrorLog,
    outputs: VecDeque<Output>,
    reboot: Option<RebootTrigger>,
    triggers_seen: u32,
    reboot_at_ns: Option<u64>,
    restarted: bool,
    restarts: u32,
    serial: String,
    firmware: String,
}

impl SimulatedBoard {
    /// A board just started.
    #[must_use]
    pub fn new(personality: &Personality, serial_number: &str, world: World, rate_baud: u32, seed: u64) -> Self {
        let mut boot_dice = Dice::new(seed, Source::Boot);
        let model = &personality.model;
        let at_time = |trigger: &RebootTrigger| trigger.at_board_time_s.map(|time_s| (time_s * 1e9) as u64);
        Self {
            module: Module::new(personality, serial_number, seed),
            world,
            link_counters: LinkCountersReply::default(),
            line_full: false,
            now_ns: 0,
            booted_ns: 0,
            boot_id: boot_dice.word(),
            boot_dice,
            clock_error_ppm: model.clock_error_ppm,
            rate_baud,
            powered: false,
            jobs: Vec::new(),
            streams: Vec::new(),
            ended: Vec::new(),
            log: ErrorLog::default(),
            outputs: VecDeque::new(),
            reboot_at_ns: model.reboot.as_ref().and_then(at_time),
            reboot: model.reboot.clone(),
            triggers_seen: 0,
            restarted: false,
            restarts: 0,
            serial: model.board_serial.clone(),
            firmware: model.board_firmware.clone(),
        }
    }

    /// Bench time, ns.
    #[must_use]
    pub fn now_ns(&self) -> u64 {
        self.now_ns
    }

    /// True seconds since the bench was started.
    #[must_use]
    pub fn true_s(&self, bench_ns: u64) -> f64 {
        bench_ns as f64 * 1e-9 / (1.0 + self.clock_error_ppm * 1e-6)
    }

    /// Bench time of a true moment.
    fn bench_ns(&self, true_s: f64) -> f64 {
        true_s * 1e9 * (1.0 + self.clock_error_ppm * 1e-6)
    }

    /// Whether the module is under power.
    #[must_use]
    pub fn is_powered(&self) -> bool {
        self.powered
    }

    /// Whether anything is under way that needs time to pass.
    #[must_use]
    pub fn has_work(&self) -> bool {
        !self.jobs.is_empty() || !self.streams.is_empty() || self.is_booting()
    }

    /// Whether it does not listen yet after a restart.
    #[must_use]
    pub fn is_booting(&self) -> bool {
        self.restarts > 0 && self.now_ns < self.booted_ns + BOOT_NS
    }

    /// Restarts since the bench was started.
    #[must_use]
    pub fn restarts(&self) -> u32 {
        self.restarts
    }

    /// Whether it restarted since the last time this was asked.
    pub fn take_restarted(&mut self) -> bool {
        std::mem::take(&mut self.restarted)
    }

    /// The next moment at which something happens, in bench time.
    #[must_use]
    pub fn next_event_ns(&self) -> Option<u64> {
        let job = |job: &Job| match job.task {
            Task::Pattern { .. } => job.ends_ns.min(self.now_ns + PIECE_NS),
            _ => job.ends_ns,
        };
        let boot = self.is_booting().then_some(self.booted_ns + BOOT_NS);
        let streams = self.streams.iter().map(|stream| self.stream_due_ns(stream));
        self.jobs.iter().map(job).chain(streams).chain(boot).chain(self.reboot_at_ns).min()
    }

    /// Lets time pass up to `to_ns`: everything due until then happens in its order.
    pub fn advance(&mut self, to_ns: u64) {
        while let Some(next_ns) = self.next_event_ns().filter(|next_ns| *next_ns <= to_ns) {
            self.now_ns = self.now_ns.max(next_ns);
            self.happen();
        }
        self.now_ns = self.now_ns.max(to_ns);
    }

    /// What is due now.
    fn happen(&mut self) {
        if self.reboot_at_ns.is_some_and(|at_ns| at_ns <= self.now_ns) {
            self.restart();
            return;
        }
        for index in 0..self.streams.len() {
            self.run_stream(index);
        }
        self.end_complete_streams();
        self.run_patterns();
        while let Some(index) = self.jobs.iter().position(|job| job.ends_ns <= self.now_ns) {
            let job = self.jobs.swap_remove(index);
            self.finish(job);
        }
    }

    /// The board lost its supply for a moment, or its watchdog fired.
    fn restart(&mut self) {
        self.reboot_at_ns = None;
        self.jobs.clear();
        self.streams.clear();
        self.ended.clear();
        self.outputs.clear();
        self.log = ErrorLog::default();
        self.set_power(false);
        self.boot_id = self.boot_dice.word();
        self.booted_ns = self.now_ns;
        self.restarted = true;
        self.restarts += 1;
    }

    fn set_power(&mut self, on: bool) {
        if on == self.powered {
            return;
        }
        self.powered = on;
        let now_s = self.true_s(self.now_ns);
        self.world.set_powered(on, now_s);
        if on {
            self.module.power_on(now_s);
        } else {
            self.streams.clear();
        }
    }

    fn board_us(&self, bench_ns: u64) -> u64 {
        bench_ns.saturating_sub(self.booted_ns) / 1000
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

    fn begin(&mut self, request: u16, what: Request) -> Result<u32, Refusal> {
        if !self.powered && needs_power(&what) {
            return Err(Refusal::new(NakCode::NotPowered, "switch the module's supply on first"));
        }
        let message = what.id();
        let trigger = what.clone();
        // The stream is checked before anything is drawn or reserved.
        if let Request::StreamStart(start) = &what {
            self.check_stream(start)?;
        }
        let held = self.jobs.iter().fold(0, |held, job| held | job.uses);
        let wanted = check(&what, &mut self.module)?;
        if held & wanted != 0 {
            let why = format!("in use by another request: {}", uses::names(held & wanted));
            return Err(Refusal::new(NakCode::Busy, &why));
        }
        let Work { expected_ns, takes_ns, task } = prepare(what, &mut self.module);
        let (started_ns, ends_ns) = (self.now_ns, self.now_ns + takes_ns);
        self.jobs.push(Job { request: Some(request), message, uses: wanted, started_ns, expected_ns, ends_ns, task });
        self.arm_reboot(&trigger);
        Ok(u32::try_from(expected_ns.div_ceil(MS)).unwrap_or(u32::MAX))
    }

    fn check_stream(&self, start: &StreamStart) -> Result<u32, Refusal> {
        let id = requests::stream_of(start.stream)?;
        if self.streams.iter().any(|stream| stream.id == id) {
            return Err(Refusal::new(NakCode::Busy, "this stream is running"));
        }
        let taken = self.streams.iter().map(|stream| stream.load_permille).sum();
        check_load(start, taken, self.rate_baud)
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

    fn finish(&mut self, job: Job) {
        let Job { request, message, started_ns, task, .. } = job;
        let finder = Finder { request: request.unwrap_or(0), message, board_time_us: self.board_us(self.now_ns) };
        let outcome = match task {
            Task::AtEnd(what) => self.carry_out(what, finder),
            Task::Flash { request, duration_us } => self.finish_flash(&request, duration_us, finder),
            Task::Timers { request, reply } => {
                if reply.interrupts != request.count {
                    let (expected, got) = (u32::from(request.count), u32::from(reply.interrupts));
                    let place = u32::from(request.timer);
                    self.log.note(finder, [Finding { kind: ErrorKind::TimerInterrupts, place, expected, got }]);
                }
                body(&reply)
            }
            Task::Pattern { run, .. } => {
                self.note_mismatch(ErrorKind::MemoryMismatch, run.reply(), finder);
                body(run.reply())
            }
        };
        let Some(request) = request else { return };
        let elapsed_us = u32::try_from((self.now_ns - started_ns) / 1000).unwrap_or(u32::MAX);
        self.outputs.push_back(Output::Done(Done { request, elapsed_us, outcome }));
    }

    fn carry_out(&mut self, what: Request, finder: Finder) -> Result<Payload, Fault> {
        match what {
            // The conversation answers these two itself.
            Request::MakeSafe(_) | Request::Abort(_) => body(&()),
            Request::ErrorRecords(request) => body(&self.log.from(request.from)),
            Request::LinkCounters(_) => body(&self.link_counters),
            Request::ModulePower(power) => {
                self.set_power(power.on == 1);
                let reply = self.module.supply(self.powered);
                if self.powered && !SUPPLY_UV.contains(&reply.supply_uv) {
                    let got = reply.supply_uv;
                    let finding = Finding { kind: ErrorKind::Supply, place: 0, expected: 5_000_000, got };
                    self.log.note(finder, [finding]);
                }
                body(&reply)
            }
            Request::Identity(_) => body(&self.module.identity),
            Request::CpuWords(request) => {
                self.core_answers(request.core)?;
                body(&CpuWordsReply { words: self.module.cpu.words(&request) })
            }
            Request::CpuIntegers(request) => {
                self.core_answers(request.core)?;
                body(&CpuIntegersReply { results: self.module.cpu.integers(&request) })
            }
            Request::CpuFloats(request) => {
                self.core_answers(request.core)?;
                body(&CpuFloatsReply { results: self.module.cpu.floats(&request) })
            }
            Request::FlashId(request) => {
                let part = self.flash(request.flash)?.part;
                body(&FlashIdReply {
                    jedec: part.jedec,
                    sector_bytes: part.sector_bytes,
                    scratch_sectors: part.scratch_sectors,
                })
            }
            Request::FlashBlankCheck(request) => {
                let reply = self.flash(request.flash)?.blank_check(request.sector);
                self.note_mismatch(ErrorKind::FlashNotBlank, &reply, finder);
                body(&reply)
            }
            Request::FlashVerify(request) => {
                let reply = self.flash(request.flash)?.verify(request.sector, request.seed);
                self.note_mismatch(ErrorKind::FlashMismatch, &reply, finder);
                body(&reply)
            }
            Request::AdRead(request) => {
                let influence = self.world.influence(self.true_s(self.now_ns));
                let gauss = self.module.sensors.analogue_gauss(&influence);
                body(&AdReadReply { channels: self.module.ad.read(request.channels, request.samples, &gauss) })
            }
            Request::IoTest(request) => {
                let levels = self.module.lines.io_test(&request);
                let pair = 1 << request.driver | 1 << request.reader;
                let expected = if request.level == 1 { pair } else { 0b1111 & !pair };
                if levels != expected {
                    let place = u32::from(request.driver) * 16 + u32::from(request.reader);
                    let (expected, got) = (u32::from(expected), u32::from(levels));
                    self.log.note(finder, [Finding { kind: ErrorKind::IoMismatch, place, expected, got }]);
                }
                body(&IoTestReply { levels })
            }
            Request::SpiTransfer(request) => {
                let direction = SpiDirection::from_number(request.direction).unwrap_or(SpiDirection::FromModule);
                let data = self.module.lines.spi(direction, &request.data);
                self.note_bytes(ErrorKind::SpiMismatch, &request.data, &data, finder);
                body(&SpiTransferReply { data })
            }
            Request::SciEcho(request) => {
                let reply = self.module.sci.echo(&request);
                self.note_bytes(ErrorKind::SciMismatch, &request.data, &reply.data, finder);
                body(&reply)
            }
            Request::GnssRestart(request) => {
                let start = GnssStart::from_number(request.start).unwrap_or(GnssStart::Hot);
                let now_s = self.true_s(self.now_ns);
                self.module.gnss.restart(start, now_s);
                body(&())
            }
            Request::StreamStart(start) => self.start_stream(&start),
            Request::StreamStop(stop) => self.stop_stream(stop.stream),
            // Prepared with tasks of their own, so that they never come here.
            Request::TimerMeasure(_) | Request::RamTest(_) | Request::FlashErase(_) | Request::FlashWrite(_) => {
                Err(fault(FaultCode::DeviceFault, "the board lost track of the request"))
            }
        }
    }

    fn core_answers(&self, core: u8) -> Result<(), Fault> {
        let dead = || fault(FaultCode::DeviceTimeout, &format!("core {core} did not answer"));
        self.module.cpu.answers(core).then_some(()).ok_or_else(dead)
    }

    fn flash(&mut self, number: u8) -> Result<&mut crate::devices::flash::FlashMemory, Fault> {
        let flash = Flash::from_number(number).ok_or_else(|| fault(FaultCode::DeviceFault, "no such flash"))?;
        Ok(self.module.flash(flash))
    }

    fn finish_flash(&mut self, what: &Request, duration_us: u32, finder: Finder) -> Result<Payload, Fault> {
        let limit_ms = match what {
            Request::FlashErase(erase) => {
                let flash = self.flash(erase.flash)?;
                flash.erase(erase.sector);
                flash.part.erase_limit_ms
            }
            Request::FlashWrite(write) => {
                let flash = self.flash(write.flash)?;
                flash.write(write.sector, write.seed);
                flash.part.write_limit_ms
            }
            _ => f64::INFINITY,
        };
        if f64::from(duration_us) > limit_ms * 1000.0 {
            let expected = (limit_ms * 1000.0) as u32;
            let finding = Finding { kind: ErrorKind::FlashSlow, place: 0, expected, got: duration_us };
            self.log.note(finder, [finding]);
        }
        body(&DurationReply { duration_us })
    }

    fn note_mismatch(&mut self, kind: ErrorKind, reply: &MismatchReply, finder: Finder) {
        let finding = Finding { kind, place: reply.first_place, expected: reply.expected, got: reply.got };
        self.log.note(finder, (reply.mismatches > 0).then_some(finding));
    }

    fn note_bytes(&mut self, kind: ErrorKind, sent: &[u8], got: &[u8], finder: Finder) {
        let compare = |(place, &expected): (usize, &u8)| {
            let got = got.get(place).map_or(0x100, |byte| u32::from(*byte));
            let finding = Finding { kind, place: place as u32, expected: u32::from(expected), got };
            (got != u32::from(expected)).then_some(finding)
        };
        self.log.note(finder, sent.iter().enumerate().filter_map(compare));
    }

    fn start_stream(&mut self, start: &StreamStart) -> Result<Payload, Fault> {
        let refused = |refusal: Refusal| Fault { code: FaultCode::DeviceFault, text: refusal.text };
        let load_permille = self.check_stream(start).map_err(refused)?;
        let id = requests::stream_of(start.stream).map_err(refused)?;
        let utc_s = self.world.utc_s(self.true_s(self.now_ns));
        let tick = match id {
            StreamId::Imu => 0,
            StreamId::Gnss => (utc_s * EPOCHS_HZ).floor().max(0.0) as u64 + 1,
            StreamId::Pps => utc_s.floor().max(0.0) as u64 + 1,
        };
        self.ended.retain(|(ended, _)| *ended != id);
        self.streams.push(Stream::new(start, id, load_permille, self.now_ns, tick));
        body(&StreamStartReply {
            format: format_of(id) as u8,
            samples_per_frame: match id {
                StreamId::Imu => samples_per_frame(start),
                StreamId::Gnss => 0,
                StreamId::Pps => 1,
            },
            load_permille: u16::try_from(load_permille).unwrap_or(u16::MAX),
        })
    }

    fn stop_stream(&mut self, number: u8) -> Result<Payload, Fault> {
        if let Some(index) = self.streams.iter().position(|stream| stream.id as u8 == number) {
            let mut stream = self.streams.swap_remove(index);
            if let Some(frame) = stream.take_frame() {
                self.send(&mut stream, frame);
            }
            self.ended.retain(|(ended, _)| *ended != stream.id);
            self.ended.push((stream.id, stream.stopped()));
        }
        let ended = self.ended.iter().find(|(id, _)| *id as u8 == number);
        body(&ended.map_or_else(StreamStopReply::default, |(_, reply)| reply.clone()))
    }

    fn end_complete_streams(&mut self) {
        while let Some(index) = self.streams.iter().position(Stream::is_complete) {
            let stream = self.streams.swap_remove(index);
            self.ended.push((stream.id, stream.stopped()));
        }
    }

    /// When a stream has something to do.
    fn stream_due_ns(&self, stream: &Stream) -> u64 {
        match stream.id {
            StreamId::Imu => stream.frame_full_ns(),
            StreamId::Gnss => {
                self.bench_ns(stream.tick as f64 / EPOCHS_HZ + LATENCY_S - self.world.utc_start_s).ceil() as u64
            }
            // A little after the second, so that the scatter of the edge cannot put it into the future.
            StreamId::Pps => self.bench_ns(stream.tick as f64 + 1e-6 - self.world.utc_start_s).ceil() as u64,
        }
    }

    fn run_stream(&mut self, index: usize) {
        // Taken out while it runs, since its samples come from the rest of the board.
        let mut stream = self.streams.swap_remove(index);
        match stream.id {
            StreamId::Imu => self.run_imu(&mut stream),
            StreamId::Gnss => self.run_gnss(&mut stream),
            StreamId::Pps => self.run_pps(&mut stream),
        }
        self.streams.push(stream);
        let last = self.streams.len() - 1;
        self.streams.swap(index, last);
    }

    fn run_imu(&mut self, stream: &mut Stream) {
        while !stream.is_complete() && stream.next_imu_ns() <= self.now_ns {
            let time_ns = stream.next_imu_ns();
            let now_s = self.true_s(time_ns);
            let influence = self.world.influence(now_s);
            let sample = self.module.sensors.sample(&influence, now_s, stream.rate_hz() as f64);
            if let Some(frame) = stream.add_imu(&sample, self.board_us(time_ns)) {
                self.send(stream, frame);
            }
        }
    }

    fn run_gnss(&mut self, stream: &mut Stream) {
        while !stream.is_complete() && self.stream_due_ns(stream) <= self.now_ns {
            let epoch_s = stream.tick as f64 / EPOCHS_HZ - self.world.utc_start_s;
            let time_us = self.board_us(self.stream_due_ns(stream));
            stream.tick += 1;
            let sentences = self.module.gnss.epoch(&self.world, epoch_s);
            for frame in stream.add_bytes(sentences.as_bytes(), time_us) {
                self.send(stream, frame);
            }
        }
    }

    fn run_pps(&mut self, stream: &mut Stream) {
        while !stream.is_complete() && self.stream_due_ns(stream) <= self.now_ns {
            let second_s = stream.tick as f64 - self.world.utc_start_s;
            stream.tick += 1;
            let Some(scatter_s) = self.module.gnss.pps_scatter_s(second_s) else { continue };
            let edge_ns = self.bench_ns(second_s + scatter_s).max(0.0) as u64;
            let captured_ns = edge_ns.saturating_sub(self.booted_ns) / CAPTURE_NS * CAPTURE_NS;
            let capture = PpsCapture { board_time_ns: captured_ns };
            if let Some(frame) = stream.add_pps(&capture, captured_ns / 1000) {
                self.send(stream, frame);
            }
        }
    }

    fn send(&mut self, stream: &mut Stream, frame: StreamFrame) {
        if self.line_full {
            stream.drop_frame(&frame);
        } else {
            self.outputs.push_back(Output::Stream(stream.id, frame));
        }
    }
}

fn body(reply: &impl Wire) -> Result<Payload, Fault> {
    reply.to_payload().map_err(|overflow| fault(FaultCode::DeviceFault, &overflow.to_string()))
}

fn fault(code: FaultCode, why: &str) -> Fault {
    Fault { code, text: text(why) }
}

impl Board for SimulatedBoard {
    fn identity(&self) -> BoardIdentity {
        BoardIdentity {
            boot_id: self.boot_id,
            capabilities: capability::POWER,
            serial: text(&self.serial),
            firmware: text(&self.firmware),
        }
    }

    fn start(&mut self, request: u16, what: Request) -> Result<u32, Refusal> {
        self.begin(request, what)
    }

    fn poll(&mut self) -> Option<Output> {
        self.outputs.pop_front()
    }

    fn progress(&self, request: u16) -> Progress {
        let Some(job) = self.jobs.iter().find(|job| job.request == Some(request)) else { return Progress::default() };
        let passed_ns = self.now_ns - job.started_ns;
        // A job that takes longer than expected stays just short of done.
        let done_permille = (passed_ns * 1000 / job.expected_ns.max(1)).min(999) as u16;
        Progress { done_permille, elapsed_ms: u32::try_from(passed_ns / MS).unwrap_or(u32::MAX) }
    }

    fn abort(&mut self, request: u16) {
        for job in &mut self.jobs {
            if job.request == Some(request) {
                job.request = None;
            }
        }
        // A flash cannot be stopped in an erase; everything else can.
        self.jobs.retain(|job| job.request.is_some() || matches!(job.task, Task::Flash { .. }));
    }

    fn make_safe(&mut self) {
        for job in std::mem::take(&mut self.jobs) {
            if let Task::Flash { request: Request::FlashErase(erase), .. } = job.task
                && let Some(flash) = Flash::from_number(erase.flash)
            {
                self.module.flash(flash).interrupt_erase(erase.sector);
            }
        }
        self.outputs.clear();
        self.streams.clear();
        self.set_power(false);
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
