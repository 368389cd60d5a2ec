//! Gyroscopes, accelerometers and magnetometer of a personality, checked.

use nalgebra::{Matrix3, Vector3};
use toml::Spanned;

use super::check::{Mistake, axes, axis, mistake, number};
use super::raw::{self, PerAxis};
use crate::devices::inertial::model::Published;
use crate::devices::inertial::{TriadFaults, TriadModel};

/// What one axis may be given of anything: beyond that somebody mistook the unit.
const MOST: f64 = 1e6;

fn each(value: Option<&Spanned<PerAxis>>, name: &str, low: f64) -> Result<Option<[f64; 3]>, Mistake> {
    let Some(spanned) = value else { return Ok(None) };
    let PerAxis(numbers) = *spanned.get_ref();
    // A NaN lies in no range.
    match numbers.into_iter().find(|number| !(low..=MOST).contains(number)) {
        Some(number) => Err(mistake(spanned, format!("{name} {number} is not in {low} to {MOST}"))),
        None => Ok(Some(numbers)),
    }
}

impl raw::Triad {
    /// The model of the sensors; what belongs to the bias is given in `unit`.
    pub(super) fn model(&self, default: TriadModel, unit: f64) -> Result<TriadModel, Mistake> {
        let mut model = match (&self.bias_stability, &self.bias_repeatability) {
            (None, None) => default,
            (Some(stability), Some(repeatability)) => {
                let figures = |value, name| Ok(each(Some(value), name, 0.0)?.unwrap_or_default());
                let stability = figures(stability, "bias_stability")?;
                let repeatability = figures(repeatability, "bias_repeatability")?;
                default.with_published(&Published { stability, repeatability }.scaled(unit))
            }
            (Some(alone), None) | (None, Some(alone)) => {
                let message = "bias_stability and bias_repeatability belong together: the noise follows from both";
                return Err(mistake(alone, message.to_owned()));
            }
        };
        let turn_on = each(self.turn_on.as_ref(), "turn_on", 0.0)?;
        let flicker = each(self.flicker.as_ref(), "flicker", 0.0)?;
        for (axis, noise) in model.noise.iter_mut().enumerate() {
            noise.turn_on = turn_on.map_or(noise.turn_on, |values| values[axis] * unit);
            noise.flicker = flicker.map_or(noise.flicker, |values| values[axis] * unit);
        }
        if let Some(rows) = &self.response {
            let mut response = Matrix3::zeros();
            for (row, columns) in rows.iter().enumerate() {
                for (column, value) in columns.iter().enumerate() {
                    response[(row, column)] = number(Some(value), "response", -100.0, 100.0, 0.0)?;
                }
            }
            model.response = response;
        }
        Ok(model)
    }

    /// Their faults; what belongs to the bias is given in `unit`.
    pub(super) fn faults(&self, unit: f64) -> Result<TriadFaults, Mistake> {
        let mut offset = Vector3::zeros();
        if let Some(values) = &self.offset {
            for (axis, value) in values.iter().enumerate() {
                offset[axis] = number(Some(value), "offset", -1e4, 1e4, 0.0)?;
            }
        }
        let swapped = match &self.swapped_axes {
            None => None,
            Some([one, other]) => {
                let pair = (axis(one)?, axis(other)?);
                if pair.0 == pair.1 {
                    return Err(mistake(other, "an axis cannot be swapped with itself".to_owned()));
                }
                Some(pair)
            }
        };
        let vector = |value: &Option<Spanned<PerAxis>>, name, low| {
            Ok(Vector3::from(each(value.as_ref(), name, low)?.unwrap_or_default()))
        };
        Ok(TriadFaults {
            stuck: axes(&self.stuck_axes)?,
            dead: axes(&self.dead_axes)?,
            swapped,
            noise_factor: number(self.noise_factor.as_ref(), "noise_factor", 0.0, 1e6, 1.0)?,
            offset,
            drift_per_h: vector(&self.drift, "drift", -MOST)? * unit,
            scale_turn_on: vector(&self.scale_turn_on, "scale_turn_on", 0.0)?,
            coupling_turn_on: number(self.coupling_turn_on.as_ref(), "coupling_turn_on", 0.0, 1.0, 0.0)?,
            deadband: vector(&self.deadband, "deadband", 0.0)?,
            step: vector(&self.step, "step", 0.0)?,
            range: vector(&self.range, "range", 0.0)?,
        })
    }
}
