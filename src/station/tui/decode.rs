//! Decodes the bytes of a terminal into keys.
//!
//! This is a decoder of our own. A scanner, a slow line and a terminal that goes away need three things that the event
//! readers of terminal libraries do not promise: an incomplete key never blocks, nothing grows without bound, and bytes
//! that are not a key are dropped and never taken for one.

/// Largest number of bytes of an escape sequence; a longer one is not a key.
const MAX_SEQUENCE: usize = 32;
/// The end of pasted text.
const PASTE_END: &[u8] = b"\x1b[201~";

/// A key, or a character that was pasted.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) enum Key {
    /// A printable character, from a keyboard or a scanner.
    Char(char),
    /// A printable character from the clipboard: always text.
    Pasted(char),
    /// F1 to F12.
    F(u8),
    /// Ctrl and a small letter.
    Ctrl(char),
    /// Cursor up.
    Up,
    /// Cursor down.
    Down,
    /// Cursor left.
    Left,
    /// Cursor right.
    Right,
    /// Home.
    Home,
    /// End.
    End,
    /// Page up.
    PageUp,
    /// Page down.
    PageDown,
    /// Enter, or the line end of a scanner.
    Enter,
    /// Escape.
    Esc,
    /// Backspace.
    Backspace,
    /// Tab, which some scanners send at the end.
    Tab,
    /// A control character that is not a key: part of a code that cannot be a serial number.
    Control,
}

/// Which keys a terminal means where terminals disagree.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum Dialect {
    /// As xterm: `CSI P` to `CSI S` are F1 to F4.
    #[default]
    Xterm,
    /// As the consoles of SCO and FreeBSD, and PuTTY set to SCO: `CSI M` to `CSI X` are F1 to F12.
    Sco,
}

impl Dialect {
    /// The dialect of a terminal by its name in `TERM`.
    pub(crate) fn of_terminal(term: &str) -> Self {
        let sco = term.ends_with("-sco") || ["sco", "cons25", "ansi"].iter().any(|name| term.starts_with(name));
        if sco { Self::Sco } else { Self::Xterm }
    }
}

/// Decodes bytes as they arrive.
#[derive(Debug, Default)]
pub(crate) struct KeyDecoder {
    dialect: Dialect,
    pending: Vec<u8>,
    pasting: bool,
    /// Bytes of an overlong sequence are dropped up to its end.
    dropping: bool,
}

impl KeyDecoder {
    pub(crate) fn new(dialect: Dialect) -> Self {
        Self { dialect, ..Self::default() }
    }

    /// Decodes more bytes; an incomplete key waits for the next call.
    pub(crate) fn feed(&mut self, bytes: &[u8], keys: &mut Vec<Key>) {
        for byte in bytes {
            self.pending.push(*byte);
            self.step(keys);
        }
    }

    /// Whether an incomplete key waits for more bytes.
    #[must_use]
    pub(crate) fn is_waiting(&self) -> bool {
        !self.pending.is_empty() && !self.pasting
    }

    /// Whether text is being pasted.
    #[must_use]
    pub(crate) fn is_pasting(&self) -> bool {
        self.pasting
    }

    /// Ends pasted text whose end never came.
    pub(crate) fn end_paste(&mut self) {
        self.pasting = false;
        self.pending.clear();
    }

    /// Ends the wait, since no more bytes arrive: a lone escape is the key Esc, and any other incomplete key is
    /// dropped.
    pub(crate) fn flush(&mut self, keys: &mut Vec<Key>) {
        if self.pending == [0x1b] {
            keys.push(Key::Esc);
        }
        if !self.pasting {
            self.pending.clear();
            self.dropping = false;
        }
    }

    fn step(&mut self, keys: &mut Vec<Key>) {
        if self.dropping {
            let end = self.pending.last().is_some_and(|byte| (0x40..=0x7e).contains(byte));
            self.pending.clear();
            self.dropping = !end;
            return;
        }
        if self.pasting {
            return self.paste(keys);
        }
        match self.pending.as_slice() {
            [0x1b] | [0x1b, b'[' | b'O'] => {}
            [0x1b, 0x1b] => {
                keys.push(Key::Esc);
                self.pending.pop();
            }
            [0x1b, b'O', last] => {
                keys.extend(ss3(*last));
                self.pending.clear();
            }
            // The Linux console's F1 to F5.
            [0x1b, b'[', b'['] => {}
            [0x1b, b'[', b'[', last] => {
                keys.extend(matches!(last, b'A'..=b'E').then(|| Key::F(last - b'A' + 1)));
                self.pending.clear();
            }
            [0x1b, b'[', middle @ .., last] if (0x40..=0x7e).contains(last) => {
                match csi(self.dialect, middle, *last) {
                    Some(Csi::PasteBegins) => self.pasting = true,
                    Some(Csi::Key(key)) => keys.push(key),
                    None => {}
                }
                self.pending.clear();
            }
            [0x1b, b'[', ..] => {
                if self.pending.len() > MAX_SEQUENCE {
                    self.pending.clear();
                    self.dropping = true;
                }
            }
            // Escape and then another character: two keys.
            [0x1b, _] => {
                keys.push(Key::Esc);
                self.pending.remove(0);
                self.step(keys);
            }
            _ => self.text(keys),
        }
    }

    /// Takes one character, or the beginning of one.
    fn text(&mut self, keys: &mut Vec<Key>) {
        if let Some(character) = self.character() {
            keys.push(plain(character));
        }
    }

    /// Takes pasted text up to its end mark. A line end in it is not Enter.
    fn paste(&mut self, keys: &mut Vec<Key>) {
        if self.pending == PASTE_END {
            self.pending.clear();
            self.pasting = false;
        } else if !PASTE_END.starts_with(&self.pending) {
            if self.pending[0] == 0x1b {
                self.pending.clear();
                return keys.push(Key::Control);
            }
            if let Some(character) = self.character() {
                keys.push(if character.is_control() { Key::Pasted(' ') } else { Key::Pasted(character) });
            }
        }
    }

    /// Takes a whole character from the pending bytes. Invalid UTF-8 becomes the replacement character.
    fn character(&mut self) -> Option<char> {
        let found = match std::str::from_utf8(&self.pending) {
            Ok(text) => text.chars().next(),
            Err(error) if error.error_len().is_none() && self.pending.len() < 4 => return None,
            Err(_) => Some(char::REPLACEMENT_CHARACTER),
        };
        self.pending.clear();
        found
    }
}

/// The length of the escape sequence at the head of these bytes, if all of it is there.
pub(crate) fn whole_sequence(bytes: &[u8]) -> Option<usize> {
    match bytes {
        [0x1b, b'O', _, ..] => Some(3),
        [0x1b, b'[', b'[', _, ..] => Some(4),
        [0x1b, b'[', rest @ ..] => {
            let last = rest.iter().take(MAX_SEQUENCE).position(|byte| !(0x20..=0x3f).contains(byte))?;
            (0x40..=0x7e).contains(&rest[last]).then_some(last + 3)
        }
        _ => None,
    }
}

enum Csi {
    Key(Key),
    PasteBegins,
}

fn csi(dialect: Dialect, middle: &[u8], last: u8) -> Option<Csi> {
    let number = |bytes: &[u8]| std::str::from_utf8(bytes).ok().and_then(|text| text.parse::<u8>().ok());
    let key = match (middle, last) {
        // A key with a modifier is another key, and the screen does not use it.
        (b"" | b"1", b'A') => Key::Up,
        (b"" | b"1", b'B') => Key::Down,
        (b"" | b"1", b'C') => Key::Right,
        (b"" | b"1", b'D') => Key::Left,
        (b"" | b"1", b'H') => Key::Home,
        (b"" | b"1", b'F') => Key::End,
        // Home, end and the pages of SCO differ from those of xterm in letters that xterm does not use.
        (b"", b'I') if dialect == Dialect::Sco => Key::PageUp,
        (b"", b'G') if dialect == Dialect::Sco => Key::PageDown,
        (b"", b'M'..=b'X') if dialect == Dialect::Sco => Key::F(last - b'M' + 1),
        (b"", b'P'..=b'S') => Key::F(last - b'P' + 1),
        // Xterm and others send these to programs that know SCO alone, whatever `TERM` says.
        (b"", b'M'..=b'O' | b'T'..=b'X') => Key::F(last - b'M' + 1),
        // Sun.
        (_, b'z') => match number(middle)? {
            number @ 224..=233 => Key::F(number - 223),
            number @ 192..=193 => Key::F(number - 181),
            214 => Key::Home,
            220 => Key::End,
            216 => Key::PageUp,
            222 => Key::PageDown,
            _ => return None,
        },
        (_, b'~') => match number(middle)? {
            1 | 7 => Key::Home,
            4 | 8 => Key::End,
            5 => Key::PageUp,
            6 => Key::PageDown,
            number @ 11..=15 => Key::F(number - 10),
            number @ 17..=21 => Key::F(number - 11),
            number @ 23..=24 => Key::F(number - 12),
            200 => return Some(Csi::PasteBegins),
            _ => return None,
        },
        _ => return None,
    };
    Some(Csi::Key(key))
}

fn ss3(last: u8) -> Option<Key> {
    Some(match last {
        b'A' => Key::Up,
        b'B' => Key::Down,
        b'C' => Key::Right,
        b'D' => Key::Left,
        b'H' => Key::Home,
        b'F' => Key::End,
        b'M' => Key::Enter,
        // Beyond F4: PuTTY set to "VT100+".
        b'P'..=b'[' => Key::F(last - b'P' + 1),
        _ => return None,
    })
}

fn plain(character: char) -> Key {
    match character {
        '\r' | '\n' => Key::Enter,
        '\t' => Key::Tab,
        '\x7f' | '\x08' => Key::Backspace,
        '\x01'..='\x1a' => Key::Ctrl(char::from(b'a' + (character as u8 - 1))),
        _ if character.is_control() => Key::Control,
        _ => Key::Char(character),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn decode(bytes: &[u8]) -> Vec<Key> {
        let (mut decoder, mut keys) = (KeyDecoder::default(), Vec::new());
        decoder.feed(bytes, &mut keys);
        decoder.flush(&mut keys);
        keys
    }

    fn check(bytes: &[u8], expected: &[Key]) {
        assert_eq!(decode(bytes), expected, "{}", bytes.escape_ascii());
        // A slow line may deliver each byte on its own.
        let (mut decoder, mut keys) = (KeyDecoder::default(), Vec::new());
        bytes.iter().for_each(|byte| decoder.feed(&[*byte], &mut keys));
        decoder.flush(&mut keys);
        assert_eq!(keys, expected, "byte by byte: {}", bytes.escape_ascii());
    }

    /// Sequences as xterm, tmux, PuTTY, rxvt and the Linux console send them.
    #[test]
    fn keys_of_common_terminals() {
        check(b"\x1bOP\x1bOQ\x1bOR\x1bOS", &[Key::F(1), Key::F(2), Key::F(3), Key::F(4)]);
        check(b"\x1b[11~\x1b[15~\x1b[17~", &[Key::F(1), Key::F(5), Key::F(6)]);
        check(b"\x1b[[A\x1b[[E", &[Key::F(1), Key::F(5)]);
        check(b"\x1b[18~\x1b[19~\x1b[20~\x1b[21~\x1b[24~", &[Key::F(7), Key::F(8), Key::F(9), Key::F(10), Key::F(12)]);
        check(b"\x1b[A\x1bOB\x1b[C\x1bOD", &[Key::Up, Key::Down, Key::Right, Key::Left]);
        check(b"\x1b[H\x1b[4~\x1b[5~\x1b[6~\x1b[1~", &[Key::Home, Key::End, Key::PageUp, Key::PageDown, Key::Home]);
        check(
            b"\x03\x7f\x08\t\r\n",
            &[Key::Ctrl('c'), Key::Backspace, Key::Backspace, Key::Tab, Key::Enter, Key::Enter],
        );
    }

    /// As terminfo lists them for scoansi, cons25, putty-sco, xterm-sun and putty-vt100.
    #[test]
    fn function_keys_of_other_terminals() {
        let all: Vec<Key> = (1..=12).map(Key::F).collect();
        let sequence = |before: &str, letters: std::ops::RangeInclusive<u8>| -> Vec<u8> {
            letters.flat_map(|letter| [before.as_bytes(), &[letter]].concat()).collect()
        };
        let sco = |bytes: &[u8]| {
            let (mut decoder, mut keys) = (KeyDecoder::new(Dialect::of_terminal("scoansi")), Vec::new());
            decoder.feed(bytes, &mut keys);
            keys
        };
        assert_eq!(sco(&sequence("\x1b[", b'M'..=b'X')), all);
        assert_eq!(sco(b"\x1b[H\x1b[F\x1b[I\x1b[G"), [Key::Home, Key::End, Key::PageUp, Key::PageDown]);
        for (term, dialect) in [
            ("cons25", Dialect::Sco),
            ("putty-sco", Dialect::Sco),
            ("xterm-256color", Dialect::Xterm),
            ("", Dialect::Xterm),
        ] {
            assert_eq!(Dialect::of_terminal(term), dialect, "{term}");
        }
        // Where TERM does not tell, only letters that mean one key are taken.
        check(b"\x1b[M\x1b[O\x1b[T\x1b[X", &[Key::F(1), Key::F(3), Key::F(8), Key::F(12)]);
        check(b"\x1b[P\x1b[S", &[Key::F(1), Key::F(4)]);
        check(&sequence("\x1bO", b'P'..=b'['), &all);
        let sun: Vec<u8> = (224..=233).chain(192..=193).flat_map(|n: u8| format!("\x1b[{n}z").into_bytes()).collect();
        check(&sun, &all);
    }

    #[test]
    fn a_lone_escape_is_a_key_and_half_a_sequence_is_none() {
        check(b"\x1b", &[Key::Esc]);
        check(b"\x1b\x1b", &[Key::Esc, Key::Esc]);
        check(b"\x1b[1", &[]);
        check(b"\x1bx", &[Key::Esc, Key::Char('x')]);
    }

    #[test]
    fn unknown_sequences_are_dropped_whole() {
        check(b"\x1b[1;5Aa", &[Key::Char('a')]);
        check(b"\x1b[?1;2ca", &[Key::Char('a')]);
        check(b"\x1b[999~a", &[Key::Char('a')]);
        let mut long = b"\x1b[".to_vec();
        long.extend([b'1'; 5000]);
        long.extend(b"~a");
        check(&long, &[Key::Char('a')]);
    }

    #[test]
    fn text_of_any_language() {
        check("é模🛰".as_bytes(), &[Key::Char('é'), Key::Char('模'), Key::Char('🛰')]);
        assert_eq!(decode(b"\xff")[0], Key::Char(char::REPLACEMENT_CHARACTER));
        check(b"\x1d", &[Key::Control]);
    }

    #[test]
    fn pasted_text_holds_no_keys() {
        let keys = decode(b"\x1b[200~a\r\x1b[21~b\x03\x1b[201~\x1b[21~");
        assert!(keys.starts_with(&[Key::Pasted('a'), Key::Pasted(' '), Key::Control]), "{keys:?}");
        let last = keys.len() - 1;
        assert!(keys[..last].iter().all(|key| matches!(key, Key::Pasted(_) | Key::Control)), "{keys:?}");
        assert_eq!(keys[last], Key::F(10));
    }

    /// A megabyte of random bytes leaves nothing behind in the decoder.
    #[test]
    fn garbage_is_bounded() {
        let (mut decoder, mut state) = (KeyDecoder::default(), 0x2545_f491_4f6c_dd1du64);
        let mut keys = Vec::new();
        for _ in 0..1000 {
            let bytes: Vec<u8> = (0..1024)
                .map(|_| {
                    state ^= state << 13;
                    state ^= state >> 7;
                    state ^= state << 17;
                    (state >> 32) as u8
                })
                .collect();
            keys.clear();
            decoder.feed(&bytes, &mut keys);
            assert!(decoder.pending.len() <= MAX_SEQUENCE + 1);
            assert!(keys.len() <= 2 * bytes.len());
        }
    }
}
