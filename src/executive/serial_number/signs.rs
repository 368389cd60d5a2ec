//! The signs that a pattern names, and the pattern with both cases of letters beyond ASCII.
//!
//! The library of regular expressions takes `(?i)` for ASCII only, so `(?i)бинс` would not fit БИНС.

/// What is read in a pattern.
#[derive(Debug, Default)]
pub(super) struct Signs {
    /// Signs and ranges of signs that the pattern names.
    pub(super) named: Vec<(char, char)>,
    /// The pattern, with the other case of each letter beyond ASCII where its flag `i` is on.
    pub(super) both_cases: String,
}

/// Reads a pattern that the library has accepted.
pub(super) fn read(pattern: &str) -> Signs {
    let signs: Vec<char> = pattern.chars().collect();
    let mut reader = Reader { signs: &signs, at: 0, any_case: false, outer: Vec::new(), read: Signs::default() };
    reader.all();
    reader.read
}

struct Reader<'a> {
    signs: &'a [char],
    at: usize,
    /// Whether the flag `i` is on here.
    any_case: bool,
    /// That flag outside each group that is open.
    outer: Vec<bool>,
    read: Signs,
}

impl Reader<'_> {
    fn peek(&self, ahead: usize) -> Option<char> {
        self.signs.get(self.at + ahead).copied()
    }

    /// Goes on behind so many signs, which stand in the result as they are.
    fn copy(&mut self, count: usize) {
        let end = (self.at + count).min(self.signs.len());
        self.read.both_cases.extend(&self.signs[self.at..end]);
        self.at = end;
    }

    fn all(&mut self) {
        while let Some(sign) = self.peek(0) {
            match sign {
                '(' => self.group(),
                ')' => {
                    self.any_case = self.outer.pop().unwrap_or_default();
                    self.copy(1);
                }
                '[' => self.class(),
                _ => match self.literal() {
                    Some((sign, length)) => self.single(sign, length),
                    // A class like `\d`, or a place like `\b`.
                    None => self.copy(2),
                },
            }
        }
    }

    /// The beginning of a group, with its flags or its name.
    fn group(&mut self) {
        let before = self.any_case;
        if self.peek(1) != Some('?') {
            self.outer.push(before);
            return self.copy(1);
        }
        let flags =
            self.signs[self.at + 2..].iter().take_while(|sign| sign.is_ascii_alphabetic() || **sign == '-').count();
        let mut on = true;
        for flag in &self.signs[self.at + 2..self.at + 2 + flags] {
            match flag {
                '-' => on = false,
                'i' => self.any_case = on,
                _ => {}
            }
        }
        match self.peek(2 + flags) {
            // The flags count from here to the end of the group around.
            Some(')') => self.copy(flags + 3),
            Some(':') => {
                self.outer.push(before);
                self.copy(flags + 3);
            }
            // A name, `(?P<name>` or `(?<name>`.
            _ => {
                self.any_case = before;
                self.outer.push(before);
                let name = self.signs[self.at..].iter().take_while(|sign| **sign != '>').count();
                self.copy(name + 1);
            }
        }
    }

    /// The literal sign that stands here, and how many signs write it.
    fn literal(&self) -> Option<(char, usize)> {
        let first = self.peek(0)?;
        if first != '\\' {
            return Some((first, 1));
        }
        let digits = match self.peek(1)? {
            'x' => 2,
            'u' => 4,
            'U' => 8,
            sign if sign.is_ascii_alphanumeric() || matches!(sign, '<' | '>') => return None,
            sign => return Some((sign, 2)),
        };
        let (from, length) = match self.peek(2) {
            Some('{') => {
                let inside = self.signs[self.at + 3..].iter().take_while(|sign| **sign != '}').count();
                (self.at + 3, inside)
            }
            _ => (self.at + 2, digits),
        };
        let number: String = self.signs.get(from..from + length)?.iter().collect();
        let sign = u32::from_str_radix(&number, 16).ok().and_then(char::from_u32)?;
        let closed = usize::from(self.peek(2) == Some('{'));
        Some((sign, from + length + closed - self.at))
    }

    fn single(&mut self, sign: char, length: usize) {
        let others = self.others((sign, sign));
        self.read.named.push((sign, sign));
        if others.is_empty() {
            return self.copy(length);
        }
        self.read.both_cases.push('[');
        self.copy(length);
        others.iter().for_each(|(other, _)| self.read.both_cases.push(*other));
        self.read.both_cases.push(']');
        self.read.named.extend(others);
    }

    /// A class in brackets.
    fn class(&mut self) {
        self.copy(1);
        if self.peek(0) == Some('^') {
            self.copy(1);
        }
        let begin = self.at;
        while let Some(sign) = self.peek(0) {
            if sign == ']' && self.at > begin {
                return self.copy(1);
            }
            // One with a name, `[:alpha:]`.
            if sign == '[' && self.peek(1) == Some(':') {
                let name = self.signs[self.at + 2..].iter().take_while(|sign| **sign != ']').count();
                self.copy(name + 3);
                continue;
            }
            let Some((first, length)) = self.literal() else {
                self.copy(2);
                continue;
            };
            self.copy(length);
            let mut range = (first, first);
            if self.peek(0) == Some('-') && self.peek(1).is_some_and(|end| end != ']') {
                self.copy(1);
                if let Some((last, length)) = self.literal() {
                    self.copy(length);
                    range.1 = last;
                }
            }
            // A range that begins in ASCII is as wide as a `.`: only its ends are named.
            match range {
                (first, last) if first.is_ascii() => self.read.named.extend([(first, first), (last, last)]),
                range => self.read.named.push(range),
            }
            for (first, last) in self.others(range) {
                self.read.both_cases.push(first);
                if first != last {
                    self.read.both_cases.extend(['-', last]);
                }
                self.read.named.push((first, last));
            }
        }
    }

    /// The same letters in the other case, where the flag is on.
    fn others(&self, (first, last): (char, char)) -> Vec<(char, char)> {
        if !self.any_case || first.is_ascii() {
            return Vec::new();
        }
        let cases = [(lower(first), lower(last)), (upper(first), upper(last))];
        let is_other = |(from, to): &(char, char)| (*from, *to) != (first, last) && from <= to && !from.is_ascii();
        cases.into_iter().filter(is_other).collect()
    }
}

/// The small letter, if it is one sign.
fn lower(sign: char) -> char {
    let mut small = sign.to_lowercase();
    small.next().filter(|_| small.next().is_none()).unwrap_or(sign)
}

/// The capital letter, if it is one sign.
fn upper(sign: char) -> char {
    let mut capital = sign.to_uppercase();
    capital.next().filter(|_| capital.next().is_none()).unwrap_or(sign)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;
    use regex_lite::Regex;

    use super::*;

    #[test]
    fn both_cases_stand_where_the_flag_is_on() {
        for (pattern, both) in [
            ("бинс-[0-9]+", "бинс-[0-9]+"),
            ("(?i)би-[0-9]+", "(?i)[бБ][иИ]-[0-9]+"),
            ("(?i)[а-яё]\\d[[:alpha:]№]", "(?i)[а-яА-ЯёЁ]\\d[[:alpha:]№]"),
            ("(?i:б)б", "(?i:[бБ])б"),
            ("((?i)б)б", "((?i)[бБ])б"),
            ("(?i)б(?-i)б", "(?i)[бБ](?-i)б"),
            ("(?i)(?P<n>б)(б)б", "(?i)(?P<n>[бБ])([бБ])[бБ]"),
            ("(?i)\\x{411}\\u0411\\(б\\[", "(?i)[\\x{411}б][\\u0411б]\\([бБ]\\["),
            ("(?i)[]б-]a", "(?i)[]бБ-]a"),
        ] {
            assert_eq!(read(pattern).both_cases, both, "{pattern}");
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(20_000))]
        /// What the library reads stays a pattern, and one without the flag stays as it is written.
        #[test]
        fn any_pattern_is_read(pieces in prop::collection::vec(prop::sample::select(vec![
            "б", "Я", "a", "(?i)", "(?-i)", "(?i:", "(?P<n>", "(", ")", "[", "[^", "]", "-", "\\d", "\\x{411}", "\\u0411", "\\[",
            "\\-", "[:alpha:]", "{2}", "+", "|", "^", "?", "\\", ":", ">",
        ]), 0..8)) {
            let pattern = pieces.concat();
            let read = read(&pattern);
            if Regex::new(&pattern).is_ok() {
                prop_assert!(Regex::new(&read.both_cases).is_ok(), "{} {}", pattern, read.both_cases);
                prop_assert!(pattern.contains("(?i") || read.both_cases == pattern, "{} {}", pattern, read.both_cases);
            }
        }
    }
}
