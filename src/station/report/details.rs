//! What an analysis found, drawn from its data alone: any analysis gets a table of what it says, and pictures of what
//! it lists under `plots`.
//!
//! | key | shown as |
//! | --- | --- |
//! | `plots`: list of `{title, x, y, log, square, series: [{name, mark: dots, line or bars, points: [[x, y]], bars: [[low, high]]}]}` | a picture |
//! | an object of `{figure: {contributions: [..], u, U, k, dof, probability, unit}}` | an uncertainty budget |
//! | a list of objects with the same keys | a table with a column for each key |
//! | a list of lists of numbers | a matrix |
//! | anything else | a line |

use serde::Deserialize;
use serde_json::{Map, Value};

use super::markup::Page;
use super::number;
use crate::compute::plot::{Mark, Panel, Series, svg};

/// The key that makes an object one figure's uncertainty budget.
const CONTRIBUTIONS: &str = "contributions";
/// Rows of a table; an analysis that lists more has the rest in the record.
const MOST_ROWS: usize = 60;

pub(super) fn show(page: &mut Page, details: &Value) {
    let Value::Object(map) = details else { return };
    page.open("div", "details");
    for (name, value) in map {
        if name != "plots" {
            page.open("div", "");
            entry(page, name, value);
            page.close("div");
        }
    }
    page.close("div");
    if let Some(plots) = map.get("plots") {
        // What is not of this form is in the record all the same.
        let panels: Vec<Plot> = serde_json::from_value(plots.clone()).unwrap_or_default();
        for panel in panels {
            page.picture(&svg(&[panel.into()]));
        }
    }
}

fn entry(page: &mut Page, name: &str, value: &Value) {
    match value {
        Value::Object(map) if map.values().any(|value| value.get(CONTRIBUTIONS).is_some()) => {
            page.element("h4", "", &heading(name));
            budget(page, map);
        }
        Value::Object(map) => {
            page.element("h4", "", &heading(name));
            facts(page, map);
        }
        Value::Array(rows) if rows.iter().all(Value::is_object) && !rows.is_empty() => {
            page.element("h4", "", &heading(name));
            objects(page, rows);
        }
        Value::Array(rows) if rows.iter().all(Value::is_array) && !rows.is_empty() => {
            page.element("h4", "", &heading(name));
            matrix(page, rows);
        }
        other => page.element("p", "", &format!("{}: {}", heading(name), inline(other))),
    }
}

/// An uncertainty budget: of each figure its contributions, then what they come to together.
fn budget(page: &mut Page, figures: &Map<String, Value>) {
    page.open("table", "");
    page.row(
        "th",
        &["Figure", "Contribution", "Type", "Distribution", "u", "Unit", "Sensitivity", "Degrees of freedom"],
    );
    for (figure, budget) in figures {
        let contributions = budget.get(CONTRIBUTIONS).and_then(Value::as_array);
        for contribution in contributions.into_iter().flatten() {
            let cell = |key: &str| contribution.get(key).map(inline).unwrap_or_default();
            page.open("tr", "");
            page.element("td", "", &heading(figure));
            for key in ["name", "type", "distribution"] {
                page.element("td", "", &cell(key));
            }
            page.element("td", "number", &cell("u"));
            page.element("td", "", &cell("unit"));
            page.element("td", "number", &cell("sensitivity"));
            page.element("td", "number", &cell("dof"));
            page.close("tr");
        }
        let part = |key: &str| budget.get(key).map(inline).unwrap_or_default();
        let together = format!("together U = {}, k = {}, probability {}", part("U"), part("k"), part("probability"));
        page.row("td", &[&heading(figure), &together, "", "", &part("u"), &part("unit"), "", &part("dof")]);
    }
    page.close("table");
}

/// Names and values, those of nested objects with their path.
fn facts(page: &mut Page, map: &Map<String, Value>) {
    page.open("table", "facts");
    for (name, value) in map {
        page.open("tr", "");
        page.element("th", "", &heading(name));
        page.element("td", "", &inline(value));
        page.close("tr");
    }
    page.close("table");
}

fn objects(page: &mut Page, rows: &[Value]) {
    let mut columns: Vec<&String> = Vec::new();
    for name in rows.iter().filter_map(Value::as_object).flat_map(Map::keys) {
        if !columns.contains(&name) {
            columns.push(name);
        }
    }
    page.open("table", "");
    let names: Vec<String> = columns.iter().map(|name| heading(name)).collect();
    page.row("th", &names.iter().map(String::as_str).collect::<Vec<_>>());
    for row in rows.iter().take(MOST_ROWS) {
        page.open("tr", "");
        for name in &columns {
            let value = row.get(name.as_str()).unwrap_or(&Value::Null);
            page.element("td", if value.is_number() { "number" } else { "" }, &inline(value));
        }
        page.close("tr");
    }
    page.close("table");
    rest(page, rows.len());
}

fn matrix(page: &mut Page, rows: &[Value]) {
    page.open("table", "");
    for row in rows.iter().take(MOST_ROWS) {
        page.open("tr", "");
        for value in row.as_array().into_iter().flatten() {
            page.element("td", "number", &inline(value));
        }
        page.close("tr");
    }
    page.close("table");
    rest(page, rows.len());
}

fn rest(page: &mut Page, rows: usize) {
    if let Some(more @ 1..) = rows.checked_sub(MOST_ROWS) {
        page.element("p", "hint", &format!("and {more} more in run.json"));
    }
}

fn inline(value: &Value) -> String {
    match value {
        Value::Null => "not available".to_owned(),
        Value::Bool(flag) => if *flag { "yes" } else { "no" }.to_owned(),
        Value::Number(count) if count.is_u64() || count.is_i64() => count.to_string(),
        Value::Number(other) => other.as_f64().map_or_else(|| other.to_string(), number),
        Value::String(text) => text.clone(),
        Value::Array(values) => values.iter().map(inline).collect::<Vec<_>>().join("  "),
        Value::Object(map) => map
            .iter()
            .map(|(name, value)| format!("{}: {}", heading(name), inline(value)))
            .collect::<Vec<_>>()
            .join("; "),
    }
}

/// A key as words.
fn heading(name: &str) -> String {
    name.replace('_', " ")
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
struct Plot {
    title: String,
    x: String,
    y: String,
    log: bool,
    square: bool,
    series: Vec<PlotSeries>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
struct PlotSeries {
    name: String,
    mark: String,
    points: Vec<(f64, f64)>,
    bars: Vec<(f64, f64)>,
}

impl From<Plot> for Panel {
    fn from(plot: Plot) -> Self {
        let series = plot.series.into_iter().map(|series| Series {
            name: series.name,
            mark: match series.mark.as_str() {
                "line" => Mark::Line,
                "bars" => Mark::Bars(series.bars),
                _ => Mark::Dots,
            },
            points: series.points,
        });
        let panel = Self::new(plot.title, plot.x, plot.y, series.collect());
        let panel = if plot.log { panel.log() } else { panel };
        if plot.square { panel.square() } else { panel }
    }
}
