//! Columns of files that store them apart (Parquet, numpy), reduced to the wanted rows and columns.

use std::path::Path;

use super::columns::ColumnPlan;
use super::gathered::Gathered;
use super::rows::Role;
use super::{TableError, time};

/// Cells of a column.
#[derive(Debug)]
pub(super) enum Cells {
    /// Rows without a value hold NaN, and `missing` lists them.
    Numbers { values: Vec<f64>, missing: Vec<usize> },
    /// Each text once, and for each row the index of its text.
    Texts { names: Vec<String>, codes: Vec<u32> },
}

impl Cells {
    pub(super) fn len(&self) -> usize {
        match self {
            Self::Numbers { values, .. } => values.len(),
            Self::Texts { codes, .. } => codes.len(),
        }
    }

    /// The text of a row; empty for numbers.
    fn text(&self, row: usize) -> &str {
        match self {
            Self::Texts { names, codes } => names.get(codes[row] as usize).map_or("", String::as_str),
            Self::Numbers { .. } => "",
        }
    }
}

/// Takes the rows that a plan wants. `cells` are those of the plan's roles, in their order.
pub(super) fn gather(path: &Path, plan: &ColumnPlan, cells: &[Cells]) -> Result<Gathered, TableError> {
    let rows = cells.iter().map(Cells::len).min().unwrap_or(0);
    let mut gathered = Gathered::default();
    let mut taken = Vec::with_capacity(rows);
    let place = |role: fn(&Role) -> bool| plan.roles.iter().position(|(_, r)| role(r)).map(|i| &cells[i]);
    let captures = place(|role| matches!(role, Role::Capture));
    let labels = place(|role| matches!(role, Role::Label));
    for row in 0..rows {
        let capture = captures.map(|cells| cells.text(row));
        if let Some((name, wanted)) = capture.zip(plan.capture.as_deref())
            && name != wanted
        {
            gathered.pass_over(name.as_bytes());
            continue;
        }
        if let Some(label) = labels.map(|cells| cells.text(row)) {
            if label.is_empty() && plan.export {
                continue;
            }
            let Some(code) = plan.allowed.iter().position(|known| known.eq_ignore_ascii_case(label)) else {
                let what = format!("`{label}` in row {} is not one of {}", row + 1, plan.allowed.join(" "));
                return Err(TableError::Damaged { path: path.to_owned(), what });
            };
            gathered.labels.push(code as u8);
        }
        if let Some(name) = capture {
            gathered.begin(taken.len(), name.as_bytes());
        }
        taken.push(row);
    }
    gathered.rows = taken.len();
    for ((_, role), cells) in plan.roles.iter().zip(cells) {
        match (role, cells) {
            (Role::Number(k), Cells::Numbers { values, missing }) => {
                gathered.numbers.push(taken.iter().map(|&row| values[row]).collect());
                let kept = missing.iter().filter(|row| taken.binary_search(row).is_ok());
                gathered.missing.extend(kept.map(|row| (*k, row + 1)));
            }
            (Role::Time { .. }, Cells::Numbers { values, .. }) => {
                gathered.times = taken.iter().map(|&row| values[row]).collect();
            }
            (Role::Time { .. }, Cells::Texts { names, codes }) => {
                let dates: Vec<f64> = names.iter().map(|name| time::date(name).unwrap_or(f64::NAN)).collect();
                gathered.times = taken.iter().map(|&row| dates[codes[row] as usize]).collect();
            }
            (Role::Number(_), Cells::Texts { .. }) => {
                let text = cells.text(0).to_owned();
                let what = format!("a column of numbers has the text `{text}` in row 1");
                return Err(TableError::Damaged { path: path.to_owned(), what });
            }
            (Role::Label | Role::Capture, _) => {}
        }
    }
    Ok(gathered)
}
