//! Colours and marks. Colour is never the only sign: each outcome has its word and its mark as well.

use gnc_executive::outcome::Outcome;
use gnc_executive::verdict::Verdict;
use ratatui::style::{Color, Modifier, Style};

use crate::tui::model::{Look, MessageWeight};

/// Text that stands out.
pub(super) fn strong() -> Style {
    Style::new().add_modifier(Modifier::BOLD)
}

/// Text of less importance.
pub(super) fn faint() -> Style {
    Style::new().add_modifier(Modifier::DIM)
}

/// The line under the cursor, and titles.
pub(super) fn turned() -> Style {
    Style::new().add_modifier(Modifier::REVERSED)
}

/// A colour, if colours are wanted.
fn coloured(look: Look, colour: Color) -> Style {
    if look.colour { Style::new().fg(colour) } else { Style::new() }
}

fn colour(outcome: Outcome) -> Color {
    match outcome {
        Outcome::Passed => Color::Green,
        Outcome::Marginal | Outcome::Aborted => Color::Yellow,
        Outcome::Failed => Color::Red,
        Outcome::Errored => Color::Magenta,
        Outcome::Skipped | Outcome::NotRun => Color::Reset,
    }
}

/// An outcome as text.
pub(super) fn outcome(look: Look, outcome: Outcome) -> Style {
    let style = coloured(look, colour(outcome));
    match outcome {
        Outcome::Failed | Outcome::Errored | Outcome::Aborted => style.add_modifier(Modifier::BOLD),
        Outcome::Skipped | Outcome::NotRun => style.add_modifier(Modifier::DIM),
        Outcome::Passed | Outcome::Marginal => style,
    }
}

/// An outcome as a whole area: seen before it is read.
fn area(look: Look, outcome: Outcome) -> Style {
    if !look.colour {
        return strong();
    }
    let letters = match outcome {
        Outcome::Failed | Outcome::Errored => Color::White,
        _ => Color::Black,
    };
    let ground = match outcome {
        Outcome::Skipped | Outcome::NotRun => Color::Gray,
        _ => colour(outcome),
    };
    Style::new().fg(letters).bg(ground).add_modifier(Modifier::BOLD)
}

/// Good items of a selection have a colour of their own, far from that of a pass.
const PARTIAL: Color = Color::Blue;

/// The end of a run as text.
pub(super) fn verdict(look: Look, verdict: Verdict) -> Style {
    let partial = || coloured(look, Color::LightBlue).add_modifier(Modifier::BOLD);
    verdict.to_show().map_or_else(partial, |shown| outcome(look, shown))
}

/// The end of a run as a whole area.
pub(super) fn verdict_area(look: Look, verdict: Verdict) -> Style {
    match verdict.to_show() {
        Some(outcome) => area(look, outcome),
        None if look.colour => Style::new().fg(Color::White).bg(PARTIAL).add_modifier(Modifier::BOLD),
        None => strong(),
    }
}

/// One cell for the end of a run.
pub(super) fn verdict_mark(verdict: Verdict) -> &'static str {
    verdict.to_show().map_or("%", mark)
}

/// A badge that must not be overlooked.
pub(super) fn badge(look: Look) -> Style {
    if look.colour {
        Style::new().fg(Color::Black).bg(Color::Yellow).add_modifier(Modifier::BOLD)
    } else {
        turned().add_modifier(Modifier::BOLD)
    }
}

/// A message.
pub(super) fn weight(look: Look, weight: MessageWeight) -> Style {
    match weight {
        MessageWeight::Info => Style::new(),
        MessageWeight::Warning => coloured(look, Color::Yellow).add_modifier(Modifier::BOLD),
        MessageWeight::Error => coloured(look, Color::Red).add_modifier(Modifier::BOLD),
    }
}

/// Work under way, and borders of the panel that has the keys.
pub(super) fn accent(look: Look) -> Style {
    coloured(look, Color::Cyan)
}

/// The curves of X, Y and Z.
pub(super) fn axis(look: Look, axis: usize) -> Style {
    coloured(look, [Color::Red, Color::Green, Color::Cyan][axis % 3])
}

/// One cell for the outcome.
pub(super) fn mark(outcome: Outcome) -> &'static str {
    match outcome {
        Outcome::Passed => "✓",
        Outcome::Marginal => "~",
        Outcome::Failed => "✗",
        Outcome::Errored => "!",
        Outcome::Aborted => "/",
        Outcome::Skipped => "-",
        Outcome::NotRun => " ",
    }
}
