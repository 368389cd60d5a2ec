//! The language of the person at the terminal, and whether the terminal can show it.

/// A language of the station.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, clap::ValueEnum)]
pub enum Lang {
    /// English.
    En,
    /// Chinese, simplified.
    Zh,
    /// Russian.
    Ru,
}

impl Lang {
    /// All languages.
    pub(crate) const ALL: [Lang; 3] = [Lang::En, Lang::Zh, Lang::Ru];

    /// The language of a locale's name, "zh_CN.UTF-8"; English if the station has no texts in that language.
    #[must_use]
    pub(crate) fn of_locale(locale: &str) -> Lang {
        match locale.split(['_', '.', '@']).next() {
            Some("zh") => Lang::Zh,
            Some("ru") => Lang::Ru,
            _ => Lang::En,
        }
    }
}

/// The characters of a terminal.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Glyphs {
    /// All of Unicode, dots for charts included.
    Unicode,
    /// Latin letters, lines and blocks: the Linux console.
    Console,
    /// ASCII alone.
    Ascii,
}

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

    /// What the terminal can show.
    pub(crate) fn glyphs(&self) -> Glyphs {
        let locale = self.locale.to_ascii_lowercase();
        let utf8 = locale.ends_with("utf-8") || locale.ends_with("utf8");
        match self.term.as_str() {
            _ if !utf8 => Glyphs::Ascii,
            // The kernel's own console has only 512 glyphs. Only this name identifies it.
            "linux" => Glyphs::Console,
            "vt100" | "vt220" => Glyphs::Ascii,
            _ => Glyphs::Unicode,
        }
    }

    /// The language that was asked for, or that of the locale; and whether the terminal lacks its glyphs.
    pub(crate) fn wanted(&self, asked: Option<Lang>) -> (Lang, bool) {
        let wanted = asked.unwrap_or_else(|| Lang::of_locale(&self.messages));
        (wanted, self.glyphs() != Glyphs::Unicode && wanted != Lang::En)
    }

    /// The language to speak: English, where the terminal lacks the glyphs of another.
    pub(crate) fn language(&self, asked: Option<Lang>) -> Lang {
        match self.wanted(asked) {
            (_, true) => Lang::En,
            (wanted, false) => wanted,
        }
    }
}
