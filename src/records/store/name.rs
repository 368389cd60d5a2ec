//! Names of folders that every file system takes: those of Windows, of memory sticks, and those that ignore case.
//!
//! A serial number is written as it is where that is safe. Otherwise its bytes are written as `~` and two digits, and lower-case
//! letters are told by a number behind `~~`, so that two numbers that differ only in case have different folders on every disk:
//!
//! | serial number | folder |
//! | --- | --- |
//! | `SN-1` | `SN-1` |
//! | `sn-1`, `Sn-1` | `sn-1~~3`, `Sn-1~~1` |
//! | `A/B`, `SN 1.` | `A~2fB`, `SN~201~2e` |
//! | `CON`, `NUL.TXT` | `~43ON`, `~4eUL.TXT` |
//!
//! [`number_of`] reads such a name back. Only a number that would need too long a name is cut, and told by its digest.

use std::fmt::Write as _;

use sha2::{Digest as _, Sha256};

use super::chain::CHAIN;
use super::{UNASSIGNED, digest};

/// Longest name of the folder of a module. File systems take 255 bytes; Windows takes 260 characters for a whole path.
const MAX_NAME: usize = 96;
/// What is left of a longer one.
const CUT: usize = 56;
/// Names of devices that Windows takes for files of any folder, with any ending.
/// Source: Microsoft, "Naming Files, Paths, and Namespaces".
const DEVICES: [&str; 24] = [
    "CON", "PRN", "AUX", "NUL", "COM0", "COM1", "COM2", "COM3", "COM4", "COM5", "COM6", "COM7", "COM8", "COM9", "LPT0",
    "LPT1", "LPT2", "LPT3", "LPT4", "LPT5", "LPT6", "LPT7", "LPT8", "LPT9",
];

/// The name of the folder of a module. Different serial numbers have different names, also where case is ignored.
#[must_use]
pub(super) fn of_module(serial_number: &str) -> String {
    let mut name = safe(serial_number);
    let lower = lower_case(serial_number);
    if !lower.is_empty() {
        name.push_str("~~");
        name.push_str(&lower);
    }
    if !serial_number.is_empty() && name.len() <= MAX_NAME {
        return name;
    }
    cut(&name, serial_number)
}

/// The beginning of a name that is too long, or of none, with the digest of the text that it is for.
fn cut(name: &str, text: &str) -> String {
    let mut cut: String = name.chars().take(CUT).collect();
    // Not in the middle of a byte.
    if let Some(at) = cut.rfind('~').filter(|at| at + 3 > cut.len()) {
        cut.truncate(at);
    }
    cut.push_str("~~~");
    for byte in Sha256::digest(text.as_bytes()).iter().take(8) {
        let _ = write!(cut, "{byte:02x}");
    }
    cut
}

/// A part of a longer name: a plan or an item, whose names have small letters only, or a file of a plan. Something stands
/// before it, so it can be no device and no option.
#[must_use]
pub(crate) fn of_part(text: &str) -> String {
    let last = text.len().saturating_sub(1);
    let mut name = String::with_capacity(text.len());
    for (index, byte) in text.bytes().enumerate() {
        match byte {
            b'.' if index == last => name.push_str("~2e"),
            b'-' | b'_' | b'.' => name.push(char::from(byte)),
            byte if byte.is_ascii_alphanumeric() => name.push(char::from(byte)),
            byte => {
                let _ = write!(name, "~{byte:02x}");
            }
        }
    }
    if !name.is_empty() && name.len() <= MAX_NAME { name } else { cut(&name, text) }
}

/// The text of which this is the name as a part; `None` if the name does not tell: it was cut, or an earlier version named it.
#[must_use]
pub(super) fn part_of(name: &str) -> Option<String> {
    // Earlier versions put eight digits of a digest behind a name in which they had replaced something.
    let is_digest = |end: &str| end.len() == 8 && digest::bytes_of(end).is_some();
    if name.split_once('~').is_some_and(|(_, end)| is_digest(end)) {
        return None;
    }
    let mut bytes = Vec::with_capacity(name.len());
    let mut rest = name.as_bytes();
    while let Some((first, behind)) = rest.split_first() {
        rest = match first {
            b'~' => {
                bytes.extend(digest::bytes_of(std::str::from_utf8(behind.get(..2)?).ok()?)?);
                &behind[2..]
            }
            _ => {
                bytes.push(*first);
                behind
            }
        };
    }
    String::from_utf8(bytes).ok().filter(|text| of_part(text) == name)
}

/// The serial number of which this is the folder; `None` if the name does not tell.
#[must_use]
pub fn number_of(folder: &str) -> Option<String> {
    let (name, lower) = folder.split_once("~~").map_or((folder, None), |(name, lower)| (name, Some(lower)));
    let mut bytes = Vec::with_capacity(name.len());
    let mut rest = name;
    while let Some(first) = rest.chars().next() {
        if first == '~' {
            bytes.push(u8::from_str_radix(rest.get(1..3)?, 16).ok()?);
            rest = &rest[3..];
        } else {
            bytes.extend(first.encode_utf8(&mut [0; 4]).bytes());
            rest = &rest[first.len_utf8()..];
        }
    }
    let text = String::from_utf8(bytes).ok().filter(|text| !text.chars().any(char::is_control))?;
    match lower {
        None => (of_module(&text) == folder).then_some(text),
        // A disk may have lost the case of the letters.
        Some(lower) => {
            let text = with_lower_case(&text.to_ascii_uppercase(), lower)?;
            of_module(&text).eq_ignore_ascii_case(folder).then_some(text)
        }
    }
}

/// Letters, digits, `-`, `_` and `.` as they are, other bytes as `~` and two digits; nothing that hides, ends badly or is a
/// device.
fn safe(text: &str) -> String {
    let mut name = String::with_capacity(text.len());
    let last = text.len().saturating_sub(1);
    for (index, byte) in text.bytes().enumerate() {
        let harmless = match byte {
            b'.' => index != 0 && index != last,
            // A program would take it for an option.
            b'-' => index != 0,
            byte => byte.is_ascii_alphanumeric() || byte == b'_',
        };
        if harmless && !(index == 0 && is_reserved(text)) {
            name.push(char::from(byte));
        } else {
            let _ = write!(name, "~{byte:02x}");
        }
    }
    name
}

/// Whether a name is a device, or one that the station uses beside the folders of modules.
fn is_reserved(text: &str) -> bool {
    let base = text.split('.').next().unwrap_or(text);
    let own = [UNASSIGNED, CHAIN].iter().any(|own| own.eq_ignore_ascii_case(text));
    own || DEVICES.iter().any(|device| device.eq_ignore_ascii_case(base))
}

/// Which letters are small ones, as a hexadecimal number with the first letter as its highest bit; empty if none is.
fn lower_case(text: &str) -> String {
    let bits: Vec<bool> = text.bytes().filter(u8::is_ascii_alphabetic).map(|byte| byte.is_ascii_lowercase()).collect();
    if !bits.contains(&true) {
        return String::new();
    }
    let first = bits.len().div_ceil(4) * 4 - bits.len();
    let digit = |bits: &[bool]| bits.iter().fold(0, |digit, bit| 2 * digit + u32::from(*bit));
    let padded: Vec<bool> = std::iter::repeat_n(false, first).chain(bits).collect();
    padded.chunks(4).filter_map(|bits| char::from_digit(digit(bits), 16)).collect()
}

/// The text with small letters where [`lower_case`] says so.
fn with_lower_case(text: &str, lower: &str) -> Option<String> {
    let letters = text.bytes().filter(u8::is_ascii_alphabetic).count();
    let digits = lower.chars().map(|digit| digit.to_digit(16)).collect::<Option<Vec<u32>>>()?;
    let bits = digits.iter().flat_map(|digit| (0..4).rev().map(move |bit| digit >> bit & 1 == 1));
    let mut bits = bits.skip((4 * digits.len()).checked_sub(letters)?);
    let case = |character: char| match character.is_ascii_alphabetic() && bits.next() == Some(true) {
        true => character.to_ascii_lowercase(),
        false => character,
    };
    Some(text.chars().map(case).collect())
}

/// The folder of a module as earlier versions named it; records of that time are still there.
#[must_use]
pub(super) fn of_module_before(serial_number: &str) -> String {
    let harmless = |character: char| character.is_ascii_alphanumeric() || matches!(character, '-' | '_' | '.');
    let characters = serial_number.chars().take(64);
    let mut name: String = characters.map(|character| if harmless(character) { character } else { '_' }).collect();
    if name.starts_with('.') {
        name.replace_range(..1, "_");
    }
    if name == serial_number && !name.is_empty() {
        return name;
    }
    let digest = Sha256::digest(serial_number.as_bytes());
    format!("{name}~{:02x}{:02x}{:02x}{:02x}", digest[0], digest[1], digest[2], digest[3])
}

#[cfg(test)]
mod tests;
