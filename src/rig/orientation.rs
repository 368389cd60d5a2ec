//! How a module lies on the table.

use std::fmt;

use serde::{Deserialize, Serialize};

/// Names of the module's axes as they are engraved on it. Keys and columns have small letters: `gnc_metrology::AXES`.
pub const MODULE_AXES: [&str; 3] = ["X", "Y", "Z"];

/// Where the table's axis points, together with the axis of the module that lies along it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Along {
    /// Up. Headings are clockwise from north.
    Up,
    /// Horizontally to true north. Headings are from up, clockwise seen from the north.
    North,
    /// To the celestial north pole, parallel to the earth's axis. Headings are from the upper side of the meridian
    /// plane, clockwise seen from the pole.
    Polar,
}

/// How the module is laid down.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Orientation {
    /// One axis of the module lies along the table's axis.
    Axis {
        /// 0 for X, 1 for Y, 2 for Z.
        axis: u8,
        /// Whether the positive end of the axis points there. Otherwise the negative end does.
        positive: bool,
        /// The direction in which this end of the axis points. The table's axis points there too.
        along: Along,
        /// Heading of the next axis (Y for X, Z for Y, X for Z). If `along` is up: degrees clockwise from north.
        /// Otherwise: degrees clockwise from the upper side, seen from where the table's axis points.
        heading_deg: f64,
    },
    /// Any attitude: this direction of the module points up.
    Up {
        /// Unit vector in module axes.
        up: [f64; 3],
        /// Heading of the axis after the one nearest to up.
        heading_deg: f64,
    },
}

impl fmt::Display for Orientation {
    /// The instruction for the operator.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let name = |axis: usize| MODULE_AXES[axis % 3];
        match *self {
            Orientation::Axis { axis, positive, along, heading_deg } => {
                let (axis, sign) = (usize::from(axis), if positive { '+' } else { '-' });
                let next = name(axis + 1);
                match along {
                    Along::Up => write!(
                        f,
                        "Lay the module with {sign}{} up and +{next} to {heading_deg:.0} degrees, clockwise from north",
                        name(axis)
                    ),
                    Along::North => write!(
                        f,
                        "Lay the module with {sign}{} level to the north and +{next} {heading_deg:.0} degrees from up, \
                         clockwise seen from the north",
                        name(axis)
                    ),
                    Along::Polar => write!(
                        f,
                        "Lay the module with {sign}{} to the celestial north pole and +{next} {heading_deg:.0} degrees \
                         from the upper side of the meridian, clockwise seen from the pole",
                        name(axis)
                    ),
                }
            }
            Orientation::Up { up: [x, y, z], heading_deg } => write!(
                f,
                "Lay the module so that ({x:+.4}, {y:+.4}, {z:+.4}) of its axes X, Y, Z points up, heading {heading_deg:.0} \
                 degrees"
            ),
        }
    }
}
