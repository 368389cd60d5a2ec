//! Figures compared with the truth of an independent small world.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "a test may end with a panic")]

mod attitude_field;
mod calibrating;
mod coverage;
mod coverage_field;
mod coverage_left;
mod coverage_list;
mod coverage_noise;
mod coverage_repeated;
mod coverage_sky;
mod integrity;
mod magnetometer;
mod performance;
mod receiver;
mod refusals;
mod sky;
pub(super) mod world;

use gnc_executive::bench::{BenchImperfections, BenchSite, SitePlace};
use gnc_executive::measurement::Value;
use gnc_executive::plan::{Params, Plan};
use gnc_executive::quantity::Unit;
use gnc_executive::uncertainty::Uncertainty;

use super::*;
use coverage::value_of;

/// Parameters of an item as a plan gives them. Setup needs no limits, so that the plan is short.
fn params(item: ItemId, params: &str) -> Params {
    let mut text = "name = \"t\"\nversion = \"1\"\n".to_owned();
    for before in
        [ItemId::SixPosition, ItemId::GyroStill, ItemId::Rotation, ItemId::BiasStability, ItemId::CalibrationDownload]
    {
        text += &format!("[[item]]\nid = \"{before}\"\nphase = \"setup\"\n");
    }
    text += &format!("[[item]]\nid = \"{item}\"\nname = \"this\"\nphase = \"setup\"\nparams = {{ {params} }}\n");
    // The items that this item needs stand before it.
    let plan = Plan::read("t.toml", text.into_bytes(), &mut |_| Err("no includes".into()));
    let plan = plan.unwrap_or_else(|mistakes| panic!("{mistakes}"));
    plan.items().iter().find(|other| other.name == "this").unwrap().params.clone()
}

/// A bench without errors of its own, so that the remaining error is the method's.
const PERFECT: BenchImperfections = BenchImperfections {
    mounting_rad: None,
    mounting_u_rad: 0.0,
    axis_u_rad: 0.0,
    runout_u_rad: 0.0,
    field_u_gauss: 0.0,
    ambient_u_gauss: 0.0,
    board_clock_u_ppm: None,
};

fn site() -> BenchSite {
    BenchSite {
        name: None,
        place: Some(SitePlace { latitude_deg: world::LATITUDE_DEG, longitude_deg: 108.9, height_m: 412.0 }),
        gravity_mps2: Some(world::GRAVITY),
        field_gauss: Some(0.5),
        fixture: Some(PERFECT),
    }
}

fn ask(
    item: ItemId,
    text: &str,
    captures: &[Capture],
    earlier: &[(String, Findings)],
) -> Result<Findings, FigureError> {
    let (params, site) = (params(item, text), site());
    analyse(item, &AnalysisInput { params: &params, site: Some(&site), captures, earlier })
}

/// Value, unit and interval of a figure.
fn figure(findings: &Findings, name: &str) -> (f64, Unit, Uncertainty) {
    match value_of(findings, name) {
        Some(Value::Estimate(quantity, known)) => (quantity.number, quantity.unit, *known),
        other => panic!("{name} is {other:?}"),
    }
}

/// Checks that the figure lies within twice its expanded uncertainty (once in 10,000 it does not), and that this is at
/// most `most`.
fn close(findings: &Findings, name: &str, truth: f64, most: f64) {
    let (value, unit, known) = figure(findings, name);
    let expanded = known.expanded().unwrap();
    assert!((value - truth).abs() <= 2.0 * expanded, "{name}: {value} {unit}, truth {truth}, U {expanded}");
    assert!(expanded <= most, "{name}: U {expanded} {unit}, at most {most} expected");
}

/// Checks that every measurement of the catalogue comes, in order and with its dimension, and that a file keeps the
/// details.
fn complete(item: ItemId, params: &Params, findings: &Findings) {
    let expected: Vec<&str> =
        item.spec().measurements.iter().filter(|spec| params.switch_on(spec.when)).map(|spec| spec.name).collect();
    let names: Vec<&str> = findings.measured.iter().map(|(name, _)| *name).collect();
    assert_eq!(names, expected, "{item}");
    for (name, value) in &findings.measured {
        let spec = item.spec().measurement(name).unwrap();
        match value {
            Value::Number(quantity) => assert_eq!(quantity.dimension(), spec.unit.dimension(), "{name}"),
            Value::Estimate(quantity, known) => {
                assert_eq!(quantity.dimension(), spec.unit.dimension(), "{name}");
                assert!(quantity.number.is_finite() && known.is_finite(), "{name}: {value:?}");
                assert!(
                    coverage_list::has_interval(item, name),
                    "{item} {name} has an interval: test how often it covers"
                );
            }
            Value::Text(_) | Value::NotAvailable(_) => {}
        }
    }
    let text = serde_json::to_string(&findings.details).unwrap();
    let back: serde_json::Value = serde_json::from_str(&text).unwrap();
    assert_eq!(back, *findings.details, "{item}");
}
