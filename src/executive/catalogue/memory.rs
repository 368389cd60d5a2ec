//! RAM and flash memories.

use super::{Device, ItemSpec, MeasurementSpec, ParamKind, ParamSpec, Resource, Traces, count, if_text, number, text};
use crate::quantity::{Dimension, Unit};

/// Patterns that are written and read back.
const PATTERNS: &[&str] = &["solid", "checkerboard", "walking-ones", "address", "march-c"];

const RAM_PARAMS: &[ParamSpec] = &[ParamSpec {
    name: "patterns",
    about: "patterns to write and read back",
    kind: ParamKind::Choices { of: PATTERNS, default: PATTERNS },
}];

/// Words that do not read back as they were written, pattern "solid".
pub const MISMATCHES_SOLID: MeasurementSpec = mismatches(
    "solid",
    "mismatches_solid",
    "Bits stay 0 or 1: the first failing address and word in the error record name the line or the cell.",
);
/// Pattern "checkerboard".
pub const MISMATCHES_CHECKERBOARD: MeasurementSpec = mismatches(
    "checkerboard",
    "mismatches_checkerboard",
    "Neighbouring bits disturb each other: look for a short between data lines.",
);
/// Pattern "walking-ones".
pub const MISMATCHES_WALKING_ONES: MeasurementSpec = mismatches(
    "walking-ones",
    "mismatches_walking_ones",
    "One data line is stuck or shorted: the bits that differ in the error record name it.",
);
/// Pattern "address".
pub const MISMATCHES_ADDRESS: MeasurementSpec = mismatches(
    "address",
    "mismatches_address",
    "Two addresses reach the same cell: an address line is open, stuck or shorted.",
);
/// Pattern "march-c".
pub const MISMATCHES_MARCH_C: MeasurementSpec = mismatches(
    "march-c",
    "mismatches_march_c",
    "Cells influence each other or lose their state: suspect the memory itself, then its timing and supply.",
);
/// The number of words that each pattern covered, for the pattern with the fewest.
pub const WORDS_TESTED: MeasurementSpec =
    count("words_tested", "The test did not cover the whole memory: compare the board's memory map with the plan.");
/// What the mismatches of all patterns have in common: one cell, one data line, or "none" without mismatches.
pub const FAULT: MeasurementSpec =
    text("fault", "The mismatches have this in common: look at it first, then at the patterns one by one.");
/// Board time of all patterns together.
pub const TEST_TIME: MeasurementSpec = number(
    "test_time",
    Unit::Second,
    Dimension::Time,
    "The memory answers slowly: check its clock and its wait states.",
);

const RAM_MEASUREMENTS: &[MeasurementSpec] = &[
    MISMATCHES_SOLID,
    MISMATCHES_CHECKERBOARD,
    MISMATCHES_WALKING_ONES,
    MISMATCHES_ADDRESS,
    MISMATCHES_MARCH_C,
    WORDS_TESTED,
    FAULT,
    TEST_TIME,
];

/// Internal RAM of the DSP.
pub(super) static INTERNAL_RAM: ItemSpec = ItemSpec {
    title: "Internal RAM",
    params: RAM_PARAMS,
    measurements: RAM_MEASUREMENTS,
    devices: &[Device::Slave],
    resources: &[Resource::Processor],
    needs: &[],
    traces: Traces::NONE,
    timeout_s: 30.0,
};

/// External SDRAM.
pub(super) static SDRAM: ItemSpec = ItemSpec {
    title: "SDRAM",
    params: RAM_PARAMS,
    measurements: RAM_MEASUREMENTS,
    devices: &[Device::Slave],
    resources: &[Resource::Processor],
    needs: &[],
    traces: Traces::NONE,
    timeout_s: 60.0,
};

const FLASH_PARAMS: &[ParamSpec] = &[ParamSpec {
    name: "sector",
    about: "index of the scratch sector",
    kind: ParamKind::Integer { min: 0, max: 65_535, default: 0 },
}];

/// Manufacturer, kind and capacity as the flash reports them.
pub const JEDEC_ID: MeasurementSpec = text(
    "jedec_id",
    "Only 00 or FF: the flash does not answer; check its lines and supply. Other bytes: another type is mounted.",
);
/// Time of an erase.
pub const ERASE_TIME: MeasurementSpec = number(
    "erase_time",
    Unit::Millisecond,
    Dimension::Time,
    "A slow erase is the first sign of a worn or damaged flash; check its supply too.",
);
/// Words that are not FF after the erase.
pub const BLANK_ERRORS: MeasurementSpec =
    count("blank_errors", "Words are not FF after the erase: the sector is bad, or write protection is on.");
/// Time of writing.
pub const WRITE_TIME: MeasurementSpec =
    number("write_time", Unit::Millisecond, Dimension::Time, "Slow programming: suspect a worn flash or a slow clock.");
/// Words that do not read back as they were written.
pub const VERIFY_ERRORS: MeasurementSpec =
    count("verify_errors", "Words differ after programming: the sector or the line to the flash is bad.");

/// SPI flash.
pub(super) static SPI_FLASH: ItemSpec = ItemSpec {
    title: "SPI flash",
    params: FLASH_PARAMS,
    measurements: &[JEDEC_ID, ERASE_TIME, BLANK_ERRORS, WRITE_TIME, VERIFY_ERRORS],
    devices: &[Device::Slave],
    resources: &[Resource::Flash],
    needs: &[],
    traces: Traces::NONE,
    timeout_s: 30.0,
};

/// Internal flash of the DSP.
pub(super) static INTERNAL_FLASH: ItemSpec = ItemSpec {
    title: "Internal flash",
    params: FLASH_PARAMS,
    measurements: &[ERASE_TIME, BLANK_ERRORS, WRITE_TIME, VERIFY_ERRORS],
    devices: &[Device::Slave],
    resources: &[Resource::Flash],
    needs: &[],
    traces: Traces::NONE,
    timeout_s: 30.0,
};

/// Words that do not read back as they were written, for one pattern.
const fn mismatches(pattern: &'static str, name: &'static str, look_at: &'static str) -> MeasurementSpec {
    if_text(count(name, look_at), "patterns", pattern)
}
