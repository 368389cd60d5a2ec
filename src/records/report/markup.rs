//! HTML, written so that no text can become markup.

use std::borrow::Cow;
use std::fmt::{self, Write as _};
use std::io;

use gnc_text::printable;

/// A text of any origin as the content of an element or an attribute.
///
/// The five special characters are escaped as in HTML, and what does not show itself (a terminal escape of a board, a null, a
/// mark that turns the direction of the line) as on a terminal. Line ends and tabs are spaces.
#[derive(Debug, Clone, Copy)]
pub(super) struct Text<'a>(pub(super) &'a str);

impl fmt::Display for Text<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let spaced = if self.0.contains(['\n', '\t']) {
            Cow::Owned(self.0.replace(['\n', '\t'], " "))
        } else {
            Cow::Borrowed(self.0)
        };
        for character in printable(&spaced).chars() {
            match character {
                '&' => f.write_str("&amp;")?,
                '<' => f.write_str("&lt;")?,
                '>' => f.write_str("&gt;")?,
                '"' => f.write_str("&quot;")?,
                '\'' => f.write_str("&#39;")?,
                character => f.write_char(character)?,
            }
        }
        Ok(())
    }
}

/// The page tells the browser to load nothing from other places, whatever its texts contain.
const HEAD: &str = r#"<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width">
<meta http-equiv="Content-Security-Policy" content="default-src 'none'; style-src 'unsafe-inline'">
"#;

const STYLE: &str = include_str!("style.css");

/// Bytes of a page that are buffered before they are written: the report of a burn-in may have tens of thousands of
/// rows.
const PIECE: usize = 1 << 16;

/// A page that grows from top to bottom.
pub(super) struct SvgPage<'a> {
    out: &'a mut dyn io::Write,
    text: String,
    written: io::Result<()>,
}

impl<'a> SvgPage<'a> {
    pub(super) fn new(out: &'a mut dyn io::Write, title: &str) -> Self {
        let text = format!("{HEAD}<title>{}</title>\n<style>\n{STYLE}</style>\n</head>\n<body>\n", Text(title));
        Self { out, text, written: Ok(()) }
    }

    /// Writes the end of the page; an error means that not all of it was written.
    pub(super) fn finish(mut self) -> io::Result<()> {
        self.text.push_str("</body>\n</html>\n");
        self.hand_on();
        self.written
    }

    /// An element with a text. Tags and classes are constants of this program.
    pub(super) fn element(&mut self, tag: &'static str, class: &'static str, text: &str) {
        self.tag(tag, class);
        // Writing to a String cannot fail, here and below.
        let _ = writeln!(self.text, "{}</{tag}>", Text(text));
    }

    pub(super) fn open(&mut self, tag: &'static str, class: &'static str) {
        self.tag(tag, class);
        self.text.push('\n');
    }

    pub(super) fn close(&mut self, tag: &'static str) {
        let _ = writeln!(self.text, "</{tag}>");
        if self.text.len() >= PIECE {
            self.hand_on();
        }
    }

    fn hand_on(&mut self) {
        if self.written.is_ok() {
            self.written = self.out.write_all(self.text.as_bytes());
        }
        self.text.clear();
    }

    /// A heading with an anchor.
    pub(super) fn heading(&mut self, text: &str, anchor: &str) {
        let _ = writeln!(self.text, "<h2 id=\"{}\">{}</h2>", Text(anchor), Text(text));
    }

    /// A cell with a link to a heading.
    pub(super) fn link(&mut self, text: &str, anchor: &str) {
        let _ = writeln!(self.text, "<td><a href=\"#{}\">{}</a></td>", Text(anchor), Text(text));
    }

    /// A cell over several columns.
    pub(super) fn wide_cell(&mut self, columns: usize, text: &str) {
        let _ = writeln!(self.text, "<td colspan=\"{columns}\">{}</td>", Text(text));
    }

    /// A row with a name and its value.
    pub(super) fn fact(&mut self, name: &str, value: &str) {
        self.open("tr", "");
        self.element("th", "", name);
        self.element("td", "", value);
        self.close("tr");
    }

    /// A row of a table.
    pub(super) fn row<T: AsRef<str>>(&mut self, cell: &'static str, texts: &[T]) {
        self.open("tr", "");
        for text in texts {
            self.element(cell, "", text.as_ref());
        }
        self.close("tr");
    }

    /// Pictures drawn by this program, beside each other if there is room.
    pub(super) fn pictures(&mut self, svgs: &[String]) {
        if svgs.is_empty() {
            return;
        }
        self.text.push_str("<figure>\n");
        svgs.iter().for_each(|svg| self.text.push_str(svg));
        self.text.push_str("</figure>\n");
    }

    /// A cell with a picture drawn by this program.
    pub(super) fn picture_cell(&mut self, svg: &str) {
        let _ = writeln!(self.text, "<td>{svg}</td>");
    }

    fn tag(&mut self, tag: &'static str, class: &'static str) {
        let _ = match class {
            "" => write!(self.text, "<{tag}>"),
            class => write!(self.text, "<{tag} class=\"{class}\">"),
        };
    }
}
