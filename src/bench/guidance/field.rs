//! The field across the axis of a spin while it is captured: points of the field, and the ellipse through them.

use gnc_metrology::ellipse::{self, Correction};
use gnc_protocol::stream::{ImuSample, MAG_LSB_PER_GAUSS};

/// Most points that are kept: more than a screen has dots on the ellipse, and their fit takes a tenth of a millisecond.
pub(crate) const POINTS: usize = 4096;

/// The field of a spin so far.
#[derive(Debug, Clone, PartialEq)]
pub struct FieldView {
    /// X and Y of points spread over the spin, gauss at nominal scale, in the order in which they came.
    pub points: Vec<[f64; 2]>,
    /// The newest point.
    pub newest: [f64; 2],
    /// Samples so far.
    pub samples: usize,
    /// The ellipse through the points, as soon as they give one.
    pub ellipse: Option<RoughEllipse>,
}

/// An ellipse by an algebraic fit: a preview of what the analysis will find, without its robustness.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RoughEllipse {
    /// Centre, gauss.
    pub centre: [f64; 2],
    /// Semi-axes, the major one first, gauss.
    pub semi_axes: [f64; 2],
    /// Direction of the major axis from X towards Y, degrees.
    pub rotation_deg: f64,
    /// The correction that makes a circle of the ellipse.
    pub correction: Correction,
    /// Radius of that circle, gauss.
    pub radius: f64,
}

impl RoughEllipse {
    fn through(points: &[[f64; 2]]) -> Option<Self> {
        let [x, y] = [0, 1].map(|axis| points.iter().map(|point| point[axis]).collect::<Vec<f64>>());
        // The fit fails for too few points and for a curve that is not closed yet.
        let [cx, cy, major, minor, rotation_deg] = ellipse::fit_algebraic(&x, &y).ok()?;
        let (centre, semi_axes) = ([cx, cy], [major, minor]);
        let (correction, radius) = Correction::of_axes(centre, semi_axes, rotation_deg);
        let ellipse = Self { centre, semi_axes, rotation_deg, correction, radius };
        radius.is_finite().then_some(ellipse)
    }

    /// A point of the ellipse, by the angle from its major axis.
    #[must_use]
    pub fn at(&self, angle_rad: f64) -> [f64; 2] {
        let (sin, cos) = self.rotation_deg.to_radians().sin_cos();
        let (u, v) = (self.semi_axes[0] * angle_rad.cos(), self.semi_axes[1] * angle_rad.sin());
        [self.centre[0] + u * cos - v * sin, self.centre[1] + u * sin + v * cos]
    }
}

/// Roll angle in degrees from a corrected field, `atan2(-y', x')`: the field turns against the module.
#[must_use]
pub fn roll_deg(correction: &Correction, [x, y]: [f64; 2]) -> f64 {
    let (x, y) = correction.apply(x, y);
    (-y).atan2(x).to_degrees()
}

/// Collects the points of a spin about an axis.
#[derive(Debug)]
pub struct FieldSoFar {
    /// The two axes across the axis of the spin.
    axes: [usize; 2],
    /// One point is kept of each stretch of so many samples.
    stride: usize,
    points: Vec<[f64; 2]>,
    newest: [f64; 2],
    samples: usize,
}

impl FieldSoFar {
    /// A collector without samples for a turn about this axis (0 for X, 1 for Y, 2 for Z).
    #[must_use]
    pub fn new(axis: u8) -> Self {
        let axis = usize::from(axis);
        let axes = [(axis + 1) % 3, (axis + 2) % 3];
        Self { axes, stride: 1, points: Vec::with_capacity(POINTS), newest: [0.0; 2], samples: 0 }
    }

    /// Takes the next samples.
    pub fn take(&mut self, samples: &[ImuSample]) {
        for sample in samples {
            if self.samples % self.stride == self.place() {
                self.points.push(self.point(sample));
                if self.points.len() == POINTS {
                    self.thin();
                }
            }
            self.samples += 1;
        }
        if let Some(last) = samples.last() {
            self.newest = self.point(last);
        }
    }

    /// Where in its stretch the next point is taken. The place varies, so that it is never in step with the turns.
    fn place(&self) -> usize {
        let stretch = self.samples / self.stride;
        ((stretch as f64 * 0.618_033_988_749_895).fract() * self.stride as f64) as usize
    }

    fn thin(&mut self) {
        let mut keep = false;
        self.points.retain(|_| {
            keep = !keep;
            keep
        });
        self.stride *= 2;
    }

    fn point(&self, sample: &ImuSample) -> [f64; 2] {
        self.axes.map(|axis| f64::from(sample.mag[axis]) / MAG_LSB_PER_GAUSS)
    }

    /// The field so far.
    #[must_use]
    pub fn look(&self) -> FieldView {
        let ellipse = RoughEllipse::through(&self.points);
        FieldView { points: self.points.clone(), newest: self.newest, samples: self.samples, ellipse }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An ellipse as a magnetometer sees it: offsets, two sensitivities, axes that are not square to each other.
    fn sample(angle_rad: f64) -> ImuSample {
        let (sin, cos) = angle_rad.sin_cos();
        let alpha = 2.0_f64.to_radians();
        let (x, y) = (0.05 + 0.3 * (cos * alpha.cos() - sin * alpha.sin()), -0.02 - 0.28 * sin);
        let counts = |gauss: f64| (gauss * MAG_LSB_PER_GAUSS).round() as i32;
        ImuSample { mag: [counts(x), counts(y), 0], ..ImuSample::default() }
    }

    /// At these rates, samples kept in step with the turns would all see the same side of the ellipse.
    #[test]
    fn any_length_of_a_spin_is_seen_from_all_sides() {
        for (count, samples_a_turn) in [(300, 66.6), (200_000, 64.0), (200_000, 128.0), (1_000_000, 256.0)] {
            let mut field = FieldSoFar::new(2);
            for k in 0..count {
                field.take(&[sample(f64::from(k) * std::f64::consts::TAU / samples_a_turn)]);
            }
            let field = field.look();
            assert!(field.points.len() < POINTS && field.samples == count as usize, "{}", field.points.len());
            assert!(count < 1000 || field.points.len() >= POINTS / 2 - 1, "{}", field.points.len());
            let found = field.ellipse.expect("an ellipse");
            let truth = [(found.centre[0], 0.05), (found.centre[1], -0.02), (found.correction.ky, 0.3 / 0.28)];
            for (found, truth) in truth {
                assert!((found - truth).abs() < 1e-4, "{count} at {samples_a_turn}: {found} for {truth}");
            }
            assert!((found.correction.sin_alpha - 2.0_f64.to_radians().sin()).abs() < 1e-4, "{found:?}");
            assert!((found.radius - 0.3).abs() < 1e-4, "{found:?}");
            let corrected = field.points.iter().map(|[x, y]| found.correction.apply(*x, *y));
            let worst = corrected.map(|(x, y)| (x.hypot(y) - 0.3).abs()).fold(0.0, f64::max);
            assert!(worst < 1e-4, "corrected points lie {worst} gauss beside the circle");
        }
    }

    /// The points that are drawn lie on the drawn ellipse.
    #[test]
    fn the_curve_goes_through_the_points() {
        let mut field = FieldSoFar::new(2);
        (0..500).for_each(|k| field.take(&[sample(f64::from(k) * 0.1)]));
        let found = field.look().ellipse.expect("an ellipse");
        for [x, y] in field.points {
            let steps = (0..3600).map(|step| found.at(f64::from(step).to_radians() / 10.0));
            let nearest = steps.map(|[u, v]| (u - x).hypot(v - y)).fold(f64::INFINITY, f64::min);
            assert!(nearest < 5e-4, "({x}, {y}) lies {nearest} gauss beside the curve");
        }
    }

    /// A module that turns by +30 degrees sees a field that turns by -30.
    #[test]
    fn roll_is_right_handed() {
        let plain = Correction { dx: 0.0, dy: 0.0, ky: 1.0, sin_alpha: 0.0 };
        let (sin, cos) = (-30.0_f64).to_radians().sin_cos();
        assert!((roll_deg(&plain, [0.3 * cos, 0.3 * sin]) - 30.0).abs() < 1e-9);
    }

    #[test]
    fn no_ellipse_of_nothing() {
        let mut field = FieldSoFar::new(2);
        assert_eq!(field.look().ellipse, None);
        (0..1000).for_each(|_| field.take(&[sample(0.3)]));
        assert_eq!(field.look().ellipse, None, "a table that stands still");
    }
}
