//! The contract between procedures, which measure, and plans, which judge: what every item takes and what it yields.
//!
//! Pure data. A procedure yields exactly the measurements that stand here, and a plan may limit exactly those.
//!
//! A bench that lacks a device of an item cannot run it: the plan is then refused before power-on, unless it calls
//! the item optional, which makes it skipped with that cause.

mod calibration;
mod magnetometer;
mod memory;
mod noise;
mod performance;
mod ports;
mod processor;
mod repeated;
mod sensors;
mod shared;

use std::fmt;

use serde::{Deserialize, Serialize};

use crate::limit::Kind;
use crate::quantity::{Dimension, Unit};

/// A test item.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum ItemId {
    /// Who is in the socket: serial number, part, versions, supply.
    Identity,
    /// Both cores.
    Cpu,
    /// The three timers.
    Timers,
    /// Internal RAM of the DSP.
    InternalRam,
    /// External SDRAM.
    Sdram,
    /// SPI flash, in a scratch sector.
    SpiFlash,
    /// Internal flash, in a scratch sector.
    InternalFlash,
    /// Gyroscopes and accelerometers at rest.
    Imu,
    /// Satellite receiver.
    Gnss,
    /// AD channels and magnetometer.
    Ad,
    /// The four IO lines.
    Io,
    /// SPI against the IO lines.
    Spi,
    /// RS-422 echo.
    Sci,
    /// CAN echo.
    Can,
    /// Accelerometer calibration from six, twelve or twenty-four positions.
    SixPosition,
    /// Gyroscope bias and g-sensitivity from still positions.
    GyroStill,
    /// Gyroscope scale factor and coupling from turns by a known angle.
    Rotation,
    /// Gyroscope bias that calibration leaves.
    GyroBias,
    /// Accelerometer bias that calibration leaves, from turns upside down.
    AccelBias,
    /// Scatter of ten-second means over an hour.
    BiasStability,
    /// Scatter of means from power-on to power-on.
    BiasRepeatability,
    /// Scatter of the scale factors from power-on to power-on.
    ScaleFactorRepeatability,
    /// Coupling between axes that calibration leaves.
    CrossCoupling,
    /// Response to a step of the published resolution.
    Resolution,
    /// Allan deviations and noise coefficients.
    Allan,
    /// Power spectral densities.
    Psd,
    /// Magnetometer spun about its third axis: ellipse and roll angle.
    MagnetometerEllipse,
    /// Magnetometer over many attitudes: hard and soft iron.
    MagnetometerEllipsoid,
    /// Position, velocity and 1PPS about the surveyed antenna.
    GnssAccuracy,
    /// The coefficients are stored in the module and read back.
    CalibrationDownload,
    /// A position and a rotation with the stored coefficients.
    CalibrationCheck,
}

impl ItemId {
    /// Every item, in the order of the tables of the test specification.
    pub const ALL: [ItemId; 31] = [
        ItemId::Identity,
        ItemId::Cpu,
        ItemId::Timers,
        ItemId::InternalRam,
        ItemId::Sdram,
        ItemId::SpiFlash,
        ItemId::InternalFlash,
        ItemId::Imu,
        ItemId::Gnss,
        ItemId::Ad,
        ItemId::Io,
        ItemId::Spi,
        ItemId::Sci,
        ItemId::Can,
        ItemId::SixPosition,
        ItemId::GyroStill,
        ItemId::Rotation,
        ItemId::GyroBias,
        ItemId::AccelBias,
        ItemId::BiasStability,
        ItemId::BiasRepeatability,
        ItemId::ScaleFactorRepeatability,
        ItemId::CrossCoupling,
        ItemId::Resolution,
        ItemId::Allan,
        ItemId::Psd,
        ItemId::MagnetometerEllipse,
        ItemId::MagnetometerEllipsoid,
        ItemId::GnssAccuracy,
        ItemId::CalibrationDownload,
        ItemId::CalibrationCheck,
    ];

    /// The id as plans and records write it.
    pub fn as_str(self) -> &'static str {
        match self {
            ItemId::Identity => "identity",
            ItemId::Cpu => "cpu",
            ItemId::Timers => "timers",
            ItemId::InternalRam => "internal-ram",
            ItemId::Sdram => "sdram",
            ItemId::SpiFlash => "spi-flash",
            ItemId::InternalFlash => "internal-flash",
            ItemId::Imu => "imu",
            ItemId::Gnss => "gnss",
            ItemId::Ad => "ad",
            ItemId::Io => "io",
            ItemId::Spi => "spi",
            ItemId::Sci => "sci",
            ItemId::Can => "can",
            ItemId::SixPosition => "six-position",
            ItemId::GyroStill => "gyro-still",
            ItemId::Rotation => "rotation",
            ItemId::GyroBias => "gyro-bias",
            ItemId::AccelBias => "accel-bias",
            ItemId::BiasStability => "bias-stability",
            ItemId::BiasRepeatability => "bias-repeatability",
            ItemId::ScaleFactorRepeatability => "scale-factor-repeatability",
            ItemId::CrossCoupling => "cross-coupling",
            ItemId::Resolution => "resolution",
            ItemId::Allan => "allan",
            ItemId::Psd => "psd",
            ItemId::MagnetometerEllipse => "magnetometer-ellipse",
            ItemId::MagnetometerEllipsoid => "magnetometer-ellipsoid",
            ItemId::GnssAccuracy => "gnss-accuracy",
            ItemId::CalibrationDownload => "calibration-download",
            ItemId::CalibrationCheck => "calibration-check",
        }
    }

    /// The item with this id.
    pub(crate) fn from_id(id: &str) -> Option<ItemId> {
        ItemId::ALL.into_iter().find(|item| item.as_str() == id)
    }

    /// What the item takes and yields.
    pub fn spec(self) -> &'static ItemSpec {
        match self {
            ItemId::Identity => &processor::IDENTITY,
            ItemId::Cpu => &processor::CPU,
            ItemId::Timers => &processor::TIMERS,
            ItemId::InternalRam => &memory::INTERNAL_RAM,
            ItemId::Sdram => &memory::SDRAM,
            ItemId::SpiFlash => &memory::SPI_FLASH,
            ItemId::InternalFlash => &memory::INTERNAL_FLASH,
            ItemId::Imu => &sensors::IMU,
            ItemId::Gnss => &sensors::GNSS,
            ItemId::Ad => &sensors::AD,
            ItemId::Io => &ports::IO,
            ItemId::Spi => &ports::SPI,
            ItemId::Sci => &ports::SCI,
            ItemId::Can => &ports::CAN,
            ItemId::SixPosition => &calibration::SIX_POSITION,
            ItemId::GyroStill => &calibration::GYRO_STILL,
            ItemId::Rotation => &calibration::ROTATION,
            ItemId::GyroBias => &performance::GYRO_BIAS,
            ItemId::AccelBias => &performance::ACCEL_BIAS,
            ItemId::BiasStability => &performance::BIAS_STABILITY,
            ItemId::BiasRepeatability => &performance::BIAS_REPEATABILITY,
            ItemId::ScaleFactorRepeatability => &repeated::SCALE_FACTOR_REPEATABILITY,
            ItemId::CrossCoupling => &repeated::CROSS_COUPLING,
            ItemId::Resolution => &performance::RESOLUTION,
            ItemId::Allan => &noise::ALLAN,
            ItemId::Psd => &noise::PSD,
            ItemId::MagnetometerEllipse => &magnetometer::ELLIPSE,
            ItemId::MagnetometerEllipsoid => &magnetometer::ELLIPSOID,
            ItemId::GnssAccuracy => &sensors::GNSS_ACCURACY,
            ItemId::CalibrationDownload => &calibration::DOWNLOAD,
            ItemId::CalibrationCheck => &calibration::CHECK,
        }
    }
}

impl ItemId {
    /// Items whose results this one works with, and the parameter that switches the need on. A plan has them before it.
    pub(crate) fn needs(self) -> &'static [(ItemId, Option<When>)] {
        const GYRO: Option<When> = Some(When::HasText { param: "sensors", element: "gyro" });
        match self {
            ItemId::GyroBias | ItemId::CalibrationDownload => {
                &[(ItemId::SixPosition, None), (ItemId::GyroStill, None), (ItemId::Rotation, None)]
            }
            ItemId::AccelBias => &[(ItemId::SixPosition, None)],
            // The gyroscopes' g-sensitivity is taken out with the force that the accelerometers measure.
            ItemId::BiasStability | ItemId::BiasRepeatability | ItemId::Resolution | ItemId::Allan | ItemId::Psd => {
                &[(ItemId::SixPosition, None), (ItemId::GyroStill, GYRO), (ItemId::Rotation, GYRO)]
            }
            ItemId::CalibrationCheck => &[(ItemId::CalibrationDownload, None)],
            _ => &[],
        }
    }
}

impl fmt::Display for ItemId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.as_str())
    }
}

/// One item of the table.
#[derive(Debug)]
pub struct ItemSpec {
    /// For people: "CPU, both cores".
    pub title: &'static str,
    /// What a plan can set.
    pub params: &'static [ParamSpec],
    /// What the procedure yields.
    pub measurements: &'static [MeasurementSpec],
    /// What the bench must have.
    pub devices: &'static [Device],
    /// What no other item may use at the same time.
    pub resources: &'static [Resource],
    /// Board time after which an attempt is given up, unless the plan says otherwise.
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
    /// What it sets, for people.
    pub about: &'static str,
    /// What it may be.
    pub kind: ParamKind,
}

/// What a parameter may be, and what it is where the plan is silent.
#[derive(Debug)]
pub enum ParamKind {
    /// A whole number.
    Integer {
        /// Smallest value.
        min: i64,
        /// Largest value.
        max: i64,
        /// Where the plan is silent.
        default: i64,
    },
    /// A list of different whole numbers, at least one.
    Integers {
        /// Smallest value.
        min: i64,
        /// Largest value.
        max: i64,
        /// Where the plan is silent.
        default: &'static [i64],
    },
    /// A number with a unit.
    Quantity {
        /// Unit of the bounds and the default; the plan may use any of the same dimension.
        unit: Unit,
        /// Smallest value.
        min: f64,
        /// Largest value.
        max: f64,
        /// Where the plan is silent.
        default: f64,
    },
    /// One text of a set.
    Choice {
        /// The set.
        of: &'static [&'static str],
        /// Where the plan is silent.
        default: &'static str,
    },
    /// A list of different texts of a set, at least one.
    Choices {
        /// The set.
        of: &'static [&'static str],
        /// Where the plan is silent.
        default: &'static [&'static str],
    },
    /// Name of an item of the plan that stands before this one, whose captures are used; none where the plan is silent:
    /// the item captures by itself. The item is skipped unless that other one is good.
    Source {
        /// What the other item may be.
        of: &'static [ItemId],
    },
}

/// One measurement of an item.
#[derive(Clone, Copy, Debug)]
pub struct MeasurementSpec {
    /// The key in the plan's limits and in records.
    pub name: &'static str,
    /// Text, or a number of a dimension.
    pub kind: Kind,
    /// Unit in which it is shown where no limit chooses one; [`Unit::Count`] for texts.
    pub unit: Unit,
    /// What to look at when it fails: a sentence for operator and engineer.
    pub look_at: &'static str,
    /// The parameter that switches it on; without one it always comes.
    pub when: Option<When>,
}

/// A measurement that comes only if a list parameter contains an element.
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

/// What a bench may have or lack.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Device {
    /// Any link to the slave test board, RS-422 or CAN.
    Slave,
    /// An RS-422 link to the slave test board.
    Rs422,
    /// A CAN link to the slave test board.
    Can,
    /// Somebody, or a fixture, who answers prompts.
    Operator,
}

impl Device {
    /// For people, in "the bench has no …".
    pub(crate) fn as_str(self) -> &'static str {
        match self {
            Device::Slave => "link to the slave board",
            Device::Rs422 => "RS-422 link",
            Device::Can => "CAN link",
            Device::Operator => "operator",
        }
    }

    /// What can be tried when it is missing.
    pub(crate) fn hint(self) -> &'static str {
        match self {
            Device::Slave => "name the port under [socket] in the bench file",
            Device::Rs422 => {
                "name the port under [socket] in the bench file, or call the item optional with optional = true"
            }
            Device::Can => "connect a CAN adapter, or call the item optional with optional = true",
            Device::Operator => "run it on a terminal, or call the item optional with optional = true",
        }
    }
}

/// What items share. Two items may run at once if none of their resources exclude each other.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Resource {
    /// The module must not move; several items may need that at once.
    Still,
    /// The module is turned.
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
    /// The supply of the module is switched or settles: excludes every other item.
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

    /// Whether one item with this resource and one with the other cannot run at once.
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
        // Two items of one kind want the same device, and one without resources still wants its module powered.
        self == other
            || switches(self.spec().resources)
            || switches(others)
            || self.spec().resources.iter().any(|mine| others.iter().any(|theirs| mine.excludes(*theirs)))
    }
}

/// A measured number that always comes.
const fn number(name: &'static str, unit: Unit, dimension: Dimension, look_at: &'static str) -> MeasurementSpec {
    MeasurementSpec { name, kind: Kind::Number(dimension), unit, look_at, when: None }
}

/// A counted number that always comes.
const fn count(name: &'static str, look_at: &'static str) -> MeasurementSpec {
    number(name, Unit::Count, Dimension::Count, look_at)
}

/// A text that always comes.
const fn text(name: &'static str, look_at: &'static str) -> MeasurementSpec {
    MeasurementSpec { name, kind: Kind::Text, unit: Unit::Count, look_at, when: None }
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
