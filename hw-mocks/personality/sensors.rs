//! Gyroscopes, accelerometers and magnetometer of a personality: their properties and faults.
//!
//! Keys have their unit in the name, and each kind of sensors has its own unit: a figure in another unit is refused.

use gnc_config::{TomlEntry, TomlTable};
use gnc_text::quoted;
use nalgebra::{Matrix3, Vector3};

use super::checks::{axes, axis, numbers, required_number, whole};
use crate::devices::inertial::bandwidth::{Bandwidth, FilterOrder};
use crate::devices::inertial::faults::{FailedReads, MOST_VIBRATIONS, Spikes, Vibration};
use crate::devices::inertial::model::Published;
use crate::devices::inertial::{TriadFaults, TriadModel};

/// Largest value of any figure of an axis: a larger one means a wrong unit.
const MOST: f64 = 1e6;
/// Highest frequency of a sensor: higher ones belong to radio.
const HIGHEST_HZ: f64 = 1e5;
/// Bounds of offsets and amplitudes.
const WIDE: (f64, f64) = (-1e4, 1e4);

/// Units of a kind of sensors.
pub(super) struct Units {
    /// Name of the table.
    kind: &'static str,
    /// Unit of the signal, in keys and for people.
    signal: (&'static str, &'static str),
    /// Unit of the bias and its noise, in keys and for people; `None`: the table takes no such figures.
    bias: Option<(&'static str, &'static str)>,
    /// The unit of the bias, expressed in the unit of the signal.
    bias_in_signal: f64,
}

pub(super) const GYRO: Units =
    Units { kind: "gyro", signal: ("dps", "deg/s"), bias: Some(("dph", "deg/h")), bias_in_signal: 1.0 / 3600.0 };
pub(super) const ACCEL: Units =
    Units { kind: "accel", signal: ("g", "g"), bias: Some(("mg", "mg")), bias_in_signal: 1e-3 };
pub(super) const MAG: Units = Units { kind: "mag", signal: ("gauss", "gauss"), bias: None, bias_in_signal: 1.0 };

/// The quantity that a key gives.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Of {
    Signal,
    Bias,
    BiasPerHour,
}

/// Keys of a triad that carry a unit of the kind of sensors; the names here are without it.
const OF_TRIAD: [(&str, Of); 13] = [
    ("bias_per_k", Of::Bias),
    ("bias_stability", Of::Bias),
    ("bias_repeatability", Of::Bias),
    ("turn_on", Of::Bias),
    ("flicker", Of::Bias),
    ("drift", Of::BiasPerHour),
    ("wander", Of::Bias),
    ("deadband", Of::Signal),
    ("step", Of::Signal),
    ("range", Of::Signal),
    ("offset", Of::Signal),
    ("clip_low", Of::Signal),
    ("clip_high", Of::Signal),
];
/// Keys of spikes that carry such a unit.
const OF_SPIKES: [(&str, Of); 1] = [("size", Of::Signal)];

impl Units {
    /// The key, and its unit for people; `None` if the kind of sensors does not take it.
    fn key(&self, stem: &str, of: Of) -> Option<(String, String)> {
        let (unit, shown) = if of == Of::Signal { self.signal } else { self.bias? };
        let per_hour = if of == Of::BiasPerHour { ("_per_h", " per hour") } else { ("", "") };
        Some((format!("{stem}_{unit}{}", per_hour.0), format!("{shown}{}", per_hour.1)))
    }

    /// The entry of this meaning in the right unit.
    fn entry<'w, 't>(&self, table: &TomlTable<'w, 't>, stem: &str, of: Of) -> Option<TomlEntry<'w, 't>> {
        table.entry(self.key(stem, of)?.0)
    }

    /// The three axes.
    fn triple(&self, table: &TomlTable<'_, '_>, stem: &str, of: Of, low: f64) -> Option<[f64; 3]> {
        per_axis(&self.entry(table, stem, of)?, (low, MOST))
    }

    /// Refuses keys with a wrong unit or without one; returns whether there is such a key.
    fn refuse_others(&self, table: &TomlTable<'_, '_>, known: &[(&str, Of)]) -> bool {
        let mut refused = false;
        for entry in table.unknown() {
            let key = entry.key();
            let is = |stem: &str| key.strip_prefix(stem).is_some_and(|rest| rest.is_empty() || rest.starts_with('_'));
            let Some((stem, of)) = known.iter().find(|(stem, _)| is(stem)) else { continue };
            let kind = self.kind;
            match self.key(stem, *of) {
                Some((right, unit)) => table.refuse(
                    &entry,
                    format!("{} is not in {unit}, the unit of {stem} in [{kind}]", quoted(key)),
                    format!("give it in {unit} as {right}"),
                ),
                None => table.refuse(
                    &entry,
                    format!("[{kind}] takes no {}: its noise has no published figures", quoted(key)),
                    "remove it; noise_factor makes the noise larger",
                ),
            }
            refused = true;
        }
        refused
    }
}

/// A number for all three axes, or one for each.
fn per_axis(entry: &TomlEntry<'_, '_>, bounds: (f64, f64)) -> Option<[f64; 3]> {
    const WANTED: &str = "a number, or three for X, Y and Z";
    if entry.value().as_array().is_some() {
        return numbers(entry, WANTED, bounds);
    }
    if entry.value().as_integer().is_none() && entry.value().as_float().is_none() {
        entry.wrong_type(WANTED);
        return None;
    }
    entry.number(bounds).map(|number| [number; 3])
}

/// A table [gyro], [accel] or [mag]; `skew_us` is that of the magnetometer.
pub(super) struct TriadAsRead {
    pub(super) model: TriadModel,
    pub(super) faults: TriadFaults,
    pub(super) y_skew_us: f64,
}

impl TriadAsRead {
    /// The values for a file without the table.
    fn good(model: TriadModel) -> Self {
        Self { model, faults: TriadFaults::default(), y_skew_us: 0.0 }
    }

    /// Reads a table.
    pub(super) fn read(root: &TomlTable<'_, '_>, units: &Units, default: TriadModel) -> Self {
        let read = |table: &TomlTable<'_, '_>| {
            let mut y_skew_us = None;
            if units.kind == MAG.kind {
                y_skew_us = table.number("y_skew_us", (-1e6, 1e6));
            } else if let Some(entry) = table.unknown().iter().find(|entry| entry.key() == "y_skew_us") {
                table.refuse(entry, format!("[{}] takes no y_skew_us", units.kind), "write it in [mag]");
            }
            let (model, faults) = (model(table, units, default), faults(table, units));
            units.refuse_others(table, &OF_TRIAD);
            Self { model, faults, y_skew_us: y_skew_us.unwrap_or(0.0) }
        };
        root.within(units.kind, read).unwrap_or_else(|| Self::good(default))
    }
}

fn model(table: &TomlTable<'_, '_>, units: &Units, default: TriadModel) -> TriadModel {
    let figures = |stem| units.entry(table, stem, Of::Bias).map(|entry| (entry, per_axis(&entry, (0.0, MOST))));
    let mut model = match (figures("bias_stability"), figures("bias_repeatability")) {
        (None, None) => default,
        (Some((_, stability)), Some((_, repeatability))) => {
            let (stability, repeatability) = (stability.unwrap_or_default(), repeatability.unwrap_or_default());
            default.with_published(&Published { stability, repeatability }.scaled(units.bias_in_signal))
        }
        (Some((alone, _)), None) | (None, Some((alone, _))) => {
            let what = "bias_stability and bias_repeatability belong together: the noise follows from both";
            alone.key_mistake(what, "write both, or neither");
            default
        }
    };
    let turn_on = units.triple(table, "turn_on", Of::Bias, 0.0);
    let flicker = units.triple(table, "flicker", Of::Bias, 0.0);
    for (axis, noise) in model.noise.iter_mut().enumerate() {
        noise.turn_on = turn_on.map_or(noise.turn_on, |values| values[axis] * units.bias_in_signal);
        noise.flicker = flicker.map_or(noise.flicker, |values| values[axis] * units.bias_in_signal);
    }
    if let Some(response) = table.entry("response").and_then(|entry| response(&entry)) {
        model.response = response;
    }
    model.bandwidth = bandwidth(table, model.bandwidth);
    model.update_rate_hz = table.number("update_rate_hz", (0.01, HIGHEST_HZ)).or(model.update_rate_hz);
    // A factor of more than a thousand in seven kelvin is not sensor noise.
    let noise_per_k = table.entry("noise_per_k").and_then(|entry| per_axis(&entry, (-1.0, 1.0)));
    let per_k = |entry: TomlEntry<'_, '_>, most: f64| entry.number((-most, most));
    let bias_per_k = units.entry(table, "bias_per_k", Of::Bias).and_then(|entry| per_k(entry, MOST));
    model.bias_per_k = bias_per_k.map_or(model.bias_per_k, |bias| bias * units.bias_in_signal);
    // A per cent in a kelvin is no sensor.
    let response_per_k = table.entry("response_per_k").and_then(|entry| per_k(entry, 0.01));
    model.response_per_k = response_per_k.unwrap_or(model.response_per_k);
    model.noise_per_k = noise_per_k.map_or(model.noise_per_k, Vector3::from);
    model
}

fn response(entry: &TomlEntry<'_, '_>) -> Option<Matrix3<f64>> {
    let rows = entry.array::<3>("three rows of three numbers")?;
    let [x, y, z] = rows.map(|row| numbers::<3>(&row, "a row of three numbers", (-100.0, 100.0)));
    Some(Matrix3::from_rows(&[x?, y?, z?].map(|row| Vector3::from(row).transpose())))
}

fn bandwidth(table: &TomlTable<'_, '_>, default: Option<Bandwidth>) -> Option<Bandwidth> {
    let default_hz = default.map(|bandwidth| bandwidth.cutoff_hz);
    let cutoff_hz = match table.entry("bandwidth_hz") {
        None => default_hz,
        Some(entry) => match entry.number((0.0, HIGHEST_HZ)) {
            // Zero removes the low-pass.
            Some(0.0) => None,
            Some(cutoff_hz) if cutoff_hz < 0.1 => {
                entry.mistake(format!("bandwidth_hz is {cutoff_hz}"), "it may be 0, for none, or 0.1 to 100000");
                default_hz
            }
            cutoff_hz => cutoff_hz.or(default_hz),
        },
    };
    let order = table.entry("bandwidth_order").and_then(|entry| {
        if cutoff_hz.is_none() {
            entry.key_mistake(
                "bandwidth_order changes nothing without a low-pass",
                "write bandwidth_hz = 80.0 beside it",
            );
        }
        Some(if whole::<u8>(&entry, (1, 2))? == 1 { FilterOrder::First } else { FilterOrder::Second })
    });
    let order = order.or(default.map(|bandwidth| bandwidth.order)).unwrap_or(FilterOrder::Second);
    cutoff_hz.map(|cutoff_hz| Bandwidth { cutoff_hz, order })
}

fn faults(table: &TomlTable<'_, '_>, units: &Units) -> TriadFaults {
    let none = TriadFaults::default();
    let vector = |stem, of, low| Vector3::from(units.triple(table, stem, of, low).unwrap_or_default());
    let clip = |stem| {
        let entry = units.entry(table, stem, Of::Signal)?;
        // An infinite limit means no limit.
        Some((entry, Vector3::from(per_axis(&entry, (f64::NEG_INFINITY, f64::INFINITY))?)))
    };
    let clip_low = clip("clip_low").map_or(none.clip_low, |(_, low)| low);
    let clip_high = clip("clip_high").map_or(none.clip_high, |(entry, high)| {
        if (0..3).any(|axis| clip_low[axis] >= high[axis]) {
            entry.mistake("clip_high is not above clip_low", "write a larger clip_high or a smaller clip_low");
        }
        high
    });
    if let Some((wander, _)) = units.key("wander", Of::Bias)
        && table.has("wander_s")
        && !table.has(&wander)
        && let Some(entry) = table.entry("wander_s")
    {
        entry.key_mistake("wander_s changes nothing alone", format!("write {wander} beside it"));
    }
    let offset = units.entry(table, "offset", Of::Signal).and_then(|entry| per_axis(&entry, WIDE));
    let scale_turn_on = table.entry("scale_turn_on").and_then(|entry| per_axis(&entry, (0.0, MOST)));
    TriadFaults {
        stuck: axes(table, "stuck_axes"),
        dead: axes(table, "dead_axes"),
        swapped: table.entry("swapped_axes").and_then(|entry| {
            let [one, other] = entry.array("two different axes")?;
            let (a, b) = (axis(&one), axis(&other));
            let (a, b) = (a?, b?);
            if a == b {
                other.mistake("an axis cannot be swapped with itself", "write two different axes");
            }
            Some((a, b))
        }),
        noise_factor: table.number("noise_factor", (0.0, 1e6)).unwrap_or(none.noise_factor),
        offset: Vector3::from(offset.unwrap_or_default()),
        drift_per_h: vector("drift", Of::BiasPerHour, -MOST) * units.bias_in_signal,
        wander: vector("wander", Of::Bias, 0.0) * units.bias_in_signal,
        wander_s: table.number("wander_s", (1.0, 1e6)).unwrap_or(none.wander_s),
        scale_turn_on: Vector3::from(scale_turn_on.unwrap_or_default()),
        coupling_turn_on: table.number("coupling_turn_on", (0.0, 1.0)).unwrap_or(none.coupling_turn_on),
        deadband: vector("deadband", Of::Signal, 0.0),
        step: vector("step", Of::Signal, 0.0),
        range: vector("range", Of::Signal, 0.0),
        clip_low,
        clip_high,
        spikes: table.within("spikes", |table| spikes(table, units)).flatten(),
        failed_reads: failed_reads(table),
    }
}

fn spikes(table: &TomlTable<'_, '_>, units: &Units) -> Option<Spikes> {
    let share = required_number(table, "share", (0.0, 1.0));
    let size = units.entry(table, "size", Of::Signal).map(|entry| entry.number((0.0, MOST)));
    let axis = table.entry("axis").and_then(|entry| axis(&entry));
    if !units.refuse_others(table, &OF_SPIKES) && size.is_none() {
        let (key, unit) = units.key("size", Of::Signal)?;
        table.mistake(format!("{key} is missing"), format!("write how large spikes are, in {unit}"));
    }
    Some(Spikes { share: share?, size: size??, axis })
}

/// Failed reads of a chip, or of all chips on the bus.
pub(super) fn failed_reads(table: &TomlTable<'_, '_>) -> Option<FailedReads> {
    let read = |table: &TomlTable<'_, '_>| {
        let share = required_number(table, "share", (0.0, 1.0));
        let codes = FailedReads::CODES.map(|code| code.to_string()).join(", ");
        let entry = table.required("code", &format!("it may be {codes}"));
        let code = entry.and_then(|entry| {
            let code = whole(&entry, (i32::MIN.into(), i32::MAX.into()))?;
            if !FailedReads::CODES.contains(&code) {
                entry.mistake(format!("code is {code}"), format!("it may be {codes}"));
            }
            Some(code)
        });
        Some(FailedReads { share: share?, code: code? })
    };
    table.within("failed_reads", read).flatten()
}

/// The vibrations of the module.
pub(super) fn vibrations(root: &TomlTable<'_, '_>) -> [Vibration; MOST_VIBRATIONS] {
    let mut vibrations = [Vibration::default(); MOST_VIBRATIONS];
    for (place, table) in root.tables("vibration").into_iter().enumerate() {
        if place == MOST_VIBRATIONS {
            table.mistake(format!("more than {MOST_VIBRATIONS} vibrations"), "remove some of them");
        }
        let vibration = table.read(|table| {
            let amplitude = |key: &'static str| {
                let read = table.entry(key).and_then(|entry| numbers(&entry, "three numbers for X, Y and Z", WIDE));
                Vector3::from(read.unwrap_or_default())
            };
            Vibration {
                frequency_hz: required_number(table, "frequency_hz", (1e-3, HIGHEST_HZ)).unwrap_or_default(),
                rate_dps: amplitude("rate_dps"),
                force_g: amplitude("force_g"),
                field_gauss: amplitude("field_gauss"),
            }
        });
        if let Some(place) = vibrations.get_mut(place) {
            *place = vibration;
        }
    }
    vibrations
}
