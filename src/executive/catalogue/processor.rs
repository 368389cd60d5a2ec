//! Identity, cores and timers.

use super::{
    Device, ItemSpec, MeasurementSpec, ParamKind, ParamSpec, Resource, Traces, count, if_integer, number, text,
};
use crate::quantity::{Dimension, Unit};

/// Serial number that the module reports.
pub const SERIAL_NUMBER: MeasurementSpec = text(
    "serial_number",
    "Compare the label of the module with the scanned number: another module may be in the socket.",
);
/// Part number that the module reports.
pub const PART: MeasurementSpec =
    text("part", "Another type of module is in the socket, or its identity was never written.");
/// Version of its hardware.
pub const HARDWARE: MeasurementSpec = text(
    "hardware",
    "The module's hardware version is not the one that the plan demands: use the plan for this version.",
);
/// Version of its firmware.
pub const FIRMWARE: MeasurementSpec = text("firmware", "Load the firmware that the plan demands.");
/// Version of the protocol between slave board and module.
pub const PROTOCOL: MeasurementSpec = count(
    "protocol",
    "The slave test board and the module use another protocol version than the plan demands: update the older firmware.",
);
/// Voltage at the socket while the module works.
pub const SUPPLY_VOLTAGE: MeasurementSpec = number(
    "supply_voltage",
    Unit::Volt,
    Dimension::Voltage,
    "Check the 5 V supply at the test socket and its contacts.",
);
/// Current into the module while it works.
pub const SUPPLY_CURRENT: MeasurementSpec = number(
    "supply_current",
    Unit::Ampere,
    Dimension::Current,
    "Too much: look for a short or a wrongly placed part; too little: a part is missing or does not start.",
);

/// The identity of the module in the socket.
pub(super) static IDENTITY: ItemSpec = ItemSpec {
    title: "Identity and supply",
    params: &[],
    measurements: &[SERIAL_NUMBER, PART, HARDWARE, FIRMWARE, PROTOCOL, SUPPLY_VOLTAGE, SUPPLY_CURRENT],
    devices: &[Device::Slave],
    // The second look at the supply settles like a switch. No stream may start in it, and no other item may add its
    // current.
    resources: &[Resource::Power],
    needs: &[],
    traces: Traces::NONE,
    timeout_s: 5.0,
};

/// Measurements of errors in one core of the DSP.
#[derive(Debug)]
pub struct CoreSpec {
    /// Registers that do not read back as they were written.
    pub register_errors: MeasurementSpec,
    /// Memory words that do not read back as they were written.
    pub memory_errors: MeasurementSpec,
    /// Integer results that differ from the host's.
    pub integer_errors: MeasurementSpec,
    /// Floating-point results that differ from the host's.
    pub float_errors: MeasurementSpec,
}

/// Core 1 and core 2.
pub const CORES: [CoreSpec; 2] = [
    CoreSpec {
        register_errors: count(
            "core1_register_errors",
            "A register of core 1 does not hold what was written: suspect the DSP itself.",
        ),
        memory_errors: count(
            "core1_memory_errors",
            "Core 1 reads other words than it wrote: suspect its local memory.",
        ),
        integer_errors: count(
            "core1_integer_errors",
            "Core 1 calculates integers wrongly: suspect the DSP or its 1.2 V supply.",
        ),
        float_errors: count(
            "core1_float_errors",
            "Core 1 calculates floating-point numbers wrongly: suspect the DSP or its 1.2 V supply.",
        ),
    },
    CoreSpec {
        register_errors: count(
            "core2_register_errors",
            "A register of core 2 does not hold what was written: suspect the DSP itself.",
        ),
        memory_errors: count(
            "core2_memory_errors",
            "Core 2 reads other words than it wrote: suspect its local memory.",
        ),
        integer_errors: count(
            "core2_integer_errors",
            "Core 2 calculates integers wrongly: suspect the DSP or its 1.2 V supply.",
        ),
        float_errors: count(
            "core2_float_errors",
            "Core 2 calculates floating-point numbers wrongly: suspect the DSP or its 1.2 V supply.",
        ),
    },
];

/// Both cores of the DSP.
pub(super) static CPU: ItemSpec = ItemSpec {
    title: "CPU, both cores",
    params: &[ParamSpec {
        name: "operand_sets",
        about: "sets of operands for the arithmetic",
        kind: ParamKind::Integer { min: 1, max: 64, default: 32 },
    }],
    measurements: &[
        CORES[0].register_errors,
        CORES[0].memory_errors,
        CORES[0].integer_errors,
        CORES[0].float_errors,
        CORES[1].register_errors,
        CORES[1].memory_errors,
        CORES[1].integer_errors,
        CORES[1].float_errors,
    ],
    devices: &[Device::Slave],
    resources: &[Resource::Processor],
    needs: &[],
    traces: Traces::NONE,
    timeout_s: 10.0,
};

const MEAN: &str = "Every interval is off by the same fraction: suspect the oscillator of the module.";
const WORST: &str = "Single intervals are off: look for interrupts that are blocked or a timer that is reloaded late.";
const JITTER: &str = "The intervals scatter: look for interrupts that are blocked, or noise on the clock.";
const MISSING: &str = "Interrupts were lost (positive) or came without a cause (negative): suspect the interrupt line.";

/// Measurements of a timer's intervals of one length.
#[derive(Debug)]
pub struct IntervalSpec {
    /// Mean interval.
    pub mean: MeasurementSpec,
    /// Largest deviation of a single interval from the nominal one, as a fraction of it.
    pub worst: MeasurementSpec,
    /// Standard deviation of the intervals.
    pub jitter: MeasurementSpec,
}

/// Measurements of one timer.
#[derive(Debug)]
pub struct TimerSpec {
    /// Intervals of 500 us, 1 ms, 2 ms and 5 ms.
    pub intervals: [IntervalSpec; 4],
    /// Interrupts that were lost or came without a cause, over all lengths.
    pub interrupts_missing: MeasurementSpec,
}

/// Timers 0 to 2.
pub const TIMER: [TimerSpec; 3] = [
    TimerSpec {
        intervals: [
            interval(0, "timer0_500us_mean", "timer0_500us_worst", "timer0_500us_jitter"),
            interval(0, "timer0_1ms_mean", "timer0_1ms_worst", "timer0_1ms_jitter"),
            interval(0, "timer0_2ms_mean", "timer0_2ms_worst", "timer0_2ms_jitter"),
            interval(0, "timer0_5ms_mean", "timer0_5ms_worst", "timer0_5ms_jitter"),
        ],
        interrupts_missing: if_integer(count("timer0_interrupts_missing", MISSING), "timers", 0),
    },
    TimerSpec {
        intervals: [
            interval(1, "timer1_500us_mean", "timer1_500us_worst", "timer1_500us_jitter"),
            interval(1, "timer1_1ms_mean", "timer1_1ms_worst", "timer1_1ms_jitter"),
            interval(1, "timer1_2ms_mean", "timer1_2ms_worst", "timer1_2ms_jitter"),
            interval(1, "timer1_5ms_mean", "timer1_5ms_worst", "timer1_5ms_jitter"),
        ],
        interrupts_missing: if_integer(count("timer1_interrupts_missing", MISSING), "timers", 1),
    },
    TimerSpec {
        intervals: [
            interval(2, "timer2_500us_mean", "timer2_500us_worst", "timer2_500us_jitter"),
            interval(2, "timer2_1ms_mean", "timer2_1ms_worst", "timer2_1ms_jitter"),
            interval(2, "timer2_2ms_mean", "timer2_2ms_worst", "timer2_2ms_jitter"),
            interval(2, "timer2_5ms_mean", "timer2_5ms_worst", "timer2_5ms_jitter"),
        ],
        interrupts_missing: if_integer(count("timer2_interrupts_missing", MISSING), "timers", 2),
    },
];

/// The three timers.
pub(super) static TIMERS: ItemSpec = ItemSpec {
    title: "Timers and interrupts",
    params: &[
        ParamSpec {
            name: "timers",
            about: "timers to test",
            kind: ParamKind::Integers { min: 0, max: 2, default: &[0, 1, 2] },
        },
        ParamSpec {
            name: "repeats",
            about: "intervals of each length",
            kind: ParamKind::Integer { min: 2, max: 100, default: 20 },
        },
    ],
    measurements: &[
        TIMER[0].intervals[0].mean,
        TIMER[0].intervals[0].worst,
        TIMER[0].intervals[0].jitter,
        TIMER[0].intervals[1].mean,
        TIMER[0].intervals[1].worst,
        TIMER[0].intervals[1].jitter,
        TIMER[0].intervals[2].mean,
        TIMER[0].intervals[2].worst,
        TIMER[0].intervals[2].jitter,
        TIMER[0].intervals[3].mean,
        TIMER[0].intervals[3].worst,
        TIMER[0].intervals[3].jitter,
        TIMER[0].interrupts_missing,
        TIMER[1].intervals[0].mean,
        TIMER[1].intervals[0].worst,
        TIMER[1].intervals[0].jitter,
        TIMER[1].intervals[1].mean,
        TIMER[1].intervals[1].worst,
        TIMER[1].intervals[1].jitter,
        TIMER[1].intervals[2].mean,
        TIMER[1].intervals[2].worst,
        TIMER[1].intervals[2].jitter,
        TIMER[1].intervals[3].mean,
        TIMER[1].intervals[3].worst,
        TIMER[1].intervals[3].jitter,
        TIMER[1].interrupts_missing,
        TIMER[2].intervals[0].mean,
        TIMER[2].intervals[0].worst,
        TIMER[2].intervals[0].jitter,
        TIMER[2].intervals[1].mean,
        TIMER[2].intervals[1].worst,
        TIMER[2].intervals[1].jitter,
        TIMER[2].intervals[2].mean,
        TIMER[2].intervals[2].worst,
        TIMER[2].intervals[2].jitter,
        TIMER[2].intervals[3].mean,
        TIMER[2].intervals[3].worst,
        TIMER[2].intervals[3].jitter,
        TIMER[2].interrupts_missing,
    ],
    devices: &[Device::Slave],
    resources: &[Resource::Processor],
    needs: &[],
    traces: Traces::NONE,
    timeout_s: 15.0,
};

const fn interval(timer: i64, mean: &'static str, worst: &'static str, jitter: &'static str) -> IntervalSpec {
    IntervalSpec {
        mean: if_integer(number(mean, Unit::Microsecond, Dimension::Time, MEAN), "timers", timer),
        worst: if_integer(number(worst, Unit::Percent, Dimension::Ratio, WORST), "timers", timer),
        jitter: if_integer(number(jitter, Unit::Microsecond, Dimension::Time, JITTER), "timers", timer),
    }
}
