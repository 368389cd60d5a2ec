//! What the station is asked to do in every run of a campaign.

use std::path::Path;

use chrono::{DateTime, FixedOffset};
use gnc_bench::fixture::Fixture;
use gnc_bench::runner::Order;
use gnc_executive::bench::BenchFile;
use gnc_executive::event::{Bench, EVENTS_SCHEMA, PlanInfo, Program, RunHeader};
use gnc_executive::job::{BenchAbilities, Job};
use gnc_executive::plan::Plan;
use gnc_link::Target;
use gnc_link::can::CanTarget;
use gnc_records::store::{RunFolder, digest};

use super::case::{Case, Link};

/// An order and the folder of its record.
pub(super) struct Ordered {
    pub(super) order: Order,
    pub(super) folder: RunFolder,
}

/// The functional plan on the bench of a case; its records go below `place`.
pub(super) fn order(
    case: &Case,
    speed: &str,
    (target, can): (Target, CanTarget),
    fixture: Fixture,
    place: &Path,
    began: DateTime<FixedOffset>,
) -> Result<Ordered, String> {
    let said = |error: &dyn std::fmt::Display| error.to_string();
    let bytes = std::fs::read(crate::functional_plan()).map_err(|error| said(&error))?;
    let mut no_includes = |name: &str| Err(format!("{name}: the functional plan includes nothing"));
    let plan = Plan::read("functional.toml", bytes, &mut no_includes).map_err(|mistakes| said(&mistakes))?;
    let file = BenchFile::read("the simulated bench's file", hw_mocks::BENCH_FILE.as_bytes().to_vec())
        .map_err(|mistakes| said(&mistakes))?;
    let abilities = BenchAbilities { rs422: case.link == Link::Rs422, can: true, operator: true };
    let header = RunHeader {
        schema: EVENTS_SCHEMA.to_owned(),
        serial_number: "T-1".to_owned(),
        operator: None,
        station: "campaign".to_owned(),
        program: Program { name: env!("CARGO_PKG_NAME").to_owned(), version: env!("CARGO_PKG_VERSION").to_owned() },
        bench: Bench::simulated(case.board.to_owned(), speed, case.bench_seed()),
        plan: PlanInfo {
            name: plan.name.clone(),
            version: plan.version.clone(),
            sha256: digest::of_plan(plan.files()),
        },
        site: file.site.clone(),
        recomputed: None,
        resumed: None,
        selection: None,
        looped: None,
    };
    let folder = RunFolder::create(&place.join("records"), began, "T-1", &plan.name).map_err(|error| said(&error))?;
    let order = Order {
        job: Job::new(plan, abilities, None).map_err(|mistakes| said(&mistakes))?,
        header,
        target,
        can: Some(can),
        fixture,
        site: file.site,
        resumed: None,
        one_by_one: false,
        nonce: Some(case.bench_seed() as u32),
        found: Vec::new(),
    };
    Ok(Ordered { order, folder })
}
