//! Bytes between sentences, ends of lines, checksums. The checksums of these frames come from elsewhere: the documents,
//! and Python (`binascii.crc_hqx`, `zlib.crc32`, a bitwise CRC-24Q).

use super::*;

/// The result for a sentence, `something`, and two more sentences.
fn between(something: &[u8]) -> (usize, Counts, String) {
    let mut bytes = text(&[&gga("GP", 0, 1)]).into_bytes();
    bytes.extend_from_slice(something);
    bytes.extend_from_slice(text(&[&gga("GP", 1, 1), &gga("GP", 2, 1)]).as_bytes());
    let (epochs, sentences) = heard(&bytes);
    (epochs.len(), sentences.counts(), sentences.foreign())
}

fn frames(hexadecimal: &str) -> Vec<u8> {
    let digits: Vec<u8> = hexadecimal.bytes().filter(|byte| !byte.is_ascii_whitespace()).collect();
    digits.chunks(2).map(|pair| u8::from_str_radix(std::str::from_utf8(pair).unwrap(), 16).unwrap()).collect()
}

#[test]
fn frames_of_other_protocols_are_passed_over() {
    for (protocol, bytes) in FRAMES {
        let (epochs, counts, foreign) = between(&frames(bytes));
        assert_eq!((epochs, counts.errors, counts.foreign), (2, 0, 1), "{protocol}: {counts:?}");
        assert_eq!(foreign, format!("1 {protocol}"));
        // A frame with a wrong byte counts as spoilt by the line, and the sentence after it is not lost.
        let mut spoilt = frames(bytes);
        let middle = spoilt.len() / 2;
        spoilt[middle] ^= 0x04;
        let (epochs, counts, _) = between(&spoilt);
        if *protocol != "TSIP or Garmin" {
            assert!(epochs == 2 && counts.errors > 0 && counts.foreign == 0, "{protocol}: {epochs} {counts:?}");
        }
    }
}

/// A payload may contain anything, even a whole sentence. A frame that was cut off takes no sentence with it.
#[test]
fn frames_are_passed_over_by_their_length() {
    let inside = text(&[&gga("GP", 40, 1)]);
    let body = [&[1, 7, inside.len() as u8, 0], inside.as_bytes()].concat();
    let sums =
        body.iter().fold((0_u8, 0_u8), |(a, b), byte| (a.wrapping_add(*byte), b.wrapping_add(a.wrapping_add(*byte))));
    let whole = [&[0xb5, 0x62][..], &body, &[sums.0, sums.1]].concat();
    assert_eq!(between(&whole), (2, Counts { foreign: 1, ..Counts::default() }, "1 UBX".to_owned()));
    let cut = &whole[..20];
    let (epochs, counts, _) = between(cut);
    assert_eq!((epochs, counts.foreign), (2, 0));
    assert!((1..=2).contains(&counts.errors), "{counts:?}");
}

const FRAMES: &[(&str, &str)] = &[
    ("RTCM 3", "d3 00 00 47 ea 4b"),
    (
        "UBX",
        "b5 62 01 07 21 00 03 0a 11 18 1f 26 2d 34 3b 42 49 50 57 5e 65 6c 73 7a 81 88 8f 96 9d a4 24 47 \
         50 47 47 41 2c 31 0a ee 2d",
    ),
    ("UBX", "b5 62 01 22 00 00 23 6a"),
    (
        "UBX",
        "f1 d9 01 05 21 00 03 0a 11 18 1f 26 2d 34 3b 42 49 50 57 5e 65 6c 73 7a 81 88 8f 96 9d a4 24 47 \
         50 47 47 41 2c 31 0a ec e5",
    ),
    (
        "SiRF",
        "a0 a2 00 21 03 0a 11 18 1f 26 2d 34 3b 42 49 50 57 5e 65 6c 73 7a 81 88 8f 96 9d a4 24 47 50 47 \
         47 41 2c 31 0a 09 c5 b0 b3",
    ),
    ("RTCM 3", "d3 00 13 3e d7 d3 02 02 98 0e de ef 34 b4 bd 62 ac 09 41 98 6f 33 36 0b 98"),
    (
        "SBF",
        "24 40 e4 a5 a7 0f 2c 00 03 0a 11 18 1f 26 2d 34 3b 42 49 50 57 5e 65 6c 73 7a 81 88 8f 96 9d a4 \
         24 47 50 47 47 41 2c 31 0a 00 00 00",
    ),
    (
        "NovAtel",
        "aa 44 12 1c 2a 00 00 00 21 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 03 0a 11 18 \
         1f 26 2d 34 3b 42 49 50 57 5e 65 6c 73 7a 81 88 8f 96 9d a4 24 47 50 47 47 41 2c 31 0a 4b d8 dd \
         db",
    ),
    (
        "NovAtel",
        "aa 44 13 21 00 00 00 00 00 00 00 00 03 0a 11 18 1f 26 2d 34 3b 42 49 50 57 5e 65 6c 73 7a 81 88 \
         8f 96 9d a4 24 47 50 47 47 41 2c 31 0a 1a 20 d2 26",
    ),
    (
        "NovAtel",
        "aa 44 b5 00 00 00 21 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 03 0a 11 18 1f 26 2d 34 \
         3b 42 49 50 57 5e 65 6c 73 7a 81 88 8f 96 9d a4 24 47 50 47 47 41 2c 31 0a 54 5d 70 51",
    ),
    (
        "NovAtel",
        "23 42 45 53 54 50 4f 53 41 2c 43 4f 4d 31 2c 30 2c 39 30 2e 35 2c 46 49 4e 45 53 54 45 45 52 49 \
         4e 47 2c 31 39 34 39 2c 34 30 33 37 34 32 2e 30 30 30 2c 30 32 30 30 30 30 30 30 2c 62 31 66 36 \
         2c 33 32 37 36 38 3b 53 4f 4c 5f 43 4f 4d 50 55 54 45 44 2c 53 49 4e 47 4c 45 2a 31 64 34 36 61 \
         62 33 64",
    ),
    (
        "Skytraq",
        "a0 a1 00 21 03 0a 11 18 1f 26 2d 34 3b 42 49 50 57 5e 65 6c 73 7a 81 88 8f 96 9d a4 24 47 50 47 \
         47 41 2c 31 0a 05 0d 0a",
    ),
    (
        "MTK",
        "04 24 2a 00 fd 00 03 0a 11 18 1f 26 2d 34 3b 42 49 50 57 5e 65 6c 73 7a 81 88 8f 96 9d a4 24 47 \
         50 47 47 41 2c 31 0a d2 0d 0a",
    ),
    (
        "TSIP or Garmin",
        "10 8f 20 03 0a 11 18 1f 26 2d 34 3b 42 49 50 57 5e 65 6c 73 7a 81 88 8f 96 9d a4 24 47 50 47 47 \
         41 2c 31 0a 10 03",
    ),
];

#[test]
fn lines_end_as_receivers_end_them() {
    let bodies = [gga("GP", 0, 1), GSA_3D.into(), gga("GP", 1, 1), GSA_3D.into(), gga("GP", 2, 1)];
    let log = text(&bodies.each_ref().map(String::as_str));
    for end in ["\n", "\r", "\r\n\r\n", "", " \r\n", "\r\n\0\0"] {
        let (epochs, sentences) = heard(log.replace("\r\n", end).as_bytes());
        assert_eq!((epochs.len(), sentences.counts().errors), (2, 0), "{end:?}");
    }
    let lower: String = log
        .lines()
        .map(|line| line.split_once('*').unwrap())
        .map(|(body, sum)| format!("{body}*{}\n", sum.to_lowercase()))
        .collect();
    let (epochs, sentences) = heard(lower.as_bytes());
    assert_eq!((epochs.len(), sentences.counts().errors), (2, 0));
}

/// A receiver that sends no checksums is accepted, and this is counted. If it sends them, the line lost this one.
#[test]
fn a_missing_checksum_is_told() {
    let bare = |second| format!("${}\r\n", gga("GP", second, 1));
    let (epochs, sentences) = heard((bare(0) + &bare(1) + &bare(2)).as_bytes());
    assert_eq!((epochs.len(), sentences.counts().errors, sentences.counts().unchecked), (2, 0, 3));
    let (_, counts, _) = between(bare(5).as_bytes());
    assert_eq!((counts.errors, counts.unchecked), (1, 0));
}

#[test]
fn long_sentences_are_read_up_to_a_bound() {
    let long =
        |length: usize| format!("GPGGA,120005,3413.9,N,10854.9,E,1,08,1.0,442.0,M,-30.0,M,,{}", "0".repeat(length));
    for (length, expected) in [(100, (3, 0)), (900, (3, 0)), (1000, (2, 1))] {
        let (epochs, counts, _) = between(sentence(&long(length)).as_bytes());
        assert_eq!((epochs, counts.errors), expected, "{length}");
    }
}

#[test]
fn other_talkers_are_passed_over() {
    let others = [
        "!AIVDM,1,1,,A,15M67FC000G?ufbE`FepT@3n00Sa,0*5F\r\n".to_owned(),
        "\\s:GP0001,c:1700000000*2C\\".to_owned(),
        text(&[
            "PGRME,15.0,M,22.5,M,15.0,M",
            "PMTK001,604,3",
            "PQTMVERNO,A,B",
            "HEHDT,123.4,T",
            "IIVHW,,T,,M,05.1,N,,K",
        ]),
        text(&["GNTXT,01,01,02,u-blox AG - www.u-blox.com", "GPGSV,1,1,00", "GYOACC,090624,000653.10,0.1", "PSTI,030"]),
        text(&["PUBX,00,120000.00,3413.9,N,10854.9,E,412.0,G3,2.1,2.0,0.007,77.52,0.007,,0.92,1.19,0.77,9,0,0"]),
    ];
    for other in others {
        let (epochs, counts, _) = between(other.as_bytes());
        assert_eq!((epochs, counts), (2, Counts::default()), "{other}");
    }
}

/// The next sentence or a frame cuts a sentence off. Noise counts once for each stretch up to a bound, not byte by
/// byte.
#[test]
fn what_the_line_spoilt_is_counted_once() {
    let whole = text(&[&gga("GP", 1, 1)]);
    let ubx = frames("b5 62 01 22 00 00 23 6a");
    for (spoilt, errors) in [
        (whole.as_bytes()[..30].to_vec(), 1),
        ([&whole.as_bytes()[..30], &ubx].concat(), 1),
        (b"\xff\xfe\xfd\x00\x81\r\n".to_vec(), 1),
        (vec![0xfe; 1100], 3),
        (whole.replace("3413", "3\u{fffd}13").into_bytes(), 1),
        (whole.replace('$', "4").into_bytes(), 1),
        (whole.replace("*", "*0").into_bytes(), 1),
    ] {
        let (epochs, counts, _) = between(&spoilt);
        assert_eq!((epochs, counts.errors), (2, errors), "{}", String::from_utf8_lossy(&spoilt));
    }
}

/// Listening may begin anywhere.
#[test]
fn what_was_under_way_is_no_error() {
    let log = text(&[&gga("GP", 0, 1), GSA_3D, &gga("GP", 1, 1), GSA_3D, &gga("GP", 2, 1)]);
    for from in 0..90 {
        let (epochs, sentences) = heard(&log.as_bytes()[from..]);
        assert_eq!(sentences.counts().errors, 0, "from {from}");
        assert!(!epochs.is_empty());
    }
}

/// The simulated receivers' logs with bytes altered, taken out and put in. The result is the same for every way to cut
/// them, and contains no impossible value. The test is seeded; a failure names log and round.
#[test]
fn spoilt_logs_say_nothing_impossible() {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../../hw-mocks/receivers");
    let mut logs: Vec<_> = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    logs.retain(|path| path.extension().is_some_and(|end| end == "nmea" || end == "bin" || end == "ubx"));
    logs.sort();
    assert!(logs.len() > 30);
    let mut state = 0x2545_f491_4f6c_dd1d_u64;
    let mut dice = move |below: usize| {
        // xorshift64*.
        state ^= state >> 12;
        state ^= state << 25;
        state ^= state >> 27;
        (state.wrapping_mul(0x2545_f491_4f6c_dd1d) >> 33) as usize % below
    };
    for path in logs {
        let log = std::fs::read(&path).unwrap();
        for round in 0..6 {
            let from = dice(log.len() / 2);
            let mut bytes: Vec<u8> = log[from..].iter().take(2500).copied().collect();
            for _ in 0..=dice(8) {
                let at = dice(bytes.len());
                match dice(4) {
                    0 => bytes[at] ^= 1 << dice(8),
                    1 => drop(bytes.drain(at..(at + 40).min(bytes.len()))),
                    2 => bytes.insert(at, [0xd3, 0xb5, 0xa0, 0x10, b'$', b'#', 0xaa, b'\\'][dice(8)]),
                    _ => bytes.insert(at, dice(256) as u8),
                }
            }
            let (epochs, _) = heard(&bytes);
            for epoch in epochs {
                let within = |angle: Option<f64>, most: f64| angle.is_none_or(|angle| angle.abs() <= most);
                let right = within(epoch.latitude_deg, 90.0) && within(epoch.longitude_deg, 180.0);
                assert!(right && epoch.hdop.is_none_or(|hdop| hdop >= 0.0), "{} {round}: {epoch:?}", path.display());
            }
        }
    }
}
