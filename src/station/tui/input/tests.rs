use super::*;

fn ms(millis: u64) -> Duration {
    Duration::from_millis(millis)
}

/// Feeds bytes, each piece so many milliseconds after the one before, then waits until all is told.
fn read(pieces: &[(u64, &[u8])]) -> Vec<Input> {
    let (mut reader, mut out, mut at) = (InputReader::default(), Vec::new(), ms(10_000));
    for (gap, piece) in pieces {
        wait(&mut reader, at + ms(*gap), &mut out);
        at += ms(*gap);
        reader.feed(at, piece, &mut out);
    }
    wait(&mut reader, at + ms(10_000), &mut out);
    assert_eq!(reader.due_at(), None, "something waits for ever");
    out
}

/// Wakes the reader whenever it asks for it, as a thread does.
fn wait(reader: &mut InputReader, until: Duration, out: &mut Vec<Input>) {
    while let Some(due_at) = reader.due_at().filter(|due_at| *due_at < until) {
        reader.pass_time(due_at, out);
        assert_ne!(reader.due_at(), Some(due_at), "it would be woken for ever");
    }
}

/// One byte after the other, so many milliseconds apart.
fn typed(gap: u64, bytes: &[u8]) -> Vec<(u64, &[u8])> {
    bytes.chunks(1).map(|byte| (gap, byte)).collect()
}

fn scan(bytes: &[u8], ended: bool) -> Input {
    Input::Scan(Scanned { bytes: bytes.to_vec(), ended, ..Scanned::default() })
}

fn keys(inputs: &[Input]) -> Vec<Key> {
    let key = |input: &Input| match input {
        Input::Key(key) => *key,
        Input::Scan(scanned) => panic!("{scanned:?} is no key"),
    };
    inputs.iter().map(key).collect()
}

#[test]
fn a_scanner_at_any_speed_is_no_hand() {
    for gap in [0, 1, 10, 29] {
        assert_eq!(read(&typed(gap, b"SN-0001\r")), [scan(b"SN-0001\r", true)], "{gap} ms");
        assert_eq!(read(&typed(gap, b"SN-0001")), [scan(b"SN-0001", false)], "{gap} ms");
    }
    assert_eq!(read(&[(0, b"SN-0001\r")]), [scan(b"SN-0001\r", true)], "all at once");
    let hand = read(&typed(80, b"SN-1\r"));
    assert_eq!(keys(&hand), [Key::Char('S'), Key::Char('N'), Key::Char('-'), Key::Char('1'), Key::Enter]);
}

/// ETX is the byte of Ctrl-C. Behind a code of one character it is no key; alone, from a hand, it is.
#[test]
fn the_etx_of_a_short_code_stops_nothing() {
    for gap in [0, 1, 10, 29] {
        assert_eq!(keys(&read(&typed(gap, b"5\x03"))), [Key::Char('5')], "{gap} ms");
        assert_eq!(read(&typed(gap, b"\x03SN-0001\x03")), [scan(b"\x03SN-0001\x03", true)], "{gap} ms");
    }
    assert_eq!(keys(&read(&[(0, b"\x03")])), [Key::Ctrl('c')]);
    assert_eq!(keys(&read(&typed(80, b"5\x03"))), [Key::Char('5'), Key::Ctrl('c')]);
    assert_eq!(keys(&read(&typed(200, b"\x03\x03"))), [Key::Ctrl('c'), Key::Ctrl('c')]);
}

/// Frames, and gaps of milliseconds between characters as scanners have them: 9600 baud, a cable, Bluetooth, and slow ones. A wireless
/// one sends the head first. Whether the code comes as a scan or as keys, its head is no ctrl-C.
#[test]
fn the_etx_before_a_slow_code_is_its_head() {
    let tails: [&[u8]; 6] = [b"", b"\r", b"\r\n", b"\t", b"\x03", b"\x03\r"];
    for head in [&b"\x03"[..], b"\x03\x02", b"\x02\x03", b"\x03\x1d"] {
        for (after_head, gap) in
            [(1, 1), (12, 12), (40, 1), (40, 12), (140, 29), (35, 35), (120, 31), (240, 240), (450, 29)]
        {
            for tail in tails {
                let code = [b"SN-0001-of-a-long-code-0123456789", tail].concat();
                let mut pieces = typed(gap, &code);
                pieces[0].0 = after_head;
                let pieces: Vec<(u64, &[u8])> = typed(gap, head).into_iter().chain(pieces).collect();
                let told = read(&pieces);
                let first = told.iter().position(|input| *input == Input::Key(Key::Ctrl('c')));
                let behind = told.iter().position(|input| *input == Input::Key(Key::Char('9'))).unwrap_or_default();
                // Behind all characters it is the end of the code: the screen passes that over.
                assert!(
                    first.is_none_or(|first| first > behind && tail.contains(&3)),
                    "{} {after_head} {gap} {}: {told:?}",
                    head.escape_ascii(),
                    tail.escape_ascii()
                );
            }
        }
    }
    // Scans one behind the other: the end of the first and the head of the second stand together.
    let both = typed(120, b"\x03SN-1\x03\x03SN-2\x03");
    let pressed = keys(&read(&both)).iter().filter(|key| **key == Key::Ctrl('c')).count();
    assert_eq!(pressed, 2, "the two ends alone");
}

/// A hand waits half a second for its stop, and no longer; its second press comes with the first. Another key does not wait.
#[test]
fn a_hand_presses_ctrl_c() {
    let (mut reader, mut out) = (InputReader::default(), Vec::new());
    reader.feed(ms(1000), b"\x03", &mut out);
    wait(&mut reader, ms(1500), &mut out);
    assert_eq!(out, []);
    wait(&mut reader, ms(1501), &mut out);
    assert_eq!(keys(&out), [Key::Ctrl('c')]);
    for gap in [40, 200, 490] {
        let (mut reader, mut out) = (InputReader::default(), Vec::new());
        reader.feed(ms(1000), b"\x03", &mut out);
        wait(&mut reader, ms(1000 + gap), &mut out);
        reader.feed(ms(1000 + gap), b"\x03", &mut out);
        wait(&mut reader, ms(1000 + gap + 31), &mut out);
        assert_eq!(keys(&out), [Key::Ctrl('c'); 2], "{gap} ms");
    }
    for (behind, key) in [(&b"\x1b[19~"[..], Key::F(8)), (b"\r", Key::Enter), (b"\x1b", Key::Esc)] {
        assert_eq!(keys(&read(&[(0, b"\x03"), (200, behind)])), [Key::Ctrl('c'), key]);
    }
    assert_eq!(keys(&read(&[(0, b"\x03"), (501, b"x")])), [Key::Ctrl('c'), Key::Char('x')]);
    // A program that had no time to read does not take the rest of a code for silence.
    let (mut reader, mut out) = (InputReader::default(), Vec::new());
    reader.feed(ms(1000), b"\x03", &mut out);
    reader.feed(ms(5000), b"SN-0001\r", &mut out);
    assert_eq!(out, [scan(b"SN-0001\r", true)]);
    // Held down.
    assert_eq!(keys(&read(&typed(33, b"\x03").repeat(10))), [Key::Ctrl('c'); 10]);
}

/// Nothing that belongs to a scan is a key: no line end, no Tab, no control character, no escape sequence.
#[test]
fn the_frame_of_a_scan_is_no_key() {
    let frames: [(&[u8], &[u8]); 12] = [
        (b"", b"\r"),
        (b"", b"\n"),
        (b"", b"\r\n"),
        (b"", b"\n\r"),
        (b"", b"\t"),
        (b"\x02", b"\x03"),
        (b"\x02", b"\r\x03"),
        (b"\x02", b"\x03\r\n"),
        (b"\r\n", b"\r\n"),
        (b"\x1d", b"\x04"),
        (b"\x1b[15~", b"\r"),
        (b"\xef\xbb\xbf", b"\r\x00\n"),
    ];
    for (before, behind) in frames {
        let code = [before, b"SN-0001", behind].concat();
        for gap in [0, 5, 15] {
            let told = read(&typed(gap, &code));
            let scans = told.iter().filter(|input| matches!(input, Input::Scan(scanned) if scanned.ended)).count();
            assert_eq!((scans, told.len()), (1, 1), "{} at {gap} ms: {told:?}", code.escape_ascii());
        }
        let told = read(&[(0, &code)]);
        assert!(matches!(told.as_slice(), [Input::Scan(_)]), "{} at once: {told:?}", code.escape_ascii());
    }
}

/// F5, F10, Esc, Ctrl-C in the middle or at the end of a code press nothing.
#[test]
fn keys_within_a_code_press_nothing() {
    for inside in [&b"\x1b[15~"[..], b"\x1b[21~", b"\x1b", b"\x03", b"\x1bOM", b"\x1b[Z"] {
        let code = [b"SN-00", inside, b"01\r"].concat();
        let last = [b"SN-0001", inside].concat();
        for code in [code, last] {
            for told in [read(&[(0, &code)]), read(&typed(3, &code)), read(&[(0, &code[..5]), (8, &code[5..])])] {
                let pressed: Vec<&Input> = told
                    .iter()
                    .filter(|input| matches!(input, Input::Key(Key::F(_) | Key::Esc | Key::Ctrl(_) | Key::Enter)))
                    .collect();
                assert!(pressed.is_empty(), "{}: {told:?}", code.escape_ascii());
            }
        }
    }
}

/// The line end is late, or a wireless scanner stops for a moment: it is one scan.
#[test]
fn a_moment_without_bytes_does_not_cut_a_scan() {
    for gap in [31, 40, 60, 120] {
        assert_eq!(read(&[(0, b"SN-00"), (gap, b"01\r")]), [scan(b"SN-0001\r", true)], "{gap} ms");
        assert_eq!(read(&[(0, b"SN-0001"), (gap, b"\r")]), [scan(b"SN-0001\r", true)], "{gap} ms");
        assert_eq!(read(&[(0, b"SN-0001\r"), (gap, b"\n")]), [scan(b"SN-0001\r", true)], "{gap} ms");
        // So early that its beginning was given as keys.
        let told = read(&[(0, b"S"), (gap, b"N-0001\r")]);
        let rest = Scanned { bytes: b"N-0001\r".to_vec(), ended: true, taken_back: 1, dropped: 0 };
        assert_eq!(told, [Input::Key(Key::Char('S')), Input::Scan(rest)], "{gap} ms");
    }
    assert_eq!(
        read(&[(0, b"SN-00"), (200, b"SN-0001\r")]),
        [scan(b"SN-00", false), scan(b"SN-0001\r", true)],
        "the first one was cut off"
    );
}

#[test]
fn two_scans_back_to_back_are_two() {
    let both = [scan(b"SN-0001\r", true), scan(b"SN-0002\r", true)];
    assert_eq!(read(&[(0, b"SN-0001\rSN-0002\r")]), both);
    assert_eq!(read(&typed(5, b"SN-0001\r\nSN-0002\r\n")), both);
    assert_eq!(read(&[(0, b"\x02SN-1\x03\x02SN-2\x03")]), [scan(b"\x02SN-1\x03", true), scan(b"\x02SN-2\x03", true)]);
}

/// A network holds the keys of a hand back and delivers them together.
#[test]
fn keys_that_come_together_are_keys() {
    for (sequence, key) in
        [(&b"\x1b[15~"[..], Key::F(5)), (b"\x1bOP", Key::F(1)), (b"\x1b[A", Key::Up), (b"\x1b[[E", Key::F(5))]
    {
        assert_eq!(keys(&read(&[(0, sequence)])), [key]);
        assert_eq!(keys(&read(&[(0, &sequence.repeat(3))])), [key; 3]);
        // A slow line delivers byte by byte.
        assert_eq!(keys(&read(&typed(10, sequence))), [key], "{}", sequence.escape_ascii());
    }
    assert_eq!(keys(&read(&[(0, b"\x1b[B\x1b[B\r")])), [Key::Down, Key::Down, Key::Enter]);
    assert_eq!(keys(&read(&[(0, b"\r\x1b[15~")])), [Key::Enter, Key::F(5)]);
    assert_eq!(keys(&read(&[(0, b"\x1b")])), [Key::Esc]);
    assert_eq!(keys(&read(&[(0, b"\x1b\x1b")])), [Key::Esc, Key::Esc]);
    assert_eq!(keys(&read(&[(0, b"\x7f\x7f\x7f")])), [Key::Backspace; 3]);
    // Number, Enter and F5 together: the key behind the line end is one.
    assert_eq!(read(&[(0, b"SN-0001\r\x1b[15~")]), [scan(b"SN-0001\r", true), Input::Key(Key::F(5))]);
    // A scanner that types this code needs time for each character.
    assert_eq!(read(&typed(2, b"SN-0001\r\x1b[15~")), [scan(b"SN-0001\r", true)]);
    // After a scan without a line end.
    assert_eq!(read(&[(0, b"SN-0001"), (100, b"\x1b[15~")]), [scan(b"SN-0001", false), Input::Key(Key::F(5))]);
}

/// Two keys of a fast hand roll over each other; a key that is held down repeats faster than a hand can type.
#[test]
fn a_fast_hand_is_no_scanner() {
    let rolled = read(&[(0, b"S"), (15, b"N"), (90, b"-"), (90, b"0"), (20, b"1"), (90, b"\r")]);
    assert!(keys(&rolled).starts_with(&[Key::Char('S'), Key::Char('N')]), "{rolled:?}");
    assert_eq!(keys(&read(&[(0, b"1"), (20, b"\r")])), [Key::Char('1'), Key::Enter]);
    for (gap, byte, key) in
        [(33, b"x", Key::Char('x')), (20, b"x", Key::Char('x')), (20, b"\x7f", Key::Backspace), (25, b"\r", Key::Enter)]
    {
        let held = typed(gap, byte).repeat(50);
        assert_eq!(keys(&read(&held)), vec![key; 50], "{gap} ms");
    }
    // It is shown while it is held.
    let (mut reader, mut out) = (InputReader::default(), Vec::new());
    (0..40).for_each(|index| reader.feed(ms(1000 + 20 * index), b"x", &mut out));
    assert_eq!(out.len(), 40);
    // A number that begins with four equal digits is whole.
    let told = read(&typed(5, b"0000123\r"));
    let Some(Input::Scan(scanned)) = told.last() else { panic!("{told:?}") };
    assert_eq!((scanned.bytes.as_slice(), scanned.taken_back), (&b"123\r"[..], 4));
}

#[test]
fn pasted_text_is_neither_keys_nor_a_scan() {
    let pasted = b"\x1b[200~SN-0001\r\x1b[15~\x03\x1b[201~\x1b[15~";
    for told in [read(&[(0, pasted)]), read(&typed(1, pasted)), read(&[(0, &pasted[..20]), (500, &pasted[20..])])] {
        let told = keys(&told);
        assert_eq!(told.last(), Some(&Key::F(5)), "the key behind it");
        let inside = &told[..told.len() - 1];
        assert!(inside.iter().all(|key| matches!(key, Key::Pasted(_) | Key::Control)), "{inside:?}");
        assert_eq!(inside[0], Key::Pasted('S'));
    }
    // Pasted text without an end does not lock the keyboard.
    assert_eq!(keys(&read(&[(0, b"\x1b[200~a"), (5000, b"\x1b[15~")])), [Key::Pasted('a'), Key::F(5)]);
}

/// What a scanner types in Russian or with a Chinese input method is one scan too.
#[test]
fn letters_of_more_bytes() {
    for text in ["ЫТ-0001", "ＳＮ－０００１", "模块-1"] {
        let code = format!("{text}\r");
        assert_eq!(read(&typed(3, code.as_bytes())), [scan(code.as_bytes(), true)]);
    }
    assert_eq!(keys(&read(&[(0, "模".as_bytes())])), [Key::Char('模')]);
    let halves = keys(&read(&typed(200, "é".as_bytes())));
    assert_eq!(halves, [Key::Char(char::REPLACEMENT_CHARACTER)], "half a letter is none");
}

#[test]
fn a_space_amid_text_is_text() {
    assert_eq!(keys(&read(&[(0, b" a")])), [Key::Pasted(' '), Key::Char('a')]);
    assert_eq!(keys(&read(&[(0, b" ")])), [Key::Char(' ')]);
    assert_eq!(keys(&read(&[(0, b" \x1b[B")])), [Key::Char(' '), Key::Down]);
}

/// Codes without an end and random bytes leave little behind, and never a function key.
#[test]
fn garbage_is_bounded() {
    let told = read(&[(0, &b"x1".repeat(100_000))]);
    let [Input::Scan(scanned)] = told.as_slice() else { panic!("{} inputs", told.len()) };
    assert_eq!((scanned.bytes.len(), scanned.dropped), (MAX_SCAN, 200_000 - MAX_SCAN));
    let (mut reader, mut out, mut state) = (InputReader::default(), Vec::new(), 0x2545_f491_4f6c_dd1du64);
    for index in 0..500 {
        let bytes: Vec<u8> = (0..1024)
            .map(|_| {
                state ^= state << 13;
                state ^= state >> 7;
                state ^= state << 17;
                (state >> 32) as u8
            })
            .collect();
        out.clear();
        reader.feed(ms(1000 + index), &bytes, &mut out);
        assert!(reader.burst.bytes.len() <= MAX_SCAN && out.len() <= 2 * bytes.len());
    }
}

/// An input method commits a name at once; it is typed and no scan. A line end right behind it still makes a scan.
#[test]
fn a_word_of_an_input_method_is_typed() {
    let typed = |name: &str| name.chars().map(|character| Input::Key(Key::Char(character))).collect::<Vec<_>>();
    for name in ["王小明", "欧阳修文", "たなか", "김민수"] {
        assert_eq!(read(&[(0, name.as_bytes())]), typed(name), "{name}");
    }
    assert_eq!(read(&[(0, "模块-0003\r".as_bytes())]), [scan("模块-0003\r".as_bytes(), true)]);
    assert_eq!(read(&[(0, "ＳＮ０１".as_bytes())]), [scan("ＳＮ０１".as_bytes(), false)]);
}
