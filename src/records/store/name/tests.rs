use std::collections::BTreeSet;

use super::*;

/// Names that file systems and programs refuse or change. Sources: Microsoft, "Naming Files, Paths, and Namespaces"; POSIX; the
/// "Big List of Naughty Strings" for the last lines.
const REFUSED: [&str; 58] = [
    "CON",
    "PRN",
    "AUX",
    "NUL",
    "COM1",
    "COM9",
    "LPT1",
    "LPT9",
    "COM\u{b9}",
    "COM\u{b2}",
    "LPT\u{b3}",
    "COM0",
    "LPT0",
    "con",
    "Con",
    "aux",
    "nul",
    "com1",
    "CON.txt",
    "con.TXT",
    "NUL.tar.gz",
    "AUX.",
    "CON ",
    "CON .txt",
    "CONIN$",
    "CONOUT$",
    "CLOCK$",
    "$Mft",
    "a<b",
    "a>b",
    "a:b",
    "a\"b",
    "a/b",
    "a\\b",
    "a|b",
    "a?b",
    "a*b",
    "a.",
    "a..",
    "a ",
    " a",
    ".",
    "..",
    "...",
    ".hidden",
    "-rf",
    "~",
    "~1",
    "PROGRA~1",
    "a\0b",
    "a\u{1f}b",
    "a\u{7f}b",
    "%00",
    "../../x",
    "/etc/passwd",
    "\u{1b}[2J",
    "Ω≈ç√∫",
    "👾",
];
/// Names that the station itself uses beside those of modules.
const OWN: [&str; 4] = ["CHAIN", "chain", "_unassigned", "_UNASSIGNED"];

fn is_safe(name: &str) -> bool {
    let base = name.split('.').next().unwrap_or_default().trim_end().to_ascii_uppercase();
    let harmless = |byte: u8| byte.is_ascii_alphanumeric() || b"-_.~".contains(&byte);
    !name.is_empty()
        && name.len() <= MAX_NAME
        && name.bytes().all(harmless)
        && !name.starts_with(['.', '-'])
        && !name.ends_with(['.', ' '])
        && !["CON", "PRN", "AUX", "NUL"].contains(&base.as_str())
        && !(base.len() == 4
            && (base.starts_with("COM") || base.starts_with("LPT"))
            && base.ends_with(|c: char| c.is_ascii_digit()))
        && !["CHAIN", "_UNASSIGNED"].contains(&name.to_ascii_uppercase().as_str())
}

#[test]
fn every_refused_name_is_safe_and_can_be_read_back() {
    for text in REFUSED.into_iter().chain(OWN) {
        let name = of_module(text);
        assert!(is_safe(&name), "{text:?} became {name}");
        let read = number_of(&name);
        // A control character is in no serial number, and is not read back.
        let expected = (!text.chars().any(char::is_control)).then(|| text.to_owned());
        assert_eq!(read, expected, "{name}");
    }
    for (text, name) in [
        ("SN-0001", "SN-0001"),
        ("T_1.2", "T_1.2"),
        ("sn-1", "sn-1~~3"),
        ("Sn-1", "Sn-1~~1"),
        ("A/B", "A~2fB"),
        ("CON", "~43ON"),
    ] {
        assert_eq!(of_module(text), name);
    }
}

/// On a disk that ignores case, and on one that composes accents, no two numbers share a folder.
#[test]
fn no_two_numbers_share_a_folder_where_case_is_ignored() {
    let mut texts: Vec<String> = REFUSED.into_iter().chain(OWN).map(str::to_owned).collect();
    // All ways to write four letters, with a digit that could be taken for part of the number behind them.
    texts.extend((0..16u32).map(|bits| {
        let letters = "abCD".bytes().enumerate().map(|(index, byte)| (bits >> index & 1 == 1, char::from(byte)));
        letters.map(|(upper, c)| if upper { c.to_ascii_uppercase() } else { c.to_ascii_lowercase() }).collect()
    }));
    texts.extend(
        ["\u{e9}", "e\u{301}", "E\u{301}", "\u{c9}", "ÿ", "Ÿ", "ß", "ss", "SS", "ı", "i", "I", "İ"].map(str::to_owned),
    );
    texts.extend(["SN-1~~3", "~73N", "sn-1~~3", "SN~2d1"].map(str::to_owned));
    texts.extend((0..40).map(|length| "x".repeat(60 + length)));
    texts.extend((0..40).map(|length| "模".repeat(1 + length)));
    texts.sort();
    texts.dedup();
    let names: BTreeSet<String> = texts.iter().map(|text| of_module(text).to_ascii_lowercase()).collect();
    assert_eq!(names.len(), texts.len());
    for text in &texts {
        let name = of_module(text);
        assert!(is_safe(&name), "{text:?} became {name}");
        let expected = (!name.contains("~~~") && !text.chars().any(char::is_control)).then(|| text.clone());
        assert_eq!(number_of(&name), expected, "{name}");
        // A disk that lost the case of a name with small letters.
        if name.contains("~~") && expected.is_some() {
            assert_eq!(number_of(&name.to_ascii_uppercase()), expected, "{name}");
        }
    }
}

/// Names that earlier versions gave are not taken for others.
#[test]
fn names_of_before_are_known() {
    assert_eq!(of_module_before("sn-1"), "sn-1");
    assert_eq!(of_module_before("模块-3").split('~').next(), Some("__-3"));
    for text in ["sn-1", "模块-3", "a/b"] {
        assert_eq!(number_of(&of_module_before(text)), None, "{text}");
    }
    assert_eq!(of_module_before("SN-1"), of_module("SN-1"));
}

#[test]
fn plans_and_files_keep_their_names() {
    for name in ["functional", "p.toml", "P.toml", "con", "power-cycle", "a.b_c"] {
        assert_eq!(of_part(name), name);
    }
    assert_eq!((of_part("plan."), of_part("my plan.toml")), ("plan~2e".into(), "my~20plan.toml".into()));
    let long = of_part(&"имя".repeat(100));
    assert!(is_safe(&long), "{long}");
    assert!(is_safe(&of_part("")));
}
