//! From the file as written to a model: every value in its range, every refusal with its place.

use std::ops::Range;
use std::sync::Arc;

use toml::Spanned;

use super::sensors::vibrations;
use super::{Load, Model, RebootTrigger, raw};
use crate::can_faults::{CanRates, CanWireFaults};
use crate::devices::ad::Rails;
use crate::devices::calibration::{CalibrationFaults, LostBit};
use crate::devices::can::CanFaults;
use crate::devices::cpu::CpuFaults;
use crate::devices::flash::{BadBit, FlashFaults, FlashPart, INTERNAL_FLASH, SPI_FLASH};
use crate::devices::gnss::{EPOCHS_HZ, GnssFaults, Playback};
use crate::devices::inertial::{SensorFaults, SensorModels};
use crate::devices::lines::LineFaults;
use crate::devices::memory::{INTERNAL_WORDS, MemoryFaults, SDRAM_WORDS};
use crate::devices::playback::{LONGEST, Recording};
use crate::devices::sci::SciFaults;
use crate::devices::start::StartFaults;
use crate::devices::supply::SupplyModel;
use crate::devices::timer::TimerModel;
use crate::wire_faults::{WireFaults, WireRates};
use crate::world::Axis;

/// Names of devices that a trigger may wait for.
const DEVICES: [&str; 16] = [
    "power",
    "identity",
    "cpu",
    "timers",
    "internal-ram",
    "sdram",
    "spi-flash",
    "internal-flash",
    "imu",
    "calibration",
    "gnss",
    "ad",
    "io",
    "spi",
    "sci",
    "can",
];

/// A value that a personality must not have, and where it stands.
#[derive(Debug)]
pub(super) struct Mistake {
    pub(super) span: Range<usize>,
    pub(super) message: String,
    /// The place of another value that means nothing without this one.
    pub(super) moot: Option<Range<usize>>,
}

impl Mistake {
    pub(super) fn of(error: &toml::de::Error) -> Self {
        Self { span: error.span().unwrap_or(0..0), message: error.message().to_owned(), moot: None }
    }
}

pub(super) fn mistake<T>(value: &Spanned<T>, message: String) -> Mistake {
    Mistake { span: value.span(), message, moot: None }
}

pub(super) fn number(
    value: Option<&Spanned<f64>>,
    name: &str,
    low: f64,
    high: f64,
    default: f64,
) -> Result<f64, Mistake> {
    let Some(spanned) = value else { return Ok(default) };
    let number = *spanned.get_ref();
    // A NaN lies in no range.
    if number >= low && number <= high {
        return Ok(number);
    }
    Err(mistake(spanned, format!("{name} {number} is not in {low} to {high}")))
}

pub(super) fn integer(value: &Spanned<u32>, name: &str, low: u32, high: u32) -> Result<u32, Mistake> {
    let number = *value.get_ref();
    if (low..=high).contains(&number) {
        return Ok(number);
    }
    Err(mistake(value, format!("{name} {number} is not in {low} to {high}")))
}

fn small(value: &Spanned<u32>, name: &str, low: u32, high: u8) -> Result<u8, Mistake> {
    let number = integer(value, name, low, u32::from(high))?;
    Ok(u8::try_from(number).unwrap_or(high))
}

fn count(value: Option<&Spanned<u32>>, name: &str) -> Result<u32, Mistake> {
    value.map_or(Ok(0), |value| integer(value, name, 0, u32::MAX))
}

fn level(value: &Spanned<u32>) -> Result<bool, Mistake> {
    Ok(integer(value, "level", 0, 1)? == 1)
}

fn short_text(value: Option<&Spanned<String>>, name: &str, most: usize, default: String) -> Result<String, Mistake> {
    match value {
        None => Ok(default),
        Some(value) if value.get_ref().len() <= most => Ok(value.get_ref().clone()),
        Some(value) => Err(mistake(value, format!("{name} is longer than {most} bytes"))),
    }
}

pub(super) fn axis(value: &Spanned<String>) -> Result<Axis, Mistake> {
    match value.get_ref().as_str() {
        "x" => Ok(Axis::X),
        "y" => Ok(Axis::Y),
        "z" => Ok(Axis::Z),
        other => Err(mistake(value, format!("axis \"{other}\" is not one of x, y, z"))),
    }
}

pub(super) fn axes(values: &[Spanned<String>]) -> Result<[bool; 3], Mistake> {
    let mut set = [false; 3];
    for value in values {
        set[axis(value)?.index()] = true;
    }
    Ok(set)
}

fn line_pair(pair: &[Spanned<u32>; 2], name: &str, high: u8) -> Result<(u8, u8), Mistake> {
    let (a, b) = (small(&pair[0], name, 0, high)?, small(&pair[1], name, 0, high)?);
    if a == b {
        return Err(mistake(&pair[1], format!("{name} {a} twice: two different ones are needed")));
    }
    Ok((a, b))
}

impl raw::Personality {
    pub(super) fn check(self, load: Load<'_>) -> Result<Model, Mistake> {
        let d = Model::default();
        let raw::Module { serial_number, part, hardware, firmware, protocol, swapped_after } = self.module;
        let oscillator = self.board.oscillator(d.oscillator)?;
        let raw::Board { serial, firmware: board_firmware, caches_identity, .. } = self.board;
        let serial_number = match &serial_number {
            Some(_) => Some(short_text(serial_number.as_ref(), "serial_number", 64, String::new())?),
            None => None,
        };
        Ok(Model {
            serial_number,
            part: short_text(part.as_ref(), "part", 32, d.part)?,
            hardware: short_text(hardware.as_ref(), "hardware", 32, d.hardware)?,
            firmware: short_text(firmware.as_ref(), "firmware", 32, d.firmware)?,
            protocol: protocol.map_or(Ok(d.protocol), |value| small(&value, "protocol", 0, 255))?,
            board_serial: short_text(serial.as_ref(), "serial", 32, d.board_serial)?,
            board_firmware: short_text(board_firmware.as_ref(), "firmware", 32, d.board_firmware)?,
            oscillator,
            sampling: self.sampling.check()?,
            supply: SupplyModel {
                voltage_v: number(self.supply.voltage_v.as_ref(), "voltage_v", 0.0, 12.0, d.supply.voltage_v)?,
                current_a: number(self.supply.current_a.as_ref(), "current_a", 0.0, 5.0, d.supply.current_a)?,
                off_voltage_v: number(
                    self.supply.off_voltage_v.as_ref(),
                    "off_voltage_v",
                    0.0,
                    12.0,
                    d.supply.off_voltage_v,
                )?,
                off_current_a: number(
                    self.supply.off_current_a.as_ref(),
                    "off_current_a",
                    0.0,
                    5.0,
                    d.supply.off_current_a,
                )?,
                meter_holds: self.supply.meter_holds,
            },
            caches_identity,
            start: StartFaults {
                late_every: count(self.start.late_every.as_ref(), "late_every")?,
                late_s: number(self.start.late_ms.as_ref(), "late_ms", 0.0, 60_000.0, 0.0)? * 1e-3,
                hangs_every: count(self.start.hangs_every.as_ref(), "hangs_every")?,
                swapped_after: count(swapped_after.as_ref(), "swapped_after")?,
            },
            rails: Rails {
                v5_v: number(self.rails.v5_v.as_ref(), "v5_v", 0.0, 6.0, d.rails.v5_v)?,
                v3v3_v: number(self.rails.v3v3_v.as_ref(), "v3v3_v", 0.0, 6.0, d.rails.v3v3_v)?,
                v1v2_v: number(self.rails.v1v2_v.as_ref(), "v1v2_v", 0.0, 6.0, d.rails.v1v2_v)?,
            },
            cpu: self.cpu.check()?,
            timers: TimerModel {
                rate_error_ppm: number(
                    self.timers.rate_error_ppm.as_ref(),
                    "rate_error_ppm",
                    -5e5,
                    5e5,
                    d.timers.rate_error_ppm,
                )?,
                jitter_ns: number(self.timers.jitter_ns.as_ref(), "jitter_ns", 0.0, 1e6, d.timers.jitter_ns)?,
                miss_every: count(self.timers.miss_every.as_ref(), "miss_every")?,
            },
            internal_ram: self.internal_ram.check(INTERNAL_WORDS, 16)?,
            sdram: self.sdram.check(SDRAM_WORDS, 32)?,
            spi_flash: self.spi_flash.check(&SPI_FLASH)?,
            internal_flash: self.internal_flash.check(&INTERNAL_FLASH)?,
            sensors: SensorModels {
                gyro: self.gyro.model(d.sensors.gyro, 1.0 / 3600.0)?,
                accel: self.accel.model(d.sensors.accel, 1e-3)?,
                mag: self.mag.model(d.sensors.mag, 1.0)?,
                ..d.sensors
            },
            sensor_faults: SensorFaults {
                gyro: self.gyro.faults(1.0 / 3600.0)?,
                accel: self.accel.faults(1e-3)?,
                mag: self.mag.faults(1.0)?,
                mag_y_skew_us: number(self.mag.y_skew_us.as_ref(), "y_skew_us", -1e6, 1e6, 0.0)?,
                vibrations: vibrations(&self.vibration)?,
                failed_reads: self.imu.failed_reads.as_ref().map(raw::FailedReads::check).transpose()?,
            },
            calibration: self.calibration.check()?,
            gnss: self.gnss.check()?,
            playback: self.gnss.playback(load)?,
            unwired_switches: self.ad.check()?,
            lines: self.io.check(&self.spi)?,
            sci: SciFaults {
                lose_every: count(self.sci.lose_every.as_ref(), "lose_every")?,
                flip_every: count(self.sci.flip_every.as_ref(), "flip_every")?,
            },
            can: CanFaults {
                flip_every: count(self.can.flip_every.as_ref(), "flip_every")?,
                swap_every: count(self.can.swap_every.as_ref(), "swap_every")?,
                tx_error_every: count(self.can.tx_error_every.as_ref(), "tx_error_every")?,
                bus_off_after: count(self.can.bus_off_after.as_ref(), "bus_off_after")?,
            },
            wire: self.wire.check()?,
            can_wire: self.can_wire.check()?,
            turntable: self.turntable.check(d.turntable)?,
            reboot: self.reboot.map(raw::Reboot::check).transpose()?,
        })
    }
}

impl raw::Cpu {
    fn check(&self) -> Result<CpuFaults, Mistake> {
        let mut faults = CpuFaults::default();
        for core in &self.dead_cores {
            faults.dead[usize::from(small(core, "core", 1, 2)? - 1)] = true;
        }
        let bit = self.multiplier_bit_of_core_2.as_ref();
        faults.multiplier_bit = bit.map(|bit| small(bit, "bit", 0, 31)).transpose()?;
        Ok(faults)
    }
}

impl raw::Memory {
    fn check(&self, words: u32, width: u8) -> Result<MemoryFaults, Mistake> {
        let last_line = (words.ilog2() - 1) as u8;
        let cell = |cell: &raw::Cell| {
            let place = integer(&cell.index, "index", 0, words - 1)?;
            Ok((place, small(&cell.bit, "bit", 0, width - 1)?, level(&cell.level)?))
        };
        let stuck_line = |line: &raw::StuckLine, high| Ok((small(&line.line, "line", 0, high)?, level(&line.level)?));
        let coupled = |pair: &raw::Coupling| {
            let aggressor = integer(&pair.aggressor, "aggressor", 0, words - 1)?;
            let victim = integer(&pair.victim, "victim", 0, words - 1)?;
            if aggressor == victim {
                return Err(mistake(&pair.victim, format!("cell {victim} cannot couple with itself")));
            }
            Ok((aggressor, victim, small(&pair.bit, "bit", 0, width - 1)?))
        };
        let shorted = self.shorted_address_lines.as_ref();
        Ok(MemoryFaults {
            stuck_data_line: self.stuck_data_line.as_ref().map(|line| stuck_line(line, width - 1)).transpose()?,
            stuck_address_line: self.stuck_address_line.as_ref().map(|line| stuck_line(line, last_line)).transpose()?,
            shorted_address_lines: shorted.map(|pair| line_pair(pair, "address line", last_line)).transpose()?,
            stuck_cells: self.stuck_cells.iter().map(cell).collect::<Result<_, _>>()?,
            coupled_cells: self.coupled_cells.iter().map(coupled).collect::<Result<_, _>>()?,
        })
    }
}

impl raw::Flash {
    fn check(&self, part: &FlashPart) -> Result<FlashFaults, Mistake> {
        let bad_bit = |bad: &raw::BadBit| {
            let sector = integer(&bad.sector, "sector", 0, u32::from(part.scratch_sectors) - 1)?;
            Ok(BadBit {
                sector: u16::try_from(sector).unwrap_or(0),
                word: integer(&bad.word, "word", 0, part.sector_bytes / 4 - 1)?,
                bit: small(&bad.bit, "bit", 0, 31)?,
                level: level(&bad.level)?,
            })
        };
        Ok(FlashFaults {
            bad_bits: self.bad_bits.iter().map(bad_bit).collect::<Result<_, _>>()?,
            erase_factor: number(self.erase_factor.as_ref(), "erase_factor", 0.01, 1000.0, 1.0)?,
        })
    }
}

impl raw::Calibration {
    fn check(&self) -> Result<CalibrationFaults, Mistake> {
        // The coefficients take 300 bytes.
        let lost = |lost: &raw::LostBit| {
            let byte = integer(&lost.byte, "byte", 0, 299)?;
            Ok(LostBit {
                byte: u16::try_from(byte).unwrap_or(0),
                bit: small(&lost.bit, "bit", 0, 7)?,
                after_power_cycle: lost.after_power_cycle,
            })
        };
        Ok(CalibrationFaults { lost_bit: self.lost_bit.as_ref().map(lost).transpose()?, transposed: self.transposed })
    }
}

impl raw::Gnss {
    fn check(&self) -> Result<GnssFaults, Mistake> {
        let metres = |value: Option<&Spanned<f64>>, name| number(value, name, -1e6, 1e6, 0.0);
        let covered = self.covered_after_fix_s.as_ref();
        Ok(GnssFaults {
            no_sky: self.no_sky,
            antenna_offset_m: (
                metres(self.repeater_north_m.as_ref(), "repeater_north_m")?,
                metres(self.repeater_east_m.as_ref(), "repeater_east_m")?,
            ),
            covered_after_fix_s: covered
                .map(|after| number(Some(after), "covered_after_fix_s", 0.0, 1e6, 0.0))
                .transpose()?,
            pps_open: self.pps_open,
            pps_jitter_s: number(self.pps_jitter_ns.as_ref(), "pps_jitter_ns", 0.0, 1e4, 0.0)? * 1e-9,
        })
    }
}

impl raw::Gnss {
    fn playback(&self, load: Load<'_>) -> Result<Option<Playback>, Mistake> {
        let epochs_hz = number(self.playback_hz.as_ref(), "playback_hz", 0.01, EPOCHS_HZ, 1.0)?;
        let Some(name) = &self.playback else {
            return match &self.playback_hz {
                Some(pace) => Err(mistake(pace, "playback_hz has no playback beside it".to_owned())),
                None => Ok(None),
            };
        };
        let refused = |why: String| Mistake {
            moot: self.playback_hz.as_ref().map(Spanned::span),
            ..mistake(name, format!("playback = \"{}\": {why}", name.get_ref()))
        };
        let log = load(name.get_ref()).map_err(refused)?;
        if log.len() > LONGEST {
            return Err(refused(format!("the log is longer than {LONGEST} bytes")));
        }
        let recording = Recording::new(&log).ok_or_else(|| refused("the log says nothing".to_owned()))?;
        Ok(Some(Playback { recording: Arc::new(recording), epochs_hz }))
    }
}

impl raw::Ad {
    fn check(&self) -> Result<[bool; 5], Mistake> {
        let mut unwired = [false; 5];
        for switch in &self.unwired_switches {
            unwired[usize::from(small(switch, "switch", 1, 5)? - 1)] = true;
        }
        Ok(unwired)
    }
}

impl raw::Io {
    fn check(&self, spi: &raw::Spi) -> Result<LineFaults, Mistake> {
        let stuck = |stuck: &raw::StuckLine| Ok((small(&stuck.line, "line", 0, 3)?, level(&stuck.level)?));
        Ok(LineFaults {
            shorted: self.shorted.iter().map(|pair| line_pair(pair, "line", 3)).collect::<Result<_, _>>()?,
            open: self.open.iter().map(|line| small(line, "line", 0, 3)).collect::<Result<_, _>>()?,
            stuck: self.stuck.iter().map(stuck).collect::<Result<_, _>>()?,
            flip_every_bits: count(spi.flip_every_bits.as_ref(), "flip_every_bits")?,
        })
    }
}

impl raw::Wire {
    fn check(&self) -> Result<WireFaults, Mistake> {
        Ok(WireFaults {
            to_host: self.to_host.as_ref().unwrap_or(&self.both).check()?,
            to_board: self.to_board.as_ref().unwrap_or(&self.both).check()?,
            can_lose_every: count(self.can_lose_every.as_ref(), "can_lose_every")?,
        })
    }
}

impl raw::Along {
    fn check(&self) -> Result<WireRates, Mistake> {
        let share = |value: &Option<Spanned<f64>>, name| number(value.as_ref(), name, 0.0, 1e6, 0.0);
        let span = |value: &Option<Spanned<f64>>, name| number(value.as_ref(), name, 0.0, 60_000.0, 0.0);
        Ok(WireRates {
            lost_bytes: share(&self.lost_bytes_per_million, "lost_bytes_per_million")?,
            lost_byte_at: count(self.lost_byte_at.as_ref(), "lost_byte_at")?,
            flipped_bits: share(&self.flipped_bits_per_million, "flipped_bits_per_million")?,
            lost_frames: share(&self.lost_frames_per_million, "lost_frames_per_million")?,
            cut_frames: share(&self.cut_frames_per_million, "cut_frames_per_million")?,
            doubled_frames: share(&self.doubled_frames_per_million, "doubled_frames_per_million")?,
            overtaken_frames: share(&self.overtaken_frames_per_million, "overtaken_frames_per_million")?,
            delayed_frames: share(&self.delayed_frames_per_million, "delayed_frames_per_million")?,
            delay_ms: span(&self.delay_ms, "delay_ms")?,
            stalled_frames: share(&self.stalled_frames_per_million, "stalled_frames_per_million")?,
            stall_ms: span(&self.stall_ms, "stall_ms")?,
            babbled_frames: share(&self.babbled_frames_per_million, "babbled_frames_per_million")?,
            echoed_frames: share(&self.echoed_frames_per_million, "echoed_frames_per_million")?,
        })
    }
}

impl raw::CanWire {
    fn check(&self) -> Result<CanWireFaults, Mistake> {
        Ok(CanWireFaults {
            to_host: self.to_host.as_ref().unwrap_or(&self.both).check()?,
            to_board: self.to_board.as_ref().unwrap_or(&self.both).check()?,
        })
    }
}

impl raw::CanDirection {
    fn check(&self) -> Result<CanRates, Mistake> {
        let share = |value: &Option<Spanned<f64>>, name| number(value.as_ref(), name, 0.0, 1e6, 0.0);
        let span = |value: &Option<Spanned<f64>>, name| number(value.as_ref(), name, 0.0, 60_000.0, 0.0);
        Ok(CanRates {
            lost_frames: share(&self.lost_frames_per_million, "lost_frames_per_million")?,
            lost_bursts: share(&self.lost_bursts_per_million, "lost_bursts_per_million")?,
            flipped_frames: share(&self.flipped_frames_per_million, "flipped_frames_per_million")?,
            doubled_frames: share(&self.doubled_frames_per_million, "doubled_frames_per_million")?,
            overtaken_frames: share(&self.overtaken_frames_per_million, "overtaken_frames_per_million")?,
            delayed_frames: share(&self.delayed_frames_per_million, "delayed_frames_per_million")?,
            delay_ms: span(&self.delay_ms, "delay_ms")?,
            stalled_frames: share(&self.stalled_frames_per_million, "stalled_frames_per_million")?,
            stall_ms: span(&self.stall_ms, "stall_ms")?,
            babbled_frames: share(&self.babbled_frames_per_million, "babbled_frames_per_million")?,
        })
    }
}

impl raw::Reboot {
    fn check(self) -> Result<RebootTrigger, Mistake> {
        let on = match self.on {
            None => None,
            Some(on) if DEVICES.contains(&on.get_ref().as_str()) => Some(on.into_inner()),
            Some(on) => {
                let message = format!("\"{}\" is not one of {}", on.get_ref(), DEVICES.join(", "));
                return Err(mistake(&on, message));
            }
        };
        let at = self.at_board_time_s.as_ref();
        Ok(RebootTrigger {
            on,
            nth: self.nth.map(|nth| integer(&nth, "nth", 1, u32::MAX)).transpose()?,
            after_ms: number(self.after_ms.as_ref(), "after_ms", 0.0, 1e6, 0.0)?,
            at_board_time_s: at.map(|at| number(Some(at), "at_board_time_s", 0.0, 1e6, 0.0)).transpose()?,
        })
    }
}
