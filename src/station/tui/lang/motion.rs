//! The position and the motion of the module in words.

use gnc_analysis::capture::Pose;
use gnc_analysis::heat::Temperatures;
use gnc_bench::guidance::{Guidance, Stage};
use gnc_executive::text::duration;
use gnc_rig::{Along, MODULE_AXES, Orientation};

use super::{Texts, fill};

impl Texts {
    /// "+X up, +Y to 0° clockwise from north".
    pub(crate) fn orientation(&self, orientation: &Orientation) -> String {
        match *orientation {
            Orientation::Axis { axis, positive, along, heading_deg } => {
                let (axis, sign) = (usize::from(axis), if positive { '+' } else { '-' });
                let (this, next) =
                    (format!("{sign}{}", MODULE_AXES[axis % 3]), format!("+{}", MODULE_AXES[(axis + 1) % 3]));
                let template = match along {
                    Along::Up => self.lie_up,
                    Along::North => self.lie_north,
                    Along::Polar => self.lie_pole,
                };
                fill(template, &[&this, &next, &format!("{heading_deg:.0}")])
            }
            Orientation::Up { up: [x, y, z], heading_deg } => {
                fill(self.lie_any, &[&format!("{x:+.4} {y:+.4} {z:+.4}"), &format!("{heading_deg:.0}")])
            }
        }
    }

    /// How the module moves while it is captured; `None` if it lies still.
    pub(crate) fn motion(&self, pose: &Pose) -> Option<String> {
        let name = |axis: u8| MODULE_AXES[usize::from(axis) % 3];
        match *pose {
            Pose::Still { .. } => None,
            Pose::Rotating { axis, angle_deg, span_s, .. } => {
                Some(fill(self.turns, &[&format!("{angle_deg:+.0}"), name(axis), &duration(span_s)]))
            }
            Pose::Spinning { axis, rate_dps, .. } => {
                Some(fill(self.spins, &[&format!("{}", Signed(rate_dps)), name(axis)]))
            }
        }
    }

    /// The present stage in words.
    pub(crate) fn stage(&self, guidance: &Guidance) -> String {
        match guidance.stage {
            Stage::Laying if guidance.waits_to_go_on() => self.stage_warms.to_owned(),
            Stage::Laying => self.stage_laying.to_owned(),
            Stage::Settling { span_s } => fill(self.stage_settling, &[&duration(span_s)]),
            Stage::Capturing => self.stage_capturing.to_owned(),
            Stage::SpinningUp { rate_dps } => fill(self.stage_spinning_up, &[&format!("{}", Signed(rate_dps))]),
            Stage::Stopping => self.stage_stopping.to_owned(),
            Stage::PoweredOff { span_s } => fill(self.stage_powered_off, &[&duration(span_s)]),
            Stage::Warming(warmth) => {
                let (template, left_s) = match warmth.left_s.filter(|left_s| *left_s < warmth.bound_s) {
                    Some(left_s) => (self.stage_warming, left_s),
                    None => (self.stage_warming_at_most, warmth.bound_s),
                };
                let degc = |temperatures: Temperatures| format!("{:.1}", temperatures.mean_c());
                fill(template, &[&degc(warmth.now), &degc(warmth.target), &duration(left_s)])
            }
            Stage::WorkingOut => self.stage_working_out.to_owned(),
        }
    }
}

/// A rate with its sign and as many digits as it needs: 5400 deg/s without decimals, and the hundredths of a
/// resolution.
struct Signed(f64);

impl std::fmt::Display for Signed {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        if self.0.abs() >= 10.0 { write!(f, "{:+.0}", self.0) } else { write!(f, "{:+}", self.0) }
    }
}
