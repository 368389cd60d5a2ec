//! The serial number within a code that has several fields: element strings of GS1 (General Specifications, section 7.8), and
//! envelopes of ISO/IEC 15434 with the data identifiers of ANSI MH10.8.2.
//!
//! The rules are strict: whatever does not keep them has no serial number, and neither has a code with two.

/// The separator behind fields of variable length: FNC1 of GS1, and the same character within an envelope.
const GS: char = '\u{1d}';
/// Ends the head of an envelope and each of its formats.
const RS: char = '\u{1e}';
/// The head of an envelope.
const ENVELOPE: &str = "[)>\u{1e}";
/// AIM identifiers of symbologies whose data are element strings of GS1: GS1-128, DataBar, DataMatrix, QR, DotCode.
const OF_GS1: [&str; 5] = ["]C1", "]e0", "]d2", "]Q3", "]J1"];
/// The application identifier of a serial number.
const SERIAL: &str = "21";
/// Longest serial number of that identifier.
const MAX_SERIAL: usize = 20;
/// First two digits of the application identifiers whose elements need no separator, with the length of the whole element:
/// the table "element strings with predefined length" of the General Specifications. They hold digits alone.
const PREDEFINED: [(&str, usize); 22] = [
    ("00", 20),
    ("01", 16),
    ("02", 16),
    ("03", 16),
    ("04", 18),
    ("11", 8),
    ("12", 8),
    ("13", 8),
    ("14", 8),
    ("15", 8),
    ("16", 8),
    ("17", 8),
    ("18", 8),
    ("19", 8),
    ("20", 4),
    ("31", 10),
    ("32", 10),
    ("33", 10),
    ("34", 10),
    ("35", 10),
    ("36", 10),
    ("41", 16),
];

/// The serial number of a code without its frame, but with the name of the symbology if the scanner sends that. `None`: it is no
/// code of several fields, has no serial number, more than one, or an error.
pub(crate) fn serial_number(code: &str) -> Option<&str> {
    let (symbology, data) = code.split_at_checked(3).filter(|_| code.starts_with(']')).unwrap_or(("", code));
    // FNC1 may stand in front.
    let data = data.trim_start_matches(GS);
    let found = match data.strip_prefix(ENVELOPE) {
        Some(formats) => {
            let each: Option<Vec<_>> = formats.split(RS).map(of_format).collect();
            each?.concat()
        }
        None if OF_GS1.contains(&symbology) || data.contains(GS) => of_elements(data)?,
        None => return None,
    };
    match found.as_slice() {
        [number] => Some(number),
        _ => None,
    }
}

/// The serial numbers of a format within an envelope.
fn of_format(format: &str) -> Option<Vec<&str>> {
    match format.split_once(GS)? {
        ("05", elements) => of_elements(elements),
        ("06", fields) => Some(fields.split(GS).filter_map(|field| field.strip_prefix('S')).collect()),
        _ => None,
    }
}

/// The serial numbers among element strings.
fn of_elements(mut rest: &str) -> Option<Vec<&str>> {
    let mut found = Vec::new();
    while !rest.is_empty() {
        let prefix = rest.get(..2).filter(|prefix| is_digits(prefix))?;
        let (element, behind) = match PREDEFINED.iter().find(|(known, _)| *known == prefix) {
            Some((_, length)) => {
                let (element, behind) = rest.split_at_checked(*length).filter(|(element, _)| is_digits(element))?;
                (element, behind.strip_prefix(GS).unwrap_or(behind))
            }
            None => rest.split_once(GS).unwrap_or((rest, "")),
        };
        if prefix == SERIAL {
            let number = &element[SERIAL.len()..];
            found.push(Some(number).filter(|number| (1..=MAX_SERIAL).contains(&number.len()))?);
        }
        rest = behind;
    }
    Some(found)
}

fn is_digits(text: &str) -> bool {
    text.bytes().all(|byte| byte.is_ascii_digit())
}

#[cfg(test)]
mod tests {
    use super::serial_number;

    /// The first is the example of GS1's guideline for DataMatrix; the others have its fields in other orders and frames.
    #[test]
    fn the_serial_number_of_element_strings() {
        for (code, expected) in [
            ("]d201034531200000111719112510ABCD1234\u{1d}2110", "10"),
            ("]C1010345312000001121SN-0001\u{1d}10ABCD1234", "SN-0001"),
            ("]C121SN-0001\u{1d}0103453120000011", "SN-0001"),
            ("]Q30103453120000011\u{1d}21SN-0001", "SN-0001"),
            ("]d2\u{1d}010345312000001121SN-0001", "SN-0001"),
            // A keyboard wedge without identifiers: the separator tells.
            ("010345312000001121SN-0001\u{1d}10ABCD1234", "SN-0001"),
            // Digits within a lot that look like an identifier; then a weight in kilograms with 3 decimals, and a place.
            ("]C110LOT21X\u{1d}31030012654140345312000001", ""),
            ("]C13103001265414034531200000121SN-0001", "SN-0001"),
            ("]C121ABCDEFGHIJKLMNOPQRST", "ABCDEFGHIJKLMNOPQRST"),
        ] {
            assert_eq!(serial_number(code).unwrap_or_default(), expected, "{}", code.escape_debug());
        }
    }

    #[test]
    fn the_serial_number_of_an_envelope() {
        for (code, expected) in [
            ("[)>\u{1e}06\u{1d}SSN-0001", "SN-0001"),
            ("[)>\u{1e}06\u{1d}1PGNC-POP-26B\u{1d}SSN-0001\u{1d}1T4711", "SN-0001"),
            ("]d1[)>\u{1e}06\u{1d}1PGNC-POP-26B\u{1d}SSN-0001", "SN-0001"),
            ("[)>\u{1e}05\u{1d}010345312000001121SN-0001", "SN-0001"),
            ("[)>\u{1e}06\u{1d}1PGNC-POP-26B\u{1e}05\u{1d}21SN-0001", "SN-0001"),
            // The serial numbers of a package and of its owner have other identifiers.
            ("[)>\u{1e}06\u{1d}25SUN1\u{1d}3SPACK", ""),
        ] {
            assert_eq!(serial_number(code).unwrap_or_default(), expected, "{}", code.escape_debug());
        }
    }

    #[test]
    fn what_is_ambiguous_or_wrong_has_none() {
        for code in [
            "",
            "]",
            "]C1",
            "SN-0001",
            "21SN-0001",
            "]C0010345312000001121SN-0001",
            "]C121SN-0001\u{1d}21SN-0002",
            "]C121\u{1d}10A",
            "]C121ABCDEFGHIJKLMNOPQRSTU",
            "]C1010345312000",
            "]C101034531200000X121SN-0001",
            "]C1SN-0001\u{1d}10A",
            "]C1моду",
            "[)>\u{1e}06",
            "[)>\u{1e}12\u{1d}SSN-0001",
            "[)>\u{1e}06\u{1d}SSN-0001\u{1d}SSN-0002",
            "[)>06\u{1d}SSN-0001",
        ] {
            assert_eq!(serial_number(code), None, "{}", code.escape_debug());
        }
    }
}
