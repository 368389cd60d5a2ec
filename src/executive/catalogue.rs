//! The contract between procedures, which measure, and plans, which judge: what every item takes and what it yields.
//!
//! Pure data. A procedure yields exactly the measurements that stand here, and a plan may limit exactly those.
//!
//! A bench that lacks a device of an item cannot run it: the plan is then refused before power-on, unless it calls
//! the item optional, which makes it skipped with that cause.

mod memory;
mod ports;
mod processor;
mod sensors;

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
}

impl ItemId {
    /// Every item, in the order of the table of the test specification.
    pub const ALL: [ItemId; 14] = [
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
        }
    }

    /// The item with this id.
    pub fn from_id(id: &str) -> Option<ItemId> {
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
    pub fn param(&self, name: &str) -> Option<&'static ParamSpec> {
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
    pub fn as_str(self) -> &'static str {
        match self {
            Device::Slave => "link to the slave board",
            Device::Rs422 => "RS-422 link",
            Device::Can => "CAN link",
            Device::Operator => "operator",
        }
    }

    /// What can be tried when it is missing.
    pub fn hint(self) -> &'static str {
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
}

impl Resource {
    /// All of them.
    pub const ALL: [Resource; 7] = [
        Resource::Still,
        Resource::Attitude,
        Resource::IoPins,
        Resource::Flash,
        Resource::Processor,
        Resource::Link,
        Resource::CanBus,
    ];

    /// Whether one item with this resource and one with the other cannot run at once.
    pub fn excludes(self, other: Resource) -> bool {
        match (self, other) {
            (Resource::Still, Resource::Still) => false,
            (Resource::Still, Resource::Attitude) | (Resource::Attitude, Resource::Still) => true,
            _ => self == other,
        }
    }
}

impl ItemId {
    /// Whether two items may not run at the same time.
    pub fn excludes(self, other: ItemId) -> bool {
        let others = other.spec().resources;
        self.spec().resources.iter().any(|mine| others.iter().any(|theirs| mine.excludes(*theirs)))
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
mod tests {
    use std::collections::BTreeSet;

    use super::*;

    #[test]
    fn the_table_is_consistent() {
        for item in ItemId::ALL {
            let spec = item.spec();
            assert_eq!(ItemId::from_id(item.as_str()), Some(item));
            assert_eq!(serde_json::to_string(&item).unwrap(), format!("\"{item}\""));
            assert!(spec.timeout_s > 0.0);
            assert!(spec.devices.contains(&Device::Slave), "{item}");
            let names: BTreeSet<&str> = spec.measurements.iter().map(|measurement| measurement.name).collect();
            assert_eq!(names.len(), spec.measurements.len(), "{item} has a measurement twice");
            for measurement in spec.measurements {
                let name = measurement.name;
                assert!(name.bytes().all(|b| b.is_ascii_lowercase() || b.is_ascii_digit() || b == b'_'), "{name}");
                assert!(measurement.look_at.ends_with('.'), "{item} {name}: not a sentence");
                match measurement.kind {
                    Kind::Number(dimension) => assert_eq!(measurement.unit.dimension(), dimension, "{item} {name}"),
                    Kind::Text => assert_eq!(measurement.unit, Unit::Count),
                }
                match measurement.when {
                    None => {}
                    Some(When::HasInteger { param, element }) => match &spec.param(param).unwrap().kind {
                        ParamKind::Integers { min, max, .. } => assert!((*min..=*max).contains(&element)),
                        other => panic!("{item} {name}: {param} is {other:?}"),
                    },
                    Some(When::HasText { param, element }) => match &spec.param(param).unwrap().kind {
                        ParamKind::Choices { of, .. } => assert!(of.contains(&element)),
                        other => panic!("{item} {name}: {param} is {other:?}"),
                    },
                }
            }
            for param in spec.params {
                match param.kind {
                    ParamKind::Integer { min, max, default } => assert!((min..=max).contains(&default)),
                    ParamKind::Integers { min, max, default } => {
                        assert!(!default.is_empty() && default.iter().all(|value| (min..=max).contains(value)));
                    }
                    ParamKind::Quantity { min, max, default, .. } => assert!((min..=max).contains(&default)),
                    ParamKind::Choice { of, default } => assert!(of.contains(&default)),
                    ParamKind::Choices { of, default } => {
                        assert!(!default.is_empty() && default.iter().all(|text| of.contains(text)));
                    }
                }
            }
        }
    }

    #[test]
    fn shared_pins_and_motion_exclude() {
        assert!(ItemId::Io.excludes(ItemId::Spi));
        assert!(ItemId::Ad.excludes(ItemId::Imu));
        assert!(ItemId::Imu.excludes(ItemId::Ad));
        assert!(!ItemId::Gnss.excludes(ItemId::Sdram));
        assert!(!Resource::Still.excludes(Resource::Still));
    }

    #[test]
    fn counts_of_measurements_are_those_of_the_specification() {
        let counts: Vec<usize> = ItemId::ALL.iter().map(|item| item.spec().measurements.len()).collect();
        // identity 7, cpu 2 x 4, timers 3 x (4 x 3 + 1), memories 5 + 2, flashes 5 and 4, imu 17, gnss 14,
        // ad 5 x 2 + 1 + 3, io 3, spi 3, sci 6, can 7.
        assert_eq!(counts, [7, 8, 39, 7, 7, 5, 4, 17, 14, 14, 3, 3, 6, 7]);
    }
}
