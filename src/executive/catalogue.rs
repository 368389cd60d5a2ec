//! The contract between procedures, which measure, and plans, which judge: what every item takes and yields.
//!
//! The catalogue is pure data. A procedure yields exactly the measurements that stand here, and a plan may limit
//! exactly those. Procedures name a measurement by its constant, so that a misspelt name does not compile.
//!
//! A bench without a device of an item cannot run it. The station then refuses the plan before power-on, unless the
//! plan calls the item optional; such an item is skipped with that cause.

pub mod calibration;
pub mod magnetometer;
pub mod memory;
pub mod noise;
mod page;
pub mod performance;
pub mod ports;
pub mod power;
pub mod processor;
mod prompt;
pub mod repeated;
pub mod sensors;
mod shared;
mod traces;

use std::fmt;

use serde::{Deserialize, Serialize};

use crate::limit::MeasurementKind;
use crate::quantity::{Dimension, Unit};
pub use page::page;
pub use shared::{
    COUPLED_PAIRS, FAILED_READS, PerTriad, SAMPLE_RATE, SENSOR_PAIRS, SPIKES, STALE_SAMPLES, TEMPERATURE,
    TEMPERATURE_DRIFT,
};
pub use traces::{Trace, Traces};

/// Makes the items out of one table. A row is an item: its description (the doc comment, which people read), its id in
/// plans and records, and its specification.
macro_rules! items {
    ($($(#[doc = $about:literal])* $item:ident = $id:literal: $spec:path,)*) => {
        /// A test item.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
        pub enum ItemId {
            $($(#[doc = $about])* #[serde(rename = $id)] $item,)*
        }

        impl ItemId {
            /// Every item, in the order of the tables of the test specification.
            pub const ALL: [ItemId; [$($id),*].len()] = [$(ItemId::$item),*];

            /// The id as plans and records write it.
            pub fn as_str(self) -> &'static str {
                match self {
                    $(ItemId::$item => $id,)*
                }
            }

            /// A description of its test, in a sentence.
            fn about(self) -> &'static str {
                match self {
                    $(ItemId::$item => concat!($($about),*).trim_ascii(),)*
                }
            }

            /// What the item takes and yields.
            pub fn spec(self) -> &'static ItemSpec {
                match self {
                    $(ItemId::$item => &$spec,)*
                }
            }
        }
    };
}

items! {
    /// The module in the socket: serial number, part, versions, supply.
    Identity = "identity": processor::IDENTITY,
    /// Both cores: registers, memory, integer and floating-point arithmetic, compared bit for bit with this computer.
    Cpu = "cpu": processor::CPU,
    /// The three timers: their intervals against the clock of the board, and missing interrupts.
    Timers = "timers": processor::TIMERS,
    /// Internal RAM of the DSP: every word, pattern by pattern.
    InternalRam = "internal-ram": memory::INTERNAL_RAM,
    /// External SDRAM: every word, pattern by pattern.
    Sdram = "sdram": memory::SDRAM,
    /// SPI flash, in a scratch sector: erase, blank check, write, read back.
    SpiFlash = "spi-flash": memory::SPI_FLASH,
    /// Internal flash, in a scratch sector: erase, blank check, write, read back.
    InternalFlash = "internal-flash": memory::INTERNAL_FLASH,
    /// Gyroscopes and accelerometers at rest: means, noise, stuck and saturated channels.
    Imu = "imu": sensors::IMU,
    /// Satellite receiver: fix, position, 1PPS, and faults in its sentences.
    Gnss = "gnss": sensors::GNSS,
    /// AD channels with each DIP switch on and off, and the magnetometer at several headings.
    Ad = "ad": sensors::AD,
    /// The four IO lines: every ordered pair at both levels, and shorts.
    Io = "io": ports::IO,
    /// SPI against the IO lines, both ways.
    Spi = "spi": ports::SPI,
    /// RS-422 echo of blocks of several lengths.
    Sci = "sci": ports::SCI,
    /// CAN echo of standard and extended frames.
    Can = "can": ports::CAN,
    /// The board switches the supply off and on: the module must start each time, as fast as before and with the same
    /// current.
    PowerCycle = "power-cycle": power::POWER_CYCLE,
    /// Questions of the plan's own to the operator: a number, a text, a choice, or that something is done.
    Prompt = "prompt": prompt::PROMPT,
    /// Accelerometer calibration from six, twelve or twenty-four positions.
    SixPosition = "six-position": calibration::SIX_POSITION,
    /// Gyroscope bias and g-sensitivity from still positions.
    GyroStill = "gyro-still": calibration::GYRO_STILL,
    /// Gyroscope scale factor and coupling from turns by a known angle.
    Rotation = "rotation": calibration::ROTATION,
    /// Gyroscope bias that remains after calibration.
    GyroBias = "gyro-bias": performance::GYRO_BIAS,
    /// Accelerometer bias that remains after calibration, from turns upside down.
    AccelBias = "accel-bias": performance::ACCEL_BIAS,
    /// Scatter of ten-second means over an hour.
    BiasStability = "bias-stability": performance::BIAS_STABILITY,
    /// Scatter of means from power-on to power-on.
    BiasRepeatability = "bias-repeatability": performance::BIAS_REPEATABILITY,
    /// Scatter of the scale factors from power-on to power-on.
    ScaleFactorRepeatability = "scale-factor-repeatability": repeated::SCALE_FACTOR_REPEATABILITY,
    /// Coupling between axes that remains after calibration.
    CrossCoupling = "cross-coupling": repeated::CROSS_COUPLING,
    /// Response to a step of the published resolution.
    Resolution = "resolution": performance::RESOLUTION,
    /// Allan deviations and noise coefficients.
    Allan = "allan": noise::ALLAN,
    /// Power spectral densities.
    Psd = "psd": noise::PSD,
    /// Magnetometer spun about its third axis: ellipse and roll angle.
    MagnetometerEllipse = "magnetometer-ellipse": magnetometer::ELLIPSE,
    /// Magnetometer over many attitudes: hard and soft iron.
    MagnetometerEllipsoid = "magnetometer-ellipsoid": magnetometer::ELLIPSOID,
    /// Errors of position, velocity and 1PPS, with the antenna at a surveyed place.
    GnssAccuracy = "gnss-accuracy": sensors::GNSS_ACCURACY,
    /// Stores the coefficients in the module and reads them back.
    CalibrationDownload = "calibration-download": calibration::DOWNLOAD,
    /// A position and a rotation with the stored coefficients.
    CalibrationCheck = "calibration-check": calibration::CHECK,
}

impl ItemId {
    /// The item with this id.
    pub(crate) fn from_id(id: &str) -> Option<ItemId> {
        ItemId::ALL.into_iter().find(|item| item.as_str() == id)
    }
}

impl fmt::Display for ItemId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.as_str())
    }
}

/// The specification of an item.
#[derive(Debug)]
pub struct ItemSpec {
    /// The title for people: "CPU, both cores".
    pub title: &'static str,
    /// The parameters that a plan can set.
    pub params: &'static [ParamSpec],
    /// The measurements that the procedure yields.
    pub measurements: &'static [MeasurementSpec],
    /// The devices that the bench must have.
    pub devices: &'static [Device],
    /// The resources that no other item may use at the same time.
    pub resources: &'static [Resource],
    /// Items whose results this item uses, and the parameter that switches the need on. A plan has them before this
    /// item.
    pub needs: &'static [(ItemId, Option<When>)],
    /// What it leaves in the module, for a run that is resumed.
    pub traces: Traces,
    /// Board time after which an attempt is given up, unless the plan states another one.
    pub timeout_s: f64,
}

impl ItemSpec {
    /// The measurement of this name.
    pub fn measurement(&self, name: &str) -> Option<&'static MeasurementSpec> {
        self.measurements.iter().find(|measurement| measurement.name == name)
    }

    /// The parameter of this name.
    pub(crate) fn param(&self, name: &str) -> Option<&'static ParamSpec> {
        self.params.iter().find(|param| param.name == name)
    }
}

/// One parameter of an item.
#[derive(Debug)]
pub struct ParamSpec {
    /// The key in the plan.
    pub name: &'static str,
    /// What the parameter sets, for people.
    pub about: &'static str,
    /// The allowed values.
    pub kind: ParamKind,
}

/// The allowed values of a parameter, and its default.
#[derive(Debug)]
pub enum ParamKind {
    /// A whole number.
    Integer {
        /// Smallest value.
        min: i64,
        /// Largest value.
        max: i64,
        /// The value if the plan gives none.
        default: i64,
    },
    /// A list of different whole numbers, at least one.
    Integers {
        /// Smallest value.
        min: i64,
        /// Largest value.
        max: i64,
        /// The value if the plan gives none.
        default: &'static [i64],
    },
    /// A number with a unit.
    Quantity {
        /// Unit of the bounds and the default; the plan may use any unit of the same dimension.
        unit: Unit,
        /// Smallest value.
        min: f64,
        /// Largest value.
        max: f64,
        /// The value if the plan gives none.
        default: f64,
    },
    /// One text of a set.
    Choice {
        /// The set.
        of: &'static [&'static str],
        /// The value if the plan gives none.
        default: &'static str,
    },
    /// A list of different texts of a set, at least one.
    Choices {
        /// The set.
        of: &'static [&'static str],
        /// The value if the plan gives none.
        default: &'static [&'static str],
    },
    /// Name of an earlier item of the plan. This item uses the captures of that one, and is skipped unless that one is
    /// good. Without a name the item captures by itself.
    Source {
        /// The kinds of items that may be named.
        of: &'static [ItemId],
    },
}

/// One measurement of an item.
#[derive(Clone, Copy, Debug)]
pub struct MeasurementSpec {
    /// The key in the plan's limits and in records.
    pub name: &'static str,
    /// Text, or a number of a dimension.
    pub kind: MeasurementKind,
    /// Unit for display if no limit chooses one; [`Unit::Count`] for texts.
    pub unit: Unit,
    /// What to look at when the measurement fails: a sentence for operator and engineer.
    pub look_at: &'static str,
    /// The condition for this measurement; `None` if it always comes.
    pub when: Option<When>,
}

/// The condition that a list parameter contains an element.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum When {
    /// The list of whole numbers `param` contains `element`.
    HasInteger {
        /// Name of the parameter.
        param: &'static str,
        /// The element.
        element: i64,
    },
    /// The list of texts `param` contains `element`.
    HasText {
        /// Name of the parameter.
        param: &'static str,
        /// The element.
        element: &'static str,
    },
}

/// A device that a bench may have or lack.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Device {
    /// Any link to the slave test board, RS-422 or CAN.
    Slave,
    /// An RS-422 link to the slave test board.
    Rs422,
    /// A CAN link to the slave test board.
    Can,
    /// A person or a fixture that answers prompts.
    Operator,
    /// The slave board's switch of the module's supply, which also measures it.
    BoardSupply,
    /// The slave board's own CAN.
    BoardCan,
    /// A calibration that the module keeps, and a slave board that compensates samples by it.
    BoardCalibration,
}

impl Device {
    /// The name for people, in "the bench has no …".
    pub(crate) fn as_str(self) -> &'static str {
        match self {
            Device::Slave => "link to the slave board",
            Device::Rs422 => "RS-422 link",
            Device::Can => "CAN link",
            Device::Operator => "operator",
            Device::BoardSupply => "slave board that switches and measures the module's supply",
            Device::BoardCan => "slave board with CAN",
            Device::BoardCalibration => "module and slave board that keep a calibration",
        }
    }

    /// What people can try if the device is missing.
    pub(crate) fn hint(self) -> &'static str {
        match self {
            Device::Slave => "name the port under [socket] in the bench file",
            Device::Rs422 => {
                "name the port under [socket] in the bench file, or make the item optional with optional = true"
            }
            Device::Can => "connect a CAN adapter, or make the item optional with optional = true",
            Device::Operator => "run the plan on a terminal, or make the item optional with optional = true",
            Device::BoardSupply | Device::BoardCan | Device::BoardCalibration => {
                "use a board that has it, or make the items optional with optional = true"
            }
        }
    }
}

/// A resource that items share. Two items may run at once if their resources do not exclude each other.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Resource {
    /// The module must not move; several items may need that at once.
    Still,
    /// The item turns the module.
    Attitude,
    /// The four IO lines, which SPI uses as well.
    IoPins,
    /// A flash memory being erased.
    Flash,
    /// The cores' undivided time.
    Processor,
    /// The bandwidth of the RS-422 link.
    Link,
    /// The CAN bus.
    CanBus,
    /// The item switches the module's supply, or the supply settles: this excludes every other item.
    Power,
}

impl Resource {
    /// All of them.
    pub(crate) const ALL: [Resource; 8] = [
        Resource::Still,
        Resource::Attitude,
        Resource::IoPins,
        Resource::Flash,
        Resource::Processor,
        Resource::Link,
        Resource::CanBus,
        Resource::Power,
    ];

    /// Whether an item with this resource and an item with the other one cannot run at once.
    pub(crate) fn excludes(self, other: Resource) -> bool {
        match (self, other) {
            (Resource::Still, Resource::Still) => false,
            (Resource::Still, Resource::Attitude) | (Resource::Attitude, Resource::Still) => true,
            (Resource::Power, _) | (_, Resource::Power) => true,
            _ => self == other,
        }
    }
}

impl ItemId {
    /// Whether two items may not run at the same time.
    pub(crate) fn excludes(self, other: ItemId) -> bool {
        let others = other.spec().resources;
        let switches = |resources: &[Resource]| resources.contains(&Resource::Power);
        // Two items of one kind need the same device, and an item without resources still needs a powered module.
        self == other
            || switches(self.spec().resources)
            || switches(others)
            || self.spec().resources.iter().any(|mine| others.iter().any(|theirs| mine.excludes(*theirs)))
    }
}

/// A measured number that always comes.
const fn number(name: &'static str, unit: Unit, dimension: Dimension, look_at: &'static str) -> MeasurementSpec {
    MeasurementSpec { name, kind: MeasurementKind::Number(dimension), unit, look_at, when: None }
}

/// A counted number that always comes.
const fn count(name: &'static str, look_at: &'static str) -> MeasurementSpec {
    number(name, Unit::Count, Dimension::Count, look_at)
}

/// A text that always comes.
const fn text(name: &'static str, look_at: &'static str) -> MeasurementSpec {
    MeasurementSpec { name, kind: MeasurementKind::Text, unit: Unit::Count, look_at, when: None }
}

/// Makes a measurement depend on a list of whole numbers.
const fn if_integer(spec: MeasurementSpec, param: &'static str, element: i64) -> MeasurementSpec {
    MeasurementSpec { when: Some(When::HasInteger { param, element }), ..spec }
}

/// Makes a measurement depend on a list of texts.
const fn if_text(spec: MeasurementSpec, param: &'static str, element: &'static str) -> MeasurementSpec {
    MeasurementSpec { when: Some(When::HasText { param, element }), ..spec }
}

#[cfg(test)]
mod tests;
