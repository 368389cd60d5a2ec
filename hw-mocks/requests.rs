//! Prepares requests: checks their parameters, and works out their devices and their time.
//!
//! Board times: identity 20 ms; CPU 1 ms and 2 us a word or pair; RAM 30 ns an access; flash reads as the part; erases
//! and writes as the part with its scatter; AD 1 ms and the samples at 10 kHz; IO 1 ms; SPI 0.2 ms and 8 clocks a byte;
//! SCI 0.5 ms and 10 bits a byte, one byte of delay; GNSS restart 50 ms; streams 1 ms; power on 150 ms, off 20 ms;
//! timers the time that they measure; calibration 1 ms, its commit an erase of the internal flash and 3 ms.

use gnc_protocol::can;
use gnc_protocol::error::NakCode;
use gnc_protocol::message::{
    Flash, GnssStart, Ram, RamPattern, Request, SpiDirection, StreamStart, TimerMeasure, TimerMeasureReply, WordTarget,
};
use gnc_protocol::slave::RequestRefusal;
use gnc_protocol::stream::{
    COMPENSATED_SAMPLE, IMU_SAMPLE, MAX_COMPENSATED_SAMPLES, MAX_IMU_SAMPLES, MAX_LOAD_PERMILLE, STREAM_HEAD, StreamId,
};

use crate::devices::ad;
use crate::devices::memory::PatternRun;
use crate::module::Module;

/// Nanoseconds in a millisecond of board time.
pub(crate) const MS: u64 = 1_000_000;
/// Time of an access to either RAM.
pub(crate) const RAM_ACCESS_NS: u64 = 30;
/// Time to program a calibration into an erased sector.
const CALIBRATION_WRITE_MS: f64 = 3.0;
/// Share of the link for the receiver's sentences and 1PPS captures: 5 epochs of at most 700 bytes with frames.
const GNSS_BYTES_A_SECOND: u64 = 3_700;
const PPS_BYTES_A_SECOND: u64 = 48;

/// Devices that a request holds while it runs; two requests that share one conflict.
pub(crate) mod uses {
    pub(crate) const NOTHING: u32 = 0;
    pub(crate) const IDENTITY: u32 = 1;
    pub(crate) const CORE_1: u32 = 1 << 1;
    pub(crate) const CORE_2: u32 = 1 << 2;
    pub(crate) const TIMERS: u32 = 1 << 3;
    pub(crate) const INTERNAL_RAM: u32 = 1 << 4;
    pub(crate) const SDRAM: u32 = 1 << 5;
    pub(crate) const SPI_FLASH: u32 = 1 << 6;
    pub(crate) const INTERNAL_FLASH: u32 = 1 << 7;
    pub(crate) const AD: u32 = 1 << 8;
    pub(crate) const IO_PINS: u32 = 1 << 9;
    pub(crate) const SCI: u32 = 1 << 10;
    pub(crate) const GNSS: u32 = 1 << 11;
    pub(crate) const IMU_STREAM: u32 = 1 << 12;
    pub(crate) const GNSS_STREAM: u32 = 1 << 13;
    pub(crate) const PPS_STREAM: u32 = 1 << 14;
    pub(crate) const CAN: u32 = 1 << 15;
    pub(crate) const COMPENSATED_STREAM: u32 = 1 << 16;
    /// The supply feeds all devices.
    pub(crate) const SUPPLY: u32 = u32::MAX;

    /// The devices that starting or stopping a stream holds.
    pub(crate) fn of_stream(stream: super::StreamId) -> u32 {
        match stream {
            super::StreamId::Imu => IMU_STREAM,
            super::StreamId::Gnss => GNSS_STREAM,
            super::StreamId::Pps => PPS_STREAM,
            super::StreamId::Compensated => COMPENSATED_STREAM,
        }
    }

    /// The devices of a set, for texts.
    pub(crate) fn names(set: u32) -> String {
        const NAMES: [&str; 17] = [
            "identity",
            "core 1",
            "core 2",
            "timers",
            "internal RAM",
            "SDRAM",
            "SPI flash",
            "internal flash",
            "AD converter",
            "IO pins",
            "SCI",
            "GNSS receiver",
            "IMU stream",
            "GNSS stream",
            "1PPS stream",
            "CAN",
            "stream of compensated samples",
        ];
        let of_set: Vec<&str> = (0..NAMES.len()).filter(|bit| set >> bit & 1 == 1).map(|bit| NAMES[bit]).collect();
        of_set.join(", ")
    }
}

/// A request ready to start.
#[derive(Debug)]
pub(crate) struct Work {
    /// The time that the board reports to the host.
    pub(crate) expected_ns: u64,
    /// The time that it really takes.
    pub(crate) takes_ns: u64,
    pub(crate) task: Task,
}

/// The work of a request, and when it is done.
#[derive(Debug)]
pub(crate) enum Task {
    /// All work is done at the end.
    AtEnd(Request),
    /// A flash that is busy for the drawn time.
    Flash { request: Request, duration_us: u32 },
    /// Intervals that are already drawn, since they determine the time.
    Timers { request: TimerMeasure, reply: TimerMeasureReply },
    /// A pattern that moves over the memory as time passes.
    Pattern { ram: Ram, run: PatternRun, done: u64, accesses: u64 },
    /// The module does not answer, and the board gives up.
    Unanswered,
}

fn bad(why: impl AsRef<str>) -> RequestRefusal {
    RequestRefusal::new(NakCode::BadParameter, why.as_ref())
}

fn range<T: PartialOrd + Copy + std::fmt::Display>(
    name: &str,
    value: T,
    low: T,
    high: T,
) -> Result<(), RequestRefusal> {
    if value >= low && value <= high { Ok(()) } else { Err(bad(format!("{name} {value} is not in {low} to {high}"))) }
}

fn known<T>(name: &str, number: u8, value: Option<T>, names: &str) -> Result<T, RequestRefusal> {
    value.ok_or_else(|| bad(format!("{name} {number} is not one of {names}")))
}

fn core(number: u8) -> Result<u32, RequestRefusal> {
    range("core", number, 1, 2)?;
    Ok(if number == 1 { uses::CORE_1 } else { uses::CORE_2 })
}

fn flash_of(number: u8) -> Result<(Flash, u32), RequestRefusal> {
    match known("flash", number, Flash::from_number(number), "0 (SPI), 1 (internal)")? {
        Flash::Spi => Ok((Flash::Spi, uses::SPI_FLASH)),
        Flash::Internal => Ok((Flash::Internal, uses::INTERNAL_FLASH)),
    }
}

fn sector(module: &mut Module, number: u8, sector: u16) -> Result<u32, RequestRefusal> {
    let (flash, uses) = flash_of(number)?;
    let scratch = module.flash(flash).part.scratch_sectors;
    if sector < scratch {
        return Ok(uses);
    }
    let why = format!("sector {sector} is not a scratch sector; those are 0 to {}", scratch - 1);
    Err(RequestRefusal::new(NakCode::Protected, &why))
}

fn seed(seed: u32) -> Result<(), RequestRefusal> {
    if seed == 0 { Err(bad("seed 0 is not in 1 to 4294967295")) } else { Ok(()) }
}

fn ms(time_ms: f64) -> u64 {
    (time_ms * MS as f64) as u64
}

/// Checks the parameters of a request and returns the devices that it needs. It draws no random numbers, so that a
/// refused request leaves no trace.
pub(crate) fn check(request: &Request, module: &mut Module) -> Result<u32, RequestRefusal> {
    match request {
        Request::MakeSafe(_) | Request::Abort(_) | Request::ErrorRecords(_) | Request::LinkCounters(_) => {
            Ok(uses::NOTHING)
        }
        Request::ModulePower(power) => {
            range("on", power.on, 0, 1)?;
            Ok(uses::SUPPLY)
        }
        Request::Identity(_) => Ok(uses::IDENTITY),
        Request::CanCounters(_) => Ok(uses::CAN),
        Request::CpuWords(words) => {
            let target = WordTarget::from_number(words.target);
            known("target", words.target, target, "0 (registers), 1 (memory)")?;
            core(words.core)
        }
        Request::CpuIntegers(integers) => {
            if let Some(index) = integers.pairs.iter().position(|pair| pair[1] == 0) {
                return Err(bad(format!("b of pair {index} is 0; it must not be 0")));
            }
            core(integers.core)
        }
        Request::CpuFloats(floats) => {
            let refused = |pair: &[f64; 2]| pair[1] == 0.0 || pair.iter().any(|operand| !operand.is_finite());
            if let Some(index) = floats.pairs.iter().position(refused) {
                let [a, b] = floats.pairs[index];
                return Err(bad(format!("pair {index} ({a:e}, {b:e}): operands must be finite, and b not 0")));
            }
            core(floats.core)
        }
        Request::TimerMeasure(timer) => {
            range("timer", timer.timer, 0, 2)?;
            range("period_us", timer.period_us, 100, 100_000)?;
            range("count", timer.count, 1, 100)?;
            Ok(uses::TIMERS)
        }
        Request::RamTest(test) => {
            let names = "0 (solid), 1 (checkerboard), 2 (walking ones), 3 (address), 4 (March C-)";
            known("pattern", test.pattern, RamPattern::from_number(test.pattern), names)?;
            match known("ram", test.ram, Ram::from_number(test.ram), "0 (internal), 1 (SDRAM)")? {
                Ram::Internal => Ok(uses::INTERNAL_RAM),
                Ram::Sdram => Ok(uses::SDRAM),
            }
        }
        Request::FlashId(id) => Ok(flash_of(id.flash)?.1),
        Request::FlashErase(erase) => sector(module, erase.flash, erase.sector),
        Request::FlashBlankCheck(check) => sector(module, check.flash, check.sector),
        Request::FlashWrite(write) => {
            seed(write.seed)?;
            sector(module, write.flash, write.sector)
        }
        Request::FlashVerify(verify) => {
            seed(verify.seed)?;
            sector(module, verify.flash, verify.sector)
        }
        Request::AdRead(read) => {
            range("channels", read.channels, 1, 255)?;
            range("samples", read.samples, 1, 1000)?;
            Ok(uses::AD)
        }
        Request::IoTest(io) => {
            range("driver", io.driver, 0, 3)?;
            range("reader", io.reader, 0, 3)?;
            range("level", io.level, 0, 1)?;
            if io.driver == io.reader {
                return Err(bad(format!("driver and reader are both line {}", io.driver)));
            }
            Ok(uses::IO_PINS)
        }
        Request::SpiTransfer(spi) => {
            let direction = SpiDirection::from_number(spi.direction);
            known("direction", spi.direction, direction, "0 (from the module), 1 (to the module)")?;
            range("clock_hz", spi.clock_hz, 10_000, 10_000_000)?;
            Ok(uses::IO_PINS)
        }
        Request::SciEcho(sci) => {
            range("rate_baud", sci.rate_baud, 9_600, 2_000_000)?;
            Ok(uses::SCI)
        }
        Request::GnssRestart(restart) => {
            known("start", restart.start, GnssStart::from_number(restart.start), "1 (hot), 2 (warm), 3 (cold)")?;
            Ok(uses::GNSS)
        }
        Request::StreamStart(start) => {
            check_stream(start)?;
            if start.stream == StreamId::Compensated as u8 && module.calibration.calibration().is_none() {
                return Err(RequestRefusal::new(NakCode::NotCalibrated, "write and commit a calibration first"));
            }
            stream_of(start.stream).map(uses::of_stream)
        }
        Request::CalibrationWrite(write) => match write.calibration.bad_field() {
            Some(field) => Err(bad(format!("{field} is outside its range"))),
            None => Ok(uses::INTERNAL_FLASH),
        },
        Request::CalibrationCommit(commit) => match module.calibration.written_checksum() {
            None => Err(bad("no calibration was written since power-on")),
            Some(written) if written != commit.checksum => Err(bad(format!(
                "checksum {:08x} differs from that of the written data, {written:08x}",
                commit.checksum
            ))),
            Some(_) => Ok(uses::INTERNAL_FLASH),
        },
        Request::CalibrationRead(_) => Ok(uses::INTERNAL_FLASH),
        Request::StreamStop(stop) => stream_of(stop.stream).map(uses::of_stream),
    }
}

/// Time after which the board gives up on a silent module.
const UNANSWERED_NS: u64 = 100 * MS;

/// A request to a module that does not answer.
pub(crate) fn unanswered() -> Work {
    Work { expected_ns: UNANSWERED_NS, takes_ns: UNANSWERED_NS, task: Task::Unanswered }
}

/// Works out how long a checked request takes, and draws the random numbers that this needs.
pub(crate) fn prepare(request: Request, module: &mut Module) -> Work {
    let bits_ns = |bits: usize, rate_hz: u32| bits as u64 * 1_000_000_000 / u64::from(rate_hz.max(1));
    let part_of = |module: &mut Module, number| module.flash(flash_of(number).map_or(Flash::Spi, |of| of.0)).part;
    let takes_ns = match &request {
        Request::MakeSafe(_) | Request::Abort(_) | Request::ErrorRecords(_) | Request::LinkCounters(_) => 0,
        Request::ModulePower(power) => {
            if power.on == 1 {
                150 * MS
            } else {
                20 * MS
            }
        }
        Request::Identity(_) => 20 * MS,
        Request::CpuWords(words) => MS + 2000 * words.words.len() as u64,
        Request::CpuIntegers(integers) => MS + 2000 * integers.pairs.len() as u64,
        Request::CpuFloats(floats) => MS + 2000 * floats.pairs.len() as u64,
        Request::TimerMeasure(timer) => {
            let expected_ns = u64::from(timer.period_us) * 1000 * u64::from(timer.count);
            let (reply, takes_ns) = module.timers.measure(timer);
            return Work { expected_ns, takes_ns, task: Task::Timers { request: timer.clone(), reply } };
        }
        Request::RamTest(test) => {
            let ram = Ram::from_number(test.ram).unwrap_or(Ram::Internal);
            let pattern = RamPattern::from_number(test.pattern).unwrap_or(RamPattern::Solid);
            let accesses = PatternRun::accesses(pattern, module.ram(ram).words());
            let takes_ns = accesses * RAM_ACCESS_NS;
            let task = Task::Pattern { ram, run: PatternRun::new(pattern), done: 0, accesses };
            return Work { expected_ns: takes_ns, takes_ns, task };
        }
        Request::FlashErase(erase) => {
            let flash = module.flash(flash_of(erase.flash).map_or(Flash::Spi, |of| of.0));
            let (typical_ms, duration_us) = (flash.part.erase_ms, flash.erase_us());
            return flash_work(typical_ms, duration_us, request);
        }
        Request::FlashWrite(write) => {
            let flash = module.flash(flash_of(write.flash).map_or(Flash::Spi, |of| of.0));
            let (typical_ms, duration_us) = (flash.part.write_ms, flash.write_us());
            return flash_work(typical_ms, duration_us, request);
        }
        Request::FlashBlankCheck(check) => ms(part_of(module, check.flash).read_ms),
        Request::FlashVerify(verify) => ms(part_of(module, verify.flash).read_ms),
        Request::AdRead(read) => MS + bits_ns(usize::from(read.samples), ad::RATE_HZ),
        Request::CanCounters(_)
        | Request::FlashId(_)
        | Request::IoTest(_)
        | Request::StreamStart(_)
        | Request::StreamStop(_)
        | Request::CalibrationWrite(_)
        | Request::CalibrationRead(_) => MS,
        Request::CalibrationCommit(_) => {
            let flash = &mut module.internal_flash;
            let typical_ms = flash.part.erase_ms + CALIBRATION_WRITE_MS;
            let duration_us = flash.erase_us() + (CALIBRATION_WRITE_MS * 1000.0) as u32;
            return flash_work(typical_ms, duration_us, request);
        }
        Request::SpiTransfer(spi) => MS / 5 + bits_ns(spi.data.len() * 8, spi.clock_hz),
        Request::SciEcho(sci) => MS / 2 + bits_ns((sci.data.len() + 1) * 10, sci.rate_baud),
        Request::GnssRestart(_) => 50 * MS,
    };
    Work { expected_ns: takes_ns, takes_ns, task: Task::AtEnd(request) }
}

fn flash_work(typical_ms: f64, duration_us: u32, request: Request) -> Work {
    let takes_ns = u64::from(duration_us) * 1000;
    Work { expected_ns: ms(typical_ms), takes_ns, task: Task::Flash { request, duration_us } }
}

/// Whether a request needs the module to be under power.
pub(crate) fn needs_power(request: &Request) -> bool {
    !matches!(
        request,
        Request::MakeSafe(_)
            | Request::Abort(_)
            | Request::ModulePower(_)
            | Request::ErrorRecords(_)
            | Request::LinkCounters(_)
            | Request::StreamStop(_)
    )
}

/// The device of a request, by the name of its test item; the triggers of faults use these names.
pub(crate) fn device(request: &Request) -> &'static str {
    let flash = |number| if number == Flash::Spi as u8 { "spi-flash" } else { "internal-flash" };
    match request {
        Request::MakeSafe(_) | Request::Abort(_) | Request::ErrorRecords(_) | Request::LinkCounters(_) => "board",
        Request::ModulePower(_) => "power",
        Request::Identity(_) => "identity",
        Request::CpuWords(_) | Request::CpuIntegers(_) | Request::CpuFloats(_) => "cpu",
        Request::TimerMeasure(_) => "timers",
        Request::RamTest(test) if test.ram == Ram::Sdram as u8 => "sdram",
        Request::RamTest(_) => "internal-ram",
        Request::FlashId(request) => flash(request.flash),
        Request::FlashErase(request) => flash(request.flash),
        Request::FlashBlankCheck(request) => flash(request.flash),
        Request::FlashWrite(request) => flash(request.flash),
        Request::FlashVerify(request) => flash(request.flash),
        Request::AdRead(_) => "ad",
        Request::IoTest(_) => "io",
        Request::SpiTransfer(_) => "spi",
        Request::SciEcho(_) => "sci",
        Request::CanCounters(_) => "can",
        Request::GnssRestart(_) => "gnss",
        Request::StreamStart(start) if is_imu(start.stream) => "imu",
        Request::StreamStop(stop) if is_imu(stop.stream) => "imu",
        Request::CalibrationWrite(_) | Request::CalibrationCommit(_) | Request::CalibrationRead(_) => "calibration",
        Request::StreamStart(_) | Request::StreamStop(_) => "gnss",
    }
}

/// Whether a stream holds samples of the IMU.
fn is_imu(stream: u8) -> bool {
    samples_of(stream).is_some()
}

/// Bytes of a sample and most samples in a frame, for the streams with samples of the IMU.
pub(crate) fn samples_of(stream: u8) -> Option<(usize, usize)> {
    match StreamId::from_number(stream)? {
        StreamId::Imu => Some((IMU_SAMPLE, MAX_IMU_SAMPLES)),
        StreamId::Compensated => Some((COMPENSATED_SAMPLE, MAX_COMPENSATED_SAMPLES)),
        StreamId::Gnss | StreamId::Pps => None,
    }
}

/// A stream by its number.
pub(crate) fn stream_of(number: u8) -> Result<StreamId, RequestRefusal> {
    known("stream", number, StreamId::from_number(number), "1 (IMU), 2 (GNSS), 3 (1PPS), 4 (compensated)")
}

fn check_stream(start: &StreamStart) -> Result<(), RequestRefusal> {
    stream_of(start.stream)?;
    match samples_of(start.stream) {
        Some((_, most)) => {
            range("rate_hz", start.rate_hz, 1, 1000)?;
            range("samples_per_frame", usize::from(start.samples_per_frame), 0, most)
        }
        None => {
            range("rate_hz of a GNSS stream", start.rate_hz, 0, 0)?;
            range("samples_per_frame of a GNSS stream", start.samples_per_frame, 0, 0)
        }
    }
}

/// Samples in a frame of IMU samples: the host's choice, or at least a frame every 50 ms.
pub(crate) fn samples_per_frame(start: &StreamStart) -> u8 {
    let most = samples_of(start.stream).map_or(1, |(_, most)| most);
    match start.samples_per_frame {
        0 => (start.rate_hz / 20).clamp(1, most as u16) as u8,
        chosen => chosen,
    }
}

/// Mean share of the link that a stream takes.
pub(crate) fn load_permille(start: &StreamStart, rate_baud: u32) -> u32 {
    let share = |bytes_a_second: u64| (bytes_a_second * 10_000 / u64::from(rate_baud.max(1))) as u32;
    match StreamId::from_number(start.stream) {
        Some(StreamId::Imu | StreamId::Compensated) => {
            let (sample_bytes, _) = samples_of(start.stream).unwrap_or_default();
            let per_frame = u32::from(samples_per_frame(start));
            gnc_protocol::stream::load_permille(sample_bytes, u32::from(start.rate_hz), per_frame, rate_baud)
        }
        Some(StreamId::Gnss) => share(GNSS_BYTES_A_SECOND),
        Some(StreamId::Pps) => share(PPS_BYTES_A_SECOND),
        None => 0,
    }
}

/// Checks whether one more stream fits beside those that take `taken_permille`.
pub(crate) fn check_load(start: &StreamStart, taken_permille: u32, rate_baud: u32) -> Result<u32, RequestRefusal> {
    let load = load_permille(start, rate_baud);
    if load + taken_permille <= MAX_LOAD_PERMILLE {
        return Ok(load);
    }
    let per_frame = usize::from(samples_per_frame(start));
    let why = if let Some((sample_bytes, _)) = samples_of(start.stream) {
        let frame_bytes = gnc_protocol::serial::on_wire(STREAM_HEAD + sample_bytes * per_frame);
        format!(
            "{} Hz / {per_frame} per frame * {frame_bytes} B * 10 bit / {rate_baud} baud = {load} permille, others \
             {taken_permille}; at most {MAX_LOAD_PERMILLE}",
            start.rate_hz
        )
    } else {
        format!("{load} permille of {rate_baud} baud and others {taken_permille}; at most {MAX_LOAD_PERMILLE}")
    };
    Err(RequestRefusal::new(NakCode::DoesNotFit, &why))
}

/// Sets one IMU sample a frame, which CAN requires.
pub(crate) fn one_sample_a_frame(start: &mut StreamStart) -> Result<(), RequestRefusal> {
    if is_imu(start.stream) {
        range("samples_per_frame on CAN", start.samples_per_frame, 0, 1)?;
        start.samples_per_frame = 1;
    }
    Ok(())
}

/// Checks whether one more stream fits on the CAN bus beside those that take `taken_permille`.
pub(crate) fn check_can_load(start: &StreamStart, taken_permille: u32) -> Result<u32, RequestRefusal> {
    let bits = match stream_of(start.stream)? {
        StreamId::Imu => can::stream::imu_bits(start.rate_hz.into()),
        StreamId::Gnss => can::stream::gnss_bits(),
        StreamId::Pps => can::stream::pps_bits(),
        StreamId::Compensated => can::stream::compensated_bits(start.rate_hz.into()),
    };
    let load = can::stream::load_permille(bits);
    if load + taken_permille <= MAX_LOAD_PERMILLE {
        return Ok(load);
    }
    let why = format!(
        "{} to {} bits a second on a bus of {} bit/s = {load} permille, others {taken_permille}; at most \
         {MAX_LOAD_PERMILLE}",
        bits.0,
        bits.1,
        can::BIT_RATE
    );
    Err(RequestRefusal::new(NakCode::DoesNotFit, &why))
}
