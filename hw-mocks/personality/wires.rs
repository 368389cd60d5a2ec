//! Faults of the lines of a personality: RS-422 and CAN, each way between station and board.

use gnc_config::TomlTable;

use super::checks::{count, needs};
use crate::can_faults::{CanRates, CanWireFaults};
use crate::fault_queue::QueueRates;
use crate::wire_faults::{WireFaults, WireRates};

pub(super) fn wire(table: &TomlTable<'_, '_>) -> WireFaults {
    let (to_host, to_board) = ways(table, along);
    WireFaults { to_host, to_board, can_lose_every: count(table, "can_lose_every") }
}

pub(super) fn can_wire(table: &TomlTable<'_, '_>) -> CanWireFaults {
    let (to_host, to_board) = ways(table, can_along);
    CanWireFaults { to_host, to_board }
}

/// Faults towards the host and towards the board. The table of one direction replaces all of `both` there.
fn ways<T: Clone + Default>(table: &TomlTable<'_, '_>, read: impl Fn(&TomlTable<'_, '_>) -> T) -> (T, T) {
    let both = table.within("both", &read).unwrap_or_default();
    let (to_host, to_board) = (table.within("to_host", &read), table.within("to_board", &read));
    (to_host.unwrap_or_else(|| both.clone()), to_board.unwrap_or(both))
}

/// Parts per million.
fn share(table: &TomlTable<'_, '_>, key: &'static str) -> f64 {
    table.number(key, (0.0, 1e6)).unwrap_or(0.0)
}

/// Faults of the queue, for both kinds of lines. One key of a pair alone does nothing.
fn queue(table: &TomlTable<'_, '_>) -> QueueRates {
    for (share, time) in [("delayed_frames_per_million", "delay_ms"), ("stalled_frames_per_million", "stall_ms")] {
        needs(table, share, time);
        needs(table, time, share);
    }
    let time_ms = |key: &'static str| table.number(key, (0.0, 60_000.0)).unwrap_or(0.0);
    QueueRates {
        doubled_frames: share(table, "doubled_frames_per_million"),
        overtaken_frames: share(table, "overtaken_frames_per_million"),
        delayed_frames: share(table, "delayed_frames_per_million"),
        delay_ms: time_ms("delay_ms"),
        stalled_frames: share(table, "stalled_frames_per_million"),
        stall_ms: time_ms("stall_ms"),
    }
}

fn along(table: &TomlTable<'_, '_>) -> WireRates {
    WireRates {
        lost_bytes: share(table, "lost_bytes_per_million"),
        lost_byte_at: count(table, "lost_byte_at"),
        flipped_bits: share(table, "flipped_bits_per_million"),
        lost_frames: share(table, "lost_frames_per_million"),
        cut_frames: share(table, "cut_frames_per_million"),
        babbled_frames: share(table, "babbled_frames_per_million"),
        echoed_frames: share(table, "echoed_frames_per_million"),
        queue: queue(table),
    }
}

fn can_along(table: &TomlTable<'_, '_>) -> CanRates {
    CanRates {
        lost_frames: share(table, "lost_frames_per_million"),
        lost_bursts: share(table, "lost_bursts_per_million"),
        flipped_frames: share(table, "flipped_frames_per_million"),
        babbled_frames: share(table, "babbled_frames_per_million"),
        queue: queue(table),
    }
}
