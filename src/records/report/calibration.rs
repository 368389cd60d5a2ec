//! The module's passport for people, or the reason why the run has none.

use super::markup::SvgPage;
use super::number;
use crate::passport::{NoPassport, PASSPORT, PASSPORT_XML, Passport};

pub(super) fn show(page: &mut SvgPage, passport: &Result<Passport, NoPassport>) {
    let passport = match passport {
        // A plan without calibration needs no text about it.
        Err(NoPassport::NoCalibration) => return,
        Err(why) => {
            page.element("h2", "", "Sensor passport");
            page.element("p", "", &format!("None: {why}. The items show what the run found."));
            return;
        }
        Ok(passport) => passport,
    };
    page.element("h2", "", "Sensor passport");
    let text = format!(
        "For programs in {PASSPORT} and {PASSPORT_XML}, with the same content. M is measured over nominal scale factor, \
         rows are sensors, columns axes of the table; biases are measured less true. U is the expanded uncertainty of compensated \
         output at zero input, worst axis."
    );
    page.element("p", "", &text);
    let Passport { conditions, accel, gyro, alignment, uncertainty, origin, .. } = passport;
    page.open("div", "details");
    matrix(page, "M_a, accelerometers", &accel.response);
    matrix(page, "M_g, gyroscopes", &gyro.response);
    matrix(page, "K_g, deg/s per g", &gyro.per_g_full_dps);
    page.close("div");
    let temperature = conditions.temperature_range_c.map(|[low, high]| format!("{low:.2} .. {high:.2} degC"));
    let optional = |value: Option<f64>, unit: &str| value.map(|value| format!("{} {unit}", number(value)));
    let each = |values: Option<[f64; 3]>, unit: &str| values.map(|values| format!("{} {unit}", list(&values)));
    let k = number(uncertainty.k);
    let rows = [
        ("Accelerometer bias b_a", each(Some(accel.bias_mg), "mg")),
        ("U of the accelerometers", Some(format!("{} mg, k = {k}", number(uncertainty.accel_mg)))),
        ("Gyroscope bias b_g", each(Some(gyro.bias_dps), "deg/s")),
        ("U of the gyroscopes", Some(format!("{} deg/s, k = {k}", number(uncertainty.gyro_dps)))),
        ("Velocity random walk N, worst axis", optional(accel.walk_mps2_per_sqrt_hz, "m/s^2/sqrt(Hz)")),
        ("Angle random walk N, worst axis", optional(gyro.walk_dps_per_sqrt_hz, "deg/s/sqrt(Hz)")),
        ("White noise of the accelerometers, one-sided", each(accel.density_ug_per_sqrt_hz, "ug/sqrt(Hz)")),
        ("White noise of the gyroscopes, one-sided", each(gyro.density_dps_per_sqrt_hz, "deg/s/sqrt(Hz)")),
        ("Bias instability, worst axis", optional(gyro.bias_instability_dph, "deg/h")),
        ("Mounting of the seat on the table", each(alignment.mounting_deg, "deg")),
        ("Standard uncertainty of the mounting", optional(alignment.mounting_u_deg, "deg")),
        (
            "Angles between the accelerometers' own axes minus 90 deg, xy xz yz",
            each(Some(alignment.nonorthogonality_accel_ppm), "ppm"),
        ),
        (
            "Angles between the gyroscopes' own axes minus 90 deg, xy xz yz",
            each(Some(alignment.nonorthogonality_gyro_ppm), "ppm"),
        ),
        ("Temperature of the calibration, measured", temperature),
        ("Supply", optional(conditions.supply_v, "V")),
        ("Vibration and shock", conditions.vibration_and_shock.clone()),
    ];
    let measured = rows.map(|(name, value)| (name, Some(value.unwrap_or_else(|| "not measured".to_owned()))));
    let beside = [
        ("Judged again from", origin.recomputed_from.clone()),
        ("Captures taken over from", origin.resumed_from.clone()),
        ("Record, SHA-256", Some(origin.record_sha256.clone())),
        ("Chain", origin.chain.clone()),
    ];
    page.open("table", "facts");
    for (name, value) in measured.into_iter().chain(beside) {
        if let Some(value) = value {
            page.fact(name, &value);
        }
    }
    page.close("table");
}

fn matrix(page: &mut SvgPage, name: &str, rows: &[[f64; 3]; 3]) {
    page.open("div", "");
    page.element("h4", "", name);
    page.open("table", "");
    for row in rows {
        page.open("tr", "");
        row.iter().for_each(|value| page.element("td", "number", &number(*value)));
        page.close("tr");
    }
    page.close("table");
    page.close("div");
}

fn list(values: &[f64]) -> String {
    values.iter().map(|value| number(*value)).collect::<Vec<_>>().join("  ")
}
