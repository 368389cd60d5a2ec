//! Accelerometer and gyroscope calibrations.

use std::path::PathBuf;

use clap::Args;
use gnc_executive::quantity::{Dimension, Unit};
use gnc_metrology::position::{self, LABELS, Limits, Position};
use gnc_metrology::{AXES, Refusal, earth, gyro_still, rotation, series, six_position};
use gnc_plot::{Panel, Series};
use nalgebra::Vector3;
use serde_json::json;

use super::gate::{GateColumns, Gated};
use super::record::{OutputTriad, Record};
use super::report::{FigureReport, matrix, vector};
use super::table::{Columns, Named, ReadingOptions, TableError, TimeUse, Wanted};
use super::{ComputeError, ComputeOutcome};

/// Gravity, given or from the place.
#[derive(Debug, Args)]
struct Gravity {
    /// Local gravity, m/s^2 (measured)
    #[arg(long, value_name = "G", conflicts_with_all = ["latitude", "height"])]
    gravity: Option<f64>,
    /// Geodetic latitude, degrees: WGS-84 normal gravity
    #[arg(long, value_name = "D", required_unless_present = "gravity", allow_negative_numbers = true)]
    latitude: Option<f64>,
    /// Height above the ellipsoid, m
    #[arg(long, value_name = "M", default_value_t = 0.0, allow_negative_numbers = true)]
    height: f64,
    /// Accept any --gravity, also outside 9.7 to 9.9 m/s^2
    #[arg(long, requires = "gravity")]
    any_gravity: bool,
}

/// Checks a gravity that was given in m/s^2: on the ground of the earth it lies within 9.76 and 9.84.
fn given_gravity(gravity: f64, any: bool) -> Result<f64, ComputeError> {
    let expected = "9.7 to 9.9: 979 is in Gal and 1 in g; --any-gravity takes it as it is";
    if any || (9.7..=9.9).contains(&gravity) {
        return Ok(gravity);
    }
    Err(Refusal::Parameter { name: "gravity (m/s^2)", value: gravity, expected }.into())
}

impl Gravity {
    fn mps2(&self) -> Result<f64, ComputeError> {
        match (self.gravity, self.latitude) {
            (Some(gravity), _) => given_gravity(gravity, self.any_gravity),
            (None, Some(latitude)) => Ok(earth::normal_gravity_mps2(latitude, self.height)?),
            (None, None) => Err(ComputeError::Usage("give --gravity or --latitude".to_owned())),
        }
    }
}

#[derive(Debug, Args)]
pub(super) struct SixPosition {
    /// Columns position,x,y,z or ux,uy,uz,x,y,z
    file: PathBuf,
    #[command(flatten)]
    gravity: Gravity,
    /// Output at which a channel is saturated
    #[arg(long, value_name = "LSB")]
    saturation: Option<f64>,
    /// Allowed wander of a position's mean, part of the response to gravity (rad of pose)
    #[arg(long, value_name = "RAD", default_value_t = Limits::ACCELEROMETER.motion)]
    motion: f64,
    #[command(flatten)]
    gate: GateColumns,
}

impl SixPosition {
    pub(super) fn compute(&self, reading: &ReadingOptions) -> Result<ComputeOutcome, ComputeError> {
        let gravity = self.gravity.mps2()?;
        let limits = Limits { motion: self.motion, saturation: self.saturation, ..Limits::ACCELEROMETER };
        let read = still_positions(&self.file, reading, OutputTriad::Accel, &limits, &self.gate, |columns| {
            columns.unit(0..3, Dimension::Acceleration)?;
            Ok(1.0)
        })?;
        let Still { columns, positions, gated, .. } = read;
        let c = six_position::calibrate(&positions, gravity)?;
        let k = c.coverage_factor();
        let mut report = FigureReport::new("six-position");
        report
            .record(&columns)
            .put("equation", "", six_position::EQUATION)
            .put("matrix", "Ka, m/s^2 per LSB", matrix(&c.matrix))
            .put("nabla", "m/s^2, added", vector(&c.nabla_mps2))
            .put("bias_mps2", "measured less true, m/s^2", vector(&c.bias_mps2()))
            .put("bias_mg", "the same, mg", vector(&(c.bias_mps2() * (1e3 / earth::STANDARD_GRAVITY_MPS2))))
            .put("bias_lsb", "the same, b, LSB", vector(&c.bias_lsb))
            .put("sensitivity", "LSB per m/s^2", vector(&c.response.diagonal()))
            .put("coupling", "M_ij / M_ii, relative to the fixture", matrix(&c.coupling()))
            .put("nonorthogonality_rad", "xy xz yz, rad", vector(&c.nonorthogonality_rad()))
            .put("response", "M of N = M f + b, LSB per m/s^2", matrix(&c.response))
            .put("gravity", "m/s^2", c.gravity_mps2)
            .put("residual_rms", "m/s^2", c.residual_rms_mps2)
            .put("condition", "", c.condition)
            .put("dof", "", c.dof)
            .put(
                "sd",
                "standard uncertainty, units as above",
                json!({
                    "matrix": matrix(&c.matrix_sd),
                    "bias_mps2": vector(&c.bias_sd_mps2),
                    "bias_lsb": vector(&c.bias_sd_lsb),
                }),
            )
            .put("coverage_factor", "95 %, Student t", k)
            .put(
                "expanded",
                "95 %, units as above",
                json!({
                    "matrix": matrix(&c.expanded().0),
                    "bias_mps2": vector(&c.expanded().1),
                    "bias_lsb": vector(&(c.bias_sd_lsb * k)),
                }),
            )
            .hidden("covariance", matrix(&c.covariance))
            .put(
                "as_printed",
                "regression of f on N, units as above",
                json!({
                    "matrix": matrix(&c.matrix_as_printed),
                    "nabla": vector(&c.nabla_as_printed_mps2),
                }),
            )
            .put("positions", "", positions.iter().map(|p| json!(p.label)).collect::<Vec<_>>())
            .put("rows", "", positions.iter().map(|p| json!(p.rows)).collect::<Vec<_>>())
            .put("residuals", "m/s^2, by position", c.residuals_mps2.iter().map(vector).collect::<Vec<_>>())
            .deprecated("bias", vector(&c.nabla_mps2), "nabla of f = matrix N + nabla: minus bias_mps2; read those")
            .deprecated("offset_lsb", vector(&c.bias_lsb), "read bias_lsb")
            .deprecated("sd.bias", vector(&c.bias_sd_mps2), "read sd.bias_mps2")
            .deprecated("expanded.bias", vector(&c.expanded().1), "read expanded.bias_mps2")
            .deprecated("as_printed.bias", vector(&c.nabla_as_printed_mps2), "read as_printed.nabla")
            .put("gate", "rows", gated.json());
        let panels =
            residual_panels("f", "m/s^2", &positions, &c.residuals_mps2, |p| c.compensate(&p.mean), |p| gravity * p.up);
        Ok(ComputeOutcome { report, panels })
    }
}

#[derive(Debug, Args)]
pub(super) struct GyroStillArgs {
    /// Columns position,x,y,z or ux,uy,uz,x,y,z (rad/s unless --response or --deg); nx,ny,nz: true north, if known
    file: PathBuf,
    /// Geodetic latitude, degrees
    #[arg(long, value_name = "D", allow_negative_numbers = true)]
    latitude: f64,
    /// Height above the ellipsoid, m
    #[arg(long, value_name = "M", default_value_t = 0.0, allow_negative_numbers = true)]
    height: f64,
    /// Local gravity, m/s^2 (instead of normal gravity)
    #[arg(long, value_name = "G")]
    gravity: Option<f64>,
    /// Accept any --gravity, also outside 9.7 to 9.9 m/s^2
    #[arg(long, requires = "gravity")]
    any_gravity: bool,
    /// Scale factor of the record, LSB per rad/s
    #[arg(long, value_name = "S", conflicts_with = "deg")]
    response: Option<f64>,
    /// The record is in deg/s
    #[arg(long)]
    deg: bool,
    /// Output at which a channel is saturated
    #[arg(long, value_name = "LSB")]
    saturation: Option<f64>,
    #[command(flatten)]
    gate: GateColumns,
}

impl GyroStillArgs {
    pub(super) fn compute(&self, reading: &ReadingOptions) -> Result<ComputeOutcome, ComputeError> {
        let gravity = match self.gravity {
            Some(gravity) => given_gravity(gravity, self.any_gravity)?,
            None => earth::normal_gravity_mps2(self.latitude, self.height)?,
        };
        let limits = Limits { saturation: self.saturation, ..Limits::GYROSCOPE };
        let Still { columns, positions, north, gated } =
            still_positions(&self.file, reading, OutputTriad::Gyro, &limits, &self.gate, |columns| {
                self.rps_per_unit(columns)
            })?;
        let c = gyro_still::calibrate(&positions, gravity, self.latitude, north.as_deref())?;
        let k = c.coverage_factor();
        let dph = 3600.0_f64.to_degrees();
        let mut report = FigureReport::new("gyro-still");
        report
            .record(&columns)
            .put("equation", "", gyro_still::EQUATION)
            .put("bias_rps", "measured less true, rad/s", vector(&c.bias_rps))
            .put("bias_dph", "the same, deg/h", vector(&(c.bias_rps * dph)));
        match self.response {
            Some(response) => report.put("bias_lsb", "the same, LSB", vector(&(c.bias_rps * response))),
            None => report.absent("bias_lsb", "the record is in units of rate; --response takes one in LSB"),
        };
        report
            .put("g_sensitivity", "(rad/s) per (m/s^2)", matrix(&c.g_sensitivity))
            .put(
                "g_sensitivity_dph_per_g",
                "deg/h per g",
                matrix(&(c.g_sensitivity * dph * earth::STANDARD_GRAVITY_MPS2)),
            )
            .put(
                "sd",
                "type A, units as above",
                json!({ "bias_rps": vector(&c.bias_sd_rps), "g_sensitivity": matrix(&c.g_sensitivity_sd) }),
            )
            .put("coverage_factor", "95 %, Student t", k)
            .put(
                "expanded",
                "95 %, type A, units as above",
                json!({ "bias_rps": vector(&c.expanded().0), "g_sensitivity": matrix(&c.expanded().1) }),
            )
            .hidden("covariance", matrix(&c.covariance))
            .put(
                "heading_bound",
                "type B: largest error where headings are unknown, units as above",
                json!({ "bias_rps": c.bias_heading_bound_rps, "g_sensitivity": c.g_sensitivity_heading_bound }),
            )
            .put("gravity", "m/s^2", gravity)
            .put("residual_rms", "rad/s", c.residual_rms_rps)
            .put("condition", "", c.condition)
            .put("dof", "", c.dof)
            .put("positions", "", positions.iter().map(|p| json!(p.label)).collect::<Vec<_>>())
            .put("residuals", "rad/s, by position", c.residuals_rps.iter().map(vector).collect::<Vec<_>>())
            .deprecated("bias", vector(&c.bias_rps), "read bias_rps")
            .deprecated("sd.bias", vector(&c.bias_sd_rps), "read sd.bias_rps")
            .deprecated("expanded.bias", vector(&c.expanded().0), "read expanded.bias_rps")
            .deprecated("heading_bound.bias", c.bias_heading_bound_rps, "read heading_bound.bias_rps")
            .put("gate", "rows", gated.json());
        let fitted = |p: &Position| c.bias_rps + c.g_sensitivity * (gravity * p.up);
        let panels = residual_panels("w_out", "rad/s", &positions, &c.residuals_rps, |p| p.mean, fitted);
        Ok(ComputeOutcome { report, panels })
    }
}

impl GyroStillArgs {
    /// Factor from the outputs of a record to rad/s. Compares the options with the units of the header.
    fn rps_per_unit(&self, columns: &mut Columns) -> Result<f64, ComputeError> {
        let named = columns.unit(0..3, Dimension::AngularRate)?;
        let contradiction = |option: &str| {
            let unit = named.text().unwrap_or_default();
            Err(TableError::Units { what: format!("the header says that x, y and z are in {unit}, {option}") }.into())
        };
        match (&named, self.response) {
            (Named::Unit(unit), Some(_)) if unit.dimension() == Dimension::AngularRate => {
                contradiction("but --response says that they are counts")
            }
            (_, Some(response)) => Ok(1.0 / series::positive("response (LSB per rad/s)", response)?),
            (Named::Unit(Unit::DegreePerSecond), None) => Ok(1.0_f64.to_radians()),
            (Named::Unit(_) | Named::Word(_), None) if self.deg => contradiction("but --deg says deg/s"),
            (Named::Unit(unit), None) => match unit.convert(1.0, Unit::RadianPerSecond) {
                Some(factor) => Ok(factor),
                None => contradiction("which needs --response"),
            },
            (Named::Word(_), None) => contradiction("which is not an angular rate: give --response"),
            (Named::Nothing, None) => Ok(if self.deg { 1.0_f64.to_radians() } else { 1.0 }),
        }
    }
}

struct Still {
    columns: Columns,
    positions: Vec<Position>,
    /// North of each position, if the record has it.
    north: Option<Vec<Vector3<f64>>>,
    gated: Gated,
}

/// Reads still positions. The outputs are multiplied by a factor that may depend on their units.
fn still_positions(
    file: &std::path::Path,
    reading: &ReadingOptions,
    triad: OutputTriad,
    limits: &Limits,
    gate: &GateColumns,
    factor: impl FnOnce(&mut Columns) -> Result<f64, ComputeError>,
) -> Result<Still, ComputeError> {
    let table = Record::open(file, triad, reading)?;
    let directions = !table.has("position") && table.has("ux");
    let has_north = table.has("nx");
    let mut names = AXES.to_vec();
    if directions {
        names.extend(["ux", "uy", "uz"]);
    }
    if has_north {
        names.extend(["nx", "ny", "nz"]);
    }
    let label = (!directions).then_some(("position", &LABELS[..]));
    // Any time may pass between attitudes that are given as directions.
    let time = if directions { TimeUse::Free } else { TimeUse::Unbroken };
    let mut columns = table.read(&Wanted { numbers: &gate.behind(&names), label, time, ..Wanted::default() })?;
    let gated = gate.positions(&AXES, &mut columns, limits.saturation)?;
    let factor = factor(&mut columns)?;
    let (outputs, rest) = columns.numbers.split_at(3);
    let outputs: Vec<Vec<f64>> = outputs.iter().map(|c| c.iter().map(|v| v * factor).collect()).collect();
    let limits = Limits { saturation: limits.saturation.map(|s| s * factor), ..*limits };
    let channels = [outputs[0].as_slice(), &outputs[1], &outputs[2]];
    let positions = if directions {
        position::from_directions([&rest[0], &rest[1], &rest[2]], channels, &limits)?
    } else {
        let labels: Vec<&str> = columns.labels.iter().map(|c| LABELS[usize::from(*c)]).collect();
        if columns.about.export && position::blocks(&labels).is_err() {
            // Positions at several headings count as attitudes, as they do in raw captures.
            let ups: Vec<Vector3<f64>> = labels.iter().filter_map(|label| position::up_of(label)).collect();
            let [x, y, z] = [0, 1, 2].map(|i| ups.iter().map(|up| up[i]).collect::<Vec<f64>>());
            position::from_directions([&x, &y, &z], channels, &limits)?
        } else {
            position::from_labels(&labels, channels, &limits)?
        }
    };
    let north = has_north.then(|| {
        let n = &rest[rest.len() - 3..];
        let mut row = 0;
        positions
            .iter()
            .map(|p| {
                let first = row;
                row += p.rows;
                Vector3::new(n[0][first], n[1][first], n[2][first])
            })
            .collect()
    });
    Ok(Still { columns, positions, north, gated })
}

/// Panels of the fit over the truth, and of the residuals by position.
fn residual_panels(
    symbol: &str,
    unit: &str,
    positions: &[Position],
    residuals: &[Vector3<f64>],
    measured: impl Fn(&Position) -> Vector3<f64>,
    expected: impl Fn(&Position) -> Vector3<f64>,
) -> Vec<Panel> {
    let fit = |i: usize| {
        Series::dots(AXES[i], positions.iter().map(|p| (expected(p)[i], measured(p)[i])).collect::<Vec<_>>())
    };
    let rest = |i: usize| {
        Series::dots(AXES[i], residuals.iter().enumerate().map(|(n, r)| (n as f64 + 1.0, r[i])).collect::<Vec<_>>())
    };
    let ends = positions.iter().flat_map(|p| expected(p).iter().copied().collect::<Vec<_>>());
    let (low, high) = ends.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(v), h.max(v)));
    let line = Series::line("equal", [(low, low), (high, high)]);
    vec![
        Panel::new(
            "Fit",
            format!("{symbol} expected, {unit}"),
            format!("{symbol} measured, {unit}"),
            (0..3).map(fit).chain([line]).collect(),
        ),
        Panel::new(
            "Residuals",
            "position, in the order of the record",
            format!("residual, {unit}"),
            (0..3).map(rest).collect(),
        ),
    ]
}

/// How the axis of rotation stands.
#[derive(Debug, Clone, Copy, clap::ValueEnum)]
enum AxisKind {
    /// Parallel to the earth's axis, positive to the celestial north
    Polar,
    /// Up
    Vertical,
}

#[derive(Debug, Args)]
pub(super) struct Rotation {
    /// Columns run,x,y,z; run is x+ x- y+ y- z+ z-, with rest before and after each rotation
    file: PathBuf,
    /// Sample rate, Hz; by default that of the time column or of the raw capture
    #[arg(long, value_name = "HZ")]
    rate: Option<f64>,
    /// Number of turns of each run
    #[arg(long, value_name = "N")]
    turns: f64,
    /// Direction of the axis of rotation; without this option the earth's rotation stays in the bias
    #[arg(long)]
    axis: Option<AxisKind>,
    /// Geodetic latitude, degrees (vertical axis)
    #[arg(long, value_name = "D", allow_negative_numbers = true, required_if_eq("axis", "vertical"))]
    latitude: Option<f64>,
    /// Output at which a channel is saturated
    #[arg(long, value_name = "LSB")]
    saturation: Option<f64>,
    /// Nominal scale factor, LSB per rad/s
    #[arg(long, value_name = "S")]
    nominal: Option<f64>,
    /// Half width of the band around the nominal scale factor, percent
    #[arg(long, value_name = "PERCENT", default_value_t = 5.0)]
    band: f64,
    #[command(flatten)]
    gate: GateColumns,
}

impl Rotation {
    pub(super) fn compute(&self, reading: &ReadingOptions) -> Result<ComputeOutcome, ComputeError> {
        let axis = match (self.axis, self.latitude) {
            (None, _) => rotation::RotationAxis::Unknown,
            (Some(AxisKind::Polar), _) => rotation::RotationAxis::Polar,
            (Some(AxisKind::Vertical), Some(latitude_deg)) => rotation::RotationAxis::Vertical { latitude_deg },
            (Some(AxisKind::Vertical), None) => return Err(ComputeError::Usage("give --latitude".to_owned())),
        };
        let names = self.gate.behind(&AXES);
        let wanted = Wanted {
            numbers: &names,
            label: Some(("run", &LABELS)),
            rate_hz: self.rate,
            time: TimeUse::Scale,
            ..Wanted::default()
        };
        let mut columns = Record::open(&self.file, OutputTriad::Gyro, reading)?.read(&wanted)?;
        let rate_hz = columns.rate_hz()?;
        let gated = self.gate.motion(&AXES, &mut columns, self.saturation)?;
        columns.unit(0..3, Dimension::AngularRate)?;
        let labels: Vec<&str> = columns.labels.iter().map(|c| LABELS[usize::from(*c)]).collect();
        let blocks = position::blocks(&labels)?;
        let runs: Vec<rotation::RotationRun> = blocks
            .iter()
            .map(|b| rotation::RotationRun {
                label: labels[b.start].to_owned(),
                channels: [0, 1, 2].map(|i| &columns.numbers[i][b.clone()]),
            })
            .collect();
        let options = rotation::RotationOptions {
            rate_hz,
            turns: self.turns,
            axis,
            saturation: self.saturation,
            nominal: self.nominal.map(|n| (n, self.band)),
        };
        let c = rotation::calibrate(&runs, &options)?;
        let k = c.coverage_factor();
        let windows = c
            .windows
            .iter()
            .map(|w| {
                let row = blocks.iter().find(|b| labels[b.start] == w.label).map_or(0, |b| b.start);
                let span_s = (w.end - w.start) as f64 / rate_hz;
                vec![
                    json!(w.label),
                    json!(row + w.start + 1),
                    json!(row + w.end),
                    json!(w.start as f64 / rate_hz),
                    json!(span_s),
                    json!(w.peak_lsb),
                    vector(&w.integral_lsb_s),
                ]
            })
            .collect();
        let mut report = FigureReport::new("rotation");
        report
            .record(&columns)
            .put("equation", "", rotation::EQUATION)
            .put("response", "S of N = S w + b, LSB per rad/s", matrix(&c.response))
            .put("matrix", "Kg, rad/s per LSB", matrix(&c.matrix))
            .put("epsilon", "rad/s, taken off", vector(&c.epsilon_rps))
            .put("bias_rps", "at this attitude, measured less true, rad/s", vector(&c.bias_rps()))
            .put("bias_lsb", "the same, b, LSB", vector(&c.bias_lsb))
            .rows("windows", &["run", "first_row", "last_row", "start_s", "span_s", "peak", "integral"], windows)
            .put(
                "sd",
                "standard uncertainty, units as above",
                json!({
                    "response": matrix(&c.response_sd),
                    "matrix": matrix(&c.matrix_sd),
                    "bias_rps": vector(&c.bias_sd_rps),
                    "bias_lsb": vector(&c.bias_sd_lsb),
                }),
            )
            .put("coverage_factor", "95 %, Student t", k)
            .put(
                "expanded",
                "95 %, units as above",
                json!({ "response": matrix(&c.expanded().0), "bias_rps": vector(&c.expanded().1) }),
            )
            .hidden("covariance", matrix(&c.covariance))
            .put("coupling", "S_ij / S_ii, relative to the fixture", matrix(&c.coupling()))
            .put("nonorthogonality_rad", "xy xz yz, rad", vector(&c.nonorthogonality_rad()))
            .put("earth_bound", "rad/s, earth rate that is not corrected in the bias", c.earth_bound_rps)
            .put("mismatch", "between the two senses, relative", vector(&c.mismatch))
            .put("residual_rms", "rad", c.residual_rms_rad)
            .put("residuals", "rad, by run x+ x- y+ y- z+ z-", c.residuals_rad.iter().map(vector).collect::<Vec<_>>())
            .put("condition", "", c.condition)
            .put("dof", "", c.dof)
            .deprecated("bias", vector(&c.epsilon_rps), "epsilon of w = matrix N - epsilon; read bias_rps")
            .deprecated("offset_lsb", vector(&c.bias_lsb), "read bias_lsb")
            .deprecated("sd.bias", vector(&c.bias_sd_rps), "read sd.bias_rps")
            .deprecated("sd.offset_lsb", vector(&c.bias_sd_lsb), "read sd.bias_lsb")
            .deprecated("expanded.bias", vector(&c.expanded().1), "read expanded.bias_rps")
            .put("gate", "rows", gated.json());
        let rates = |run: &rotation::RotationRun, i: usize| {
            let points = run.channels[i].iter().enumerate().map(|(n, v)| (n as f64 / rate_hz, *v));
            Series::line(AXES[i], points.collect::<Vec<_>>())
        };
        let window = |run: &rotation::RotationRun| {
            let found = c.windows.iter().find(|w| w.label == run.label);
            let corners = found.map(|w| [w.start, w.start, w.end, w.end].map(|i| i as f64 / rate_hz));
            let peak = found.map_or(0.0, |w| w.peak_lsb);
            Series::line("window", corners.into_iter().flatten().zip([0.0, peak, peak, 0.0]))
        };
        let mut panels: Vec<Panel> = runs
            .iter()
            .map(|run| {
                let series = (0..3).map(|i| rates(run, i)).chain([window(run)]).collect();
                Panel::new(format!("run {}", run.label), "time, s", "output", series)
            })
            .collect();
        let rest =
            |i: usize| Series::dots(AXES[i], c.residuals_rad.iter().enumerate().map(|(r, v)| (r as f64 + 1.0, v[i])));
        panels.push(Panel::new("Residuals", "run, x+ x- y+ y- z+ z-", "angle, rad", (0..3).map(rest).collect()));
        Ok(ComputeOutcome { report, panels })
    }
}
