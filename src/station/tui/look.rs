//! Finds out from the environment what the terminal can show.

use super::lang::Lang;
use super::model::Look;
use crate::locale::Environment;

/// Chooses the language and how to draw on the terminal. A terminal without the glyphs of a language gets English.
pub(crate) fn choose(environment: &Environment, wanted: Option<Lang>) -> (Lang, Look) {
    let (glyphs, (_, poor)) = (environment.glyphs(), environment.wanted(wanted));
    (environment.language(wanted), Look { colour: !environment.no_color, glyphs, poor })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::locale::Glyphs;

    fn check(term: &str, locale: &str, wanted: Option<Lang>, expected: (Lang, Glyphs, bool)) {
        let environment =
            Environment { term: term.into(), locale: locale.into(), messages: locale.into(), no_color: false };
        let (lang, look) = choose(&environment, wanted);
        assert_eq!((lang, look.glyphs, look.poor), expected, "{term} {locale} {wanted:?}");
    }

    #[test]
    fn terminals_and_locales() {
        check("xterm-256color", "zh_CN.UTF-8", None, (Lang::Zh, Glyphs::Unicode, false));
        check("screen", "ru_RU.utf8", None, (Lang::Ru, Glyphs::Unicode, false));
        check("xterm", "de_DE.UTF-8", None, (Lang::En, Glyphs::Unicode, false));
        check("xterm", "en_GB.UTF-8", Some(Lang::Zh), (Lang::Zh, Glyphs::Unicode, false));
        check("linux", "zh_CN.UTF-8", None, (Lang::En, Glyphs::Console, true));
        check("linux", "en_US.UTF-8", None, (Lang::En, Glyphs::Console, false));
        check("xterm", "zh_CN.GB18030", None, (Lang::En, Glyphs::Ascii, true));
        check("xterm", "", Some(Lang::Ru), (Lang::En, Glyphs::Ascii, true));
        check("xterm", "C", None, (Lang::En, Glyphs::Ascii, false));
    }
}
