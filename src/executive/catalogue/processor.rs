//! Identity, cores and timers.

use super::{Device, ItemSpec, MeasurementSpec, ParamKind, ParamSpec, Resource, count, if_integer, number, text};
use crate::quantity::{Dimension, Unit};

/// Who is in the socket.
pub(super) static IDENTITY: ItemSpec = ItemSpec {
    title: "Identity and supply",
    params: &[],
    measurements: &[
        text(
            "serial_number",
            "Compare the label of the module with the scanned number: another module may be in the socket.",
        ),
        text("part", "Another type of module is in the socket, or its identity was never written."),
        text("hardware", "The module is of another hardware version than the plan is for."),
        text("firmware", "Load the firmware that the plan demands."),
        count("protocol", "Firmware of the slave test board and station do not speak the same version."),
        number(
            "supply_voltage",
            Unit::Volt,
            Dimension::Voltage,
            "Check the 5 V supply at the test socket and its contacts.",
        ),
        number(
            "supply_current",
            Unit::Ampere,
            Dimension::Current,
            "Too much: look for a short or a wrongly placed part; too little: a part is missing or does not start.",
        ),
    ],
    devices: &[Device::Slave],
    // Its second look at the supply settles like a switch: no stream may start in it, and no other item add its current.
    resources: &[Resource::Power],
    timeout_s: 5.0,
};

/// Both cores of the DSP.
pub(super) static CPU: ItemSpec = ItemSpec {
    title: "CPU, both cores",
    params: &[ParamSpec {
        name: "operand_sets",
        about: "sets of operands for the arithmetic",
        kind: ParamKind::Integer { min: 1, max: 64, default: 32 },
    }],
    measurements: &[
        count("core1_register_errors", "A register of core 1 does not hold what was written: suspect the DSP itself."),
        count("core1_memory_errors", "Core 1 reads other words than it wrote: suspect its local memory."),
        count("core1_integer_errors", "Core 1 calculates integers wrongly: suspect the DSP or its 1.2 V supply."),
        count(
            "core1_float_errors",
            "Core 1 calculates floating-point numbers wrongly: suspect the DSP or its 1.2 V supply.",
        ),
        count("core2_register_errors", "A register of core 2 does not hold what was written: suspect the DSP itself."),
        count("core2_memory_errors", "Core 2 reads other words than it wrote: suspect its local memory."),
        count("core2_integer_errors", "Core 2 calculates integers wrongly: suspect the DSP or its 1.2 V supply."),
        count(
            "core2_float_errors",
            "Core 2 calculates floating-point numbers wrongly: suspect the DSP or its 1.2 V supply.",
        ),
    ],
    devices: &[Device::Slave],
    resources: &[Resource::Processor],
    timeout_s: 10.0,
};

const MEAN: &str = "Every interval is off by the same part: suspect the oscillator of the module.";
const WORST: &str = "Single intervals are off: look for interrupts that are blocked or a timer that is reloaded late.";
const JITTER: &str = "The intervals scatter: look for interrupts that are blocked, or noise on the clock.";
const MISSING: &str = "Interrupts were lost (positive) or came without cause (negative): suspect the interrupt line.";

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
        mean(0, "timer0_500us_mean"),
        worst(0, "timer0_500us_worst"),
        jitter(0, "timer0_500us_jitter"),
        mean(0, "timer0_1ms_mean"),
        worst(0, "timer0_1ms_worst"),
        jitter(0, "timer0_1ms_jitter"),
        mean(0, "timer0_2ms_mean"),
        worst(0, "timer0_2ms_worst"),
        jitter(0, "timer0_2ms_jitter"),
        mean(0, "timer0_5ms_mean"),
        worst(0, "timer0_5ms_worst"),
        jitter(0, "timer0_5ms_jitter"),
        if_integer(count("timer0_interrupts_missing", MISSING), "timers", 0),
        mean(1, "timer1_500us_mean"),
        worst(1, "timer1_500us_worst"),
        jitter(1, "timer1_500us_jitter"),
        mean(1, "timer1_1ms_mean"),
        worst(1, "timer1_1ms_worst"),
        jitter(1, "timer1_1ms_jitter"),
        mean(1, "timer1_2ms_mean"),
        worst(1, "timer1_2ms_worst"),
        jitter(1, "timer1_2ms_jitter"),
        mean(1, "timer1_5ms_mean"),
        worst(1, "timer1_5ms_worst"),
        jitter(1, "timer1_5ms_jitter"),
        if_integer(count("timer1_interrupts_missing", MISSING), "timers", 1),
        mean(2, "timer2_500us_mean"),
        worst(2, "timer2_500us_worst"),
        jitter(2, "timer2_500us_jitter"),
        mean(2, "timer2_1ms_mean"),
        worst(2, "timer2_1ms_worst"),
        jitter(2, "timer2_1ms_jitter"),
        mean(2, "timer2_2ms_mean"),
        worst(2, "timer2_2ms_worst"),
        jitter(2, "timer2_2ms_jitter"),
        mean(2, "timer2_5ms_mean"),
        worst(2, "timer2_5ms_worst"),
        jitter(2, "timer2_5ms_jitter"),
        if_integer(count("timer2_interrupts_missing", MISSING), "timers", 2),
    ],
    devices: &[Device::Slave],
    resources: &[Resource::Processor],
    timeout_s: 15.0,
};

/// Mean interval.
const fn mean(timer: i64, name: &'static str) -> MeasurementSpec {
    if_integer(number(name, Unit::Microsecond, Dimension::Time, MEAN), "timers", timer)
}

/// Largest deviation of a single interval from the nominal one, as a part of it.
const fn worst(timer: i64, name: &'static str) -> MeasurementSpec {
    if_integer(number(name, Unit::Percent, Dimension::Ratio, WORST), "timers", timer)
}

/// Standard deviation of the intervals.
const fn jitter(timer: i64, name: &'static str) -> MeasurementSpec {
    if_integer(number(name, Unit::Microsecond, Dimension::Time, JITTER), "timers", timer)
}
