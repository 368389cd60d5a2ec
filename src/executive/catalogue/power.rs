//! The module's supply, switched off and on several times.

use super::shared::quantity;
use super::{Device, ItemSpec, MeasurementSpec, ParamKind, ParamSpec, Resource, Trace, Traces, count, number};
use crate::quantity::{Dimension, Unit};

const VOLTAGE: &str = "Compare the cycles in the details: if all are off, check the 5 V supply at the test socket; if one is off, check the contacts.";
const CURRENT: &str = "Compare the cycles in the details: if the current differs after one power-on, the module started differently; suspect its supplies and its firmware.";
const OFF: &str =
    "Something feeds the module with its supply off: check the board's switch, and lines that lead to other devices.";

/// Completed cycles.
pub const CYCLES_DONE: MeasurementSpec = count("cycles_done", "The test ended early: see the log of this item.");
/// Cycles in which the module did not report its identity before `identity_timeout`.
pub const STARTS_MISSED: MeasurementSpec =
    count("starts_missed", "The module does not start each time: suspect its supplies, its reset and its boot flash.");
/// Board time from the request for power to the first identity, in the slowest cycle.
pub const TIME_TO_IDENTITY: MeasurementSpec = number(
    "time_to_identity",
    Unit::Second,
    Dimension::Time,
    "The module starts late: compare the cycles in the details; suspect its reset, its oscillator and its boot flash.",
);
/// Lowest voltage at the socket after settling.
pub const SUPPLY_VOLTAGE_MIN: MeasurementSpec = number("supply_voltage_min", Unit::Volt, Dimension::Voltage, VOLTAGE);
/// Highest voltage at the socket after settling.
pub const SUPPLY_VOLTAGE_MAX: MeasurementSpec = number("supply_voltage_max", Unit::Volt, Dimension::Voltage, VOLTAGE);
/// Lowest current into the module after settling.
pub const SUPPLY_CURRENT_MIN: MeasurementSpec = number("supply_current_min", Unit::Ampere, Dimension::Current, CURRENT);
/// Highest current into the module after settling.
pub const SUPPLY_CURRENT_MAX: MeasurementSpec = number("supply_current_max", Unit::Ampere, Dimension::Current, CURRENT);
/// Highest voltage at the socket at the end of the time without supply.
pub const OFF_VOLTAGE: MeasurementSpec = number("off_voltage", Unit::Millivolt, Dimension::Voltage, OFF);
/// Highest current into the module at the end of the time without supply.
pub const OFF_CURRENT: MeasurementSpec = number("off_current", Unit::Ampere, Dimension::Current, OFF);

/// The board's switch takes the supply away and gives it back.
pub(super) static POWER_CYCLE: ItemSpec = ItemSpec {
    title: "Power cycles",
    params: &[
        ParamSpec {
            name: "cycles",
            about: "number of times that the supply goes off and on again",
            kind: ParamKind::Integer { min: 1, max: 100, default: 3 },
        },
        quantity("off_time", "time without supply in each cycle", Unit::Second, (0.1, 600.0), 2.0),
        quantity(
            "settling_time",
            "time from the first identity to the reading of the supply",
            Unit::Second,
            (0.0, 60.0),
            0.5,
        ),
        quantity(
            "identity_timeout",
            "board time after power-on within which the module must report its identity",
            Unit::Second,
            (0.2, 60.0),
            2.0,
        ),
    ],
    measurements: &[
        CYCLES_DONE,
        STARTS_MISSED,
        TIME_TO_IDENTITY,
        SUPPLY_VOLTAGE_MIN,
        SUPPLY_VOLTAGE_MAX,
        SUPPLY_CURRENT_MIN,
        SUPPLY_CURRENT_MAX,
        OFF_VOLTAGE,
        OFF_CURRENT,
    ],
    devices: &[Device::Slave, Device::BoardSupply],
    resources: &[Resource::Power],
    needs: &[],
    traces: Traces { leaves: &[Trace::PowerOn], feels: &[] },
    timeout_s: 600.0,
};
