//! Finds out from the environment what the terminal can show.

use super::lang::Lang;
use super::model::{Glyphs, Look};

/// The environment variables that matter.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct Environment {
    pub term: String,
    /// The locale for characters: `LC_ALL`, `LC_CTYPE` or `LANG`, the first that is set.
    pub locale: String,
    /// The locale for messages: `LC_ALL`, `LC_MESSAGES` or `LANG`.
    pub messages: String,
    pub no_color: bool,
}

impl Environment {
    pub(crate) fn read() -> Self {
        let first = |names: [&str; 3]| {
            names.iter().filter_map(|name| std::env::var(name).ok()).find(|value| !value.is_empty()).unwrap_or_default()
        };
        Self {
            term: std::env::var("TERM").unwrap_or_default(),
            locale: first(["LC_ALL", "LC_CTYPE", "LANG"]),
            messages: first(["LC_ALL", "LC_MESSAGES", "LANG"]),
            // https://no-color.org: present and not empty.
            no_color: std::env::var_os("NO_COLOR").is_some_and(|value| !value.is_empty()),
        }
    }
}

/// Chooses the language and how to draw on the terminal. A terminal without the glyphs of a language gets English.
pub(crate) fn choose(environment: &Environment, wanted: Option<Lang>) -> (Lang, Look) {
    let locale = environment.locale.to_ascii_lowercase();
    let utf8 = locale.ends_with("utf-8") || locale.ends_with("utf8");
    let glyphs = match environment.term.as_str() {
        _ if !utf8 => Glyphs::Ascii,
        // The kernel's own console has only 512 glyphs. Only this name identifies it.
        "linux" => Glyphs::Console,
        "vt100" | "vt220" => Glyphs::Ascii,
        _ => Glyphs::Unicode,
    };
    let wanted = wanted.unwrap_or_else(|| Lang::of_locale(&environment.messages));
    let poor = glyphs != Glyphs::Unicode && wanted != Lang::En;
    let lang = if poor { Lang::En } else { wanted };
    (lang, Look { colour: !environment.no_color, glyphs, poor })
}

#[cfg(test)]
mod tests {
    use super::*;

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
