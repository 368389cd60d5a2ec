//! Personalities: what a board and its module are like, as TOML.
//!
//! A personality says how the world, the devices and the wire differ from those of a good module; a file that says
//! nothing is a good module. `[expect.PLAN]` tables say for people and for tests how a plan should end; the bench
//! carries them and never looks at them.

use std::collections::BTreeMap;
use std::ops::Range;

use nalgebra::Vector3;
use serde::Deserialize;
use toml::Spanned;

use crate::boards::BOARDS;
use crate::devices::ad::Rails;
use crate::devices::cpu::CpuFaults;
use crate::devices::flash::{BadBit, FlashFaults, FlashPart, INTERNAL_FLASH, SPI_FLASH};
use crate::devices::gnss::GnssFaults;
use crate::devices::inertial::{SensorFaults, SensorModels, TriadFaults, TriadModel};
use crate::devices::lines::LineFaults;
use crate::devices::memory::MemoryFaults;
use crate::devices::sci::SciFaults;
use crate::devices::timer::TimerModel;
use crate::module::{INTERNAL_WORDS, SDRAM_WORDS, SupplyModel};
use crate::world::Axis;

/// A personality, checked.
#[derive(Debug, Clone, PartialEq)]
pub struct Personality {
    /// Its name: the file's, without `.toml`.
    pub name: String,
    /// What it is, for people.
    pub description: String,
    /// How plans should end with it, by the plan's name.
    pub expect: BTreeMap<String, Expectation>,
    pub(crate) model: Model,
}

/// How a plan should end with a personality.
#[derive(Debug, Clone, PartialEq, Eq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Expectation {
    /// An outcome in the records' words: passed, failed, errored.
    pub outcome: String,
    /// The items that do not pass.
    #[serde(default)]
    pub items: Vec<String>,
}

/// Why a text is no personality.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{name}:{line}:{column}: {message}")]
pub struct PersonalityError {
    /// Name of the personality.
    pub name: String,
    /// Line, from 1.
    pub line: usize,
    /// Column, from 1, in characters.
    pub column: usize,
    /// What is wrong.
    pub message: String,
}

/// When the board restarts by itself.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct RebootTrigger {
    pub(crate) on: Option<String>,
    pub(crate) nth: Option<u32>,
    pub(crate) after_ms: f64,
    pub(crate) at_board_time_s: Option<f64>,
}

/// Faults of the line between board and host.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct WireFaults {
    pub(crate) silent: bool,
    pub(crate) answer_delay_ms: f64,
    pub(crate) lost_to_host_per_million: f64,
    pub(crate) lost_to_board_per_million: f64,
}

/// Everything about board and module that a personality may set.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Model {
    pub(crate) serial_number: Option<String>,
    pub(crate) part: String,
    pub(crate) hardware: String,
    pub(crate) firmware: String,
    pub(crate) protocol: u8,
    pub(crate) board_serial: String,
    pub(crate) board_firmware: String,
    pub(crate) clock_error_ppm: f64,
    pub(crate) supply: SupplyModel,
    pub(crate) rails: Rails,
    pub(crate) cpu: CpuFaults,
    pub(crate) timers: TimerModel,
    pub(crate) internal_ram: MemoryFaults,
    pub(crate) sdram: MemoryFaults,
    pub(crate) spi_flash: FlashFaults,
    pub(crate) internal_flash: FlashFaults,
    pub(crate) sensors: SensorModels,
    pub(crate) sensor_faults: SensorFaults,
    pub(crate) gnss: GnssFaults,
    pub(crate) unwired_switches: [bool; 5],
    pub(crate) lines: LineFaults,
    pub(crate) sci: SciFaults,
    pub(crate) wire: WireFaults,
    pub(crate) reboot: Option<RebootTrigger>,
}

/// Names of devices that a trigger may wait for.
const DEVICES: [&str; 14] = [
    "power",
    "identity",
    "cpu",
    "timers",
    "internal-ram",
    "sdram",
    "spi-flash",
    "internal-flash",
    "imu",
    "gnss",
    "ad",
    "io",
    "spi",
    "sci",
];

impl Personality {
    /// The good module that the bench has in its socket unless told otherwise.
    #[must_use]
    pub fn good() -> Self {
        let (name, text) = BOARDS[0];
        // A test holds every embedded personality to be well formed; without a text it is good anyway.
        Self::from_toml(name, text).unwrap_or_else(|_| Self {
            name: name.to_owned(),
            description: String::new(),
            expect: BTreeMap::new(),
            model: Model::default(),
        })
    }

    /// An embedded personality by its name.
    #[must_use]
    pub fn named(name: &str) -> Option<Self> {
        let (name, text) = BOARDS.iter().find(|(known, _)| *known == name)?;
        Self::from_toml(name, text).ok()
    }

    /// Reads a personality.
    ///
    /// # Errors
    /// [`PersonalityError`] for a text that is not TOML, has keys unknown here or values out of their range.
    pub fn from_toml(name: &str, text: &str) -> Result<Self, PersonalityError> {
        let at = |offset: usize, message: &str| {
            let before = text.get(..offset).unwrap_or(text);
            let line_start = before.rfind('\n').map_or(0, |newline| newline + 1);
            PersonalityError {
                name: name.to_owned(),
                line: before.matches('\n').count() + 1,
                column: before[line_start..].chars().count() + 1,
                message: message.trim().replace('\n', "; "),
            }
        };
        let raw: raw::Personality =
            toml::from_str(text).map_err(|error| at(error.span().map_or(0, |span| span.start), error.message()))?;
        let raw::Personality { description, expect, .. } = &raw;
        let (description, expect) = (description.clone(), expect.clone());
        let model = raw.check().map_err(|Mistake { span, message }| at(span.start, &message))?;
        Ok(Self { name: name.to_owned(), description, expect, model })
    }
}

/// The personalities in this library: name and text, the good module first.
#[must_use]
pub fn boards() -> &'static [(&'static str, &'static str)] {
    BOARDS
}

impl Default for Model {
    fn default() -> Self {
        Self {
            serial_number: None,
            part: "GNC-POP-26".to_owned(),
            hardware: "C".to_owned(),
            firmware: "1.4.0".to_owned(),
            protocol: 1,
            board_serial: "SIM-BOARD-1".to_owned(),
            board_firmware: "sim 1.0.0".to_owned(),
            clock_error_ppm: 3.0,
            supply: SupplyModel::default(),
            rails: Rails::default(),
            cpu: CpuFaults::default(),
            timers: TimerModel::default(),
            internal_ram: MemoryFaults::default(),
            sdram: MemoryFaults::default(),
            spi_flash: FlashFaults::default(),
            internal_flash: FlashFaults::default(),
            sensors: SensorModels::default(),
            sensor_faults: SensorFaults::default(),
            gnss: GnssFaults::default(),
            unwired_switches: [false; 5],
            lines: LineFaults::default(),
            sci: SciFaults::default(),
            wire: WireFaults::default(),
            reboot: None,
        }
    }
}

/// A value that a personality must not have, and where it stands.
#[derive(Debug)]
struct Mistake {
    span: Range<usize>,
    message: String,
}

fn mistake<T>(value: &Spanned<T>, message: String) -> Mistake {
    Mistake { span: value.span(), message }
}

fn number(value: Option<&Spanned<f64>>, name: &str, low: f64, high: f64, default: f64) -> Result<f64, Mistake> {
    let Some(spanned) = value else { return Ok(default) };
    let number = *spanned.get_ref();
    // A NaN lies in no range.
    if number >= low && number <= high {
        return Ok(number);
    }
    Err(mistake(spanned, format!("{name} {number} is not in {low} to {high}")))
}

fn integer(value: &Spanned<u32>, name: &str, low: u32, high: u32) -> Result<u32, Mistake> {
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

fn axis(value: &Spanned<String>) -> Result<Axis, Mistake> {
    match value.get_ref().as_str() {
        "x" => Ok(Axis::X),
        "y" => Ok(Axis::Y),
        "z" => Ok(Axis::Z),
        other => Err(mistake(value, format!("axis \"{other}\" is not one of x, y, z"))),
    }
}

fn axes(values: &[Spanned<String>]) -> Result<[bool; 3], Mistake> {
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
    fn check(self) -> Result<Model, Mistake> {
        let d = Model::default();
        let raw::Module { serial_number, part, hardware, firmware, protocol } = self.module;
        let raw::Board { serial, firmware: board_firmware, clock_error_ppm } = self.board;
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
            clock_error_ppm: number(clock_error_ppm.as_ref(), "clock_error_ppm", -1e4, 1e4, d.clock_error_ppm)?,
            supply: SupplyModel {
                voltage_v: number(self.supply.voltage_v.as_ref(), "voltage_v", 0.0, 12.0, d.supply.voltage_v)?,
                current_a: number(self.supply.current_a.as_ref(), "current_a", 0.0, 5.0, d.supply.current_a)?,
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
                ..d.sensors
            },
            sensor_faults: SensorFaults {
                gyro: self.gyro.faults()?,
                accel: self.accel.faults()?,
                mag: self.mag.faults()?,
            },
            gnss: self.gnss.check()?,
            unwired_switches: self.ad.check()?,
            lines: self.io.check(&self.spi)?,
            sci: SciFaults {
                lose_every: count(self.sci.lose_every.as_ref(), "lose_every")?,
                flip_every: count(self.sci.flip_every.as_ref(), "flip_every")?,
            },
            wire: self.wire.check()?,
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

impl raw::Triad {
    fn model(&self, default: TriadModel, unit: f64) -> Result<TriadModel, Mistake> {
        match (&self.bias_stability, &self.bias_repeatability) {
            (None, None) => Ok(default),
            (Some(stability), Some(repeatability)) => {
                let stability = number(Some(stability), "bias_stability", 0.0, 1e6, 0.0)?;
                let repeatability = number(Some(repeatability), "bias_repeatability", 0.0, 1e6, 0.0)?;
                Ok(default.with_published(stability * unit, repeatability * unit))
            }
            (Some(alone), None) | (None, Some(alone)) => {
                let message = "bias_stability and bias_repeatability belong together: the noise follows from both";
                Err(mistake(alone, message.to_owned()))
            }
        }
    }

    fn faults(&self) -> Result<TriadFaults, Mistake> {
        let mut offset = Vector3::zeros();
        if let Some(values) = &self.offset {
            for (axis, value) in values.iter().enumerate() {
                offset[axis] = number(Some(value), "offset", -1e4, 1e4, 0.0)?;
            }
        }
        let swapped = match &self.swapped_axes {
            None => None,
            Some([one, other]) => {
                let pair = (axis(one)?, axis(other)?);
                if pair.0 == pair.1 {
                    return Err(mistake(other, "an axis cannot be swapped with itself".to_owned()));
                }
                Some(pair)
            }
        };
        Ok(TriadFaults {
            stuck: axes(&self.stuck_axes)?,
            dead: axes(&self.dead_axes)?,
            swapped,
            noise_factor: number(self.noise_factor.as_ref(), "noise_factor", 0.0, 1e6, 1.0)?,
            offset,
        })
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
        })
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
        let share = |value: Option<&Spanned<f64>>, name| number(value, name, 0.0, 1e6, 0.0);
        Ok(WireFaults {
            silent: self.silent,
            answer_delay_ms: number(self.answer_delay_ms.as_ref(), "answer_delay_ms", 0.0, 60_000.0, 0.0)?,
            lost_to_host_per_million: share(self.lost_to_host_per_million.as_ref(), "lost_to_host_per_million")?,
            lost_to_board_per_million: share(self.lost_to_board_per_million.as_ref(), "lost_to_board_per_million")?,
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

/// The file as written, before anything is checked.
mod raw {
    use super::{BTreeMap, Deserialize, Expectation, Spanned};

    #[derive(Debug, Default, Deserialize)]
    #[serde(deny_unknown_fields, default)]
    pub(super) struct Personality {
        pub(super) description: String,
        pub(super) expect: BTreeMap<String, Expectation>,
        pub(super) module: Module,
        pub(super) board: Board,
        pub(super) supply: Supply,
        pub(super) rails: Rails,
        pub(super) cpu: Cpu,
        pub(super) timers: Timers,
        pub(super) internal_ram: Memory,
        pub(super) sdram: Memory,
        pub(super) spi_flash: Flash,
        pub(super) internal_flash: Flash,
        pub(super) gyro: Triad,
        pub(super) accel: Triad,
        pub(super) mag: Triad,
        pub(super) gnss: Gnss,
        pub(super) ad: Ad,
        pub(super) io: Io,
        pub(super) spi: Spi,
        pub(super) sci: Sci,
        pub(super) wire: Wire,
        pub(super) reboot: Option<Reboot>,
    }

    #[derive(Debug, Default, Deserialize)]
    #[serde(deny_unknown_fields, default)]
    pub(super) struct Module {
        pub(super) serial_number: Option<Spanned<String>>,
        pub(super) part: Option<Spanned<String>>,
        pub(super) hardware: Option<Spanned<String>>,
        pub(super) firmware: Option<Spanned<String>>,
        pub(super) protocol: Option<Spanned<u32>>,
    }

    #[derive(Debug, Default, Deserialize)]
    #[serde(deny_unknown_fields, default)]
    pub(super) struct Board {
        pub(super) serial: Option<Spanned<String>>,
        pub(super) firmware: Option<Spanned<String>>,
        pub(super) clock_error_ppm: Option<Spanned<f64>>,
    }

    #[derive(Debug, Default, Deserialize)]
    #[serde(deny_unknown_fields, default)]
    pub(super) struct Supply {
        pub(super) voltage_v: Option<Spanned<f64>>,
        pub(super) current_a: Option<Spanned<f64>>,
    }

    #[derive(Debug, Default, Deserialize)]
    #[serde(deny_unknown_fields, default)]
    pub(super) struct Rails {
        pub(super) v5_v: Option<Spanned<f64>>,
        pub(super) v3v3_v: Option<Spanned<f64>>,
        pub(super) v1v2_v: Option<Spanned<f64>>,
    }

    #[derive(Debug, Default, Deserialize)]
    #[serde(deny_unknown_fields, default)]
    pub(super) struct Cpu {
        pub(super) dead_cores: Vec<Spanned<u32>>,
        pub(super) multiplier_bit_of_core_2: Option<Spanned<u32>>,
    }

    #[derive(Debug, Default, Deserialize)]
    #[serde(deny_unknown_fields, default)]
    pub(super) struct Timers {
        pub(super) rate_error_ppm: Option<Spanned<f64>>,
        pub(super) jitter_ns: Option<Spanned<f64>>,
        pub(super) miss_every: Option<Spanned<u32>>,
    }

    #[derive(Debug, Default, Deserialize)]
    #[serde(deny_unknown_fields, default)]
    pub(super) struct Memory {
        pub(super) stuck_data_line: Option<StuckLine>,
        pub(super) stuck_address_line: Option<StuckLine>,
        pub(super) shorted_address_lines: Option<[Spanned<u32>; 2]>,
        pub(super) stuck_cells: Vec<Cell>,
        pub(super) coupled_cells: Vec<Coupling>,
    }

    #[derive(Debug, Deserialize)]
    #[serde(deny_unknown_fields)]
    pub(super) struct StuckLine {
        pub(super) line: Spanned<u32>,
        pub(super) level: Spanned<u32>,
    }

    #[derive(Debug, Deserialize)]
    #[serde(deny_unknown_fields)]
    pub(super) struct Cell {
        pub(super) index: Spanned<u32>,
        pub(super) bit: Spanned<u32>,
        pub(super) level: Spanned<u32>,
    }

    #[derive(Debug, Deserialize)]
    #[serde(deny_unknown_fields)]
    pub(super) struct Coupling {
        pub(super) aggressor: Spanned<u32>,
        pub(super) victim: Spanned<u32>,
        pub(super) bit: Spanned<u32>,
    }

    #[derive(Debug, Default, Deserialize)]
    #[serde(deny_unknown_fields, default)]
    pub(super) struct Flash {
        pub(super) bad_bits: Vec<BadBit>,
        pub(super) erase_factor: Option<Spanned<f64>>,
    }

    #[derive(Debug, Deserialize)]
    #[serde(deny_unknown_fields)]
    pub(super) struct BadBit {
        pub(super) sector: Spanned<u32>,
        pub(super) word: Spanned<u32>,
        pub(super) bit: Spanned<u32>,
        pub(super) level: Spanned<u32>,
    }

    /// Three sensors. Units: gyro deg/s with stability and repeatability in deg/h; accel g with those in mg; mag
    /// gauss, without them.
    #[derive(Debug, Default, Deserialize)]
    #[serde(deny_unknown_fields, default)]
    pub(super) struct Triad {
        #[serde(alias = "bias_stability_dph", alias = "bias_stability_mg")]
        pub(super) bias_stability: Option<Spanned<f64>>,
        #[serde(alias = "bias_repeatability_dph", alias = "bias_repeatability_mg")]
        pub(super) bias_repeatability: Option<Spanned<f64>>,
        pub(super) stuck_axes: Vec<Spanned<String>>,
        pub(super) dead_axes: Vec<Spanned<String>>,
        pub(super) swapped_axes: Option<[Spanned<String>; 2]>,
        pub(super) noise_factor: Option<Spanned<f64>>,
        #[serde(alias = "offset_dps", alias = "offset_g", alias = "offset_gauss")]
        pub(super) offset: Option<[Spanned<f64>; 3]>,
    }

    #[derive(Debug, Default, Deserialize)]
    #[serde(deny_unknown_fields, default)]
    pub(super) struct Gnss {
        pub(super) no_sky: bool,
        pub(super) repeater_north_m: Option<Spanned<f64>>,
        pub(super) repeater_east_m: Option<Spanned<f64>>,
        pub(super) covered_after_fix_s: Option<Spanned<f64>>,
        pub(super) pps_open: bool,
    }

    #[derive(Debug, Default, Deserialize)]
    #[serde(deny_unknown_fields, default)]
    pub(super) struct Ad {
        pub(super) unwired_switches: Vec<Spanned<u32>>,
    }

    #[derive(Debug, Default, Deserialize)]
    #[serde(deny_unknown_fields, default)]
    pub(super) struct Io {
        pub(super) shorted: Vec<[Spanned<u32>; 2]>,
        pub(super) open: Vec<Spanned<u32>>,
        pub(super) stuck: Vec<StuckLine>,
    }

    #[derive(Debug, Default, Deserialize)]
    #[serde(deny_unknown_fields, default)]
    pub(super) struct Spi {
        pub(super) flip_every_bits: Option<Spanned<u32>>,
    }

    #[derive(Debug, Default, Deserialize)]
    #[serde(deny_unknown_fields, default)]
    pub(super) struct Sci {
        pub(super) lose_every: Option<Spanned<u32>>,
        pub(super) flip_every: Option<Spanned<u32>>,
    }

    #[derive(Debug, Default, Deserialize)]
    #[serde(deny_unknown_fields, default)]
    pub(super) struct Wire {
        pub(super) silent: bool,
        pub(super) answer_delay_ms: Option<Spanned<f64>>,
        pub(super) lost_to_host_per_million: Option<Spanned<f64>>,
        pub(super) lost_to_board_per_million: Option<Spanned<f64>>,
    }

    #[derive(Debug, Default, Deserialize)]
    #[serde(deny_unknown_fields, default)]
    pub(super) struct Reboot {
        pub(super) on: Option<Spanned<String>>,
        pub(super) nth: Option<Spanned<u32>>,
        pub(super) after_ms: Option<Spanned<f64>>,
        pub(super) at_board_time_s: Option<Spanned<f64>>,
    }
}
