//! Units as data sheets, loggers and people write them: `°/√h`, `µg/√Hz`, `m·s⁻²`, `dps`, `deg/√hr`.
//!
//! A unit is read as a product of powers of a few words, so `m/s²`, `m·s^-2` and `m/s/s` are the same unit. The case of
//! letters counts if it separates units (`mg` and `mG`, `MHz` and `mHz`). An unknown word is never guessed.

use super::Unit;

/// Longer texts are not units: our longest has 16 characters.
const LONGEST: usize = 64;

/// Depth of brackets within brackets; units need at most two.
const DEEPEST: usize = 4;

/// The words that units are made of. `s^-1` stands for Hz, so that `deg/√s` and `deg/s/√Hz` are one.
const WORDS: [&str; 34] = [
    "%", "ppm", "ns", "us", "ms", "s", "min", "h", "kHz", "MHz", "uV", "mV", "V", "mA", "A", "mm", "m", "km", "deg",
    "mdeg", "rad", "ug", "mg", "g", "gauss", "mgauss", "T", "mT", "uT", "nT", "C", "bit", "kbit", "bytes",
];

/// Other spellings with letters whose case counts.
const ALIASES: [(&str, &str); 33] = [
    ("Hz", "s^-1"),
    ("degC", "deg C"),
    ("hr", "h"),
    ("hrs", "h"),
    ("mdps", "mdeg/s"),
    // The gauss has the symbol G; Chinese and Russian data sheets write Gs.
    ("G", "gauss"),
    ("Gs", "gauss"),
    ("Gauss", "gauss"),
    ("mG", "mgauss"),
    ("mGs", "mgauss"),
    ("mGauss", "mgauss"),
    ("B", "bytes"),
    // Russian and Chinese data sheets.
    ("с", "s"),
    ("мс", "ms"),
    ("мкс", "us"),
    ("нс", "ns"),
    ("мин", "min"),
    ("ч", "h"),
    ("Гц", "s^-1"),
    ("мВ", "mV"),
    ("В", "V"),
    ("мА", "mA"),
    ("А", "A"),
    ("мм", "mm"),
    ("м", "m"),
    ("Гс", "gauss"),
    ("мГс", "mgauss"),
    ("мкТл", "uT"),
    ("нТл", "nT"),
    ("度", "deg"),
    ("秒", "s"),
    ("小时", "h"),
    ("高斯", "gauss"),
];

/// Other spellings in any case: these words have no prefix, so their case does not matter.
const WORDS_IN_ANY_CASE: [(&str, &str); 43] = [
    ("deg", "deg"),
    ("degs", "deg"),
    ("degree", "deg"),
    ("degrees", "deg"),
    ("rad", "rad"),
    ("radian", "rad"),
    ("radians", "rad"),
    ("dps", "deg/s"),
    ("dph", "deg/h"),
    ("sec", "s"),
    ("secs", "s"),
    ("second", "s"),
    ("seconds", "s"),
    ("msec", "ms"),
    ("usec", "us"),
    ("nsec", "ns"),
    ("min", "min"),
    ("mins", "min"),
    ("minute", "min"),
    ("minutes", "min"),
    ("hour", "h"),
    ("hours", "h"),
    ("hz", "s^-1"),
    ("hertz", "s^-1"),
    ("volt", "V"),
    ("volts", "V"),
    ("amp", "A"),
    ("amps", "A"),
    ("ampere", "A"),
    ("meter", "m"),
    ("meters", "m"),
    ("metre", "m"),
    ("metres", "m"),
    ("gauss", "gauss"),
    ("celsius", "deg C"),
    ("percent", "%"),
    ("ppm", "ppm"),
    ("byte", "bytes"),
    ("bytes", "bytes"),
    ("bps", "bit/s"),
    ("kbps", "kbit/s"),
    ("град", "deg"),
    ("рад", "rad"),
];

/// The unit that a text spells; `None` if it spells no unit of the table.
pub(super) fn read(text: &str) -> Option<Unit> {
    let powers = Powers::of(text)?;
    Unit::ALL.into_iter().find(|unit| Powers::of(unit.symbol()).as_ref() == Some(&powers))
}

/// The text in the letters of the table, as far as single characters can be replaced: `°/√h` becomes `deg /sqrt h`.
pub(super) fn plain(text: &str) -> String {
    let mut plain = String::with_capacity(text.len() + 8);
    let mut raised = false;
    for c in text.trim().chars() {
        let exponent = match c {
            '⁰' => Some('0'),
            '¹' => Some('1'),
            '²' => Some('2'),
            '³' => Some('3'),
            '⁴'..='⁹' => char::from_digit(c as u32 - '⁰' as u32, 10),
            '⁻' => Some('-'),
            '⁺' => Some('+'),
            _ => None,
        };
        if let Some(exponent) = exponent {
            if !raised {
                plain.push('^');
            }
            plain.push(exponent);
            raised = true;
            continue;
        }
        raised = false;
        match c {
            // The signs for micro and the letter mu.
            '\u{b5}' | '\u{3bc}' => plain.push('u'),
            // The degree sign, the raised o of ordinals and the ring above.
            '\u{b0}' | '\u{ba}' | '\u{2da}' => plain.push_str("deg "),
            '℃' => plain.push_str("degC"),
            '√' => plain.push_str("sqrt "),
            '½' => plain.push_str("0.5"),
            '·' | '⋅' | '∙' | '•' | '×' | '⋆' => plain.push('*'),
            '∕' | '⁄' | '／' | '÷' => plain.push('/'),
            '−' | '‐' | '‑' | '–' => plain.push('-'),
            '％' => plain.push('%'),
            // This is the bar over the argument of a root.
            '\u{300}'..='\u{36f}' => {}
            c if c.is_whitespace() => plain.push(' '),
            c => plain.push(c),
        }
    }
    plain.trim_end().replace("**", "^")
}

/// Powers of words, in halves, in the order of [`WORDS`]. Words that cancel have the power 0.
#[derive(Debug, Clone, PartialEq, Eq)]
struct Powers([i32; WORDS.len()]);

impl Powers {
    const NONE: Powers = Powers([0; WORDS.len()]);

    /// `None` if a word is unknown, a sign is misplaced, or everything cancels.
    fn of(text: &str) -> Option<Self> {
        if text.len() > LONGEST {
            return None;
        }
        let plain = plain(text);
        let mut reader = Reader { rest: &plain, depth: 0 };
        let powers = reader.product()?;
        (reader.rest.is_empty() && powers != Self::NONE).then_some(powers)
    }

    fn of_word(word: &str) -> Option<Self> {
        if let Some(index) = WORDS.iter().position(|known| *known == word) {
            let mut powers = Self::NONE;
            powers.0[index] = 2;
            return Some(powers);
        }
        let lower = word.to_lowercase();
        let known = |table: &[(&str, &'static str)], word: &str| {
            table.iter().find(|(spelled, _)| *spelled == word).map(|(_, ours)| *ours)
        };
        Self::of(known(&ALIASES, word).or_else(|| known(&WORDS_IN_ANY_CASE, &lower))?)
    }

    /// This times the other to the power of `halves / 2`; `None` if a power is not a whole number of halves.
    fn times(mut self, other: &Self, halves: i32) -> Option<Self> {
        for (own, power) in self.0.iter_mut().zip(other.0) {
            let product = power.checked_mul(halves)?;
            if product % 2 != 0 {
                return None;
            }
            *own = own.checked_add(product / 2)?;
        }
        Some(self)
    }
}

/// Reads `product := power { ('/' | '*' | ' ') power }`, `power := root [exponent]`,
/// `root := 'sqrt' root | '(' product ')' | word`.
struct Reader<'a> {
    rest: &'a str,
    depth: usize,
}

impl Reader<'_> {
    fn product(&mut self) -> Option<Powers> {
        let mut product = Powers::NONE.times(&self.power()?, 2)?;
        loop {
            self.blanks();
            let sign = if self.takes("/") || self.takes_word(&["per"]) {
                -2
            } else if self.takes("*") || self.rest.starts_with(|c: char| c.is_alphabetic() || c == '(' || c == '[') {
                2
            } else {
                return Some(product);
            };
            product = product.times(&self.power()?, sign)?;
        }
    }

    fn power(&mut self) -> Option<Powers> {
        let base = self.root()?;
        let raised = self.takes("^");
        let halves = if raised || self.rest.starts_with(|c: char| c.is_ascii_digit()) { self.exponent()? } else { 2 };
        Powers::NONE.times(&base, halves)
    }

    fn root(&mut self) -> Option<Powers> {
        self.blanks();
        if self.takes_word(&["sqrt", "rt", "root"]) {
            self.blanks();
            self.takes("-");
            return self.nested(|reader| Powers::NONE.times(&reader.root()?, 1));
        }
        for (open, close) in [("(", ")"), ("[", "]")] {
            if self.takes(open) {
                let inside = self.nested(Self::product)?;
                return self.takes(close).then_some(inside);
            }
        }
        let length = if self.rest.starts_with('%') { 1 } else { self.word().len() };
        let (word, rest) = self.rest.split_at(length);
        self.rest = rest;
        match Powers::of_word(word) {
            // `rtHz` and `rthr` are written as one word.
            None => Powers::NONE.times(&Powers::of_word(word.strip_prefix("rt")?)?, 1),
            powers => powers,
        }
    }

    /// An exponent in halves: `2`, `-1`, `0.5`, `1/2`, with or without brackets.
    fn exponent(&mut self) -> Option<i32> {
        let bracket = self.takes("(");
        let sign = if self.takes("-") {
            -1
        } else {
            self.takes("+");
            1
        };
        let whole = self.digit()?;
        let halves = if self.takes(".5") {
            2 * whole + 1
        } else if self.takes("/2") {
            whole
        } else {
            2 * whole
        };
        (!bracket || self.takes(")")).then_some(sign * halves)
    }

    fn digit(&mut self) -> Option<i32> {
        let digit = self.rest.chars().next()?.to_digit(10)?;
        self.rest = &self.rest[1..];
        i32::try_from(digit).ok()
    }

    fn nested(&mut self, read: impl FnOnce(&mut Self) -> Option<Powers>) -> Option<Powers> {
        self.depth += 1;
        let powers = if self.depth > DEEPEST { None } else { read(self) };
        self.depth -= 1;
        powers
    }

    /// The letters that come next.
    fn word(&self) -> &str {
        let end = self.rest.find(|c: char| !c.is_alphabetic()).unwrap_or(self.rest.len());
        &self.rest[..end]
    }

    fn takes_word(&mut self, words: &[&str]) -> bool {
        let word = self.word();
        let taken = words.iter().any(|known| word.eq_ignore_ascii_case(known));
        if taken {
            self.rest = &self.rest[word.len()..];
        }
        taken
    }

    fn takes(&mut self, sign: &str) -> bool {
        match self.rest.strip_prefix(sign) {
            Some(rest) => {
                self.rest = rest;
                true
            }
            None => false,
        }
    }

    fn blanks(&mut self) {
        self.rest = self.rest.trim_start();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Each unit in all spellings in data sheets of gyroscopes, accelerometers and magnetometers.
    #[test]
    fn every_spelling_of_a_unit_is_that_unit() {
        for (unit, spellings) in [
            (
                "deg/sqrt(h)",
                "deg/√h|°/√h|º/√h|°/√hr|deg/√hr|deg/sqrt(hr)|deg/rt(h)|°/rthr|deg/rt-hr|DEG/SQRT(h)|deg·h^-0.5|° h^-1/2|°·h⁻½|deg/h^0.5|deg/root hour|°/√(h)|deg per root hour|°/√ч|°/√h̅|град/√ч|[°/√h]|°/√小时",
            ),
            (
                "deg/s/sqrt(Hz)",
                "°/s/√Hz|dps/√Hz|dps/rtHz|(deg/s)/√Hz|deg/s/Hz^(1/2)|deg/√s|°/sec/√hz|dps/√(Hz)|°/с/√Гц",
            ),
            ("mdeg/s/sqrt(Hz)", "mdps/√Hz|mdeg/s/√Hz"),
            ("deg/h/sqrt(Hz)", "°/h/√Hz|(°/hr)/√Hz|dph/√Hz"),
            ("m/s/sqrt(h)", "m/s/√h|m/s/√hr|(m/s)/√h|m·s⁻¹·h^-0.5|m/sec/rt(hr)|м/с/√ч"),
            ("ug/sqrt(Hz)", "µg/√Hz|μg/√Hz|ug/rtHz|µg/√(Hz)|(µg)/√Hz|µg·Hz^-0.5"),
            ("mg/sqrt(Hz)", "mg/√Hz|mg / √Hz"),
            ("ug", "µg|μg"),
            ("mg", "[mg]|(mg)"),
            (
                "deg/s",
                "°/s|º/s|˚/s|dps|DPS|Deg/s|degrees/second|deg per sec|deg s^-1|deg·s⁻¹|(deg/s)|[dps]|° / s|°∕s|°/sec|°/с|度/秒",
            ),
            ("mdeg/s", "mdps|mdeg/s"),
            ("deg/h", "°/h|°/hr|deg/hr|deg/hour|dph|°·h⁻¹|º/h|°/ч|度/小时"),
            ("rad/s", "rad·s⁻¹|radians/s|rad/sec|рад/с"),
            ("m/s^2", "m/s²|m/s2|m·s⁻²|m/s/s|m s^-2|(m/s²)|m/sec²|m/s**2|м/с²|m⋅s^−2"),
            ("deg/s/g", "°/s/g|dps/g|(deg/s)/g"),
            ("deg/h/g", "°/h/g|deg/hr/g|(°/h)/g"),
            ("degC", "°C|℃|º C|deg C|Celsius"),
            ("deg", "°|degrees|º"),
            ("gauss", "G|Gs|Gauss|高斯|Гс"),
            ("mgauss", "mG|mGs|mGauss|мГс"),
            ("uT", "µT|μT|мкТл"),
            ("us", "µs|usec|мкс"),
            ("uV", "µV"),
            ("%", "％|percent"),
            ("Hz", "hz|s⁻¹"),
            ("h", "hr|hours|Hour|ч"),
            ("min", "minutes|мин"),
            ("bit/s", "bps"),
            ("bytes", "byte|B"),
        ] {
            for spelled in spellings.split('|') {
                assert_eq!(read(spelled), Unit::from_symbol(unit), "{spelled} is {unit}");
            }
            assert_eq!(read(unit), Unit::from_symbol(unit), "{unit}");
        }
    }

    #[test]
    fn what_is_no_unit_of_ours_is_none() {
        for text in [
            "",
            " ",
            "/",
            "deg/",
            "/s",
            "deg//s",
            "m/m",
            "s*Hz",
            "deg/S",
            "MG",
            "mv",
            "mhz",
            "sqrt(h",
            "sqrt",
            "deg/sqrt()",
            "K",
            "C",
            "°F",
            "deg/s^",
            "deg/s^9999999999",
            "°/h·g",
            "a",
            "√√√√√√√√h",
            "((((((((((deg))))))))))",
            "m/s^2)",
            "deg/h^0.7",
            "ppm/°C",
            "\u{1b}[2J",
        ] {
            assert_eq!(read(text), None, "{text:?}");
        }
        assert_eq!(read(&"deg/s ".repeat(1000)), None);
    }
}
