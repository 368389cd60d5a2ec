//! Sections 11 and 13: what each message answers.

mod board;
mod memory;
mod module;
mod ranges;

use crate::check::checks;
use board::{error_records, error_records_from, link_counters, power_off, power_on, power_twice};
use memory::{flash_and, flash_id, flash_pattern, flash_protected, ram, ram_sdram};
use module::{
    ad, ad_channels, calibration_commit, calibration_read, calibration_stream, calibration_unwritten, can_counters,
    cpu_floats, cpu_integers, cpu_words, gnss_restart, identity, io, sci, spi, timer,
};
use ranges::{ranges, ranges_calibration, ranges_stream};

checks! { 11:
    "power.on" Session power_on "ModulePower on reports supply in uV and current in uA when the supply has settled",
    "power.twice" Powered power_twice "switching on what is on, or off what is off, is no error",
    "power.off" Powered power_off "ModulePower off takes the power away: Identity gets NAK 6",
    "error-records.empty" Session error_records "a new session starts without error records",
    "error-records.from" Powered error_records_from "ErrorRecords gives the records from an index on, rising; a new session has none of them",
    "link-counters" Session link_counters "LinkCounters counts as section 3 says: good, wrong checksum, malformed, missing, sent",
    "range.fields" Powered ranges "a field outside its range gets NAK 4, in every message",
    "range.streams" Powered ranges_stream "StreamStart and StreamStop refuse fields outside their ranges by NAK 4",
    "range.calibration" Powered ranges_calibration "CalibrationWrite refuses coefficients that are not finite or outside their range, and id 0, by NAK 4",
    "identity" Powered identity "Identity answers texts and protocol version, the same each time",
    "cpu.words" Powered cpu_words "CpuWords gives back the words, of both cores, registers and memory, and an empty list",
    "cpu.integers" Powered cpu_integers "CpuIntegers is 32-bit arithmetic: low 32 bits, quotient towards zero, remainder with the sign of a",
    "cpu.floats" Powered cpu_floats "CpuFloats is IEEE 754 double arithmetic, bit by bit, with infinities and subnormal numbers",
    "timer" Powered timer "TimerMeasure gives as many intervals as interrupts, in ns",
    "flash.id" Powered flash_id "FlashId gives a JEDEC id and sectors of 4096 and 16,384 bytes",
    "flash.protected" Powered flash_protected "a sector that is no scratch sector gets NAK 7",
    "ad.channels" Powered ad_channels "AdRead gives the channels that were asked for, rising",
    "ad.values" Powered ad "AdRead gives mean, min and max in uV within 0 to 6.144 V",
    "io" Powered io "IoTest gives the levels of four lines",
    "spi" Powered spi "SpiTransfer gives what the other side saw, in both directions",
    "sci" Powered sci "SciEcho gives error counters and the bytes that came back",
    "gnss.restart" Powered gnss_restart "GnssRestart ends with an empty body",
    "can.counters" Powered can_counters "CanCounters gives state 0 to 2 and the counters of the module's controller",
    "calibration.read" Powered calibration_read "CalibrationRead gives state, counter, checksum and the 300 bytes",
    "calibration.unwritten" Powered calibration_unwritten "CalibrationCommit gets NAK 4 if nothing was written since power-on",
    "calibration.commit" Powered calibration_commit "CalibrationCommit stores what was written, unless the checksum is another one, and it reads the same after a power cycle",
    "calibration.stream" Powered calibration_stream "a calibration that was committed counts from the next StreamStart on",
}

/// Section 13: memory patterns.
pub(crate) mod patterns {
    use super::{flash_and, flash_pattern, ram, ram_sdram};
    use crate::check::checks;

    checks! { 13:
        "ram.internal" Powered ram "each pattern compares all 65,536 words of the internal RAM",
        "ram.sdram" Powered ram_sdram "each pattern compares all 1,048,576 words of the SDRAM",
        "flash.pattern" Powered flash_pattern "FlashWrite and FlashVerify use the xorshift of a seed, from its first output on",
        "flash.and" Powered flash_and "programming only clears bits: a sector that was not erased ends as the bitwise AND",
    }
}
