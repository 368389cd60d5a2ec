//! The passport of a run, or why it has none.

use gnc_analysis::details::{self, BUDGET, FRAMES};
use gnc_analysis::figures::calibration::CALIBRATION;
use gnc_analysis::figures::{FigureError, Findings, ModuleCalibration};
use gnc_executive::catalogue::calibration::{FORCE_BIAS, G_SENSITIVITY, NONORTHOGONALITY, RATE_BIAS};
use gnc_executive::catalogue::noise::{BIAS_INSTABILITY, DENSITY, RANDOM_WALK};
use gnc_executive::catalogue::processor::SUPPLY_VOLTAGE;
use gnc_executive::catalogue::{ItemId, MeasurementSpec, TEMPERATURE, TEMPERATURE_DRIFT};
use gnc_executive::event::BenchKind;
use gnc_executive::measurement::Value;
use gnc_executive::numbers::GivenNumber;
use gnc_executive::outcome::Outcome;
use gnc_executive::quantity::Unit;
use gnc_executive::record::{ItemRecord, RunRecord};
use gnc_executive::verdict::Verdict;
use gnc_metrology::earth::STANDARD_GRAVITY_MPS2;
use gnc_protocol::stream::{ACCEL_LSB_PER_G, GYRO_LSB_PER_DPS};
use nalgebra::Matrix3;
use serde::Deserialize;

use super::{
    Alignment, Conditions, Gyro, Origin, Passport, PassportAccel, PassportBudget, PassportNumber, PassportUncertainty,
    TempCoeff,
};

/// The items that a passport needs.
const NEEDED: [ItemId; 3] = [ItemId::SixPosition, ItemId::GyroStill, ItemId::Rotation];
/// The parts of a calibration, in the order in which their budgets are listed.
const PARTS: [fn(&ModuleCalibration) -> bool; 4] = [
    |known| known.accel.is_some(),
    |known| known.gyro_still.is_some(),
    |known| known.gyro_scale.is_some(),
    |known| known.mag.is_some(),
];

/// Why a run has no passport.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum NoPassport {
    /// The plan is not a calibration plan.
    #[error("the plan calibrates nothing")]
    NoCalibration,
    /// A part of the calibration is not in the plan.
    #[error("the plan has no {item}")]
    Incomplete {
        /// The item.
        item: ItemId,
    },
    /// The run has no end event.
    #[error("the run was interrupted")]
    Interrupted,
    /// The station ended before it had closed the run.
    #[error("the run was closed late")]
    ClosedLate,
    /// Some items were left out.
    #[error("only chosen items of the plan were run")]
    Selection,
    /// The run did not pass. A passport says that the module may be used.
    #[error("the run {outcome}")]
    Outcome {
        /// How the run ended.
        outcome: Outcome,
    },
    /// Findings of an item are missing or unusable.
    #[error(transparent)]
    Figures(#[from] FigureError),
    /// A required value is not a number.
    #[error("{key} is not a number")]
    NotANumber {
        /// Its key.
        key: &'static str,
    },
}

/// The passport of a run. The run must cover the whole plan, calibrate accelerometers and gyroscopes, come to its end,
/// and be passed or marginal. `record_sha256` and `chain` are those of [`Origin`].
///
/// # Errors
/// [`NoPassport`] says why the run has none.
pub fn of_run(record: &RunRecord, record_sha256: &str, chain: Option<&str>) -> Result<Passport, NoPassport> {
    let is_planned = |item: &ItemId| record.items.iter().any(|planned| planned.id == *item);
    if !NEEDED.iter().any(is_planned) {
        return Err(NoPassport::NoCalibration);
    }
    if let Some(item) = NEEDED.into_iter().find(|item| !is_planned(item)) {
        return Err(NoPassport::Incomplete { item });
    }
    if record.interrupted {
        return Err(NoPassport::Interrupted);
    }
    match record.verdict {
        Verdict::Module(outcome) if outcome.is_good() => {}
        Verdict::Selection(outcome) if outcome.is_good() => return Err(NoPassport::Selection),
        Verdict::Module(outcome) | Verdict::Selection(outcome) => return Err(NoPassport::Outcome { outcome }),
    }
    let found: Vec<(String, Findings)> = record.items.iter().filter_map(findings).collect();
    of(&record.serial_number, supply_v(record), origin(record, record_sha256, chain), &found)
}

/// The findings that count for an item: those of the last round of its last attempt.
fn findings(item: &ItemRecord) -> Option<(String, Findings)> {
    let attempt = item.last_attempt().filter(|_| item.outcome.is_good())?;
    let round = attempt.measurements.iter().filter_map(|measurement| measurement.repeat).max();
    let counts = attempt.measurements.iter().filter(|measurement| measurement.repeat == round);
    let known = counts.filter_map(|measurement| Some((item.id.spec().measurement(&measurement.name)?, measurement)));
    let measured = known.map(|(spec, measurement)| (spec.name, measurement.measured())).collect();
    let details = attempt.details.last().cloned().unwrap_or_default();
    Some((item.name.clone(), Findings { measured, details }))
}

fn supply_v(record: &RunRecord) -> Option<f64> {
    let identity = record.items.iter().find(|item| item.id == ItemId::Identity)?;
    let (_, found) = findings(identity)?;
    Some(number(&found, &SUPPLY_VOLTAGE, Unit::Volt)).filter(|volts| volts.is_finite())
}

fn origin(record: &RunRecord, record_sha256: &str, chain: Option<&str>) -> Origin {
    let board =
        record.board.as_ref().map(|board| format!(", slave board {}, firmware {}", board.board_serial, board.firmware));
    let earlier = |run: &Option<gnc_executive::event::EarlierRun>| run.as_ref().map(|run| plain(&run.run));
    Origin {
        date: record.started.to_rfc3339(),
        means: plain(&format!("station {}{}", record.station, board.unwrap_or_default())),
        program: plain(&record.program.to_string()),
        plan: plain(&format!("{} {}", record.plan.name, record.plan.version)),
        plan_sha256: plain(&record.plan.sha256),
        outcome: record.verdict.to_string(),
        simulated: record.bench.kind == BenchKind::Simulated,
        unproven: record.bench.kind == BenchKind::Unproven,
        recomputed_from: earlier(&record.recomputed),
        resumed_from: earlier(&record.resumed),
        numbers: record.numbers.iter().map(number_of).collect(),
        record_sha256: record_sha256.to_owned(),
        chain: chain.map(str::to_owned),
    }
}

fn number_of(number: &GivenNumber) -> PassportNumber {
    PassportNumber { key: plain(&number.key), label: plain(&number.label), value: plain(&number.value) }
}

/// A text from outside in a form that both files of the passport can hold, and that shows what it is: XML has no control
/// characters, and a passport is read by people.
pub(super) fn plain(text: &str) -> String {
    gnc_text::printable(text).into_owned()
}

/// Makes the passport from what the items of a run found, oldest first.
pub(super) fn of(
    device_id: &str,
    supply_v: Option<f64>,
    origin: Origin,
    found: &[(String, Findings)],
) -> Result<Passport, NoPassport> {
    let missing = |item: ItemId| FigureError::NotCalibrated { item };
    let calibration = ModuleCalibration::of(found)?;
    let [accel, still, turned, _] = PARTS.map(|has| newest(found, has));
    let (_, six) = accel.ok_or(missing(ItemId::SixPosition))?;
    let (_, still) = still.ok_or(missing(ItemId::GyroStill))?;
    let (_, turned) = turned.ok_or(missing(ItemId::Rotation))?;
    let scale = calibration.gyro_scale.ok_or(missing(ItemId::Rotation))?;
    let accel = calibration.accel.ok_or(missing(ItemId::SixPosition))?;
    let passport = Passport {
        device_id: plain(device_id),
        conditions: Conditions { temperature_range_c: temperatures(found), supply_v, vibration_and_shock: None },
        accel: accelerometers(&accel.matrix, six, found),
        gyro: gyroscopes(&scale.response, still, found),
        magnetometer: calibration.mag,
        alignment: alignment(six, turned),
        uncertainty: uncertainty(six, still, budgets(found)),
        origin,
    };
    check(passport)
}

fn alignment(six: &Findings, turned: &Findings) -> Alignment {
    let frames = FRAMES.of(&six.details);
    let angles = |findings: &Findings| each(findings, &NONORTHOGONALITY, Unit::PartsPerMillion);
    Alignment {
        mounting_deg: frames.as_ref().and_then(|frames| frames.mounting_deg),
        mounting_u_deg: frames.map(|frames| frames.mounting_u_deg),
        nonorthogonality_accel_ppm: angles(six),
        nonorthogonality_gyro_ppm: angles(turned),
    }
}

fn accelerometers(per_count: &[[f64; 3]; 3], six: &Findings, found: &[(String, Findings)]) -> PassportAccel {
    let walk = worst(found, &RANDOM_WALK.accel, Unit::MetrePerSecondPerRootHour);
    PassportAccel {
        response: relative(inverse(per_count), ACCEL_LSB_PER_G / STANDARD_GRAVITY_MPS2),
        bias_mg: each(six, &FORCE_BIAS, Unit::Milligravity),
        temp_coeff: TempCoeff { bias_mg_per_c: None },
        walk_mps2_per_sqrt_hz: walk.map(|walk| walk / 60.0),
        density_ug_per_sqrt_hz: axes(found, &DENSITY.accel, Unit::MicrogravityPerRootHertz),
    }
}

fn gyroscopes(response: &[[f64; 3]; 3], still: &Findings, found: &[(String, Findings)]) -> Gyro {
    let per_g_full_dps = [0, 1, 2].map(|row| each(still, &G_SENSITIVITY[row], Unit::DegreePerSecondPerGravity));
    Gyro {
        response: relative(matrix(response), GYRO_LSB_PER_DPS * 1.0_f64.to_degrees()),
        bias_dps: each(still, &RATE_BIAS, Unit::DegreePerSecond),
        per_g_dps: per_g_full_dps.map(largest),
        per_g_full_dps,
        walk_dps_per_sqrt_hz: worst(found, &RANDOM_WALK.gyro, Unit::DegreePerSecondPerRootHertz),
        density_dps_per_sqrt_hz: axes(found, &DENSITY.gyro, Unit::DegreePerSecondPerRootHertz),
        bias_instability_dph: worst(found, &BIAS_INSTABILITY.gyro, Unit::DegreePerHour),
    }
}

/// Refuses a passport that lacks a required number: JSON writes NaN and infinity as null.
fn check(passport: Passport) -> Result<Passport, NoPassport> {
    let Passport { accel, gyro, alignment, uncertainty, .. } = &passport;
    let rows = |matrix: &[[f64; 3]; 3]| matrix.as_flattened().to_vec();
    for (key, numbers) in [
        ("M_a", rows(&accel.response)),
        ("b_a_mg", accel.bias_mg.to_vec()),
        ("M_g", rows(&gyro.response)),
        ("b_g_dps", gyro.bias_dps.to_vec()),
        ("K_g_full_dps_per_g", rows(&gyro.per_g_full_dps)),
        ("nonorthogonality_accel_ppm", alignment.nonorthogonality_accel_ppm.to_vec()),
        ("nonorthogonality_gyro_ppm", alignment.nonorthogonality_gyro_ppm.to_vec()),
        ("k", vec![uncertainty.k]),
        ("U_accel_mg", vec![uncertainty.accel_mg]),
        ("U_gyro_dps", vec![uncertainty.gyro_dps]),
    ] {
        if !numbers.iter().all(|number| number.is_finite()) {
            return Err(NoPassport::NotANumber { key });
        }
    }
    Ok(passport)
}

/// The newest findings that hold this part of a calibration.
fn newest(found: &[(String, Findings)], has: impl Fn(&ModuleCalibration) -> bool) -> Option<&(String, Findings)> {
    found.iter().rev().find(|(_, findings)| CALIBRATION.of(&findings.details).is_some_and(|known| has(&known)))
}

/// A number in a unit; NaN if there is none.
fn number(findings: &Findings, measurement: &MeasurementSpec, unit: Unit) -> f64 {
    match findings.value(measurement) {
        Some(Value::Number(quantity) | Value::Estimate(quantity, _)) => quantity.in_unit(unit).unwrap_or(f64::NAN),
        _ => f64::NAN,
    }
}

fn each(findings: &Findings, measurements: &[MeasurementSpec; 3], unit: Unit) -> [f64; 3] {
    measurements.each_ref().map(|measurement| number(findings, measurement, unit))
}

/// The newest value of each axis; `None` unless all three were found.
fn axes(found: &[(String, Findings)], measurements: &[MeasurementSpec; 3], unit: Unit) -> Option<[f64; 3]> {
    let mut figures = found.iter().rev().map(|(_, findings)| each(findings, measurements, unit));
    let figures = figures.find(|figures| figures.iter().any(|figure| figure.is_finite()))?;
    figures.iter().all(|figure| figure.is_finite()).then_some(figures)
}

/// The largest of the three axes.
fn worst(found: &[(String, Findings)], measurements: &[MeasurementSpec; 3], unit: Unit) -> Option<f64> {
    axes(found, measurements, unit).map(|figures| figures.into_iter().fold(0.0, f64::max))
}

/// Lowest and highest temperature, from the means of the calibrating items and their drifts.
fn temperatures(found: &[(String, Findings)]) -> Option<[f64; 2]> {
    let calibrating = found.iter().filter(|(_, findings)| CALIBRATION.of(&findings.details).is_some());
    let spans = calibrating.filter_map(|(_, findings)| {
        let mean = Some(number(findings, &TEMPERATURE, Unit::DegreeCelsius)).filter(|mean| mean.is_finite())?;
        let drift = number(findings, &TEMPERATURE_DRIFT, Unit::DegreeCelsius);
        let half = if drift.is_finite() { drift / 2.0 } else { 0.0 };
        Some((mean - half, mean + half))
    });
    spans.fold(None, |range: Option<[f64; 2]>, (low, high)| match range {
        None => Some([low, high]),
        Some(range) => Some([range[0].min(low), range[1].max(high)]),
    })
}

/// Expanded uncertainties of both kinds of sensors, with the larger of their coverage factors.
fn uncertainty(six: &Findings, still: &Findings, budget: Vec<PassportBudget>) -> PassportUncertainty {
    let of = |findings: &Findings, bias: &[MeasurementSpec; 3], unit: Unit| {
        let known = bias.iter().filter_map(|axis| match findings.value(axis) {
            Some(Value::Estimate(quantity, known)) => {
                let known = known.in_unit(quantity.unit, unit)?;
                Some((known.expanded()? / known.k?, known.k?))
            }
            _ => None,
        });
        known.fold((0.0_f64, 0.0_f64), |(u, k), (one, factor)| (u.max(one), k.max(factor)))
    };
    let ((accel, accel_k), (gyro, gyro_k)) =
        (of(six, &FORCE_BIAS, Unit::Milligravity), of(still, &RATE_BIAS, Unit::DegreePerSecond));
    let k = accel_k.max(gyro_k);
    PassportUncertainty { k, accel_mg: k * accel, gyro_dps: k * gyro, budget }
}

/// The budgets of all parts of the calibration.
fn budgets(found: &[(String, Findings)]) -> Vec<PassportBudget> {
    let of_part = |(item, findings): &(String, Findings)| {
        let written = findings.details.get(BUDGET.key()).and_then(serde_json::Value::as_object);
        // A budget that is damaged by a missing number does not remove the others.
        let budgets = written.into_iter().flatten().filter_map(|(figure, written)| {
            let details::BudgetDetails { unit, u, dof, k, expanded, probability, contributions, .. } =
                details::BudgetDetails::deserialize(written).ok()?;
            let (item, figure) = (plain(item), figure.clone());
            Some(PassportBudget { item, figure, unit, u, dof, k, expanded, probability, contributions })
        });
        budgets.collect::<Vec<_>>()
    };
    PARTS.iter().filter_map(|has| newest(found, has)).flat_map(of_part).collect()
}

fn matrix(rows: &[[f64; 3]; 3]) -> Matrix3<f64> {
    Matrix3::from_fn(|i, j| rows[i][j])
}

fn inverse(rows: &[[f64; 3]; 3]) -> Matrix3<f64> {
    matrix(rows).try_inverse().unwrap_or_else(|| Matrix3::repeat(f64::NAN))
}

fn relative(response: Matrix3<f64>, nominal: f64) -> [[f64; 3]; 3] {
    [0, 1, 2].map(|i| [0, 1, 2].map(|j| response[(i, j)] / nominal))
}

fn largest(row: [f64; 3]) -> f64 {
    row.into_iter().fold(0.0, |most: f64, value| if value.abs() > most.abs() { value } else { most })
}
