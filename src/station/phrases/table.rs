//! The table: files by the part of the station that makes the sentence.

use std::collections::BTreeMap;
use std::sync::LazyLock;

use serde::Deserialize;

const FILES: [(&str, &str); 12] = [
    ("analysis", include_str!("analysis.toml")),
    ("bench", include_str!("bench.toml")),
    ("board", include_str!("board.toml")),
    ("check", include_str!("check.toml")),
    ("executive", include_str!("executive.toml")),
    ("link", include_str!("link.toml")),
    ("listing", include_str!("listing.toml")),
    ("metrology", include_str!("metrology.toml")),
    ("os", include_str!("os.toml")),
    ("progress", include_str!("progress.toml")),
    ("records", include_str!("records.toml")),
    ("station", include_str!("station.toml")),
];

/// A sentence in each language.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Sentence {
    /// The part that makes it, and its name there: "link", "port_busy". They never name another sentence.
    pub id: (&'static str, &'static str),
    /// English.
    pub en: &'static str,
    /// Simplified Chinese.
    pub zh: &'static str,
    /// Russian.
    pub ru: &'static str,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Row {
    en: String,
    zh: String,
    ru: String,
}

static TABLE: LazyLock<Vec<Sentence>> = LazyLock::new(|| {
    let mut sentences = Vec::new();
    for (part, text) in FILES {
        // The tests read each file; a file that cannot be read leaves its sentences in English.
        let rows: BTreeMap<String, Row> = toml::from_str(text).unwrap_or_default();
        sentences.extend(rows.into_iter().map(|(name, row)| Sentence {
            id: (part, name.leak()),
            en: row.en.leak(),
            zh: row.zh.leak(),
            ru: row.ru.leak(),
        }));
    }
    sentences
});

/// All sentences, sorted by their ids.
pub(crate) fn all() -> &'static [Sentence] {
    &TABLE
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_file_is_read() {
        for (part, text) in FILES {
            let rows: Result<BTreeMap<String, Row>, _> = toml::from_str(text);
            assert!(rows.as_ref().is_ok_and(|rows| !rows.is_empty()), "{part}: {rows:?}");
        }
    }
}
