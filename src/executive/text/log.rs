//! `log.txt`: the whole run for people, with start, elapsed and end times and every error.

use std::fmt::Write as _;

use chrono::{DateTime, FixedOffset};
use gnc_text::printable;

use super::{banners, breach_lines, duration, error_record, failing_rows, item_line, measurement_line, verdict_line};
use crate::event::NoteLevel;
use crate::outcome::words;
use crate::record::{AttemptRecord, ItemRecord, RunRecord};

/// The run as a text file; every line ends with a line feed.
pub fn log_txt(record: &RunRecord) -> String {
    let mut out = String::new();
    for banner in banners(record) {
        let _ = writeln!(out, "*** {banner} ***");
    }
    head(&mut out, record);
    for item in &record.items {
        let _ = writeln!(out);
        section(&mut out, item);
    }
    if !record.notes.is_empty() {
        let _ = writeln!(out, "\nNotes");
        for note in &record.notes {
            let level = match note.level {
                NoteLevel::Info => "info",
                NoteLevel::Warning => "warning",
                NoteLevel::Error => "error",
            };
            let item = note.item.as_deref().map(|item| format!("{}: ", printable(item))).unwrap_or_default();
            let elapsed = format!("{:.3} s", note.elapsed_s);
            let _ = writeln!(out, "  {}  {elapsed:>12}  {level:7}  {item}{}", time(note.at), printable(&note.text));
        }
    }
    let breaches = breach_lines(record);
    if !breaches.is_empty() {
        let _ = writeln!(out, "\nThe board and the interface document");
        for (line, breach) in breaches.iter().zip(&record.board_breaches) {
            let _ = writeln!(out, "  first at {}  {line}", time(breach.first_at));
        }
    }
    let failing = failing_rows(record);
    if !failing.is_empty() {
        let _ = write!(out, "\nNot good\n{failing}");
    }
    let _ = writeln!(out, "\n{}", verdict_line(record));
    for banner in banners(record) {
        let _ = writeln!(out, "*** {banner} ***");
    }
    out
}

fn head(out: &mut String, record: &RunRecord) {
    let mut line = |name: &str, text: &str| {
        let _ = writeln!(out, "{name:14}{}", printable(text));
    };
    line("Serial number", &record.serial_number);
    let plan = &record.plan;
    line("Plan", &format!("{} {}, SHA-256 {}", plan.name, plan.version, plan.sha256));
    if let Some(part) = &record.part {
        line("Part asked", &part.to_string());
    }
    if let Some(limits) = &record.limits {
        line("Limits", &limits.to_string());
    }
    for number in &record.numbers {
        line("Number", &number.to_string());
    }
    line("Station", &record.station);
    line("Operator", record.operator.as_deref().unwrap_or("not given"));
    line("Program", &record.program.to_string());
    let bench = &record.bench;
    let details: Vec<String> = [
        bench.unproven.clone(),
        bench.personality.as_ref().map(|personality| format!("personality {personality}")),
        bench.speed.as_ref().map(|speed| format!("speed {speed}")),
        bench.seed.map(|seed| format!("seed {seed}")),
        bench.port.clone(),
        bench.rate_bps.map(|rate| format!("{rate} bit/s")),
        bench.site.as_ref().map(|site| format!("site {site}")),
    ]
    .into_iter()
    .flatten()
    .collect();
    line("Bench", &[&[bench.kind.as_str().to_owned()], details.as_slice()].concat().join(", "));
    if let Some(board) = &record.board {
        let text = format!(
            "{}, firmware {}, protocol {}, boot {}, {}",
            board.board_serial, board.firmware, board.protocol, board.boot_id, board.link
        );
        line("Board", &text);
    }
    if let Some(looped) = record.looped {
        let of = looped.count.map(|count| format!(" of {count}")).unwrap_or_default();
        line("Loop", &format!("round {}{of}", looped.index));
    }
    line("Start", &time(record.started));
    line("Elapsed", &format!("{:.3} s", record.elapsed_s));
    line("End", &record.finished.map_or_else(|| "none: the run was interrupted".to_owned(), time));
    if let Some(stop) = &record.stop {
        line("Stopped by", &stop.by);
    }
}

fn section(out: &mut String, item: &ItemRecord) {
    let _ = writeln!(out, "{}", item_line(item));
    for (index, attempt) in item.attempts.iter().enumerate() {
        let number = index + 1;
        let elapsed = attempt.elapsed_s.map_or_else(|| "no end".to_owned(), duration);
        let _ = writeln!(
            out,
            "  attempt {number}: {}, start {}, elapsed {elapsed}",
            words(attempt.outcome),
            time(attempt.started)
        );
        values(out, attempt);
    }
}

fn values(out: &mut String, attempt: &AttemptRecord) {
    for measurement in &attempt.measurements {
        // A value without a limit is information, and must not look like a pass.
        let outcome = measurement.outcome.map_or("-", words);
        let _ = writeln!(out, "    {outcome:8}  {}", measurement_line(measurement));
    }
    for record in &attempt.error_records {
        let _ = writeln!(out, "    board:    {}", error_record(record));
    }
    if let Some(error) = &attempt.error {
        let _ = writeln!(out, "    error:    {}", printable(&error.text));
    }
}

fn time(at: DateTime<FixedOffset>) -> String {
    at.format("%Y-%m-%d %H:%M:%S%.3f %:z").to_string()
}
