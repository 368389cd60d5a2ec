//! Text in cells: Chinese characters take two, and nothing may be wider than its place.

use gnc_text::printable;
use ratatui::Frame;
use ratatui::layout::Rect;
use ratatui::text::{Line, Span};
use ratatui::widgets::Paragraph;

/// Text from outside as the screen shows it. It keeps only characters that have the same width on all terminals. A
/// character that combines with others, or runs from right to left, would shift all text behind it.
pub(super) fn shown(text: &str) -> String {
    printable(text).chars().map(|character| if is_steady(character) { character } else { '?' }).collect()
}

fn is_steady(character: char) -> bool {
    matches!(character,
        ' '..='~' | '\u{a0}'..='\u{17f}' | '\u{391}'..='\u{3c9}' | '\u{400}'..='\u{45f}' | '–' | '—' | '…' | '•'
        | '\u{3001}'..='\u{3020}' | '\u{3041}'..='\u{3096}' | '\u{30a1}'..='\u{30fe}' | '\u{4e00}'..='\u{9fff}'
        | '\u{ac00}'..='\u{d7a3}' | '\u{ff01}'..='\u{ff5e}' | '“' | '”' | '‘' | '’')
}

/// Cells of a text.
pub(in crate::tui) fn width(text: &str) -> usize {
    Span::raw(text).width()
}

/// Cells of one character.
fn cells_of(character: char) -> usize {
    width(character.encode_utf8(&mut [0; 4]))
}

/// The text in at most `cells` cells, with an ellipsis if it is cut.
pub(super) fn cut(text: &str, cells: usize) -> String {
    if width(text) <= cells {
        return text.to_owned();
    }
    let mut out = String::new();
    let mut used = 0;
    for character in text.chars() {
        used += cells_of(character);
        if used + 1 > cells {
            break;
        }
        out.push(character);
    }
    if cells > 0 {
        out.push('…');
    }
    out
}

/// The line in at most `cells` cells, with an ellipsis if it is cut. Spaces at its end may go without one.
pub(super) fn marked(line: Line<'static>, cells: usize) -> Line<'static> {
    let text: String = line.spans.iter().map(|span| span.content.as_ref()).collect();
    if width(text.trim_end()) <= cells {
        return line;
    }
    let Line { spans, style, alignment } = line;
    let (mut kept, mut room) = (Vec::new(), cells.saturating_sub(1));
    for span in spans {
        if span.width() <= room {
            room -= span.width();
            kept.push(span);
            continue;
        }
        // One cell more for the ellipsis, which ends the line.
        kept.push(Span::styled(cut(&span.content, room + 1), span.style));
        break;
    }
    Line { spans: kept, style, alignment }
}

/// Keeps the lines that have room, with a mark if some go.
pub(super) fn shorten(lines: &mut Vec<String>, room: usize, cells: usize) {
    if lines.len() > room {
        lines.truncate(room);
        if let Some(last) = lines.last_mut() {
            *last = cut(&format!("{last} …"), cells);
        }
    }
}

/// Draws lines from the top of their place. What is wider than the place ends with an ellipsis.
pub(super) fn lines(frame: &mut Frame<'_>, lines: impl IntoIterator<Item = Line<'static>>, area: Rect) {
    let cells = usize::from(area.width);
    let lines: Vec<Line<'static>> = lines.into_iter().map(|line| marked(line, cells)).collect();
    frame.render_widget(Paragraph::new(lines), area);
}

/// The text in exactly `cells` cells.
pub(super) fn fit(text: &str, cells: usize) -> String {
    let mut out = cut(text, cells);
    out.push_str(&" ".repeat(cells.saturating_sub(width(&out))));
    out
}

/// The text at the right end of `cells` cells.
pub(super) fn right(text: &str, cells: usize) -> String {
    let text = cut(text, cells);
    format!("{}{text}", " ".repeat(cells.saturating_sub(width(&text))))
}

/// Lines of at most `cells` cells: broken at spaces, and between Chinese characters.
pub(super) fn wrap(text: &str, cells: usize) -> Vec<String> {
    let cells = cells.max(2);
    let mut lines = Vec::new();
    let (mut line, mut used) = (String::new(), 0);
    for piece in pieces(text) {
        let wide = width(piece.trim_end());
        if used > 0 && used + wide > cells {
            lines.push(std::mem::take(&mut line).trim_end().to_owned());
            used = 0;
        }
        if wide > cells {
            // A word longer than a line: a path, or garbage.
            for character in piece.chars() {
                if used + cells_of(character) > cells {
                    lines.push(std::mem::take(&mut line));
                    used = 0;
                }
                line.push(character);
                used += cells_of(character);
            }
        } else {
            line.push_str(piece);
            used += width(piece);
        }
    }
    if !line.trim_end().is_empty() || lines.is_empty() {
        lines.push(line.trim_end().to_owned());
    }
    lines
}

/// Pieces after which a line may end: words with their spaces, and wide characters with the marks that close them.
fn pieces(text: &str) -> Vec<&str> {
    let mut pieces = Vec::new();
    let mut start = 0;
    let mut characters = text.char_indices().peekable();
    while let Some((_, character)) = characters.next() {
        let Some((end, next)) = characters.peek().copied() else { break };
        let closes = CLOSING.contains(next);
        let after_word = character == ' ' && next != ' ';
        let beside_wide = !closes && next != ' ' && (cells_of(character) == 2 || cells_of(next) == 2);
        if after_word || beside_wide {
            pieces.push(&text[start..end]);
            start = end;
        }
    }
    if start < text.len() {
        pieces.push(&text[start..]);
    }
    pieces
}

/// Characters that never begin a line.
const CLOSING: &str = "，。：；？！）、”";

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn wide_characters_take_two_cells() {
        assert_eq!(width("检测"), 4);
        assert_eq!(cut("检测台", 5), "检测…");
        assert_eq!(cut("检测台", 4), "检…");
        assert_eq!(fit("检", 4), "检  ");
        assert_eq!(right("1.5", 5), "  1.5");
        assert_eq!(cut("abc", 0), "");
    }

    /// Escapes, combining marks, right-to-left letters and wide pictures have no effect.
    #[test]
    fn text_from_outside_keeps_its_width() {
        assert_eq!(shown("SN-1 模块 Модуль é µ"), "SN-1 模块 Модуль é µ");
        assert_eq!(shown("a\u{1b}[2J"), "a\\u{1b}[2J");
        assert_eq!(shown("e\u{301} \u{5d0} 👩‍🚀"), "e? ? ???");
    }

    #[test]
    fn lines_break_where_they_may() {
        assert_eq!(wrap("check the cable", 10), ["check the", "cable"]);
        assert_eq!(wrap("检查电缆，然后重试", 10), ["检查电缆，", "然后重试"]);
        assert_eq!(wrap("检查电缆，然后重试", 9), ["检查电", "缆，然后", "重试"]);
        assert_eq!(wrap("/a/very/long/path", 6), ["/a/ver", "y/long", "/path"]);
        assert_eq!(wrap("", 6), [""]);
        let text = "Is the module at rest? 模块是否静止？如果是，请检查 sensor-X 与电源。";
        for cells in 4..40 {
            for line in wrap(text, cells) {
                assert!(width(&line) <= cells, "{line:?} in {cells}");
            }
        }
    }
}
