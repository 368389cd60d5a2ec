//! What a bench does around its runs: who tests, which plan is usual, what follows a verdict, when shifts begin, how its
//! terminal draws pictures.

use chrono::NaiveTime;
use gnc_config::TomlTable;
use gnc_text::quoted;

use super::checked;
use crate::quantity::{Unit, bounded_at};

/// How long a program after a verdict may run if the bench file does not say it: a label printer needs a few seconds.
const HOOK_LIMIT_S: f64 = 10.0;
/// Bounds of that time. A program that runs longer than a module takes would never catch up.
const HOOK_LIMITS_S: (f64, f64) = (0.1, 600.0);
/// Largest number of words of the program's command line.
const HOOK_WORDS: usize = 64;
/// Largest number of shifts of a day.
const SHIFTS: usize = 24;

/// Who tests at a bench: the table `[operator]`.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct OperatorHabit {
    /// No run begins without the operator's name.
    pub required: bool,
    /// The operator, if the command line and the screen name none.
    pub name: Option<String>,
}

/// What follows a verdict: the table `[verdict]`.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct VerdictHabit {
    /// The terminal rings at a verdict and at a question.
    pub bell: bool,
    /// The program that is told each verdict.
    pub hook: Option<Hook>,
}

/// A program that is told each verdict.
#[derive(Clone, Debug, PartialEq)]
pub struct Hook {
    /// The program and its arguments as written; there is at least one word.
    pub command: Vec<String>,
    /// Seconds after which the program is killed.
    pub limit_s: f64,
}

/// How the screen draws the pictures of questions: `pictures` of the table `[screen]`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum DrawPictures {
    /// As the terminal says what it is.
    #[default]
    Auto,
    /// By the protocol of kitty.
    Kitty,
    /// By the protocol of iTerm2.
    Iterm2,
    /// As sixels.
    Sixel,
    /// Not at all: the path alone is shown.
    Off,
}

/// The words for it in bench files.
const DRAW_PICTURES: [(&str, DrawPictures); 5] = [
    ("auto", DrawPictures::Auto),
    ("kitty", DrawPictures::Kitty),
    ("iterm2", DrawPictures::Iterm2),
    ("sixel", DrawPictures::Sixel),
    ("off", DrawPictures::Off),
];

pub(super) fn pictures(table: &TomlTable<'_, '_>) -> DrawPictures {
    let Some((word, span)) = table.text("pictures") else { return DrawPictures::default() };
    if let Some((_, how)) = DRAW_PICTURES.iter().find(|(known, _)| *known == word) {
        return *how;
    }
    let what = format!("{} is no way to draw pictures", quoted(word));
    table.mistake_at(span, what, "write \"auto\", \"kitty\", \"iterm2\", \"sixel\" or \"off\"");
    DrawPictures::default()
}

pub(super) fn operator(table: &TomlTable<'_, '_>) -> OperatorHabit {
    OperatorHabit { required: table.flag("required"), name: checked(table, table.text("name")) }
}

pub(super) fn verdict(table: &TomlTable<'_, '_>) -> VerdictHabit {
    let bell = table.flag("bell");
    let limit_s = bounded_at(table, "hook_time", Unit::Second, HOOK_LIMITS_S);
    let words = table.texts("hook");
    let hint = "write hook = [\"./light.sh\"]: the program first, then its arguments";
    if let Some((_, span)) = words.get(HOOK_WORDS) {
        table.mistake_at(span.clone(), format!("the command has more than {HOOK_WORDS} words"), hint);
    }
    if let Some((first, span)) = words.first()
        && first.trim().is_empty()
    {
        table.mistake_at(span.clone(), "the program has no name", hint);
    }
    if words.is_empty() && table.has("hook_time") {
        table.mistake("there is a hook_time and no hook", hint);
    }
    let command: Vec<String> = words.into_iter().filter_map(|word| checked(table, Some(word))).collect();
    let hook = (!command.is_empty()).then(|| Hook { command, limit_s: limit_s.unwrap_or(HOOK_LIMIT_S) });
    VerdictHabit { bell, hook }
}

/// Reads when shifts begin, in the order of the day; empty if the bench file does not say it.
pub(super) fn shifts(table: &TomlTable<'_, '_>) -> Vec<NaiveTime> {
    let mut begins = Vec::new();
    for (text, span) in table.texts("begins").into_iter().take(SHIFTS) {
        match NaiveTime::parse_from_str(text, "%H:%M") {
            Ok(time) if begins.contains(&time) => {
                table.mistake_at(span, format!("two shifts begin at {text}"), "write each time once");
            }
            Ok(time) => begins.push(time),
            Err(_) => {
                let what = format!("{} is not a time of day", quoted(text));
                table.mistake_at(span, what, "write begins = [\"06:00\", \"14:00\", \"22:00\"]");
            }
        }
    }
    begins.sort_unstable();
    begins
}
