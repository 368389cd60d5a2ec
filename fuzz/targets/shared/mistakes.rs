//! What must hold of every list of mistakes.

use gnc_config::{MAX_MISTAKES, Mistakes};

/// There is one at least, each with its mark below its line, and nothing of them plays tricks on a terminal.
pub fn can_be_shown(mistakes: &Mistakes) {
    assert!((1..=MAX_MISTAKES).contains(&mistakes.iter().count()));
    for mistake in mistakes.iter() {
        assert!(!mistake.what.is_empty());
        if let Some(place) = &mistake.place {
            assert!(place.line >= 1 && place.column >= 1 && place.marked >= 1, "{place:?}");
            // Past the end is the place of what is missing there.
            assert!(place.mark + place.marked <= place.text.chars().count() + 1, "{place:?}");
        }
    }
    let shown = mistakes.to_string();
    assert!(!shown.contains(|c: char| c.is_control() && c != '\n'), "{shown:?}");
}
