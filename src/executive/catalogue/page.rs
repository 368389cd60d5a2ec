//! The catalogue as a page for people: every item with its parameters and measurements.

use std::fmt::Write as _;

use super::{Device, ItemId, MeasurementSpec, ParamKind, ParamSpec};
use crate::limit::MeasurementKind;
use crate::quantity::{Quantity, Unit};

const HEAD: &str = "# Items of a plan

What each item tests, what a plan sets and what a plan can limit. The program prints this page from its own table: `cargo run
-q -p gnc-executive --example items > docs/items.md`. A parameter that a plan leaves out has the value that stands here. A
measurement without a limit is information and never makes a module good.
";

/// The page in Markdown.
#[must_use]
pub fn page() -> String {
    let mut page = HEAD.to_owned();
    for item in ItemId::ALL {
        // Writing to a string cannot fail.
        let _ = section(&mut page, item);
    }
    page
}

fn section(page: &mut String, item: ItemId) -> std::fmt::Result {
    let spec = item.spec();
    writeln!(page, "\n## {item}: {}\n\n{}", spec.title, item.about())?;
    write!(page, "Time limit: {}.", Quantity::new(spec.timeout_s, Unit::Second))?;
    let others = spec.devices.iter().filter(|device| **device != Device::Slave);
    let devices: Vec<&str> = others.map(|device| device.as_str()).collect();
    if !devices.is_empty() {
        write!(page, " Needs: {}.", devices.join(", "))?;
    }
    if !spec.needs.is_empty() {
        let before: Vec<&str> = spec.needs.iter().map(|(need, _)| need.as_str()).collect();
        write!(page, " Uses the results of these earlier items: {}.", before.join(", "))?;
    }
    writeln!(page)?;
    if !spec.params.is_empty() {
        writeln!(page, "\n| parameter | | if left out | may be |\n| --- | --- | --- | --- |")?;
    }
    for param in spec.params {
        let (default, may_be) = values(param);
        writeln!(page, "| `{}` | {} | {default} | {may_be} |", param.name, param.about)?;
    }
    if id_asks(item) {
        writeln!(
            page,
            "\nThe plan names its questions, and each answer is a measurement: see [plans.md](plans.md#questions-to-the-operator)."
        )?;
        return Ok(());
    }
    writeln!(page, "\n| measurement | in | out of its limit |\n| --- | --- | --- |")?;
    for measurement in spec.measurements {
        writeln!(page, "| `{}` | {} | {} |", measurement.name, kind(measurement), measurement.look_at)?;
    }
    Ok(())
}

/// Whether a plan names the measurements of an item.
fn id_asks(item: ItemId) -> bool {
    item == ItemId::Prompt
}

/// The default of a parameter, and its allowed values.
fn values(param: &ParamSpec) -> (String, String) {
    let list = |values: &[i64]| values.iter().map(i64::to_string).collect::<Vec<_>>().join(", ");
    match param.kind {
        ParamKind::Integer { min, max, default } => (default.to_string(), format!("{min} to {max}")),
        ParamKind::Integers { min, max, default } => (list(default), format!("any of {min} to {max}")),
        ParamKind::Quantity { unit, min, max, default } => {
            let of = |value| Quantity::new(value, unit).to_string();
            (of(default), format!("{} to {}", of(min), of(max)))
        }
        ParamKind::Choice { of, default } => (default.to_owned(), of.join(", ")),
        ParamKind::Choices { of, default } => (default.join(", "), format!("any of {}", of.join(", "))),
        ParamKind::Source { of } => {
            let of: Vec<&str> = of.iter().map(|item| item.as_str()).collect();
            ("captures of its own".to_owned(), format!("name of an item of the plan: {}", of.join(", ")))
        }
    }
}

fn kind(measurement: &MeasurementSpec) -> String {
    match measurement.kind {
        MeasurementKind::Text => "text".to_owned(),
        MeasurementKind::Number(dimension) if measurement.unit.symbol().is_empty() => dimension.to_string(),
        MeasurementKind::Number(_) => measurement.unit.to_string(),
    }
}
