//! The devices of a personality's module, apart from its inertial sensors.

use std::sync::Arc;

use gnc_config::TomlTable;
use gnc_text::{printable, quoted};

use super::checks::{choice, count, level, needs, pair, required_whole, whole};
use super::{Load, RebootTrigger};
use crate::devices::ad::Rails;
use crate::devices::calibration::{CalibrationFaults, LostBit};
use crate::devices::can::CanFaults;
use crate::devices::cpu::CpuFaults;
use crate::devices::flash::{BadBit, FlashFaults, FlashPart};
use crate::devices::gnss::{EPOCHS_HZ, GnssFaults, Playback};
use crate::devices::lines::LineFaults;
use crate::devices::memory::MemoryFaults;
use crate::devices::playback::{LONGEST, Recording};
use crate::devices::sci::SciFaults;
use crate::devices::start::StartFaults;
use crate::devices::supply::SupplyModel;
use crate::devices::timer::TimerModel;
use crate::operator::OperatorFaults;
use crate::world::HeatModel;

/// Bytes of the coefficients that a module stores.
const COEFFICIENT_BYTES: i64 = 300;

/// Names of devices that can trigger a restart of the board.
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

pub(super) fn supply(table: &TomlTable<'_, '_>) -> SupplyModel {
    let d = SupplyModel::default();
    SupplyModel {
        voltage_v: table.number("voltage_v", (0.0, 12.0)).unwrap_or(d.voltage_v),
        current_a: table.number("current_a", (0.0, 5.0)).unwrap_or(d.current_a),
        off_voltage_v: table.number("off_voltage_v", (0.0, 12.0)).unwrap_or(d.off_voltage_v),
        off_current_a: table.number("off_current_a", (0.0, 5.0)).unwrap_or(d.off_current_a),
        meter_holds: table.flag("meter_holds"),
    }
}

/// The heat of a module.
pub(super) fn heat(table: &TomlTable<'_, '_>) -> HeatModel {
    let d = HeatModel::default();
    HeatModel {
        room_c: table.number("room_c", (-40.0, 85.0)).or(d.room_c),
        rise_k: table.number("rise_k", (0.0, 60.0)).unwrap_or(d.rise_k),
        warm_up_s: table.number("warm_up_s", (1.0, 36_000.0)).unwrap_or(d.warm_up_s),
    }
}

/// The start of a module. The swap of the module stands in the table of the module.
pub(super) fn start(table: &TomlTable<'_, '_>) -> StartFaults {
    needs(table, "late_ms", "late_every");
    needs(table, "late_every", "late_ms");
    StartFaults {
        late_every: count(table, "late_every"),
        late_s: table.number("late_ms", (0.0, 60_000.0)).unwrap_or(0.0) * 1e-3,
        hangs_every: count(table, "hangs_every"),
        ..StartFaults::default()
    }
}

pub(super) fn rails(table: &TomlTable<'_, '_>) -> Rails {
    let d = Rails::default();
    let rail = |key: &'static str, default| table.number(key, (0.0, 6.0)).unwrap_or(default);
    Rails { v5_v: rail("v5_v", d.v5_v), v3v3_v: rail("v3v3_v", d.v3v3_v), v1v2_v: rail("v1v2_v", d.v1v2_v) }
}

pub(super) fn cpu(table: &TomlTable<'_, '_>) -> CpuFaults {
    let mut faults = CpuFaults::default();
    for core in table.list("dead_cores", "a list of cores, 1 and 2") {
        if let Some(core) = whole::<usize>(&core, (1, 2)) {
            faults.dead[core - 1] = true;
        }
    }
    faults.multiplier_bit = table.entry("multiplier_bit_of_core_2").and_then(|entry| whole(&entry, (0, 31)));
    faults
}

pub(super) fn timers(table: &TomlTable<'_, '_>) -> TimerModel {
    let d = TimerModel::default();
    TimerModel {
        rate_error_ppm: table.number("rate_error_ppm", (-5e5, 5e5)).unwrap_or(d.rate_error_ppm),
        jitter_ns: table.number("jitter_ns", (0.0, 1e6)).unwrap_or(d.jitter_ns),
        miss_every: count(table, "miss_every"),
    }
}

/// Reads the faults of a memory with this number of words and bits.
pub(super) fn memory(table: &TomlTable<'_, '_>, words: u32, width: u8) -> MemoryFaults {
    let (last_word, last_bit) = (i64::from(words) - 1, i64::from(width) - 1);
    let last_line = i64::from(words.ilog2()) - 1;
    let stuck = |key: &'static str, last: i64| table.within(key, |table| stuck_line(table, last)).flatten();
    let cell = |table: &TomlTable<'_, '_>| {
        let (index, bit) =
            (required_whole(table, "index", (0, last_word)), required_whole(table, "bit", (0, last_bit)));
        let level = level(table);
        Some((index?, bit?, level?))
    };
    let coupled = |table: &TomlTable<'_, '_>| {
        let aggressor = required_whole(table, "aggressor", (0, last_word));
        let victim = required_whole(table, "victim", (0, last_word));
        let bit = required_whole(table, "bit", (0, last_bit));
        let (aggressor, victim): (u32, u32) = (aggressor?, victim?);
        if aggressor == victim {
            table.mistake(format!("cell {victim} cannot couple with itself"), "write two different cells");
        }
        Some((aggressor, victim, bit?))
    };
    let shorted = table.entry("shorted_address_lines").and_then(|entry| pair(&entry, (0, last_line)));
    MemoryFaults {
        stuck_data_line: stuck("stuck_data_line", last_bit),
        stuck_address_line: stuck("stuck_address_line", last_line),
        shorted_address_lines: shorted,
        stuck_cells: all(table, "stuck_cells", cell),
        coupled_cells: all(table, "coupled_cells", coupled),
    }
}

/// Reads a list of tables, and skips those that cannot be read.
fn all<T>(table: &TomlTable<'_, '_>, key: &'static str, read: impl Fn(&TomlTable<'_, '_>) -> Option<T>) -> Vec<T> {
    table.tables(key).into_iter().filter_map(|table| table.read(&read)).collect()
}

fn stuck_line(table: &TomlTable<'_, '_>, last: i64) -> Option<(u8, bool)> {
    let (line, level) = (required_whole(table, "line", (0, last)), level(table));
    Some((line?, level?))
}

pub(super) fn flash(table: &TomlTable<'_, '_>, part: &FlashPart) -> FlashFaults {
    let bad_bit = |table: &TomlTable<'_, '_>| {
        let sector = required_whole(table, "sector", (0, i64::from(part.scratch_sectors) - 1));
        let word = required_whole(table, "word", (0, i64::from(part.sector_bytes / 4) - 1));
        let (bit, level) = (required_whole(table, "bit", (0, 31)), level(table));
        Some(BadBit { sector: sector?, word: word?, bit: bit?, level: level? })
    };
    FlashFaults {
        bad_bits: all(table, "bad_bits", bad_bit),
        erase_factor: table.number("erase_factor", (0.01, 1000.0)).unwrap_or(1.0),
    }
}

pub(super) fn calibration(table: &TomlTable<'_, '_>) -> CalibrationFaults {
    let lost_bit = |table: &TomlTable<'_, '_>| {
        let byte = required_whole(table, "byte", (0, COEFFICIENT_BYTES - 1));
        let bit = required_whole(table, "bit", (0, 7));
        let after_power_cycle = table.flag("after_power_cycle");
        Some(LostBit { byte: byte?, bit: bit?, after_power_cycle })
    };
    CalibrationFaults { lost_bit: table.within("lost_bit", lost_bit).flatten(), transposed: table.flag("transposed") }
}

pub(super) fn gnss(table: &TomlTable<'_, '_>, load: Load<'_>) -> (GnssFaults, Option<Playback>) {
    let metres = |key: &'static str| table.number(key, (-1e6, 1e6)).unwrap_or(0.0);
    let faults = GnssFaults {
        no_sky: table.flag("no_sky"),
        antenna_offset_m: (metres("repeater_north_m"), metres("repeater_east_m")),
        covered_after_fix_s: table.number("covered_after_fix_s", (0.0, 1e6)),
        pps_open: table.flag("pps_open"),
        pps_jitter_s: table.number("pps_jitter_ns", (0.0, 1e4)).unwrap_or(0.0) * 1e-9,
    };
    (faults, playback(table, load))
}

fn playback(table: &TomlTable<'_, '_>, load: Load<'_>) -> Option<Playback> {
    needs(table, "playback_hz", "playback");
    // A receiver that plays a log back does not use the sky.
    for key in ["no_sky", "repeater_north_m", "repeater_east_m", "covered_after_fix_s"] {
        if table.has("playback")
            && let Some(entry) = table.entry(key)
        {
            entry.key_mistake(format!("{key} changes nothing beside a playback"), "remove one of the two");
        }
    }
    let epochs_hz = table.number("playback_hz", (0.01, EPOCHS_HZ)).unwrap_or(1.0);
    let entry = table.entry("playback")?;
    let name = entry.text()?;
    let read = load(name).and_then(|log| {
        if log.len() > LONGEST {
            return Err(format!("the log is longer than {LONGEST} bytes"));
        }
        Recording::new(&log).ok_or_else(|| "the log has no messages".to_owned())
    });
    match read {
        Ok(recording) => Some(Playback { recording: Arc::new(recording), epochs_hz }),
        Err(why) => {
            let what = format!("playback {} cannot be read: {}", quoted(name), printable(&why));
            entry.mistake(what, "name a log of NMEA or UBX in the folder of this file");
            None
        }
    }
}

pub(super) fn ad(table: &TomlTable<'_, '_>) -> [bool; 5] {
    switches(table, "unwired_switches")
}

/// Some of the five DIP switches.
fn switches(table: &TomlTable<'_, '_>, key: &'static str) -> [bool; 5] {
    let mut set = [false; 5];
    for switch in table.list(key, "a list of switches, 1 to 5") {
        if let Some(switch) = whole::<usize>(&switch, (1, 5)) {
            set[switch - 1] = true;
        }
    }
    set
}

pub(super) fn operator(table: &TomlTable<'_, '_>) -> OperatorFaults {
    needs(table, "forgets_from", "forgets");
    OperatorFaults {
        switches_on: switches(table, "switches_on"),
        forgets_from: table.entry("forgets_from").and_then(|entry| whole(&entry, (1, 100))).unwrap_or(1),
        forgets: table.entry("forgets").and_then(|entry| whole(&entry, (1, 100))).unwrap_or(0),
    }
}

/// The lines of [io]; the SPI uses the same lines.
pub(super) fn io(table: &TomlTable<'_, '_>) -> LineFaults {
    let open = table.list("open", "a list of lines, 0 to 3");
    let shorted = table.list("shorted", "a list of pairs of lines, such as [[2, 3]]");
    LineFaults {
        shorted: shorted.iter().filter_map(|entry| pair(entry, (0, 3))).collect(),
        open: open.iter().filter_map(|entry| whole(entry, (0, 3))).collect(),
        stuck: all(table, "stuck", |table| stuck_line(table, 3)),
        flip_every_bits: 0,
    }
}

pub(super) fn sci(table: &TomlTable<'_, '_>) -> SciFaults {
    SciFaults { lose_every: count(table, "lose_every"), flip_every: count(table, "flip_every") }
}

pub(super) fn can(table: &TomlTable<'_, '_>) -> CanFaults {
    CanFaults {
        flip_every: count(table, "flip_every"),
        swap_every: count(table, "swap_every"),
        tx_error_every: count(table, "tx_error_every"),
        bus_off_after: count(table, "bus_off_after"),
    }
}

pub(super) fn reboot(table: &TomlTable<'_, '_>) -> RebootTrigger {
    needs(table, "nth", "on");
    needs(table, "after_ms", "on");
    if !table.has("on") && !table.has("at_board_time_s") {
        table.mistake(
            "[reboot] does not say when the board restarts",
            "write on = \"sdram\", or at_board_time_s = 60.0",
        );
    }
    RebootTrigger {
        on: table.entry("on").and_then(|entry| choice(&entry, &DEVICES)).map(str::to_owned),
        nth: table.entry("nth").and_then(|entry| whole(&entry, (1, u32::MAX.into()))),
        after_ms: table.number("after_ms", (0.0, 1e6)).unwrap_or(0.0),
        at_board_time_s: table.number("at_board_time_s", (0.0, 1e6)),
    }
}
