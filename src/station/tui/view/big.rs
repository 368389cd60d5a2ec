//! Letters that can be read from two metres: five cells wide and five high, or twice that.

use ratatui::Frame;
use ratatui::layout::Rect;
use ratatui::style::Style;
use ratatui::text::Line;
use ratatui::widgets::Paragraph;

/// Rows of a letter at its smallest.
pub(super) const HEIGHT: u16 = 5;

/// The picture of a letter; `None` if the letter has no picture.
fn letter(letter: char) -> Option<[&'static str; 5]> {
    Some(match letter {
        'A' | 'А' => [" ### ", "#   #", "#####", "#   #", "#   #"],
        'B' => ["#### ", "#   #", "#### ", "#   #", "#### "],
        'E' | 'Е' => ["#####", "#    ", "#### ", "#    ", "#####"],
        'F' => ["#####", "#    ", "#### ", "#    ", "#    "],
        'G' => [" ####", "#    ", "#  ##", "#   #", " ####"],
        'I' => ["#####", "  #  ", "  #  ", "  #  ", "#####"],
        'L' => ["#    ", "#    ", "#    ", "#    ", "#####"],
        'M' => ["#   #", "## ##", "# # #", "#   #", "#   #"],
        'N' => ["#   #", "##  #", "# # #", "#  ##", "#   #"],
        'O' | 'О' => [" ### ", "#   #", "#   #", "#   #", " ### "],
        'P' | 'Р' => ["#### ", "#   #", "#### ", "#    ", "#    "],
        'R' => ["#### ", "#   #", "#### ", "#  # ", "#   #"],
        'S' => [" ####", "#    ", " ### ", "    #", "#### "],
        'T' | 'Т' => ["#####", "  #  ", "  #  ", "  #  ", "  #  "],
        'Б' => ["#####", "#    ", "#### ", "#   #", "#### "],
        'Г' => ["#####", "#    ", "#    ", "#    ", "#    "],
        'Д' => [" ### ", " # # ", " # # ", "#####", "#   #"],
        'Й' => [" # # ", "#   #", "#  ##", "# # #", "##  #"],
        'И' => ["#   #", "#  ##", "# # #", "##  #", "#   #"],
        'К' => ["#   #", "#  # ", "###  ", "#  # ", "#   #"],
        'Л' => ["  ###", " #  #", " #  #", " #  #", "#   #"],
        'Н' => ["#   #", "#   #", "#####", "#   #", "#   #"],
        'П' => ["#####", "#   #", "#   #", "#   #", "#   #"],
        'С' => [" ####", "#    ", "#    ", "#    ", " ####"],
        'Ч' => ["#   #", "#   #", " ####", "    #", "    #"],
        'Ь' => ["#    ", "#    ", "#### ", "#   #", "#### "],
        'Ш' => ["# # #", "# # #", "# # #", "# # #", "#####"],
        '0' => [" ### ", "#  ##", "# # #", "##  #", " ### "],
        '1' => ["  #  ", " ##  ", "  #  ", "  #  ", " ### "],
        '2' => ["#### ", "    #", " ### ", "#    ", "#####"],
        '3' => ["#### ", "    #", " ### ", "    #", "#### "],
        '4' => ["#   #", "#   #", "#####", "    #", "    #"],
        '5' => ["#####", "#    ", "#### ", "    #", "#### "],
        '6' => [" ### ", "#    ", "#### ", "#   #", " ### "],
        '7' => ["#####", "    #", "   # ", "  #  ", "  #  "],
        '8' => [" ### ", "#   #", " ### ", "#   #", " ### "],
        '9' => [" ### ", "#   #", " ####", "    #", " ### "],
        '/' => ["    #", "   # ", "  #  ", " #   ", "#    "],
        _ => return None,
    })
}

/// Whether a word can be drawn.
#[cfg(test)]
pub(in crate::tui) fn has(word: &str) -> bool {
    word.chars().all(|character| letter(character).is_some())
}

/// Draws a word in the middle of an area, as large as it fits.
pub(super) fn draw(frame: &mut Frame<'_>, area: Rect, word: &str, style: Style) {
    let letters: Vec<[&str; 5]> = word.chars().filter_map(letter).collect();
    let width = (letters.len() * 6).saturating_sub(1);
    let fits = |scale: usize| {
        width * scale <= usize::from(area.width) && usize::from(HEIGHT) * scale <= usize::from(area.height)
    };
    let Some(scale) = [2, 1].into_iter().find(|scale| fits(*scale)) else {
        let middle = Rect { y: area.y + area.height / 2, height: area.height.min(1), ..area };
        return frame.render_widget(Paragraph::new(word).centered().style(style), middle);
    };
    let mut lines = Vec::new();
    for row in 0..usize::from(HEIGHT) {
        let pattern: Vec<&str> = letters.iter().map(|letter| letter[row]).collect();
        let cells = pattern.join(" ");
        let text: String =
            cells.chars().flat_map(|cell| std::iter::repeat_n(if cell == '#' { '█' } else { ' ' }, scale)).collect();
        lines.extend(std::iter::repeat_n(Line::raw(text), scale));
    }
    let height = u16::try_from(lines.len()).unwrap_or(area.height).min(area.height);
    let middle = Rect { y: area.y + (area.height - height) / 2, height, ..area };
    frame.render_widget(Paragraph::new(lines).centered().style(style), middle);
}
