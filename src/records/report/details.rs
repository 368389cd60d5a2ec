//! Findings of an analysis as tables. The form of the data alone decides how it is shown. What `plots` draws is not
//! listed.
//!
//! | value | shown as |
//! | --- | --- |
//! | an object of `{figure: {contributions: [..], u, U, k, dof, probability, unit}}` | an uncertainty budget |
//! | a list of objects with the same keys | a table with a column for each key |
//! | a list of lists of numbers | a matrix |
//! | anything else | a line |

use gnc_analysis::figures::calibration::CALIBRATION;
use serde_json::{Map, Value};

use super::markup::SvgPage;
use super::{number, plots};

/// The key that makes an object one figure's uncertainty budget.
const CONTRIBUTIONS: &str = "contributions";
/// Most rows of a table; the record has the rest.
const MOST_ROWS: usize = 60;
/// Most columns of a table. Objects with more keys stand beside each other, with a line for each key.
const MOST_COLUMNS: usize = 8;
/// Keys whose text stands before the numbers: what the numbers are, and what they do not say.
const PROSE: [&str; 2] = ["equation", "label"];
/// The calibration in the form that later items read; it repeats other details.
const FOR_ITEMS: &str = CALIBRATION.key();

pub(super) fn show(page: &mut SvgPage, details: &Value) {
    let Value::Object(map) = details else { return };
    for text in PROSE.iter().filter_map(|key| map.get(*key)) {
        page.element("p", "", &inline(text));
    }
    page.open("div", "details");
    let hidden = |name: &str| plots::is_drawn(name) || PROSE.contains(&name) || name == FOR_ITEMS;
    // The long tables of the budgets come last.
    let (budgets, others): (Vec<_>, Vec<_>) =
        map.iter().filter(|(name, _)| !hidden(name)).partition(|(_, value)| is_budget(value));
    for (name, value) in others.into_iter().chain(budgets) {
        page.open("div", "");
        entry(page, name, value);
        page.close("div");
    }
    page.close("div");
}

fn entry(page: &mut SvgPage, name: &str, value: &Value) {
    match value {
        Value::Object(map) if is_budget(value) => {
            page.element("h4", "", &heading(name));
            budget(page, map);
        }
        Value::Object(_) => {
            page.element("h4", "", &heading(name));
            facts(page, value);
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

fn is_budget(value: &Value) -> bool {
    value.as_object().is_some_and(|map| map.values().any(|value| value.get(CONTRIBUTIONS).is_some()))
}

/// An uncertainty budget: the contributions of each figure, then their combination. `u` is the input's uncertainty
/// times the sensitivity, in the unit of the figure.
fn budget(page: &mut SvgPage, figures: &Map<String, Value>) {
    page.open("table", "");
    page.row(
        "th",
        &["Figure", "Contribution", "Type", "Distribution", "Input", "", "Sensitivity", "u", "Degrees of freedom"],
    );
    for (figure, budget) in figures {
        let of_figure = |key: &str| budget.get(key).map(inline).unwrap_or_default();
        let mut name = format!("{}, {}", heading(figure), of_figure("unit"));
        let contributions = budget.get(CONTRIBUTIONS).and_then(Value::as_array);
        for contribution in contributions.into_iter().flatten() {
            let cell = |key: &str| contribution.get(key).map(inline).unwrap_or_default();
            page.open("tr", "");
            page.element("td", "", &std::mem::take(&mut name));
            for key in ["name", "type", "distribution"] {
                page.element("td", "", &cell(key));
            }
            page.element("td", "number", &cell("value"));
            page.element("td", "", &cell("unit"));
            page.element("td", "number", &cell("sensitivity"));
            page.element("td", "number", &cell("u"));
            page.element("td", "number", &freedom(contribution));
            page.close("tr");
        }
        let together =
            format!("U = {} with k = {}, probability {}", of_figure("U"), of_figure("k"), of_figure("probability"));
        page.open("tr", "together");
        page.element("td", "", "");
        page.wide_cell(6, &together);
        page.element("td", "number", &of_figure("u"));
        page.element("td", "number", &freedom(budget));
        page.close("tr");
    }
    page.close("table");
}

/// Degrees of freedom; JSON has no infinity, so null means infinite.
fn freedom(of: &Value) -> String {
    match of.get("dof") {
        None => String::new(),
        Some(Value::Null) => "infinite".to_owned(),
        Some(dof) => inline(dof),
    }
}

/// Names and values; values of nested objects have their path.
fn facts(page: &mut SvgPage, whole: &Value) {
    page.open("table", "facts");
    for (name, value) in flattened("", whole) {
        page.fact(&heading(&name), &inline(value));
    }
    page.close("table");
}

fn objects(page: &mut SvgPage, rows: &[Value]) {
    let flat: Vec<Vec<(String, &Value)>> = rows.iter().take(MOST_ROWS).map(|row| flattened("", row)).collect();
    let mut names: Vec<&String> = Vec::new();
    for (name, _) in flat.iter().flatten() {
        if !names.contains(&name) {
            names.push(name);
        }
    }
    // Columns with text, such as names, come first.
    let is_text = |name: &&String| flat.iter().flatten().any(|(other, value)| other == *name && value.is_string());
    names.sort_by_key(|name| !is_text(name));
    let cell = |row: &[(String, &Value)], name: &String| {
        row.iter().find(|(other, _)| other == name).map_or(Value::Null, |(_, value)| (*value).clone())
    };
    page.open("table", "");
    if names.len() > MOST_COLUMNS && flat.len() <= MOST_COLUMNS {
        for name in names {
            page.open("tr", "");
            page.element("th", "", &heading(name));
            flat.iter().for_each(|row| value_cell(page, &cell(row, name)));
            page.close("tr");
        }
    } else {
        page.row("th", &names.iter().map(|name| heading(name)).collect::<Vec<_>>());
        for row in &flat {
            page.open("tr", "");
            names.iter().for_each(|name| value_cell(page, &cell(row, name)));
            page.close("tr");
        }
    }
    page.close("table");
    rest(page, rows.len());
}

fn value_cell(page: &mut SvgPage, value: &Value) {
    page.element("td", if value.is_number() { "number" } else { "" }, &inline(value));
}

/// An object with its nested objects as one flat list, each value under its path.
fn flattened<'v>(path: &str, value: &'v Value) -> Vec<(String, &'v Value)> {
    let Value::Object(map) = value else { return vec![(path.to_owned(), value)] };
    let below = |name: &String| if path.is_empty() { name.clone() } else { format!("{path} {name}") };
    map.iter().flat_map(|(name, value)| flattened(&below(name), value)).collect()
}

fn matrix(page: &mut SvgPage, rows: &[Value]) {
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

fn rest(page: &mut SvgPage, rows: usize) {
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
