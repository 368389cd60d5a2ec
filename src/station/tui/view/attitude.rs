//! Directions of the axes of a module that lies on the table, and how they look from beside it.

use gnc_rig::{Along, Orientation};
use nalgebra::Vector3;

/// East, north, up.
pub(super) type Direction = Vector3<f64>;

/// Height of the celestial pole in pictures. They show which axis points there, and not how high it stands at the
/// bench.
const POLE_DEG: f64 = 45.0;
/// The eye is so far east of south of the module, and so high above it, that all three directions look different.
const EYE_EAST_DEG: f64 = 30.0;
const EYE_UP_DEG: f64 = 25.0;

/// A module on the table.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct ModuleOnTable {
    /// Where its axes X, Y, Z point.
    pub(super) axes: [Direction; 3],
    /// Direction of the axis about which the table turns, in the sense of the module's axis that is nearest to it.
    pub(super) table: Direction,
}

impl ModuleOnTable {
    /// The attitude of a module that was laid down in this orientation.
    pub(super) fn of(orientation: &Orientation) -> Self {
        let (along, heading_deg) = match *orientation {
            Orientation::Axis { along, heading_deg, .. } => (along, heading_deg),
            Orientation::Up { heading_deg, .. } => (Along::Up, heading_deg),
        };
        let (nearest, there) = match *orientation {
            Orientation::Axis { axis, positive, .. } => {
                let axis = usize::from(axis) % 3;
                (axis, unit(axis) * if positive { 1.0 } else { -1.0 })
            }
            Orientation::Up { up, .. } => {
                let up = Vector3::from(up).try_normalize(1e-6).unwrap_or_else(Vector3::z);
                (nearest(&up), up)
            }
        };
        let (direction, zero) = frame(along);
        let (sin, cos) = heading_deg.to_radians().sin_cos();
        // Clockwise as seen against the direction.
        let heading = zero * cos + zero.cross(&direction) * sin;
        let next = unit(nearest + 1);
        let reference = (next - there * there.dot(&next)).try_normalize(1e-6).unwrap_or_else(Vector3::x);
        let side = direction.cross(&heading);
        let module_side = there.cross(&reference);
        let axes = [0, 1, 2].map(|axis| direction * there[axis] + heading * reference[axis] + side * module_side[axis]);
        let sense = if there[nearest] < 0.0 { -1.0 } else { 1.0 };
        Self { axes, table: direction * sense }
    }
}

fn unit(axis: usize) -> Direction {
    [Vector3::x(), Vector3::y(), Vector3::z()][axis % 3]
}

/// The axis nearest to a direction. Of equally near axes it is the first, as the table takes it.
fn nearest(direction: &Direction) -> usize {
    [1, 2]
        .into_iter()
        .fold(0, |best, axis| if direction[axis].abs() > direction[best].abs() + 1e-9 { axis } else { best })
}

/// A direction, and the zero of headings about it.
fn frame(along: Along) -> (Direction, Direction) {
    match along {
        Along::Up => (Vector3::z(), Vector3::y()),
        Along::North => (Vector3::y(), Vector3::z()),
        Along::Polar => {
            let (sin, cos) = POLE_DEG.to_radians().sin_cos();
            (Vector3::new(0.0, cos, sin), Vector3::new(0.0, -sin, cos))
        }
    }
}

/// The direction to the eye.
pub(super) fn towards_eye() -> Direction {
    let (sin_east, cos_east) = EYE_EAST_DEG.to_radians().sin_cos();
    let (sin_up, cos_up) = EYE_UP_DEG.to_radians().sin_cos();
    Vector3::new(sin_east * cos_up, -cos_east * cos_up, sin_up)
}

/// A point as it is seen: to the right, upwards, and towards the eye.
pub(super) fn seen(point: &Direction) -> [f64; 3] {
    let (sin_east, cos_east) = EYE_EAST_DEG.to_radians().sin_cos();
    let right = Vector3::new(cos_east, sin_east, 0.0);
    let towards = towards_eye();
    [right.dot(point), towards.cross(&right).dot(point), towards.dot(point)]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn check(orientation: Orientation, expected: [[f64; 3]; 3]) {
        let axes = ModuleOnTable::of(&orientation).axes;
        for (axis, expected) in axes.iter().zip(expected) {
            assert!((axis - Vector3::from(expected)).norm() < 1e-9, "{orientation:?}: {axes:?}");
        }
        // Axes that are not right-handed would show a module that does not exist.
        assert!((axes[0].cross(&axes[1]) - axes[2]).norm() < 1e-9, "{orientation:?}");
    }

    /// By hand, with a box on a desk: east is right, north is away, up is up.
    #[test]
    fn laid_by_hand() {
        let (east, north, up) = ([1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]);
        let minus = |v: [f64; 3]| v.map(|x: f64| -x);
        let orientation = |axis, positive, along, heading_deg| Orientation::Axis { axis, positive, along, heading_deg };
        check(orientation(2, true, Along::Up, 0.0), [north, minus(east), up]);
        check(orientation(2, true, Along::Up, 90.0), [east, north, up]);
        check(orientation(2, false, Along::Up, 0.0), [north, east, minus(up)]);
        check(orientation(0, true, Along::Up, 0.0), [up, north, minus(east)]);
        check(orientation(1, false, Along::Up, 180.0), [minus(east), minus(up), minus(north)]);
        check(orientation(2, true, Along::North, 0.0), [up, east, north]);
        check(orientation(2, true, Along::North, 90.0), [minus(east), up, north]);
        let slope = 0.5_f64.sqrt();
        check(orientation(2, true, Along::Polar, 0.0), [[0.0, -slope, slope], east, [0.0, slope, slope]]);
        check(Orientation::Up { up: [0.0, 0.0, -1.0], heading_deg: 0.0 }, [north, east, minus(up)]);
    }

    /// The direction that the plan calls up points up, and the simulated bench lays the module down in the same way.
    #[test]
    fn what_is_up_points_up() {
        let up = Vector3::new(0.1, -0.7, 0.2).normalize();
        let axes = ModuleOnTable::of(&Orientation::Up { up: up.into(), heading_deg: 30.0 }).axes;
        let height: Vec<f64> = axes.iter().map(|axis| axis.z).collect();
        for (axis, height) in height.iter().enumerate() {
            assert!((height - up[axis]).abs() < 1e-12, "{height}");
        }
        // The axis after Y, which is nearest, is Z.
        assert!((axes[2].x.atan2(axes[2].y).to_degrees() - 30.0).abs() < 1e-9, "{axes:?}");
    }

    #[test]
    fn seen_from_the_south_and_above() {
        let [right, above, near] = seen(&Vector3::x());
        assert!(right > 0.8 && above.abs() < 0.25 && near > 0.0, "east is to the right");
        let [right, above, near] = seen(&Vector3::y());
        assert!(right > 0.4 && above > 0.3 && near < 0.0, "north is away");
        let [right, above, near] = seen(&Vector3::z());
        assert!(right == 0.0 && above > 0.9 && near > 0.0, "up is up");
    }
}
