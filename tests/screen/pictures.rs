//! The picture of a question on terminals that can draw, read out of what the terminal is sent: the colours must be those
//! of the file.

use std::process::Command;

use gnc_tests::Place;
use serde_json::Value;

use crate::terminal::Terminal;
use crate::{F2, F5, F10, STATION, open_on};

const PLAN: &str = "name = \"by-hand\"\nversion = \"1\"\n[[item]]\nid = \"prompt\"\nname = \"by-hand\"\n[[item.ask]]\n\
                    name = \"lid\"\nen = \"Close the lid.\"\nkind = \"done\"\npicture = \"lid.png\"\n";
/// Size of the picture: red on the left, blue on the right.
const SIZE: (usize, usize) = (200, 96);

/// A picture, packed by hand: one block that is stored as it is.
fn png() -> Vec<u8> {
    let row = || {
        let pixels = (0..SIZE.0).flat_map(|x| if x < SIZE.0 / 2 { [255, 0, 0] } else { [0, 0, 255] });
        std::iter::once(0).chain(pixels)
    };
    let rows: Vec<u8> = (0..SIZE.1).flat_map(|_| row()).collect();
    let (low, high) = rows.iter().fold((1_u32, 0_u32), |(low, high), byte| {
        let low = (low + u32::from(*byte)) % 65521;
        (low, (high + low) % 65521)
    });
    let length = u16::try_from(rows.len()).expect("one block");
    let mut packed = vec![0x78, 0x01, 0x01];
    packed.extend(length.to_le_bytes());
    packed.extend((!length).to_le_bytes());
    packed.extend(&rows);
    packed.extend(((high << 16) | low).to_be_bytes());
    let side = |side: usize| u32::try_from(side).expect("small").to_be_bytes();
    let head = [&side(SIZE.0)[..], &side(SIZE.1), &[8, 2, 0, 0, 0]].concat();
    let mut png = b"\x89PNG\r\n\x1a\n".to_vec();
    for (name, data) in [(b"IHDR", &head[..]), (b"IDAT", &packed), (b"IEND", &[])] {
        png.extend(u32::try_from(data.len()).expect("small").to_be_bytes());
        let named = [&name[..], data].concat();
        let bit = |crc: u32| if crc & 1 == 1 { 0xedb8_8320 ^ (crc >> 1) } else { crc >> 1 };
        let crc = named.iter().fold(u32::MAX, |crc, byte| (0..8).fold(crc ^ u32::from(*byte), |crc, _| bit(crc)));
        png.extend(&named);
        png.extend((!crc).to_be_bytes());
    }
    png
}

/// Starts the run and waits for its question.
fn asked(place: &Place, environment: &[(&str, &str)]) -> Terminal {
    place.write("p.toml", PLAN);
    std::fs::write(place.path().join("lid.png"), png()).expect("a picture");
    let args = ["--sim", "--sim-speed", "max", "--plan", "p.toml"];
    let mut terminal = open_on(place, environment, &args, 120, 40);
    terminal.wait_for("by-hand 1");
    terminal.types(b"Q-1\r");
    terminal.wait_for("Q-1: F5 starts the test.");
    terminal.types(F5);
    terminal.wait_for("Close the lid.");
    terminal.wait_for("Picture: lid.png.");
    terminal
}

/// Answers the question and leaves. Returns all that the terminal was sent.
fn answered(mut terminal: Terminal) -> Vec<u8> {
    terminal.types(F2);
    terminal.wait_for("F4 Repeat");
    assert!(!terminal.text().contains('\u{10eeee}'), "the picture is still there:\n{}", terminal.text());
    let sent = terminal.sent().to_vec();
    terminal.types(F10);
    let (status, restored) = terminal.end();
    assert!(restored && status.code() == Some(0), "{status}");
    sent
}

fn find(bytes: &[u8], what: &[u8]) -> Option<usize> {
    bytes.windows(what.len()).position(|window| window == what)
}

/// What stands between a beginning and the end of a string to the terminal.
fn string<'a>(bytes: &'a [u8], begin: &[u8]) -> Option<(&'a [u8], &'a [u8])> {
    let after = &bytes[find(bytes, begin)? + begin.len()..];
    let end = find(after, b"\x1b\\")?;
    Some((&after[..end], &after[end + 2..]))
}

fn base64(text: &[u8]) -> Vec<u8> {
    let digit = |byte: &u8| match byte {
        b'A'..=b'Z' => Some(byte - b'A'),
        b'a'..=b'z' => Some(byte - b'a' + 26),
        b'0'..=b'9' => Some(byte - b'0' + 52),
        b'+' => Some(62),
        b'/' => Some(63),
        _ => None,
    };
    let digits: Vec<u8> = text.iter().filter_map(digit).collect();
    let group = |group: &[u8]| {
        let bits = group.iter().enumerate().fold(0, |bits, (at, digit)| bits | u32::from(*digit) << (18 - 6 * at));
        bits.to_be_bytes()[1..group.len()].to_vec()
    };
    digits.chunks(4).flat_map(group).collect()
}

/// The pixels that kitty is sent, row by row, red, green and blue in percent; `None` if not all has come.
fn kitty(mut bytes: &[u8]) -> Option<(usize, Vec<[usize; 3]>)> {
    let (mut pixels, mut width) = (Vec::new(), None);
    loop {
        let (command, rest) = string(bytes, b"\x1b_G")?;
        let (keys, data) = command.split_at(find(command, b";")?);
        let keys = String::from_utf8_lossy(keys).into_owned();
        let key = |name: &str| keys.split(',').find_map(|key| key.strip_prefix(name)).map(str::to_owned);
        if let Some(columns) = key("s=") {
            assert_eq!((key("f=").as_deref(), key("o=")), (Some("32"), None), "{keys}");
            width = columns.parse().ok();
        }
        pixels.extend(base64(data));
        bytes = rest;
        if key("m=").as_deref() == Some("0") {
            break;
        }
    }
    let percent = |pixel: &[u8]| [0, 1, 2].map(|channel| usize::from(pixel[channel]) * 100 / 255);
    Some((width?, pixels.chunks_exact(4).map(percent).collect()))
}

/// The same of sixels. Colours of the whole picture are percents.
fn sixel(bytes: &[u8]) -> Option<(usize, Vec<[usize; 3]>)> {
    let (picture, _) = string(bytes, b"\x1bP")?;
    let body = &picture[find(picture, b"q")? + 1..];
    let (mut colours, mut colour, mut repeat) = (vec![[0; 3]; 256], 0, 1);
    let (mut pixels, mut width, mut x, mut y) = (Vec::new(), 0, 0, 0);
    let mut at = 0;
    while at < body.len() {
        let command = body[at];
        at += 1;
        let mut numbers = || {
            let count = body[at..].iter().take_while(|byte| byte.is_ascii_digit() || **byte == b';').count();
            let text = String::from_utf8_lossy(&body[at..at + count]).into_owned();
            at += count;
            text.split(';').map(|number| number.parse().unwrap_or(0)).collect::<Vec<usize>>()
        };
        match command {
            b'"' => {
                let size = numbers();
                (width, pixels) = (size[2], vec![[0; 3]; size[2] * size[3]]);
            }
            b'#' => match numbers()[..] {
                [number, 2, red, green, blue] => colours[number] = [red, green, blue],
                [number] => colour = number,
                ref other => panic!("a colour by other means: {other:?}"),
            },
            b'!' => repeat = numbers()[0],
            b'$' => x = 0,
            b'-' => (x, y) = (0, y + 6),
            b'?'..=b'~' => {
                for column in x..x + repeat {
                    for row in (0..6).filter(|row| (command - b'?') >> row & 1 == 1) {
                        if let Some(pixel) = pixels.get_mut((y + row) * width + column) {
                            *pixel = colours[colour];
                        }
                    }
                }
                (x, repeat) = (x + repeat, 1);
            }
            _ => {}
        }
    }
    (width > 0).then_some((width, pixels))
}

/// Red on the left, blue on the right, at the height of the file.
fn check_colours((width, pixels): (usize, Vec<[usize; 3]>)) {
    assert_eq!((width, pixels.len() / width), SIZE);
    for y in [1, SIZE.1 / 2, SIZE.1 - 2] {
        for (x, expected) in
            [(2, [100, 0, 0]), (SIZE.0 / 2 - 5, [100, 0, 0]), (SIZE.0 / 2 + 5, [0, 0, 100]), (197, [0, 0, 100])]
        {
            let pixel = pixels[y * width + x];
            let is_near = pixel.iter().zip(expected).all(|(is, wanted)| is.abs_diff(wanted) <= 4);
            assert!(is_near, "at {x}, {y}: {pixel:?} is not {expected:?}");
        }
    }
}

#[test]
fn kitty_draws_the_picture_of_a_question() {
    let place = Place::new(STATION);
    let mut terminal = asked(&place, &[("TERM", "xterm-kitty")]);
    terminal.wait_for_bytes("a picture", |sent| kitty(sent).is_some());
    terminal.wait_for("\u{10eeee}");
    let sent = answered(terminal);
    check_colours(kitty(&sent).expect("a picture"));
    assert_eq!(find(&sent, b"\x1bP"), None);
    // The record says which picture it was.
    let events = std::fs::read_to_string(place.runs()[0].join("events.jsonl")).expect("a journal");
    let events = events.lines().map(|line| serde_json::from_str::<Value>(line).expect("an event"));
    let shown: Vec<_> = events.filter_map(|event| Some(event.get("picture_sha256")?.as_str()?.to_owned())).collect();
    let sum = Command::new("sha256sum").arg(place.path().join("lid.png")).output().expect("sha256sum").stdout;
    assert_eq!(shown, [String::from_utf8_lossy(&sum[..64])]);
}

#[test]
fn sixels_draw_the_picture_of_a_question() {
    let place = Place::new(STATION);
    let mut terminal = asked(&place, &[("TERM", "foot")]);
    terminal.wait_for_bytes("a picture", |sent| sixel(sent).is_some());
    let sent = answered(terminal);
    check_colours(sixel(&sent).expect("a picture"));
    assert_eq!(find(&sent, b"\x1b_G"), None);
}

/// A terminal that cannot draw, and one behind tmux, are sent the path alone.
#[test]
fn other_terminals_show_the_path() {
    for environment in [&[("TERM", "xterm")][..], &[("TERM", "xterm-kitty"), ("TMUX", "/tmp/tmux-0/default,1,0")]] {
        let place = Place::new(STATION);
        let sent = answered(asked(&place, environment));
        for begin in [&b"\x1b_G"[..], b"\x1bP", b"\x1b]1337"] {
            assert_eq!(find(&sent, begin), None, "{environment:?}");
        }
        assert!(place.record()["items"][0]["outcome"] == "passed", "{environment:?}");
    }
}
