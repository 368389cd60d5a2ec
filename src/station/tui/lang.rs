//! The texts of the screen in each language. Each language is one value of [`Texts`], so that the compiler finds a
//! missing text.

mod ask;
mod en;
mod motion;
mod ru;
mod ru_catalogue;
mod zh;
mod zh_catalogue;

use std::borrow::Cow;

use gnc_bench::fixture::Ask;
use gnc_executive::catalogue::ItemId;
use gnc_executive::event::NoteLevel;
use gnc_executive::outcome::{Cause, Outcome};
use gnc_executive::verdict::Verdict;

use super::keymap::KeyAction;
pub use crate::locale::Lang;
use crate::phrases::in_language;

impl Lang {
    /// Its texts.
    #[must_use]
    pub(crate) fn texts(self) -> &'static Texts {
        match self {
            Lang::En => &en::TEXTS,
            Lang::Zh => &zh::TEXTS,
            Lang::Ru => &ru::TEXTS,
        }
    }
}

/// The texts of a key: a word for the last line, and a sentence for the help.
#[derive(Debug, Clone, Copy)]
pub(crate) struct KeyText {
    /// At most two short words.
    pub short: &'static str,
    /// A sentence.
    pub long: &'static str,
}

/// All texts of one language. `{}` is a place to fill in.
#[derive(Debug)]
pub(crate) struct Texts {
    /// The language.
    pub lang: Lang,
    /// The language's own name.
    pub language: &'static str,
    // Pages and panels.
    pub tests: &'static str,
    pub live: &'static str,
    pub calibration: &'static str,
    pub records: &'static str,
    pub setup: &'static str,
    pub help: &'static str,
    pub log: &'static str,
    pub product: &'static str,
    pub run: &'static str,
    pub detail: &'static str,
    pub mistakes: &'static str,
    // Above everything.
    pub station_title: &'static str,
    pub simulated: &'static str,
    /// At most three letters for a narrow list, like the other short caveats.
    pub simulated_short: &'static str,
    pub simulated_long: &'static str,
    pub unproven: &'static str,
    pub unproven_short: &'static str,
    /// With the reason in the language of the screen.
    pub unproven_long: &'static str,
    pub too_small: &'static str,
    /// What a small screen lacks, and the size from which on it is there.
    pub small_screen: &'static str,
    pub no_glyphs: &'static str,
    // Product panel.
    pub serial_number: &'static str,
    pub next_module: &'static str,
    pub part: &'static str,
    pub operator: &'static str,
    pub station: &'static str,
    pub plan: &'static str,
    pub board: &'static str,
    pub no_board_yet: &'static str,
    pub no_board_answer: &'static str,
    /// The module is under power where it must not be; short enough for the narrowest panel.
    pub danger_powered: &'static str,
    /// The board breaks rules of the interface document; a number follows.
    pub board_breaks: &'static str,
    pub module_on: &'static str,
    pub module_off: &'static str,
    /// No board has confirmed that the module is off, and only the board's watchdog switches it off.
    pub power_unknown: &'static str,
    pub watchdog_acts: &'static str,
    pub line_lost: &'static str,
    pub scan_here: &'static str,
    /// Whose name is taken over from the last run.
    pub operator_remembered: &'static str,
    pub operator_of_last_run: &'static str,
    pub operator_needed: &'static str,
    // The shift.
    /// Modules, passed, failed, others: short enough for the border of the narrowest panel.
    pub shift_short: &'static str,
    /// The first-pass yield in percent, after the counters.
    pub first_pass_short: &'static str,
    /// Since when, and how many modules.
    pub shift_since: &'static str,
    /// The first-pass yield in percent, and of how many modules.
    pub first_pass: &'static str,
    pub others: &'static str,
    pub last_modules: &'static str,
    /// How many modules.
    pub modules: &'static str,
    pub loading: &'static str,
    pub still_loading: &'static str,
    // Run panel.
    pub started: &'static str,
    pub elapsed: &'static str,
    pub remaining: &'static str,
    pub ends_at: &'static str,
    pub ended_at: &'static str,
    pub unknown_yet: &'static str,
    pub longer_than_last: &'static str,
    pub round: &'static str,
    pub round_of: &'static str,
    pub selection: &'static str,
    pub selection_short: &'static str,
    pub selection_long: &'static str,
    pub rejudged: &'static str,
    pub rejudged_short: &'static str,
    pub rejudged_long: &'static str,
    pub closed_late: &'static str,
    pub late: &'static str,
    pub late_short: &'static str,
    pub late_long: &'static str,
    pub paused: &'static str,
    pub pausing: &'static str,
    pub stopping: &'static str,
    pub stop_now: &'static str,
    pub go_on: &'static str,
    pub stopping_at_once: &'static str,
    pub running: &'static str,
    pub ready: &'static str,
    pub not_ready: &'static str,
    pub no_verdict_yet: &'static str,
    pub refused_next: &'static str,
    pub record_in: &'static str,
    // Table of items.
    pub item: &'static str,
    pub outcome: &'static str,
    pub time: &'static str,
    pub decided_by: &'static str,
    pub attempt: &'static str,
    pub waiting: &'static str,
    pub value: &'static str,
    pub limits: &'static str,
    pub measurement: &'static str,
    pub look_at: &'static str,
    pub try_this: &'static str,
    pub board_says: &'static str,
    pub nothing_measured: &'static str,
    pub more_lines: &'static str,
    /// How many lines of mistakes have no room, and the key that shows them.
    pub all_lines: &'static str,
    pub optional: &'static str,
    // Messages.
    pub scan_first: &'static str,
    pub scanned: &'static str,
    pub scanned_refused: &'static str,
    pub scanned_next: &'static str,
    pub scan_empty: &'static str,
    pub scan_too_long: &'static str,
    pub scan_control: &'static str,
    pub other_module: &'static str,
    pub limits_of_part: &'static str,
    pub limits_of_plan: &'static str,
    pub setup_part: &'static str,
    pub setup_revision: &'static str,
    pub revision_alone: &'static str,
    pub revision_gone: &'static str,
    pub number_taken: &'static str,
    pub number_needed: &'static str,
    pub number_misfit: &'static str,
    pub scan_misfit: &'static str,
    pub scanner_lost: &'static str,
    pub scanner_back: &'static str,
    pub scan_invisible: &'static str,
    pub scan_layout: &'static str,
    pub scan_sign: &'static str,
    pub scan_fields: &'static str,
    pub scan_cut: &'static str,
    pub not_used: &'static str,
    pub answer_cut: &'static str,
    pub scan_waits: &'static str,
    pub scan_instead: &'static str,
    pub scan_beside_form: &'static str,
    pub nothing_ticked: &'static str,
    pub nothing_failed: &'static str,
    pub no_plan: &'static str,
    pub no_bench: &'static str,
    pub not_during_run: &'static str,
    pub not_running_item: &'static str,
    pub events_lost: &'static str,
    pub store_error: &'static str,
    pub run_refused: &'static str,
    pub aborting_item: &'static str,
    // Questions.
    pub again_title: &'static str,
    pub again_question: &'static str,
    pub changed_title: &'static str,
    pub changed_question: &'static str,
    pub file_changed: &'static str,
    pub file_unreadable: &'static str,
    pub reading_new: &'static str,
    /// Before a run: what takes time where many runs are filed.
    pub looking_back: &'static str,
    pub interrupted_title: &'static str,
    pub interrupted_question: &'static str,
    pub no_resume_question: &'static str,
    pub no_resume_items: &'static str,
    pub resume_asked: &'static str,
    pub only_unknown: &'static str,
    pub stop_title: &'static str,
    pub stop_question: &'static str,
    pub give_up_question: &'static str,
    pub leave_loses: &'static str,
    pub broke_off: &'static str,
    pub broke_off_scan: &'static str,
    pub leave_title: &'static str,
    pub leave_question: &'static str,
    pub leave_stop_first: &'static str,
    pub interrupt_again: &'static str,
    pub interrupt_after_run: &'static str,
    pub prompt_title: &'static str,
    pub asked_since: &'static str,
    pub asked_log: &'static str,
    pub answered_log: &'static str,
    pub question_waits: &'static str,
    pub done: &'static str,
    pub not_possible: &'static str,
    pub on_no: &'static str,
    // Questions of the plan.
    pub picture_loading: &'static str,
    pub picture_gone: &'static str,
    pub picture_unreadable: &'static str,
    pub picture_changed: &'static str,
    pub picture_other_format: &'static str,
    pub picture_broken: &'static str,
    pub picture_large: &'static str,
    pub answer_typed: &'static str,
    pub answer_takes: &'static str,
    pub answer_key: &'static str,
    pub first_question: &'static str,
    pub on: &'static str,
    pub off: &'static str,
    // Setup.
    pub setup_plan: &'static str,
    pub setup_bench: &'static str,
    pub setup_operator: &'static str,
    pub setup_rounds: &'static str,
    pub setup_on_fail: &'static str,
    pub setup_language: &'static str,
    pub setup_hint: &'static str,
    pub rounds_once: &'static str,
    pub rounds_count: &'static str,
    pub rounds_time: &'static str,
    pub on_fail_plan: &'static str,
    pub on_fail_stop: &'static str,
    pub on_fail_continue: &'static str,
    pub not_a_number: &'static str,
    pub plan_good: &'static str,
    pub plan_pinned: &'static str,
    pub plan_not_pinned: &'static str,
    pub mistakes_found: &'static str,
    pub mistakes_of_bench: &'static str,
    // Live.
    pub rate: &'static str,
    pub acceleration: &'static str,
    pub field: &'static str,
    pub temperature: &'static str,
    /// How far a temperature has drifted.
    pub drift: &'static str,
    pub gnss: &'static str,
    pub satellites: &'static str,
    pub no_fix: &'static str,
    pub ad_channels: &'static str,
    pub streams: &'static str,
    pub streams_legend: &'static str,
    pub no_live_yet: &'static str,
    pub watching: &'static str,
    pub last_values: &'static str,
    pub no_verdict: &'static str,
    pub pulses: &'static str,
    pub seconds_ago: &'static str,
    // Captures.
    pub capture_of: &'static str,
    pub to_go: &'static str,
    pub this_capture: &'static str,
    pub captures: &'static str,
    pub bench_time: &'static str,
    pub captures_later: &'static str,
    pub stage_laying: &'static str,
    pub stage_settling: &'static str,
    pub stage_capturing: &'static str,
    pub stage_spinning_up: &'static str,
    pub stage_stopping: &'static str,
    pub stage_powered_off: &'static str,
    pub stage_warming: &'static str,
    pub stage_warming_at_most: &'static str,
    pub stage_warms: &'static str,
    pub captures_taken: &'static str,
    pub taken_over: &'static str,
    pub stage_working_out: &'static str,
    pub lie_up: &'static str,
    pub lie_north: &'static str,
    pub lie_pole: &'static str,
    pub lie_any: &'static str,
    pub turns: &'static str,
    pub spins: &'static str,
    pub north: &'static str,
    pub raw: &'static str,
    pub corrected: &'static str,
    pub centre: &'static str,
    pub sensitivity_ratio: &'static str,
    pub roll: &'static str,
    pub by_host: &'static str,
    pub not_available: &'static str,
    pub no_ellipse: &'static str,
    pub allan: &'static str,
    pub gyroscopes: &'static str,
    pub accelerometers: &'static str,
    // Records.
    pub days: &'static str,
    pub no_records: &'static str,
    pub reading_records: &'static str,
    pub filter_all: &'static str,
    pub filter: &'static str,
    pub search: &'static str,
    pub interrupted: &'static str,
    pub unsealed: &'static str,
    pub changed_record: &'static str,
    pub not_in_chain: &'static str,
    pub running_record: &'static str,
    pub unreadable: &'static str,
    pub newer: &'static str,
    pub written_by_newer: &'static str,
    pub digests_agree: &'static str,
    pub verifying: &'static str,
    pub as_written: &'static str,
    pub not_as_written: &'static str,
    pub no_run_matches: &'static str,
    pub start_time: &'static str,
    pub too_many_runs: &'static str,
    pub enter_opens: &'static str,
    // Texts that depend on a value.
    /// The request to the operator in words.
    pub ask: fn(&Ask) -> String,
    pub key: fn(KeyAction) -> KeyText,
    pub outcome_word: fn(Outcome) -> &'static str,
    /// Good items of a selection: no pass of the module.
    pub partial: &'static str,
    /// At most six capital letters, drawn as large as the screen allows. Only letters of [`super::view::big`].
    pub verdict: fn(Verdict) -> &'static str,
    pub item_title: fn(ItemId) -> &'static str,
    pub level: fn(NoteLevel) -> &'static str,
    pub cause: fn(&Cause) -> String,
    /// The sentence of the catalogue in this language.
    pub look_at_sentence: fn(&'static str) -> &'static str,
}

impl Texts {
    /// The name of a capture, which the plan's item made, in this language.
    pub(crate) fn capture<'a>(&self, name: &'a str) -> Cow<'a, str> {
        in_language(name, self.lang)
    }

    /// The end of a run in a word.
    pub(crate) fn word_of(&self, verdict: Verdict) -> &'static str {
        verdict.to_show().map_or(self.partial, self.outcome_word)
    }
}

/// The text with each `{}` replaced by the next part.
pub(crate) fn fill(text: &str, parts: &[&str]) -> String {
    let mut out = String::with_capacity(text.len() + parts.iter().map(|part| part.len()).sum::<usize>());
    let mut parts = parts.iter();
    for (index, piece) in text.split("{}").enumerate() {
        if index > 0 {
            out.push_str(parts.next().unwrap_or(&""));
        }
        out.push_str(piece);
    }
    out
}

#[cfg(test)]
mod tests;
