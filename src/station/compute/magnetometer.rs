//! Magnetometer corrections.

use std::path::PathBuf;

use clap::Args;
use gnc_executive::quantity::Dimension;
use gnc_metrology::{AXES, ellipse, ellipsoid};
use gnc_plot::{Panel, Series};
use nalgebra::Vector3;
use serde_json::json;

use super::gate::GateColumns;
use super::record::{OutputTriad, Record};
use super::report::{FigureReport, matrix, vector};
use super::table::{ReadingOptions, TimeUse, Wanted};
use super::{ComputeError, ComputeOutcome};

#[derive(Debug, Args)]
pub(super) struct EllipseArgs {
    /// Columns x,y
    file: PathBuf,
    /// Output at which a channel is saturated
    #[arg(long, value_name = "LSB")]
    saturation: Option<f64>,
    #[command(flatten)]
    gate: GateColumns,
    /// Largest rms distance from the ellipse, and movement of its centre, percent of the radius
    #[arg(long, value_name = "PERCENT", default_value_t = 5.0)]
    residual: f64,
}

impl EllipseArgs {
    pub(super) fn compute(&self, reading: &ReadingOptions) -> Result<ComputeOutcome, ComputeError> {
        let names = self.gate.behind(&["x", "y"]);
        let wanted = Wanted { numbers: &names, time: TimeUse::Free, ..Wanted::default() };
        let mut columns = Record::open(&self.file, OutputTriad::Mag, reading)?.read(&wanted)?;
        let gated = self.gate.points(&["x", "y"], &mut columns, self.saturation)?;
        columns.unit(0..2, Dimension::MagneticField)?;
        let (x, y) = (&columns.numbers[0], &columns.numbers[1]);
        let e = ellipse::fit_within(x, y, self.saturation, self.residual / 100.0)?;
        let correction =
            |c: &ellipse::Correction| json!({ "dx": c.dx, "dy": c.dy, "ky": c.ky, "sin_alpha": c.sin_alpha });
        let mut report = FigureReport::new("ellipse");
        report
            .record(&columns)
            .put("equation", "", ellipse::EQUATION)
            .put("centre", "unit of the record", json!(e.centre))
            .put("semi_axes", "major, minor", json!(e.semi_axes))
            .put("rotation_deg", "of the major axis, x towards y", e.rotation_deg)
            .put("correction", "", correction(&e.correction))
            .put("radius", "of the corrected circle", e.radius)
            .put("residual_rms", "normal distance", e.residual_rms)
            .put("residual_peak", "radius error after correction, relative", e.residual_peak)
            .put("residual_rms_as_printed", "radius error with the published correction", e.residual_rms_as_printed)
            .put(
                "extremes",
                "by the published formulas, from the extremes",
                json!({ "dx": e.extremes.dx, "dy": e.extremes.dy, "ky": e.extremes.ky }),
            )
            .put("rejected", "points", e.rejected)
            .put("used", "points", e.used)
            .put("gate", "rows", gated.json())
            .put("turns", "", json!(e.turns))
            .put("gap_deg", "largest sector without a point", e.gap_deg)
            .put("condition", "", e.condition)
            .put("dof", "", e.dof)
            .hidden("covariance", matrix(&e.covariance))
            .put(
                "sd",
                "standard uncertainty, units as above",
                json!({
                    "centre": e.sd.centre,
                    "semi_axes": e.sd.semi_axes,
                    "rotation_deg": e.sd.rotation_deg,
                    "correction": correction(&e.sd.correction),
                }),
            );
        let (sin, cos) = e.rotation_deg.to_radians().sin_cos();
        let outline = (0..=360).map(|d| f64::from(d).to_radians().sin_cos()).map(|(s, c)| {
            let (a, b) = (e.semi_axes[0] * c, e.semi_axes[1] * s);
            (e.centre[0] + a * cos - b * sin, e.centre[1] + a * sin + b * cos)
        });
        let pairs = || x.iter().copied().zip(y.iter().copied());
        let circle = (0..=360).map(|d| f64::from(d).to_radians().sin_cos()).map(|(s, c)| (e.radius * c, e.radius * s));
        let corrected = || pairs().map(|(x, y)| e.correction.apply(x, y));
        let radial =
            corrected().map(|(u, v)| (v.atan2(u).to_degrees(), (u.hypot(v) - e.radius) / e.radius)).collect::<Vec<_>>();
        // Spikes are counted and not shown: beside them the curve would shrink to a dot.
        let about = |centre: f64, half: f64| Some((centre - 1.3 * half, centre + 1.3 * half));
        let limit = 8.0 * e.sigma / e.semi_axes[1];
        let (major, [cx, cy]) = (e.semi_axes[0], e.centre);
        let panels = vec![
            Panel::new("Raw", "x", "y", vec![Series::dots("record", pairs()), Series::line("fit", outline)])
                .square()
                .within(about(cx, major), about(cy, major)),
            Panel::new(
                "Corrected",
                "x'",
                "y'",
                vec![Series::dots("record", corrected()), Series::line("circle", circle)],
            )
            .square()
            .within(about(0.0, e.radius), about(0.0, e.radius)),
            Panel::new("Residuals", "direction, deg", "radius error / radius", vec![Series::dots("record", radial)])
                .within(None, Some((-limit, limit))),
        ];
        Ok(ComputeOutcome { report, panels })
    }
}

#[derive(Debug, Args)]
pub(super) struct EllipsoidArgs {
    /// Columns x,y,z
    file: PathBuf,
    /// Strength of the field, in the unit wanted for corrected vectors
    #[arg(long, value_name = "F")]
    field: Option<f64>,
    /// Output at which a channel is saturated
    #[arg(long, value_name = "LSB")]
    saturation: Option<f64>,
    #[command(flatten)]
    gate: GateColumns,
    /// Largest rms distance from the ellipsoid, and movement of its centre, percent of the radius
    #[arg(long, value_name = "PERCENT", default_value_t = 5.0)]
    residual: f64,
}

impl EllipsoidArgs {
    pub(super) fn compute(&self, reading: &ReadingOptions) -> Result<ComputeOutcome, ComputeError> {
        let names = self.gate.behind(&AXES);
        let wanted = Wanted { numbers: &names, time: TimeUse::Free, ..Wanted::default() };
        let mut columns = Record::open(&self.file, OutputTriad::Mag, reading)?.read(&wanted)?;
        let gated = self.gate.points(&AXES, &mut columns, self.saturation)?;
        // Accelerometers over many attitudes lie on an ellipsoid too.
        let accelerations = columns.units.iter().any(|unit| columns.is_in(unit.as_ref(), Dimension::Acceleration));
        columns.unit(0..3, if accelerations { Dimension::Acceleration } else { Dimension::MagneticField })?;
        let [x, y, z] = [0, 1, 2].map(|i| columns.numbers[i].as_slice());
        let e = ellipsoid::fit_within([x, y, z], self.field, self.saturation, self.residual / 100.0)?;
        let mut report = FigureReport::new("ellipsoid");
        report
            .record(&columns)
            .put("equation", "", ellipsoid::EQUATION)
            .put("centre", "unit of the record", vector(&e.centre))
            .put("matrix", if self.field.is_some() { "" } else { "determinant 1" }, matrix(&e.matrix))
            .put("field", if self.field.is_some() { "given" } else { "" }, e.field)
            .put("semi_axes", "unit of the record", vector(&e.semi_axes))
            .put("residual_relative", "rms distance over mean radius", e.residual_relative)
            .put("coverage", "1 even, 0 planar", e.coverage)
            .put("one_sidedness", "0 balanced, 0.5 half sphere", e.one_sidedness)
            .put("condition", "", e.condition)
            .put("rejected", "points", e.rejected)
            .put("used", "points", e.used)
            .put("gate", "rows", gated.json())
            .put("dof", "", e.dof)
            .hidden("covariance", matrix(&e.covariance))
            .put(
                "sd",
                "standard uncertainty, units as above",
                json!({ "centre": vector(&e.centre_sd), "matrix": matrix(&e.matrix_sd), "field": e.field_sd }),
            );
        let corrected: Vec<Vector3<f64>> =
            (0..x.len()).map(|i| e.matrix * (Vector3::new(x[i], y[i], z[i]) - e.centre)).collect();
        let raw: [&[f64]; 3] = [x, y, z];
        // Spikes are counted and not shown: beside them the cloud would shrink to a dot.
        let about = |centre: f64, half: f64| Some((centre - 1.3 * half, centre + 1.3 * half));
        let view = |a: usize, b: usize| {
            let (p, q) = (AXES[a], AXES[b]);
            let half = e.semi_axes[0];
            let points = raw[a].iter().copied().zip(raw[b].iter().copied());
            Panel::new(format!("Raw {p}-{q}"), p, q, vec![Series::dots("record", points)])
                .square()
                .within(about(e.centre[a], half), about(e.centre[b], half))
        };
        let view_corrected = |a: usize, b: usize| {
            let (p, q) = (AXES[a], AXES[b]);
            let circle = (0..=360).map(|d| f64::from(d).to_radians().sin_cos());
            let series = vec![
                Series::dots("record", corrected.iter().map(|c| (c[a], c[b]))),
                Series::line("field", circle.map(|(s, c)| (e.field * c, e.field * s))),
            ];
            Panel::new(format!("Corrected {p}-{q}"), p, q, series)
                .square()
                .within(about(0.0, e.field), about(0.0, e.field))
        };
        let errors = corrected.iter().enumerate().map(|(i, c)| (i as f64 + 1.0, c.norm() / e.field - 1.0));
        let limit = 8.0 * e.sigma / e.semi_axes[2];
        let residuals = Panel::new("Residuals", "row", "|corrected| / field - 1", vec![Series::dots("record", errors)])
            .within(None, Some((-limit, limit)));
        let panels = vec![view(0, 1), view(0, 2), residuals, view_corrected(0, 1), view_corrected(0, 2)];
        Ok(ComputeOutcome { report, panels })
    }
}
