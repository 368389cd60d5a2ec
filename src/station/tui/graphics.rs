//! What a terminal can draw, told from its environment. It is never asked: its answer would come among the keys and scans.

use super::model::{Glyphs, Look};

/// A way to draw a picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Graphics {
    /// By characters that stand for parts of a picture that was sent before. The colour of the characters names the picture.
    Kitty,
    Iterm2,
    Sixel,
}

impl Graphics {
    /// Whether it works together with what else is known of the terminal.
    pub(crate) fn works(self, look: Look) -> bool {
        self != Self::Kitty || (look.colour && look.glyphs == Glyphs::Unicode)
    }
}

/// Programs between the station and the terminal that keep pictures from it, by the variables that they set.
const BETWEEN: [&str; 3] = ["TMUX", "STY", "ZELLIJ"];
/// The same, by the beginnings of `TERM`.
const BETWEEN_TERMS: [&str; 2] = ["tmux", "screen"];
/// Terminals that say who they are by the beginning of `TERM`. That name reaches the station through ssh too.
const TERMS: [(&str, Graphics); 6] = [
    ("xterm-kitty", Graphics::Kitty),
    ("xterm-ghostty", Graphics::Kitty),
    ("wezterm", Graphics::Iterm2),
    ("foot", Graphics::Sixel),
    ("mlterm", Graphics::Sixel),
    ("contour", Graphics::Sixel),
];
/// Terminals that call themselves an xterm, by their `TERM_PROGRAM`.
const PROGRAMS: [(&str, Graphics); 5] = [
    ("kitty", Graphics::Kitty),
    ("ghostty", Graphics::Kitty),
    ("WezTerm", Graphics::Iterm2),
    ("iTerm.app", Graphics::Iterm2),
    ("mintty", Graphics::Iterm2),
];
/// Variables of other terminals. One that was started from kitty or from a program above inherits their variables.
const OTHERS: [&str; 4] = ["VTE_VERSION", "KONSOLE_VERSION", "XTERM_VERSION", "ALACRITTY_WINDOW_ID"];

/// Tells what the terminal can draw. `variable` reads the environment; an empty one counts as none.
pub(crate) fn of_terminal(variable: impl Fn(&str) -> Option<String>) -> Option<Graphics> {
    let get = |name: &str| variable(name).filter(|value| !value.is_empty());
    let term = get("TERM").unwrap_or_default();
    let is_between =
        BETWEEN_TERMS.iter().any(|name| term.starts_with(name)) || BETWEEN.iter().any(|name| get(name).is_some());
    if is_between {
        return None;
    }
    if let Some((_, graphics)) = TERMS.iter().find(|(name, _)| term.starts_with(name)) {
        return Some(*graphics);
    }
    if term.contains("sixel") {
        return Some(Graphics::Sixel);
    }
    if !term.starts_with("xterm") || OTHERS.iter().any(|name| get(name).is_some()) {
        return None;
    }
    match get("TERM_PROGRAM") {
        Some(program) => PROGRAMS.iter().find(|(name, _)| *name == program).map(|(_, graphics)| *graphics),
        None => get("KITTY_WINDOW_ID").map(|_| Graphics::Kitty),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn check(environment: &[(&str, &str)], expected: Option<Graphics>) {
        let variable =
            |name: &str| environment.iter().find(|(known, _)| *known == name).map(|(_, value)| (*value).to_owned());
        assert_eq!(of_terminal(variable), expected, "{environment:?}");
    }

    #[test]
    fn terminals_are_told_by_their_environment() {
        check(&[("TERM", "xterm-kitty")], Some(Graphics::Kitty));
        check(&[("TERM", "xterm-ghostty"), ("TERM_PROGRAM", "ghostty")], Some(Graphics::Kitty));
        check(&[("TERM", "xterm-256color"), ("KITTY_WINDOW_ID", "1")], Some(Graphics::Kitty));
        check(&[("TERM", "xterm-256color"), ("TERM_PROGRAM", "WezTerm")], Some(Graphics::Iterm2));
        check(&[("TERM", "xterm-256color"), ("TERM_PROGRAM", "iTerm.app")], Some(Graphics::Iterm2));
        check(&[("TERM", "foot")], Some(Graphics::Sixel));
        check(&[("TERM", "foot-extra")], Some(Graphics::Sixel));
        check(&[("TERM", "mlterm-256color")], Some(Graphics::Sixel));
        check(&[("TERM", "yaft-sixel")], Some(Graphics::Sixel));
        for term in ["", "xterm", "xterm-256color", "linux", "vt100", "alacritty", "rxvt-unicode-256color"] {
            check(&[("TERM", term)], None);
        }
    }

    #[test]
    fn nothing_is_drawn_through_a_multiplexer() {
        for term in ["screen", "screen-256color", "screen.xterm-256color", "tmux-256color"] {
            check(&[("TERM", term), ("KITTY_WINDOW_ID", "1"), ("TERM_PROGRAM", "WezTerm")], None);
        }
        for variable in ["TMUX", "STY", "ZELLIJ"] {
            check(&[("TERM", "xterm-kitty"), (variable, "0")], None);
            check(&[("TERM", "xterm-kitty"), (variable, "")], Some(Graphics::Kitty));
        }
    }

    /// A terminal that was started from another one inherits its variables.
    #[test]
    fn inherited_variables_are_not_believed() {
        for other in ["VTE_VERSION", "KONSOLE_VERSION", "XTERM_VERSION"] {
            check(&[("TERM", "xterm-256color"), ("KITTY_WINDOW_ID", "1"), (other, "1")], None);
            check(&[("TERM", "xterm-256color"), ("TERM_PROGRAM", "WezTerm"), (other, "1")], None);
        }
        check(&[("TERM", "alacritty"), ("KITTY_WINDOW_ID", "1")], None);
        check(&[("TERM", "foot"), ("KITTY_WINDOW_ID", "1"), ("TERM_PROGRAM", "WezTerm")], Some(Graphics::Sixel));
        check(&[("TERM", "xterm-256color"), ("KITTY_WINDOW_ID", "1"), ("TERM_PROGRAM", "vscode")], None);
    }

    /// The characters of kitty need Unicode and colours.
    #[test]
    fn kitty_needs_colours_and_unicode() {
        let look = |colour, glyphs| Look { colour, glyphs, poor: false };
        assert!(Graphics::Kitty.works(look(true, Glyphs::Unicode)));
        assert!(!Graphics::Kitty.works(look(false, Glyphs::Unicode)));
        assert!(!Graphics::Kitty.works(look(true, Glyphs::Ascii)));
        assert!(Graphics::Sixel.works(look(false, Glyphs::Ascii)));
    }
}
