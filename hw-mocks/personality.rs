//! Personalities: TOML files that describe a board and its module.
//!
//! A personality says how the world, the devices and the wire differ from those of a good module; an empty file is a
//! good module. All mistakes of a file are reported at once, with line, column and a hint. A key with the unit of
//! another sensor is a mistake, and so is a key that changes nothing. `[expect.PLAN]` tables tell people and tests how
//! a plan should end; the bench carries them and never reads them. A file may hold the following keys; the name of a
//! key ends with its unit:
//!
//! ```
//! # let text = r#"
//! description = "Everything at once."
//!
//! [expect.functional]                  # ignored by the bench
//! outcome = "failed"
//! items = ["sdram"]
//! figures = ["mismatches_march_c"]
//!
//! [module]                             # what it says about itself
//! serial_number = "GNC-7"              # else the one that was scanned
//! part = "GNC-POP-26"
//! hardware = "C"
//! firmware = "1.4.0"
//! protocol = 1
//! swapped_after = 3                    # power-ons: another module is in the socket from then on; 0: never
//!
//! [board]                              # the slave board
//! serial = "SIM-BOARD-1"
//! firmware = "sim 1.0.0"
//! clock_error_ppm = 3.0                # of its oscillator, against true time: positive: too fast
//! clock_drift_ppm_per_h = 0.5          # it gets so much faster each hour
//! caches_identity = true               # it answers with what the module said before, without asking it
//! ## Keys by which the board breaks the interface document stand at the head of `personality/breaches.rs`.
//!
//! [sampling]                           # of the IMU's streams; a good board has its samples on the grid of its own clock
//! rate_error_ppm = 30.0                # the sensors have an oscillator of their own, so much too fast against the board's
//! counted_times = true                 # the times in frames are counted from the rate asked for, whatever the samples do
//! time_step = { at_s = 0.5, for_s = 0.2, step_us = -500 } # the times are off for a while in each stream
//!
//! [supply]                             # at the socket
//! voltage_v = 5.012
//! current_a = 0.487
//!
//! off_voltage_v = 1.9                  # with the switch off: something else feeds the module
//! off_current_a = 0.02
//! meter_holds = true                   # it never measures again after its first look at a module that is on
//!
//! [start]                              # of the module, when its supply comes on
//! late_every = 3                       # power-ons; it answers so much later than at the others
//! late_ms = 800.0
//! hangs_every = 3                      # power-ons; it does not start before the next one
//!
//! [heat]                               # of the module: its temperature goes to the room's, and with power above it
//! room_c = 23.0
//! rise_k = 5.0                         # above the room, with power
//! warm_up_s = 180.0                    # time constant
//!
//! [rails]                              # of the module; the 5 V rail is never above the supply
//! v5_v = 4.985
//! v3v3_v = 3.306
//! v1v2_v = 1.203
//!
//! [cpu]
//! dead_cores = [2]
//! multiplier_bit_of_core_2 = 3         # stays at 0
//!
//! [timers]
//! rate_error_ppm = 12.0                # positive: intervals too long
//! jitter_ns = 60.0
//! miss_every = 10                      # interrupts; 0: none is missed
//!
//! [sdram]                              # [internal_ram] alike
//! stuck_data_line = { line = 7, level = 0 }
//! stuck_address_line = { line = 14, level = 0 }
//! shorted_address_lines = [5, 12]
//! stuck_cells = [{ index = 40000, bit = 11, level = 0 }]
//! coupled_cells = [{ aggressor = 700000, victim = 700001, bit = 9 }]
//!
//! [spi_flash]                          # [internal_flash] alike
//! bad_bits = [{ sector = 0, word = 17, bit = 3, level = 0 }]
//! erase_factor = 10.0                  # times as long as usual
//!
//! [gyro]                               # [accel] alike: _mg for _dph, _g for _dps; [mag]: _gauss, and no key in _dph
//! bias_stability_dph = [4.5995, 5.12, 4.07] # of X, Y, Z, or one number for all; so with all that has such a unit
//! bias_repeatability_dph = 1.2403
//! turn_on_dph = [90.0, 0.8, 0.7]       # instead of what follows from the two
//! flicker_dph = [25.0, 0.4, 0.4]       # the same
//! drift_dph_per_h = [120.0, 0.0, 0.0]  # from each power-on on
//! wander_dph = [22.0, 0.0, 0.0]        # up and down, as a sine from each power-on on ...
//! wander_s = 60.0                      # ... of this period
//! scale_turn_on = [0.005, 0.0, 0.0]    # relative deviation of the scale factor from power-on to power-on
//! coupling_turn_on = 0.005             # deviation of the response of X to the Y axis, alike
//! deadband_dps = [0.03, 0.0, 0.0]      # smaller rates give nothing
//! step_dps = 0.0                       # the signal moves in such steps, under its noise
//! range_dps = [200.0, 0.0, 0.0]        # beyond it the code is the end of the converter; 0: the converter's own
//! response = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]] # rows are sensors
//! stuck_axes = ["x"]
//! dead_axes = ["y"]
//! swapped_axes = ["x", "z"]
//! noise_factor = 20.0
//! offset_dps = [0.0, 0.0, 1.0]
//! bandwidth_hz = 80.0                  # of the chip's low-pass; 0: none. Noise and motion pass it
//! bandwidth_order = 2                  # or 1; without it as in a good module, where there is one, else 2
//! update_rate_hz = 100.0               # a stream that reads more often finds the last conversion again
//! bias_per_k_dph = 2.88                # of all three
//! response_per_k = 3e-5                # relative
//! noise_per_k = [0.01, 0.0, 0.0]       # the white noise grows by the exponential of this a kelvin; as it is at 25 degC
//! clip_low_dps = -inf                  # the converter ends there; inf is none
//! clip_high_dps = [inf, 150.0, inf]
//! spikes = { share = 1e-4, size_dps = 50.0, axis = "x" } # one in each 10,000 conversions; without an axis any of three
//! failed_reads = { share = 0.001, code = 0 } # of this chip, all its channels at once; or -1, 8388607, -8388608
//!
//! [imu]                                # gyroscopes, accelerometers and magnetometer are a chip each; this is their bus
//! failed_reads = { share = 0.001, code = -1 } # of all three at once
//!
//! [[vibration]]                        # what shakes the module: sines, in phase in all that feel them; at most four
//! frequency_hz = 87.0
//! rate_dps = [0.0, 0.0, 0.5]           # amplitudes along its axes
//! force_g = [0.1, 0.0, 0.0]
//! field_gauss = [0.0, 0.0, 0.0]
//!
//! [calibration]
//! lost_bit = { byte = 100, bit = 3, after_power_cycle = true } # of every one that is stored
//! transposed = true                    # the firmware compensates by the matrices' columns
//!
//! [mag]
//! y_skew_us = 1000.0                   # Y is sampled so much later than X and Z
//!
//! [gnss]
//! no_sky = true
//! repeater_north_m = 500.0             # the signals are those of a place so far away
//! repeater_east_m = 0.0
//! covered_after_fix_s = 1.0
//! pps_open = true
//! pps_jitter_ns = 300.0                # deviation, beside the usual one
//! ## Or, in place of a sky, a log beside this file, NMEA or UBX, that the receiver plays from each start on:
//! ## playback = "lost-fix.nmea"
//! ## playback_hz = 1.0                  # its epochs a second, at most 5
//!
//! [ad]
//! unwired_switches = [2]
//!
//! [operator]
//! switches_on = [1, 2]                 # DIP switches that are on at the start
//! forgets_from = 2                     # from this request to set switches on ...
//! forgets = 1                          # ... so many are answered without touching a switch
//!
//! [io]
//! shorted = [[2, 3]]
//! open = [1]
//! stuck = [{ line = 0, level = 1 }]
//!
//! [spi]
//! flip_every_bits = 1000
//!
//! [sci]
//! lose_every = 200                     # bytes, with a framing error
//! flip_every = 300                     # bytes, unnoticed
//!
//! [can]
//! flip_every = 40                      # test frames with data, unnoticed
//! swap_every = 40                      # test frames: it goes after the next one
//! tx_error_every = 4                   # test frames: sent again, and counted
//! bus_off_after = 100                  # test frames
//!
//! [wire]
//! can_lose_every = 50                  # CAN frames towards the host
//!
//! [wire.both]                          # each way between host and board; chance comes from the seed
//! lost_bytes_per_million = 100.0
//! lost_byte_at = 40                    # of every frame that has so many, its delimiter counted
//! flipped_bits_per_million = 10.0
//! lost_frames_per_million = 1000.0
//! cut_frames_per_million = 1000.0      # the rest of the frame is lost
//! doubled_frames_per_million = 1000.0
//! overtaken_frames_per_million = 1000.0 # by one to three frames sent later
//! delayed_frames_per_million = 1000.0
//! delay_ms = 80.0                      # link time; what is sent later waits too
//! stalled_frames_per_million = 1000.0  # the line stands still in the middle of one
//! stall_ms = 300.0
//! babbled_frames_per_million = 1000.0  # garbage before them
//! echoed_frames_per_million = 1000.0   # they come back to their sender too
//!
//! [wire.to_host]                       # [wire.to_board] alike: stands for all of [wire.both] in this direction
//! lost_frames_per_million = 1e6
//!
//! [can_wire.both]                      # [can_wire.to_host], [can_wire.to_board] alike: each way between station and bus
//! lost_frames_per_million = 1000.0     # damaged ones too: controllers throw them away
//! lost_bursts_per_million = 1000.0     # it and up to 31 behind it: cuts messages
//! flipped_frames_per_million = 1000.0  # one bit, unnoticed by any controller; of messages alone
//! doubled_frames_per_million = 1000.0
//! overtaken_frames_per_million = 1000.0
//! delayed_frames_per_million = 1000.0
//! delay_ms = 80.0
//! stalled_frames_per_million = 1000.0
//! stall_ms = 300.0
//! babbled_frames_per_million = 1000.0  # one that nobody sent goes before it
//! [turntable]                          # its errors; what each means stands at `TableModel`
//! axis_error_arcsec = [6.0, -4.0]
//! heading_error_arcsec = 60.0
//! mounting_deg = [0.012, -0.018, 0.015]
//! attitude_error_arcsec = 4.0
//! repeatability_arcsec = 2.0
//! angle_error_ppm = 5.0
//! angle_error_arcsec = 2.0
//! rate_error_ppm = 20.0
//! wobble_arcsec = 2.0
//! field_mgauss = [0.15, -0.1, 0.2]
//! field_swing_ppm = 150.0
//! lever_arm_mm = [3.0, -2.0, 4.0]
//! slew_s = 6.0                         # to orient; 0: at once
//! ramp_share = 0.1                     # of the time of a turn, for each of its two ramps; 0.5: no steady rate between them
//!
//! [reboot]
//! on = "sdram"                         # at a request to this device ...
//! nth = 1                              # ... the first only; without it, each time
//! after_ms = 20.0                      # of board time
//! at_board_time_s = 60.0               # once, whatever runs
//! # "#;
//! # hw_mocks::Personality::from_toml("everything", text).unwrap();
//! ```

mod breaches;
mod checks;
mod clocks;
mod devices;
mod sensors;
mod table;
mod wires;

use std::collections::BTreeMap;
use std::path::Path;

use gnc_config::{Mistakes, SourceText, TomlTable};
use gnc_files::{Reach, Refused, is_refused};

use checks::{count, set, short_text, whole};
use sensors::{ACCEL, GYRO, MAG, TriadAsRead};

use crate::boards::BOARDS;
use crate::breaches::Breaches;
use crate::can_faults::CanWireFaults;
use crate::devices::ad::Rails;
use crate::devices::calibration::CalibrationFaults;
use crate::devices::can::CanFaults;
use crate::devices::cpu::CpuFaults;
use crate::devices::flash::{FlashFaults, INTERNAL_FLASH, SPI_FLASH};
use crate::devices::gnss::{GnssFaults, Playback};
use crate::devices::inertial::{SensorFaults, SensorModels};
use crate::devices::lines::LineFaults;
use crate::devices::memory::{INTERNAL_WORDS, MemoryFaults, SDRAM_WORDS};
use crate::devices::playback::LONGEST;
use crate::devices::sci::SciFaults;
use crate::devices::start::StartFaults;
use crate::devices::supply::SupplyModel;
use crate::devices::timer::TimerModel;
use crate::operator::OperatorFaults;
use crate::oscillator::Oscillator;
use crate::sampling::SamplingFaults;
use crate::turntable::TableModel;
use crate::wire_faults::WireFaults;
use crate::world::HeatModel;

/// A checked personality.
#[derive(Debug, Clone, PartialEq)]
pub struct Personality {
    /// Its name: the file name without `.toml`.
    pub name: String,
    /// A description for people.
    pub description: String,
    /// How plans should end with it, by the plan's name.
    pub expect: BTreeMap<String, Expectation>,
    pub(crate) model: PersonalityModel,
}

/// How a plan should end with a personality.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Expectation {
    /// An outcome in the words of the records: passed, failed, errored.
    pub outcome: String,
    /// The items that do not pass.
    pub items: Vec<String>,
    /// The measured figures that do not pass; empty if the items say all. The names belong to the plan and mean nothing
    /// here.
    pub figures: Vec<String>,
    /// Figures so near to their limit that chance decides: they and their items may pass or not.
    pub chance: Vec<String>,
}

/// When the board restarts by itself.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct RebootTrigger {
    pub(crate) on: Option<String>,
    pub(crate) nth: Option<u32>,
    pub(crate) after_ms: f64,
    pub(crate) at_board_time_s: Option<f64>,
}

/// Everything about board and module that a personality may set.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct PersonalityModel {
    pub(crate) serial_number: Option<String>,
    pub(crate) part: String,
    pub(crate) hardware: String,
    pub(crate) firmware: String,
    pub(crate) protocol: u8,
    pub(crate) board_serial: String,
    pub(crate) board_firmware: String,
    pub(crate) breaches: Breaches,
    pub(crate) oscillator: Oscillator,
    pub(crate) sampling: SamplingFaults,
    pub(crate) caches_identity: bool,
    pub(crate) supply: SupplyModel,
    pub(crate) heat: HeatModel,
    pub(crate) start: StartFaults,
    pub(crate) rails: Rails,
    pub(crate) cpu: CpuFaults,
    pub(crate) timers: TimerModel,
    pub(crate) internal_ram: MemoryFaults,
    pub(crate) sdram: MemoryFaults,
    pub(crate) spi_flash: FlashFaults,
    pub(crate) internal_flash: FlashFaults,
    pub(crate) sensors: SensorModels,
    pub(crate) sensor_faults: SensorFaults,
    pub(crate) calibration: CalibrationFaults,
    pub(crate) gnss: GnssFaults,
    pub(crate) playback: Option<Playback>,
    pub(crate) unwired_switches: [bool; 5],
    pub(crate) operator: OperatorFaults,
    pub(crate) lines: LineFaults,
    pub(crate) sci: SciFaults,
    pub(crate) can: CanFaults,
    pub(crate) wire: WireFaults,
    pub(crate) can_wire: CanWireFaults,
    pub(crate) turntable: TableModel,
    pub(crate) reboot: Option<RebootTrigger>,
}

impl Personality {
    /// The good module that the bench has in its socket unless told otherwise.
    #[must_use]
    pub fn good() -> Self {
        let (name, text) = BOARDS[0];
        // A test checks that every embedded personality is well formed. Without a readable text the module is good.
        Self::from_toml(name, text).unwrap_or_else(|_| Self {
            name: name.to_owned(),
            description: String::new(),
            expect: BTreeMap::new(),
            model: PersonalityModel::default(),
        })
    }

    /// An embedded personality by its name.
    #[must_use]
    pub fn named(name: &str) -> Option<Self> {
        let (name, text) = BOARDS.iter().find(|(known, _)| *known == name)?;
        Self::from_toml(name, text).ok()
    }

    /// Reads a personality that needs no other file.
    ///
    /// # Errors
    /// The first mistake of syntax; without one, all mistakes of content: unknown keys, wrong types, values out of
    /// range.
    pub fn from_toml(name: &str, text: &str) -> Result<Self, Mistakes> {
        Self::with_files(name, text, &mut |_| Err("files are read beside a board's own file only".to_owned()))
    }

    /// Reads a personality, and with `load` the files that it names. They lie beside the personality's own file.
    ///
    /// # Errors
    /// As [`Personality::from_toml`]; or a file cannot be read.
    pub fn with_files(name: &str, text: &str, load: Load<'_>) -> Result<Self, Mistakes> {
        let source = SourceText { name: name.to_owned(), text: text.to_owned() };
        gnc_config::read(&source, |root| Self {
            name: name.to_owned(),
            description: root.text("description").map(|(text, _)| text.to_owned()).unwrap_or_default(),
            expect: root.within("expect", expectations).unwrap_or_default(),
            model: PersonalityModel::read(root, load),
        })
    }
}

fn expectations(table: &TomlTable<'_, '_>) -> BTreeMap<String, Expectation> {
    let expectation = |table: &TomlTable<'_, '_>| {
        let names = |key| table.texts(key).into_iter().map(|(name, _)| name.to_owned()).collect();
        let outcome = table.required_text("outcome", "it may be passed, failed or errored");
        Expectation {
            outcome: outcome.map(|(text, _)| text.to_owned()).unwrap_or_default(),
            items: names("items"),
            figures: names("figures"),
            chance: names("chance"),
        }
    };
    // Each key is the name of a plan.
    let plans = table.entries().into_iter().map(|entry| entry.key().to_owned());
    plans.filter_map(|plan| Some((plan.clone(), table.within(plan, expectation)?))).collect()
}

impl PersonalityModel {
    fn read(root: &TomlTable<'_, '_>, load: Load<'_>) -> Self {
        let mut model = Self::default();
        root.within("module", |table| {
            model.serial_number = short_text(table, "serial_number", 64);
            set(&mut model.part, short_text(table, "part", 32));
            set(&mut model.hardware, short_text(table, "hardware", 32));
            set(&mut model.firmware, short_text(table, "firmware", 32));
            set(&mut model.protocol, table.entry("protocol").and_then(|entry| whole(&entry, (0, 255))));
            model.start.swapped_after = count(table, "swapped_after");
        });
        root.within("board", |table| {
            set(&mut model.board_serial, short_text(table, "serial", 32));
            set(&mut model.board_firmware, short_text(table, "firmware", 32));
            model.caches_identity = table.flag("caches_identity");
            model.oscillator = clocks::oscillator(table, model.oscillator);
            model.breaches = breaches::breaches(table);
        });
        let triad = |units, default| TriadAsRead::read(root, units, default);
        let gyro = triad(&GYRO, model.sensors.gyro);
        let accel = triad(&ACCEL, model.sensors.accel);
        let mag = triad(&MAG, model.sensors.mag);
        let memory = |key, words, width| root.within(key, |table| devices::memory(table, words, width));
        let flash = |key, part| root.within(key, |table| devices::flash(table, part));
        let (gnss, playback) = root.within("gnss", |table| devices::gnss(table, load)).unwrap_or_default();
        Self {
            sampling: root.within("sampling", clocks::sampling).unwrap_or_default(),
            supply: root.within("supply", devices::supply).unwrap_or_default(),
            start: StartFaults {
                swapped_after: model.start.swapped_after,
                ..root.within("start", devices::start).unwrap_or_default()
            },
            heat: root.within("heat", devices::heat).unwrap_or_default(),
            rails: root.within("rails", devices::rails).unwrap_or_default(),
            cpu: root.within("cpu", devices::cpu).unwrap_or_default(),
            timers: root.within("timers", devices::timers).unwrap_or_default(),
            internal_ram: memory("internal_ram", INTERNAL_WORDS, 16).unwrap_or_default(),
            sdram: memory("sdram", SDRAM_WORDS, 32).unwrap_or_default(),
            spi_flash: flash("spi_flash", &SPI_FLASH).unwrap_or_default(),
            internal_flash: flash("internal_flash", &INTERNAL_FLASH).unwrap_or_default(),
            sensors: SensorModels { gyro: gyro.model, accel: accel.model, mag: mag.model, ..model.sensors },
            sensor_faults: SensorFaults {
                gyro: gyro.faults,
                accel: accel.faults,
                mag: mag.faults,
                mag_y_skew_us: mag.y_skew_us,
                vibrations: sensors::vibrations(root),
                failed_reads: root.within("imu", sensors::failed_reads).flatten(),
            },
            calibration: root.within("calibration", devices::calibration).unwrap_or_default(),
            gnss,
            playback,
            unwired_switches: root.within("ad", devices::ad).unwrap_or_default(),
            operator: root.within("operator", devices::operator).unwrap_or_default(),
            lines: LineFaults {
                flip_every_bits: root.within("spi", |table| count(table, "flip_every_bits")).unwrap_or(0),
                ..root.within("io", devices::io).unwrap_or_default()
            },
            sci: root.within("sci", devices::sci).unwrap_or_default(),
            can: root.within("can", devices::can).unwrap_or_default(),
            wire: root.within("wire", wires::wire).unwrap_or_default(),
            can_wire: root.within("can_wire", wires::can_wire).unwrap_or_default(),
            turntable: root.within("turntable", table::turntable).unwrap_or_default(),
            reboot: root.within("reboot", devices::reboot),
            ..model
        }
    }
}

/// Largest personality file that is read: such files are a page long.
pub const LARGEST_FILE: u64 = 1 << 20;

/// Reads a file that a personality names, or tells why it cannot.
pub type Load<'a> = &'a mut dyn FnMut(&str) -> Result<Vec<u8>, String>;

/// Reads files in the folder of the personality, and farther away if `reach` allows it. It does not read a file to the end
/// if it is longer than any use allows.
pub fn beside(board: &Path, reach: Reach) -> impl FnMut(&str) -> Result<Vec<u8>, String> {
    let folder = board.parent().unwrap_or(Path::new("")).to_owned();
    move |name| {
        let read = gnc_files::named_beginning(&folder, &folder.join(name), reach, LONGEST as u64 + 1);
        read.map_err(|error| match is_refused(&error) {
            Some(Refused::Outside) => {
                "it lies outside of the folder of the board's file, and only --allow-outside allows that".to_owned()
            }
            _ => error.to_string(),
        })
    }
}

/// The personalities in this library: name and text, the good module first.
#[must_use]
pub fn boards() -> &'static [(&'static str, &'static str)] {
    BOARDS
}

impl Default for PersonalityModel {
    fn default() -> Self {
        Self {
            serial_number: None,
            part: "GNC-POP-26".to_owned(),
            hardware: "C".to_owned(),
            firmware: "1.4.0".to_owned(),
            protocol: 1,
            board_serial: "SIM-BOARD-1".to_owned(),
            board_firmware: "sim 1.0.0".to_owned(),
            breaches: Breaches::default(),
            oscillator: Oscillator { error_ppm: 3.0, drift_ppm_per_h: 0.0 },
            sampling: SamplingFaults::default(),
            caches_identity: false,
            supply: SupplyModel::default(),
            heat: HeatModel::default(),
            start: StartFaults::default(),
            rails: Rails::default(),
            cpu: CpuFaults::default(),
            timers: TimerModel::default(),
            internal_ram: MemoryFaults::default(),
            sdram: MemoryFaults::default(),
            spi_flash: FlashFaults::default(),
            internal_flash: FlashFaults::default(),
            sensors: SensorModels::default(),
            sensor_faults: SensorFaults::default(),
            calibration: CalibrationFaults::default(),
            gnss: GnssFaults::default(),
            playback: None,
            unwired_switches: [false; 5],
            operator: OperatorFaults::default(),
            lines: LineFaults::default(),
            sci: SciFaults::default(),
            can: CanFaults::default(),
            wire: WireFaults::default(),
            can_wire: CanWireFaults::default(),
            turntable: TableModel::default(),
            reboot: None,
        }
    }
}
