//! Gyroscopes, accelerometers and magnetometer of a personality, checked.

use nalgebra::{Matrix3, Vector3};
use toml::Spanned;

use super::check::{Mistake, axes, axis, integer, mistake, number};
use super::raw::{self, PerAxis};
use crate::devices::inertial::bandwidth::{Bandwidth, Order};
use crate::devices::inertial::faults::{FailedReads, MOST_VIBRATIONS, Spikes, Vibration};
use crate::devices::inertial::model::Published;
use crate::devices::inertial::{TriadFaults, TriadModel};

/// What one axis may be given of anything: beyond that somebody mistook the unit.
const MOST: f64 = 1e6;
/// Frequencies above this are those of a radio, not of a sensor.
const HIGHEST_HZ: f64 = 1e5;

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
        model.bandwidth = self.bandwidth(model.bandwidth)?;
        if let Some(update_hz) = &self.update_rate_hz {
            model.update_rate_hz = Some(number(Some(update_hz), "update_rate_hz", 0.01, HIGHEST_HZ, 0.0)?);
        }
        if let Some(per_k) = &self.noise_per_k {
            let PerAxis(each) = *per_k.get_ref();
            // More than a thousandfold in seven kelvin is no noise of a sensor.
            match each.into_iter().find(|per_k| !(-1.0..=1.0).contains(per_k)) {
                Some(out) => return Err(mistake(per_k, format!("noise_per_k {out} is not in -1 to 1"))),
                None => model.noise_per_k = Vector3::from(each),
            }
        }
        Ok(model)
    }

    fn bandwidth(&self, default: Option<Bandwidth>) -> Result<Option<Bandwidth>, Mistake> {
        let cutoff_hz = match &self.bandwidth_hz {
            // Zero takes the low-pass away.
            Some(cutoff_hz) if *cutoff_hz.get_ref() == 0.0 => None,
            Some(cutoff_hz) => Some(number(Some(cutoff_hz), "bandwidth_hz", 0.1, HIGHEST_HZ, 0.0)?),
            None => default.map(|bandwidth| bandwidth.cutoff_hz),
        };
        let order = match &self.bandwidth_order {
            None => default.map_or(Order::Second, |bandwidth| bandwidth.order),
            Some(alone) if cutoff_hz.is_none() => {
                return Err(mistake(alone, "bandwidth_order has no bandwidth_hz beside it".to_owned()));
            }
            Some(order) if integer(order, "bandwidth_order", 1, 2)? == 1 => Order::First,
            Some(_) => Order::Second,
        };
        Ok(cutoff_hz.map(|cutoff_hz| Bandwidth { cutoff_hz, order }))
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
        let none = TriadFaults::default();
        let clip_low = limits(self.clip_low.as_ref(), "clip_low", none.clip_low)?;
        let clip_high = limits(self.clip_high.as_ref(), "clip_high", none.clip_high)?;
        if let Some(high) = &self.clip_high
            && (0..3).any(|axis| clip_low[axis] >= clip_high[axis])
        {
            return Err(mistake(high, "clip_high is not above clip_low".to_owned()));
        }
        Ok(TriadFaults {
            stuck: axes(&self.stuck_axes)?,
            dead: axes(&self.dead_axes)?,
            swapped,
            noise_factor: number(self.noise_factor.as_ref(), "noise_factor", 0.0, 1e6, 1.0)?,
            offset,
            drift_per_h: vector(&self.drift, "drift", -MOST)? * unit,
            wander: vector(&self.wander, "wander", 0.0)? * unit,
            wander_s: number(self.wander_s.as_ref(), "wander_s", 1.0, 1e6, 60.0)?,
            scale_turn_on: vector(&self.scale_turn_on, "scale_turn_on", 0.0)?,
            coupling_turn_on: number(self.coupling_turn_on.as_ref(), "coupling_turn_on", 0.0, 1.0, 0.0)?,
            deadband: vector(&self.deadband, "deadband", 0.0)?,
            step: vector(&self.step, "step", 0.0)?,
            range: vector(&self.range, "range", 0.0)?,
            clip_low,
            clip_high,
            spikes: self.spikes.as_ref().map(raw::Spikes::check).transpose()?,
            failed_reads: self.failed_reads.as_ref().map(raw::FailedReads::check).transpose()?,
        })
    }
}

/// Limits of the three axes; an infinite one is none.
fn limits(value: Option<&Spanned<PerAxis>>, name: &str, default: Vector3<f64>) -> Result<Vector3<f64>, Mistake> {
    let Some(spanned) = value else { return Ok(default) };
    let PerAxis(numbers) = *spanned.get_ref();
    if numbers.iter().any(|number| number.is_nan()) {
        return Err(mistake(spanned, format!("{name} NaN is no number")));
    }
    Ok(Vector3::from(numbers))
}

fn share(value: &Spanned<f64>) -> Result<f64, Mistake> {
    number(Some(value), "share", 0.0, 1.0, 0.0)
}

impl raw::Spikes {
    fn check(&self) -> Result<Spikes, Mistake> {
        Ok(Spikes {
            share: share(&self.share)?,
            size: number(Some(&self.size), "size", 0.0, MOST, 0.0)?,
            axis: self.axis.as_ref().map(axis).transpose()?,
        })
    }
}

impl raw::FailedReads {
    pub(super) fn check(&self) -> Result<FailedReads, Mistake> {
        let code = *self.code.get_ref();
        if !FailedReads::CODES.contains(&code) {
            let message =
                format!("code {code} is not one of {}", FailedReads::CODES.map(|code| code.to_string()).join(", "));
            return Err(mistake(&self.code, message));
        }
        Ok(FailedReads { share: share(&self.share)?, code })
    }
}

/// What the module is shaken with.
pub(super) fn vibrations(raw: &[raw::Vibration]) -> Result<[Vibration; MOST_VIBRATIONS], Mistake> {
    if let Some(one_more) = raw.get(MOST_VIBRATIONS) {
        let message = format!("more than {MOST_VIBRATIONS} vibrations");
        return Err(mistake(&one_more.frequency_hz, message));
    }
    let amplitude = |values: &Option<[Spanned<f64>; 3]>, name| {
        let mut checked = Vector3::zeros();
        for (axis, value) in values.iter().flatten().enumerate() {
            checked[axis] = number(Some(value), name, -1e4, 1e4, 0.0)?;
        }
        Ok(checked)
    };
    let mut vibrations = [Vibration::default(); MOST_VIBRATIONS];
    for (place, raw) in vibrations.iter_mut().zip(raw) {
        *place = Vibration {
            frequency_hz: number(Some(&raw.frequency_hz), "frequency_hz", 1e-3, HIGHEST_HZ, 0.0)?,
            rate_dps: amplitude(&raw.rate_dps, "rate_dps")?,
            force_g: amplitude(&raw.force_g, "force_g")?,
            field_gauss: amplitude(&raw.field_gauss, "field_gauss")?,
        };
    }
    Ok(vibrations)
}
