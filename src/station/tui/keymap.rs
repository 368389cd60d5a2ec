//! The table of keys: which key does what, and where. Keys are looked up in it, and help and footers are drawn from it.
//!
//! No letter is ever a command, since a scanner types letters.

use super::decode::Key;

/// What a key asks for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) enum KeyAction {
    /// Shows what the keys do.
    Help,
    /// Plan, bench, operator, rounds, language.
    Setup,
    /// Runs the item under the cursor alone.
    One,
    /// Runs again the items that did not pass, or passed only marginally.
    Repeat,
    /// Starts a run.
    Start,
    /// Shows raw values without a run.
    Watch,
    /// Begins no further item, or goes on.
    Pause,
    /// Ends the item under the cursor; the run goes on.
    AbortItem,
    /// Stops in order; again: at once.
    Stop,
    /// What an interrupt means here: a stop while something is on, else the end of the program.
    Interrupt,
    /// Stops although captures are lost.
    StopAnyway,
    /// Ends the item although captures are lost.
    GiveUpAnyway,
    /// Shows the next page.
    NextPage,
    /// Leaves the program.
    Leave,
    /// Ticks or unticks an item.
    Tick,
    /// Ticks all items, or none.
    TickAll,
    /// Opens what is under the cursor.
    Open,
    /// Goes back.
    Back,
    /// Takes what was chosen.
    Take,
    /// Reads the chosen plan and bench again.
    LookAgain,
    /// Yes.
    Yes,
    /// No.
    No,
    /// Answers the question before again.
    Redo,
    /// Reads and checks the files that were changed.
    LoadNew,
    /// Runs the plan as it was checked.
    RunChecked,
    /// Takes a run up again that broke off.
    TakeUp,
    /// Runs the plan from its beginning.
    FromStart,
    /// Shows the log.
    Log,
    /// Compares the run with its digests.
    Verify,
    /// Draws everything again.
    Redraw,
    /// Shows only runs of one outcome.
    Filter,
    /// Reads the records again.
    Reload,
    /// Cursor up.
    Up,
    /// Cursor down.
    Down,
    /// The value before.
    Left,
    /// The value after.
    Right,
    /// A page up.
    PageUp,
    /// A page down.
    PageDown,
    /// To the top.
    Home,
    /// To the bottom.
    End,
}

/// Where a key is pressed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) enum KeyContext {
    /// The items, while nothing runs.
    Idle,
    /// The items, while a run is on.
    Running,
    /// One item with its measurements, or the log.
    Detail,
    /// Live readings, while nothing is on.
    Live,
    /// Live readings or captures, while a run is on.
    LiveRunning,
    /// Live readings without a run.
    Watching,
    /// Captures, while nothing is on.
    Calibration,
    /// Days or runs of the records.
    Records,
    /// One run of the records.
    Record,
    /// The form for plan, bench and rounds.
    Setup,
    /// A request of the run.
    Prompt,
    /// A question of the plan, which has an answer in words.
    Question,
    /// A question of the program.
    Confirm,
    /// The question what to do with files that were changed.
    Changed,
    /// The question whether to take a run up again.
    Interrupted,
    /// The question whether to stop a run that would lose captures.
    Stopping,
    /// The question whether to end an item that would lose captures.
    GivingUp,
    /// The list of keys.
    Help,
}

impl KeyContext {
    /// All places.
    #[cfg(test)]
    pub(crate) const ALL: &[KeyContext] = EVERYWHERE;
}

/// One row of the table.
#[derive(Debug)]
pub(crate) struct Binding {
    /// The key.
    pub key: Key,
    /// The action that it asks for.
    pub action: KeyAction,
    /// The places in which it works.
    pub places: &'static [KeyContext],
    /// Whether the last line of the screen shows it.
    pub footer: bool,
}

const EVERYWHERE: &[KeyContext] = &[
    KeyContext::Idle,
    KeyContext::Running,
    KeyContext::Detail,
    KeyContext::Live,
    KeyContext::LiveRunning,
    KeyContext::Watching,
    KeyContext::Calibration,
    KeyContext::Records,
    KeyContext::Record,
    KeyContext::Setup,
    KeyContext::Prompt,
    KeyContext::Question,
    KeyContext::Confirm,
    KeyContext::Changed,
    KeyContext::Interrupted,
    KeyContext::Stopping,
    KeyContext::GivingUp,
    KeyContext::Help,
];
const PAGES: &[KeyContext] = &[
    KeyContext::Idle,
    KeyContext::Running,
    KeyContext::Detail,
    KeyContext::Live,
    KeyContext::LiveRunning,
    KeyContext::Watching,
    KeyContext::Calibration,
    KeyContext::Records,
    KeyContext::Record,
];
const LISTS: &[KeyContext] = &[
    KeyContext::Idle,
    KeyContext::Running,
    KeyContext::Detail,
    KeyContext::Records,
    KeyContext::Record,
    KeyContext::Setup,
    KeyContext::Help,
];
/// Every place while a run is on: a module that must lose its power does not wait until the operator has found the page. The
/// form, and the questions before a start, are open only while nothing runs.
const RUN: &[KeyContext] = &[
    KeyContext::Running,
    KeyContext::LiveRunning,
    KeyContext::Watching,
    KeyContext::Detail,
    KeyContext::Record,
    KeyContext::Help,
    KeyContext::Confirm,
    KeyContext::Prompt,
    KeyContext::Question,
    KeyContext::GivingUp,
];
/// The same where the last line has no room for it.
const RUN_SILENT: &[KeyContext] = &[KeyContext::Records];

const BACK: &[KeyContext] = &[
    KeyContext::Idle,
    KeyContext::Running,
    KeyContext::Live,
    KeyContext::LiveRunning,
    KeyContext::Watching,
    KeyContext::Calibration,
];

const fn shown(key: Key, action: KeyAction, places: &'static [KeyContext]) -> Binding {
    Binding { key, action, places, footer: true }
}

const fn silent(key: Key, action: KeyAction, places: &'static [KeyContext]) -> Binding {
    Binding { key, action, places, footer: false }
}

/// The table.
pub(crate) const BINDINGS: &[Binding] = &[
    shown(Key::F(1), KeyAction::Help, PAGES),
    shown(Key::F(2), KeyAction::Setup, &[KeyContext::Idle]),
    shown(Key::F(3), KeyAction::One, &[KeyContext::Idle]),
    shown(Key::F(4), KeyAction::Repeat, &[KeyContext::Idle]),
    shown(Key::F(5), KeyAction::Start, &[KeyContext::Idle]),
    shown(Key::F(5), KeyAction::Watch, &[KeyContext::Live]),
    shown(Key::F(6), KeyAction::Pause, &[KeyContext::Running, KeyContext::LiveRunning]),
    shown(Key::F(7), KeyAction::AbortItem, &[KeyContext::Running]),
    shown(Key::F(8), KeyAction::Stop, RUN),
    silent(Key::F(8), KeyAction::Stop, RUN_SILENT),
    silent(Key::Ctrl('c'), KeyAction::Interrupt, EVERYWHERE),
    // The same keys: whoever is in a hurry presses twice. Not Enter, which a scanner sends.
    shown(Key::F(8), KeyAction::StopAnyway, &[KeyContext::Stopping]),
    shown(Key::F(7), KeyAction::GiveUpAnyway, &[KeyContext::GivingUp]),
    shown(Key::F(3), KeyAction::Verify, &[KeyContext::Records, KeyContext::Record]),
    shown(Key::F(4), KeyAction::Filter, &[KeyContext::Records]),
    shown(Key::F(5), KeyAction::Reload, &[KeyContext::Records]),
    shown(Key::F(5), KeyAction::LookAgain, &[KeyContext::Setup]),
    // A question is answered by a function key, since scanners send line ends. Not by F5: a second press of F5 must not
    // answer it.
    shown(Key::F(2), KeyAction::Yes, &[KeyContext::Prompt, KeyContext::Question, KeyContext::Confirm]),
    shown(Key::F(6), KeyAction::Redo, &[KeyContext::Question]),
    shown(Key::F(2), KeyAction::LoadNew, &[KeyContext::Changed]),
    shown(Key::F(6), KeyAction::RunChecked, &[KeyContext::Changed]),
    shown(Key::F(2), KeyAction::TakeUp, &[KeyContext::Interrupted]),
    shown(Key::F(6), KeyAction::FromStart, &[KeyContext::Interrupted]),
    // This ends the item that asks, as F7 does elsewhere. Esc does nothing here.
    shown(Key::F(7), KeyAction::No, &[KeyContext::Prompt, KeyContext::Question]),
    shown(
        Key::Esc,
        KeyAction::No,
        &[
            KeyContext::Confirm,
            KeyContext::Changed,
            KeyContext::Interrupted,
            KeyContext::Stopping,
            KeyContext::GivingUp,
        ],
    ),
    shown(Key::Enter, KeyAction::Open, &[KeyContext::Records, KeyContext::Record]),
    silent(Key::Enter, KeyAction::Open, &[KeyContext::Idle, KeyContext::Running]),
    shown(Key::Enter, KeyAction::Take, &[KeyContext::Setup]),
    shown(Key::Ctrl('l'), KeyAction::Log, &[KeyContext::Record]),
    silent(Key::Ctrl('l'), KeyAction::Log, &[KeyContext::Idle, KeyContext::Running]),
    shown(
        Key::Esc,
        KeyAction::Back,
        &[KeyContext::Detail, KeyContext::Records, KeyContext::Record, KeyContext::Setup, KeyContext::Help],
    ),
    silent(Key::Esc, KeyAction::Back, BACK),
    silent(Key::Char(' '), KeyAction::Tick, &[KeyContext::Idle]),
    silent(Key::Ctrl('a'), KeyAction::TickAll, &[KeyContext::Idle]),
    shown(Key::F(9), KeyAction::NextPage, PAGES),
    shown(Key::F(10), KeyAction::Leave, PAGES),
    silent(
        Key::F(10),
        KeyAction::Leave,
        &[KeyContext::Setup, KeyContext::Help, KeyContext::Prompt, KeyContext::Question],
    ),
    silent(Key::Ctrl('r'), KeyAction::Redraw, PAGES),
    silent(Key::Up, KeyAction::Up, LISTS),
    silent(Key::Down, KeyAction::Down, LISTS),
    silent(Key::Left, KeyAction::Left, &[KeyContext::Setup]),
    silent(Key::Right, KeyAction::Right, &[KeyContext::Setup]),
    silent(Key::PageUp, KeyAction::PageUp, LISTS),
    silent(Key::PageDown, KeyAction::PageDown, LISTS),
    silent(Key::Home, KeyAction::Home, LISTS),
    silent(Key::End, KeyAction::End, LISTS),
];

/// The action of a key in a place.
#[must_use]
pub(crate) fn action(place: KeyContext, key: Key) -> Option<KeyAction> {
    bindings(place).find(|binding| binding.key == key).map(|binding| binding.action)
}

/// The keys of a place.
pub(crate) fn bindings(place: KeyContext) -> impl Iterator<Item = &'static Binding> {
    BINDINGS.iter().filter(move |binding| binding.places.contains(&place))
}

/// A key as it is printed on a keyboard.
#[must_use]
pub(crate) fn name(key: Key) -> String {
    match key {
        Key::F(number) => format!("F{number}"),
        Key::Ctrl(letter) => format!("Ctrl-{}", letter.to_ascii_uppercase()),
        Key::Char(' ') => "Space".into(),
        Key::Char(character) | Key::Pasted(character) => character.to_string(),
        Key::Up => "Up".into(),
        Key::Down => "Down".into(),
        Key::Left => "Left".into(),
        Key::Right => "Right".into(),
        Key::Home => "Home".into(),
        Key::End => "End".into(),
        Key::PageUp => "PgUp".into(),
        Key::PageDown => "PgDn".into(),
        Key::Enter => "Enter".into(),
        Key::Esc => "Esc".into(),
        Key::Backspace => "Backspace".into(),
        Key::Tab => "Tab".into(),
        Key::Control => String::new(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A scanner types letters and digits, so these keys must not do anything.
    #[test]
    fn no_letter_is_a_command() {
        for binding in BINDINGS {
            let letter = matches!(binding.key, Key::Char(c) if c != ' ') || matches!(binding.key, Key::Pasted(_));
            assert!(!letter, "{binding:?}");
        }
    }

    /// A scanner sends line ends, Tab and control characters, so none of them answers a question of the station.
    #[test]
    fn no_scanner_answers_a_question() {
        for place in [
            KeyContext::Prompt,
            KeyContext::Question,
            KeyContext::Confirm,
            KeyContext::Changed,
            KeyContext::Interrupted,
        ] {
            let does_something =
                |action| action != KeyAction::No || [KeyContext::Prompt, KeyContext::Question].contains(&place);
            for binding in bindings(place).filter(|binding| does_something(binding.action)) {
                // It stops a run, or says no. A scanner's ETX is none: see the reader of the terminal.
                let stop = binding.key == Key::Ctrl('c') && binding.action == KeyAction::Interrupt;
                assert!(matches!(binding.key, Key::F(_)) || stop, "{place:?}: {binding:?}");
            }
        }
    }

    #[test]
    fn a_key_does_one_thing_in_a_place() {
        for place in KeyContext::ALL.iter().copied() {
            for binding in bindings(place) {
                let same = bindings(place).filter(|other| other.key == binding.key).count();
                assert_eq!(same, 1, "{place:?} {:?}", binding.key);
            }
        }
    }

    /// Keys that operators have learnt.
    #[test]
    fn fixed_keys() {
        assert_eq!(action(KeyContext::Idle, Key::F(1)), Some(KeyAction::Help));
        assert_eq!(action(KeyContext::Idle, Key::F(5)), Some(KeyAction::Start));
        for place in
            [KeyContext::Idle, KeyContext::Running, KeyContext::Live, KeyContext::Calibration, KeyContext::Records]
        {
            assert_eq!(action(place, Key::F(10)), Some(KeyAction::Leave), "{place:?}");
            assert_eq!(action(place, Key::Esc), Some(KeyAction::Back), "{place:?}");
        }
        assert_eq!(action(KeyContext::Running, Key::F(5)), None, "a run is not started twice");
    }
}
