//! The imperfections that a bench knows: how the module's seat is mounted on the table, how well the table's axis is
//! aligned, and what magnetic field the bench adds to the earth's.
//!
//! ```toml
//! [fixture]                                        # optional, as each of its keys
//! mounting = ["0.012 deg", "-0.018 deg", "0 deg"]  # rotation from the table's axes to the seat's, about X, Y, Z
//! mounting_u = "0.002 deg"                         # how well it is known
//! axis_u = "0.02 deg"                              # alignment of the table's axis
//! runout_u = "0.001 deg"                           # tilt of that axis in step with the turn
//! field_u = "0.2 mgauss"                           # field of the fixture at the magnetometer, each axis
//! ambient_u = "0.1 mgauss"                         # departure of the ambient field from its mean
//! board_clock_u = "5 ppm"                          # rate of the slave board's crystal against true time
//! ```
//!
//! Every `_u` is a standard uncertainty. The defaults of [`BenchImperfections::default`] hold for missing keys.

use gnc_config::TomlTable;
use serde::{Deserialize, Serialize};

use crate::quantity::{Unit, bounded, bounded_at};

/// Largest angle of an imperfection. A larger angle is another attitude.
const MOST_DEG: f64 = 5.0;
/// Largest field of a fixture. Beyond it the fixture is a magnet.
const MOST_GAUSS: f64 = 0.1;
/// Largest uncertainty of a crystal. Beyond it the board has no crystal.
const MOST_PPM: f64 = 1000.0;

/// Imperfections of the bench. Angles in rad, fields in gauss, rates in ppm; every `_u` is a standard uncertainty.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BenchImperfections {
    /// Rotation vector that transforms components in the table's axes into components in the axes of the module's seat.
    /// `None` if it was not measured; it then counts as zero.
    pub mounting_rad: Option<[f64; 3]>,
    /// How well the mounting is known, about each axis.
    pub mounting_u_rad: f64,
    /// Alignment of the table's axis with the commanded direction.
    pub axis_u_rad: f64,
    /// Tilt of the axis in step with the turn, each of two components.
    pub runout_u_rad: f64,
    /// Field of the fixture itself, which turns with the module, on each axis.
    pub field_u_gauss: f64,
    /// Departure of the ambient field from its mean: one value for a whole item, and another one for each of its
    /// attitudes.
    pub ambient_u_gauss: f64,
    /// Rate of the slave board's clock against true time, ppm; `None` if the bench file does not state it; the plan's
    /// `clock_u` counts then.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub board_clock_u_ppm: Option<f64>,
}

impl Default for BenchImperfections {
    /// The defaults stand for a socket that is screwed on by hand, a position table that is levelled with a spirit
    /// level and pointed by a compass theodolite, a fixture of aluminium and brass, and a laboratory without lifts or
    /// trams next to it.
    fn default() -> Self {
        Self {
            mounting_rad: None,
            mounting_u_rad: 0.015_f64.to_radians(),
            axis_u_rad: 0.02_f64.to_radians(),
            runout_u_rad: 0.001_f64.to_radians(),
            field_u_gauss: 0.2e-3,
            ambient_u_gauss: 0.1e-3,
            board_clock_u_ppm: None,
        }
    }
}

/// The table [fixture].
pub(super) fn fixture(table: &TomlTable<'_, '_>) -> BenchImperfections {
    let default = BenchImperfections::default();
    let angle = |key: &'static str, default_rad: f64| {
        bounded_at(table, key, Unit::Degree, (0.0, MOST_DEG)).map_or(default_rad, f64::to_radians)
    };
    let field = |key: &'static str, default_gauss: f64| {
        bounded_at(table, key, Unit::Gauss, (0.0, MOST_GAUSS)).unwrap_or(default_gauss)
    };
    let mounting_rad = table.entry("mounting").and_then(|entry| {
        let known: Vec<f64> = entry
            .list("a list of three angles, such as [\"0.01 deg\", \"-0.02 deg\", \"0 deg\"]")?
            .iter()
            .filter_map(|angle| bounded(angle, Unit::Degree, (-MOST_DEG, MOST_DEG))?.in_unit(Unit::Degree))
            .map(f64::to_radians)
            .collect();
        let three = <[f64; 3]>::try_from(known).ok();
        if three.is_none() {
            let hint = "write three angles: mounting = [\"0.01 deg\", \"-0.02 deg\", \"0 deg\"]";
            entry.mistake("mounting is not three angles about X, Y and Z", hint);
        }
        three
    });
    BenchImperfections {
        mounting_rad,
        mounting_u_rad: angle("mounting_u", default.mounting_u_rad),
        axis_u_rad: angle("axis_u", default.axis_u_rad),
        runout_u_rad: angle("runout_u", default.runout_u_rad),
        field_u_gauss: field("field_u", default.field_u_gauss),
        ambient_u_gauss: field("ambient_u", default.ambient_u_gauss),
        board_clock_u_ppm: bounded_at(table, "board_clock_u", Unit::PartsPerMillion, (0.0, MOST_PPM)),
    }
}
