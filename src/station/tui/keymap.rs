//! Which key does what, where: one table, from which keys are looked up and help and footers are drawn.
//!
//! No letter is ever a command, since a scanner types letters.

use super::decode::Key;

/// What a key asks for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) enum Action {
    /// Shows what the keys do.
    Help,
    /// Plan, bench, operator, rounds, language.
    Setup,
    /// Runs the item under the cursor alone.
    One,
    /// Runs again what was not good.
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
    /// Yes.
    Yes,
    /// No.
    No,
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
pub(crate) enum Place {
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
    /// A question of the run.
    Prompt,
    /// A question of the program.
    Confirm,
    /// The question what to do with files that were changed.
    Changed,
    /// The question whether to take a run up again.
    Interrupted,
    /// The list of keys.
    Help,
}

impl Place {
    /// All places.
    #[cfg(test)]
    pub(crate) const ALL: [Place; 15] = [
        Place::Idle,
        Place::Running,
        Place::Detail,
        Place::Live,
        Place::LiveRunning,
        Place::Watching,
        Place::Calibration,
        Place::Records,
        Place::Record,
        Place::Setup,
        Place::Prompt,
        Place::Confirm,
        Place::Changed,
        Place::Interrupted,
        Place::Help,
    ];
}

/// One row of the table.
#[derive(Debug)]
pub(crate) struct Binding {
    /// The key.
    pub key: Key,
    /// What it asks for.
    pub action: Action,
    /// Where.
    pub places: &'static [Place],
    /// Whether the last line of the screen shows it.
    pub footer: bool,
}

const PAGES: &[Place] = &[
    Place::Idle,
    Place::Running,
    Place::Detail,
    Place::Live,
    Place::LiveRunning,
    Place::Watching,
    Place::Calibration,
    Place::Records,
    Place::Record,
];
const LISTS: &[Place] =
    &[Place::Idle, Place::Running, Place::Detail, Place::Records, Place::Record, Place::Setup, Place::Help];
const RUN: &[Place] = &[Place::Running, Place::LiveRunning, Place::Watching, Place::Prompt];

const BACK: &[Place] =
    &[Place::Idle, Place::Running, Place::Live, Place::LiveRunning, Place::Watching, Place::Calibration];

const fn shown(key: Key, action: Action, places: &'static [Place]) -> Binding {
    Binding { key, action, places, footer: true }
}

const fn silent(key: Key, action: Action, places: &'static [Place]) -> Binding {
    Binding { key, action, places, footer: false }
}

/// The table.
pub(crate) const BINDINGS: &[Binding] = &[
    shown(Key::F(1), Action::Help, PAGES),
    shown(Key::F(2), Action::Setup, &[Place::Idle]),
    shown(Key::F(3), Action::One, &[Place::Idle]),
    shown(Key::F(4), Action::Repeat, &[Place::Idle]),
    shown(Key::F(5), Action::Start, &[Place::Idle]),
    shown(Key::F(5), Action::Watch, &[Place::Live]),
    shown(Key::F(6), Action::Pause, &[Place::Running, Place::LiveRunning]),
    shown(Key::F(7), Action::AbortItem, &[Place::Running]),
    shown(Key::F(8), Action::Stop, RUN),
    silent(Key::Ctrl('c'), Action::Stop, RUN),
    shown(Key::F(3), Action::Verify, &[Place::Records, Place::Record]),
    shown(Key::F(4), Action::Filter, &[Place::Records]),
    shown(Key::F(5), Action::Reload, &[Place::Records]),
    shown(Key::Enter, Action::Yes, &[Place::Prompt, Place::Confirm]),
    // Not with F5: a key that is pressed twice must not answer.
    shown(Key::Enter, Action::LoadNew, &[Place::Changed]),
    shown(Key::F(6), Action::RunChecked, &[Place::Changed]),
    shown(Key::Enter, Action::TakeUp, &[Place::Interrupted]),
    shown(Key::F(6), Action::FromStart, &[Place::Interrupted]),
    shown(Key::Esc, Action::No, &[Place::Prompt, Place::Confirm, Place::Changed, Place::Interrupted]),
    shown(Key::Enter, Action::Open, &[Place::Records, Place::Record]),
    silent(Key::Enter, Action::Open, &[Place::Idle, Place::Running]),
    shown(Key::Enter, Action::Take, &[Place::Setup]),
    shown(Key::Ctrl('l'), Action::Log, &[Place::Record]),
    silent(Key::Ctrl('l'), Action::Log, &[Place::Idle, Place::Running]),
    shown(Key::Esc, Action::Back, &[Place::Detail, Place::Records, Place::Record, Place::Setup, Place::Help]),
    silent(Key::Esc, Action::Back, BACK),
    silent(Key::Char(' '), Action::Tick, &[Place::Idle]),
    silent(Key::Ctrl('a'), Action::TickAll, &[Place::Idle]),
    shown(Key::F(9), Action::NextPage, PAGES),
    shown(Key::F(10), Action::Leave, PAGES),
    silent(Key::F(10), Action::Leave, &[Place::Setup, Place::Help, Place::Prompt]),
    silent(Key::Ctrl('r'), Action::Redraw, PAGES),
    silent(Key::Up, Action::Up, LISTS),
    silent(Key::Down, Action::Down, LISTS),
    silent(Key::Left, Action::Left, &[Place::Setup]),
    silent(Key::Right, Action::Right, &[Place::Setup]),
    silent(Key::PageUp, Action::PageUp, LISTS),
    silent(Key::PageDown, Action::PageDown, LISTS),
    silent(Key::Home, Action::Home, LISTS),
    silent(Key::End, Action::End, LISTS),
];

/// What a key asks for in a place.
#[must_use]
pub(crate) fn action(place: Place, key: Key) -> Option<Action> {
    bindings(place).find(|binding| binding.key == key).map(|binding| binding.action)
}

/// The keys of a place.
pub(crate) fn bindings(place: Place) -> impl Iterator<Item = &'static Binding> {
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

    /// A scanner types letters and digits: none of them may do anything.
    #[test]
    fn no_letter_is_a_command() {
        for binding in BINDINGS {
            let letter = matches!(binding.key, Key::Char(c) if c != ' ') || matches!(binding.key, Key::Pasted(_));
            assert!(!letter, "{binding:?}");
        }
    }

    #[test]
    fn a_key_does_one_thing_in_a_place() {
        for place in Place::ALL {
            for binding in bindings(place) {
                let same = bindings(place).filter(|other| other.key == binding.key).count();
                assert_eq!(same, 1, "{place:?} {:?}", binding.key);
            }
        }
    }

    /// Keys that operators have learnt.
    #[test]
    fn fixed_keys() {
        assert_eq!(action(Place::Idle, Key::F(1)), Some(Action::Help));
        assert_eq!(action(Place::Idle, Key::F(5)), Some(Action::Start));
        for place in [Place::Idle, Place::Running, Place::Live, Place::Calibration, Place::Records] {
            assert_eq!(action(place, Key::F(10)), Some(Action::Leave), "{place:?}");
            assert_eq!(action(place, Key::Esc), Some(Action::Back), "{place:?}");
        }
        assert_eq!(action(Place::Running, Key::F(5)), None, "a run is not started twice");
    }
}
