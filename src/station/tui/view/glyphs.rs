//! Replaces characters that a terminal cannot show. This is done after everything is drawn, so that no text can slip
//! through, whatever its source.

use ratatui::buffer::Buffer;

use crate::tui::model::Glyphs;

/// Replaces what the terminal cannot show.
pub(super) fn translate(buffer: &mut Buffer, glyphs: Glyphs) {
    if glyphs == Glyphs::Unicode {
        return;
    }
    let mut hidden = 0usize;
    for cell in &mut buffer.content {
        if hidden > 0 {
            // The second half of a wide character.
            cell.set_symbol(" ");
            hidden -= 1;
            continue;
        }
        let symbol = cell.symbol();
        if symbol.is_ascii() || (glyphs == Glyphs::Console && console_has(symbol)) {
            continue;
        }
        hidden = super::text::width(symbol).saturating_sub(1);
        let plain = plain(symbol);
        cell.set_symbol(plain);
    }
}

/// The lines and blocks of the character set that console fonts share.
fn console_has(symbol: &str) -> bool {
    symbol.chars().all(|character| "─│┌┐└┘├┤┬┴┼█▀▄░▒▓°".contains(character))
}

fn plain(symbol: &str) -> &'static str {
    match symbol.chars().next().unwrap_or(' ') {
        '─' | '━' => "-",
        '│' | '┃' => "|",
        '┌' | '┐' | '└' | '┘' | '├' | '┤' | '┬' | '┴' | '┼' | '╭' | '╮' | '╰' | '╯' => "+",
        '█' | '▀' | '▄' => "#",
        '▓' | '▒' => "=",
        '░' => ".",
        '✓' => "+",
        '✗' => "X",
        '…' => "~",
        '°' => " ",
        '²' => "2",
        '•' | '·' => "*",
        '±' => "+",
        _ => "?",
    }
}
