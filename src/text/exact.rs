//! Names and paths, shown so that two of them that differ never look the same.

use std::fmt::Write as _;
use std::path::Path;

use crate::printable::{Marks, escape};

/// A name as [`crate::printable`] shows it, and more: all joiners and all blanks other than the space are escaped too, and a
/// backslash is written twice where it could be taken for the beginning of an escape. So different names have different texts.
#[must_use]
pub fn exact(name: &str) -> String {
    exact_bytes(name.as_bytes())
}

/// A path for people: as [`exact`], and a byte that is no text is written as `\x{ff}`.
///
/// Names on a disk are the names that any program gave them. One with a line end in it would else forge a line of a list.
#[must_use]
pub fn shown_path(path: &Path) -> String {
    exact_bytes(path.as_os_str().as_encoded_bytes())
}

fn exact_bytes(bytes: &[u8]) -> String {
    let mut marks = Marks::default();
    let mut hides = |c: char| marks.hides(c) || c != ' ' && c.is_whitespace();
    let is_plain = std::str::from_utf8(bytes).is_ok_and(|text| !text.chars().any(&mut hides) && !has_escape(text));
    let mut out = String::with_capacity(bytes.len());
    let mut marks = Marks::default();
    for piece in bytes.utf8_chunks() {
        for c in piece.valid().chars() {
            match c {
                '\\' if !is_plain => {
                    let _ = marks.hides(c);
                    out.push_str("\\\\");
                }
                c if marks.hides(c) || c != ' ' && c.is_whitespace() => escape(&mut out, c),
                c => out.push(c),
            }
        }
        for byte in piece.invalid() {
            marks = Marks::default();
            // Writing to a String cannot fail.
            let _ = write!(out, "\\x{{{byte:02x}}}");
        }
    }
    out
}

/// Whether a text holds what an escape looks like.
fn has_escape(text: &str) -> bool {
    text.match_indices('\\').any(|(at, _)| {
        let rest = &text[at + 1..];
        rest.starts_with(['\\', 'n', 'r', 't']) || rest.starts_with("u{") || rest.starts_with("x{")
    })
}

#[cfg(test)]
mod tests {
    use std::ffi::OsStr;
    use std::os::unix::ffi::OsStrExt as _;

    use proptest::prelude::*;

    use super::*;

    #[test]
    fn a_name_is_one_line_and_shows_what_it_is() {
        assert_eq!(exact("records/2026-11-28/SN-1"), "records/2026-11-28/SN-1");
        assert_eq!(exact("a\n2026-11-28 passed"), "a\\n2026-11-28 passed");
        assert_eq!(exact("SN\u{a0}1"), "SN\\u{a0}1");
        assert_eq!(exact("C:\\data"), "C:\\data");
        assert_eq!(exact("a\\nb"), "a\\\\nb");
        assert_eq!(shown_path(Path::new(OsStr::from_bytes(b"a\xffb"))), "a\\x{ff}b");
    }

    /// Pieces of names that try to look like each other.
    fn tricky() -> impl Strategy<Value = Vec<u8>> {
        let pieces: [&[u8]; 20] = [
            b"a",
            b"\\",
            b"n",
            b"\n",
            b"u{a0}",
            "\u{a0}".as_bytes(),
            b"x{ff}",
            b"\xff",
            b"\xe2\x80",
            "\u{202e}".as_bytes(),
            b"u{202e}",
            b"{",
            "\u{301}".as_bytes(),
            b"u{301}",
            b"t",
            b"\t",
            "ی".as_bytes(),
            "\u{200c}".as_bytes(),
            b"u{200c}",
            "क\u{94d}".as_bytes(),
        ];
        prop::collection::vec(prop::sample::select(pieces.to_vec()), 0..6).prop_map(|pieces| pieces.concat())
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(20_000))]
        #[test]
        fn different_names_look_different(a in tricky(), b in tricky()) {
            let path = |bytes: &[u8]| shown_path(Path::new(OsStr::from_bytes(bytes)));
            prop_assert_eq!(a == b, path(&a) == path(&b), "{:?} {:?}", path(&a), path(&b));
        }

        #[test]
        fn any_name_is_printable(name in prop::collection::vec(any::<u8>(), 0..40)) {
            let shown = shown_path(Path::new(OsStr::from_bytes(&name)));
            prop_assert_eq!(crate::printable(&shown), shown.as_str());
        }
    }
}
