use super::*;

fn of(bytes: &[u8]) -> Result<String, ScanProblem> {
    number("", &Scanned { bytes: bytes.to_vec(), ended: true, ..Scanned::default() })
}

#[test]
fn the_frame_is_taken_off() {
    let codes: [&[u8]; 22] = [
        b"SN-0001",
        b"SN-0001\r",
        b"SN-0001\r\n",
        b"SN-0001\n\r",
        b"SN-0001\t",
        b"\x02SN-0001\x03",
        b"\x02SN-0001\x03\r\n",
        b"\r\nSN-0001\r\n",
        b"]C1SN-0001\r",
        b"]d2SN-0001\r",
        b"]Q3SN-0001\r",
        b"\x02]A0SN-0001\r\x03",
        b"\x1dSN-0001\r",
        b"]C1\x1dSN-0001\x1d\r",
        b"\xef\xbb\xbfSN-0001\r",
        b"\0SN-0001\0\r",
        b"S\0N\0-\x000\x000\x000\x001\0\r",
        b"\x1b[15~SN-0001\r",
        b"SN-0001\x1b[15~\r",
        b"SN-0001\x1bOM",
        b"\x1bSN-0001\r",
        b"  SN-0001 \r",
    ];
    for code in codes {
        assert_eq!(of(code).as_deref(), Ok("SN-0001"), "{}", code.escape_ascii());
    }
    let rest = Scanned { bytes: b"N-0001\r".to_vec(), ended: true, ..Scanned::default() };
    assert_eq!(number("S", &rest).as_deref(), Ok("SN-0001"));
    let rest = Scanned { bytes: b"1SN-0001\r".to_vec(), ..rest };
    assert_eq!(number("]C", &rest).as_deref(), Ok("SN-0001"), "the name of the symbology was torn");
    assert_eq!(of(b"SN 1\r").as_deref(), Ok("SN 1"), "a space within belongs to the number");
    assert_eq!(of(b"]C1\r").as_deref(), Ok("]C1"), "a frame around nothing");
}

#[test]
fn what_is_no_number_is_told() {
    let no = |bytes: &[u8]| of(bytes).expect_err("it is no number");
    assert_eq!(no(b"\r"), ScanProblem::Empty);
    assert_eq!(no(b"\x02 \x03\r"), ScanProblem::Empty);
    assert_eq!(no(b"SN\x1b[15~01\r"), ScanProblem::Control);
    assert_eq!(no(b"SN\x0701\r"), ScanProblem::Control);
    assert_eq!(no(b"[)>\x1e06\x1dSSN-0001\x1e\x04"), ScanProblem::Control);
    assert_eq!(no(b"]d221SN-0001\x1d10LOT5\r"), ScanProblem::Fields("21SN-0001 | 10LOT5".into()));
    assert_eq!(no("SN\u{200b}-1\r".as_bytes()), ScanProblem::Invisible('\u{200b}'));
    assert_eq!(no("SN\u{a0}1\r".as_bytes()), ScanProblem::Invisible('\u{a0}'));
    assert_eq!(no(b"SN\xff1\r"), ScanProblem::Invisible('\u{fffd}'));
    assert_eq!(no(&b"9".repeat(65)), ScanProblem::TooLong { characters: 65 });
}

/// ЙЦУКЕН in place of QWERTY gives "ЫТ" for "SN"; a Chinese input method gives full width.
#[test]
fn other_layouts_are_seen() {
    for number in ["ЫТ-0001", "ΣΝ-1", "ＳＮ－０００１", "SN。1", "ｱ1", "SN-О1", "שn1"] {
        assert!(is_other_layout(number), "{number}");
    }
    for number in ["SN-0001", "é-1", "模块-1", "12 34/5#"] {
        assert!(!is_other_layout(number), "{number}");
    }
}

/// What a serial port brings is cut at line ends, and at silence for scanners that send none.
#[test]
fn lines_of_a_serial_port() {
    let at = Duration::from_secs(1);
    let mut lines = ScannerLines::default();
    let numbers =
        |scans: Vec<Scanned>| -> Vec<_> { scans.iter().map(|scan| (number("", scan).ok(), scan.ended)).collect() };
    assert_eq!(lines.feed(at, b"SN-00"), []);
    let one = |text: &str| (Some(text.to_owned()), true);
    assert_eq!(
        numbers(lines.feed(at, b"01\r\n]C1SN-0002\r\n\x02SN-0003\x03")),
        [one("SN-0001"), one("SN-0002"), one("SN-0003")]
    );
    assert_eq!(lines.feed(at, b"\r\n"), []);
    assert_eq!(lines.due_at(), None);
    assert_eq!(lines.feed(at, b"SN-0004"), []);
    assert_eq!(lines.due_at(), Some(at + REST_OF_LINE));
    assert_eq!(numbers(lines.rest().into_iter().collect()), [(Some("SN-0004".to_owned()), false)]);
    lines.feed(at, b"SN-0");
    lines.cut();
    assert_eq!(
        numbers(lines.feed(at, b"SN-0005\r")),
        [one("SN-0005")],
        "the half of a code before the plug was pulled"
    );
    lines.feed(at, &b"x".repeat(3 * MAX_LINE));
    assert!(lines.line.bytes.len() == MAX_LINE && lines.line.dropped == 2 * MAX_LINE);
}
