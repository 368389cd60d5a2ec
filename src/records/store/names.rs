//! Compares the journal of a run with the name of its folder: a folder that was renamed names another module, day or plan.

use std::path::Path;

use chrono::{NaiveDateTime, NaiveTime, TimeDelta};
use gnc_executive::state::RunState;

use super::located::located;
use super::{UNASSIGNED, name, reader};

/// What the first event may be away from the time in the name of the folder, which is made just before it: a slow disk, or a clock
/// that is set right in between.
const AWAY: TimeDelta = TimeDelta::hours(2);

/// What the journal names and the folder does not; `None` if they agree, and for a folder that stands in no day.
pub(super) fn unlike(folder: &Path, state: &RunState) -> Option<String> {
    let folder = located(folder).ok()?;
    let day = reader::day_of_run(&folder)?;
    let (header, started) = (state.header()?, state.started()?);
    let of = |folder: Option<&Path>| Some(folder?.file_name()?.to_str()?.to_owned());
    let (module, run) = (of(folder.parent())?, of(Some(&folder))?);
    let is_of_module = match module.as_str() {
        UNASSIGNED => state.other_module().is_some(),
        module => reader::folders_of(&header.serial_number).iter().any(|own| own == module),
    };
    if !is_of_module {
        return Some(format!(
            "the journal names the serial number {}, and the folder is not that of its module",
            gnc_text::quoted(&header.serial_number)
        ));
    }
    if let Some(earlier) = &header.recomputed {
        // Such a folder stands beside that of the first run and has its name.
        let is_beside = run.strip_prefix(&earlier.run).is_some_and(|rest| rest.starts_with("-recomputed"));
        return (!is_beside).then(|| {
            format!(
                "the journal is of {} judged again, and the folder has another name",
                gnc_text::printable(&earlier.run)
            )
        });
    }
    let (time, rest) = run.split_once('-').unwrap_or((&run, ""));
    let named = NaiveTime::parse_from_str(time, "%H%M%S").ok().map(|time| NaiveDateTime::new(day, time));
    let began = started.naive_local();
    if named.is_none_or(|named| (began - named).abs() > AWAY) {
        return Some(format!(
            "the journal begins at {}, and the folder names another day or time",
            began.format("%F %T")
        ));
    }
    let plan = name::of_part(&header.plan.name);
    // Runs of one second are told by a number.
    let number = rest.strip_prefix(&plan).map(|number| number.strip_prefix('-').unwrap_or(number));
    let is_plan = number.is_some_and(|number| number.bytes().all(|byte| byte.is_ascii_digit()));
    (!is_plan).then(|| {
        format!("the journal names the plan {}, and the folder another one", gnc_text::quoted(&header.plan.name))
    })
}
