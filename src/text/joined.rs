//! Invisible characters that names need: joiners between the letters of Persian, Hindi or Sinhala, and the joiners
//! and selectors of emoji. They stand where the writing needs them, and nowhere else.

use unicode_width::UnicodeWidthChar as _;

/// Keeps two letters from being joined.
const ZWNJ: char = '\u{200c}';
/// Joins two letters, or two pictures.
const ZWJ: char = '\u{200d}';
/// Asks for the picture of a sign.
const PICTURE: char = '\u{fe0f}';
/// The key around a digit.
const KEYCAP: char = '\u{20e3}';

/// What stands before a character of a text.
#[derive(Debug, Default)]
pub(crate) struct Before {
    /// The letter or sign that marks and joiners belong to.
    base: Option<char>,
    /// The character directly before.
    last: Option<char>,
}

impl Before {
    /// Whether the writing needs this joiner or selector here. `has_place`: a mark more may stand over the letter before.
    pub(crate) fn needs(&self, c: char, next: Option<char>, has_place: bool) -> bool {
        let (Some(base), Some(last)) = (self.base, self.last) else { return false };
        match c {
            PICTURE => last == base && (is_picture(base) || is_on_key(base) && next == Some(KEYCAP)),
            // The half form of a letter, or its whole form.
            ZWNJ | ZWJ if is_virama(last) => is_of_block(base, last),
            // Between a letter and its virama, as Bengali writes it.
            ZWJ if last == base && next.is_some_and(|next| is_virama(next) && is_of_block(base, next)) => has_place,
            ZWJ if is_picture(base) || is_skin(base) => {
                (last == base || last == PICTURE) && next.is_some_and(is_picture)
            }
            ZWNJ | ZWJ => !is_joiner(last) && script(base).is_some_and(|of| next.and_then(script) == Some(of)),
            _ => false,
        }
    }

    /// Goes on behind a character that is shown as it is.
    pub(crate) fn pass(&mut self, c: char) {
        self.last = Some(c);
        if !is_joiner(c) && c.width() != Some(0) {
            self.base = Some(c);
        }
    }
}

/// Whether a text that is cut must not end with this character: it belongs to what is cut off, too.
pub(crate) fn is_joiner(c: char) -> bool {
    matches!(c, ZWNJ | ZWJ | PICTURE)
}

/// The script of a letter, if its letters are joined as in Arabic; `None` for others and for all that is no letter.
fn script(c: char) -> Option<u8> {
    if !c.is_alphabetic() || c.width() == Some(0) {
        return None;
    }
    Some(match c {
        // Arabic, which Persian, Urdu, Kurdish and Uyghur write too.
        '\u{620}'..='\u{6ff}' | '\u{750}'..='\u{77f}' | '\u{870}'..='\u{8ff}' => 0,
        // Syriac.
        '\u{710}'..='\u{74f}' | '\u{860}'..='\u{86f}' => 1,
        // N'Ko.
        '\u{7c0}'..='\u{7ff}' => 2,
        // Mandaic.
        '\u{840}'..='\u{85f}' => 3,
        // Mongolian.
        '\u{1820}'..='\u{18aa}' => 4,
        // Adlam.
        '\u{1e900}'..='\u{1e943}' => 5,
        _ => return None,
    })
}

/// Whether a mark takes the vowel from its letter, so that the next letter joins it.
///
/// Source: Unicode 16, Indic_Syllabic_Category Virama, Pure_Killer and Invisible_Stacker of the scripts in use.
fn is_virama(c: char) -> bool {
    matches!(
        c,
        '\u{94d}'
            | '\u{9cd}'
            | '\u{a4d}'
            | '\u{acd}'
            | '\u{b4d}'
            | '\u{bcd}'
            | '\u{c4d}'
            | '\u{ccd}'
            | '\u{d3b}'
            | '\u{d3c}'
            | '\u{d4d}'
            | '\u{dca}'
            | '\u{1039}'
            | '\u{103a}'
            | '\u{17d2}'
            | '\u{1b44}'
            | '\u{a9c0}'
    )
}

/// Whether a letter is one of the script of a virama: each of these scripts has a block of 128 numbers.
fn is_of_block(letter: char, virama: char) -> bool {
    letter.is_alphabetic() && u32::from(letter) >> 7 == u32::from(virama) >> 7
}

/// Whether a sign is a picture or has one. Source: Unicode 16, Extended_Pictographic.
fn is_picture(c: char) -> bool {
    matches!(c,
        '©' | '®' | '\u{203c}' | '\u{2049}' | '\u{2122}' | '\u{2139}' | '\u{2194}'..='\u{2199}' | '\u{21a9}' | '\u{21aa}'
        | '\u{231a}' | '\u{231b}' | '\u{2328}' | '\u{23cf}' | '\u{23e9}'..='\u{23f3}' | '\u{23f8}'..='\u{23fa}' | '\u{24c2}'
        | '\u{25aa}' | '\u{25ab}' | '\u{25b6}' | '\u{25c0}' | '\u{25fb}'..='\u{25fe}' | '\u{2600}'..='\u{27bf}'
        | '\u{2934}' | '\u{2935}' | '\u{2b05}'..='\u{2b07}' | '\u{2b1b}' | '\u{2b1c}' | '\u{2b50}' | '\u{2b55}'
        | '\u{3030}' | '\u{303d}' | '\u{3297}' | '\u{3299}' | '\u{1f000}'..='\u{1f1e5}' | '\u{1f200}'..='\u{1f3fa}'
        | '\u{1f400}'..='\u{1faff}')
}

fn is_skin(c: char) -> bool {
    matches!(c, '\u{1f3fb}'..='\u{1f3ff}')
}

fn is_on_key(c: char) -> bool {
    matches!(c, '0'..='9' | '#' | '*')
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use crate::{exact, is_hidden, printable, quoted};

    /// Names as people write them, each with an invisible character.
    const NAMES: [&str; 12] = [
        "علی\u{200c}رضا کریمی",
        "می\u{200c}خواهم",
        "ශ්\u{200d}රී ලංකා",
        "ක්\u{200d}ෂි",
        "क्\u{200d}षि",
        "शक्\u{200c}ति",
        "র\u{200d}্যাব",
        "ന്\u{200d}",
        "👩\u{200d}🔧",
        "👩🏽\u{200d}🔧",
        "❤\u{fe0f}",
        "1\u{fe0f}\u{20e3} 🏳\u{fe0f}\u{200d}🌈 👁\u{fe0f}\u{200d}🗨\u{fe0f}",
    ];

    #[test]
    fn names_keep_the_joiners_that_they_need() {
        for name in NAMES {
            assert_eq!(printable(name), name, "{}", name.escape_unicode());
            assert_eq!(quoted(name), format!("\"{name}\""));
            assert!(exact(name).chars().all(|c| !is_hidden(c)), "a list shows each character: {name}");
        }
    }

    #[test]
    fn joiners_stand_nowhere_else() {
        for (text, shown) in [
            ("SN\u{200c}1", "SN\\u{200c}1"),
            ("БИ\u{200d}НС", "БИ\\u{200d}НС"),
            ("علی\u{200c}", "علی\\u{200c}"),
            ("\u{200c}علی", "\\u{200c}علی"),
            ("علی\u{200c} رضا", "علی\\u{200c} رضا"),
            ("علی\u{200c}a", "علی\\u{200c}a"),
            ("ی\u{200c}\u{200c}ر", "ی\\u{200c}\\u{200c}ر"),
            ("ශ්\u{200d}\u{200d}රී", "ශ්\u{200d}\\u{200d}රී"),
            ("श\u{200c}क", "श\\u{200c}क"),
            ("a\u{94d}\u{200d}b", "a\u{94d}\\u{200d}b"),
            ("1\u{fe0f}", "1\\u{fe0f}"),
            ("a\u{fe0f}", "a\\u{fe0f}"),
            ("❤\u{fe0f}\u{fe0f}", "❤\u{fe0f}\\u{fe0f}"),
            ("❤\u{fe0e}", "❤\\u{fe0e}"),
            ("👩\u{200d}", "👩\\u{200d}"),
            ("👩\u{200d}a", "👩\\u{200d}a"),
            ("👩\u{200c}🔧", "👩\\u{200c}🔧"),
            ("ی\u{202e}ر", "ی\\u{202e}ر"),
        ] {
            assert_eq!(printable(text), shown, "{}", text.escape_unicode());
        }
    }

    #[test]
    fn a_cut_name_does_not_end_with_a_joiner() {
        assert_eq!(crate::shortened("علی\u{200c}رضا", 4), "علی…");
        assert_eq!(crate::shortened("👩\u{200d}🔧", 2), "👩…");
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(5_000))]
        /// Letters, joiners and marks in any order: what is shown stays when it is shown again, and a joiner alone never stands
        /// beside another one or at the beginning.
        #[test]
        fn what_is_shown_once_stays(pieces in prop::collection::vec(prop::sample::select(
            vec!['a', '1', 'ی', 'ر', 'क', 'র', '\u{9cd}', '\u{94d}', '\u{301}', '\u{200c}', '\u{200d}', '\u{fe0f}', '\u{20e3}', '👩', '🏽', ' ']
        ), 0..9)) {
            let text: String = pieces.iter().collect();
            let shown = printable(&text).into_owned();
            prop_assert_eq!(printable(&shown), shown.as_str());
            let chars: Vec<char> = shown.chars().collect();
            for pair in chars.windows(2) {
                let selected = pair == ['\u{fe0f}', '\u{200d}'];
                prop_assert!(!(is_hidden(pair[0]) && is_hidden(pair[1])) || selected, "{}", shown.escape_unicode());
            }
            prop_assert!(chars.first().is_none_or(|c| !is_hidden(*c)));
        }
    }
}
