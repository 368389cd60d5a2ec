//! The receiver: sentences with an independent checksum and parser, times to fix, positions against the truth, 1PPS.

use gnc_protocol::message::{GnssRestart, StreamStart, StreamStop};
use gnc_protocol::stream::PpsCapture;
use gnc_protocol::wire::Wire;
use hw_mocks::devices::nmea::civil;
use hw_mocks::devices::sky::{Satellite, dilution};

use crate::host::Host;

/// Runs the GNSS stream for this many bytes; returns the sentences without `$` and checksum, whole lines only.
fn sentences(host: &mut Host, bytes: u32) -> Vec<String> {
    host.frames.clear();
    host.ask(&StreamStart { stream: 2, rate_hz: 0, count: bytes, samples_per_frame: 0 });
    let text = loop {
        let frames = host.streamed(2);
        let mut text = String::new();
        for frame in &frames {
            assert_eq!((frame.head.first as usize, frame.head.dropped), (text.len(), 0));
            assert_eq!(usize::from(frame.head.count), frame.samples.len());
            text.push_str(std::str::from_utf8(&frame.samples).unwrap());
        }
        if text.len() == bytes as usize {
            break text;
        }
        host.run_until(|frame| frame.header.kind == gnc_protocol::Kind::Stream);
    };
    assert_eq!(host.ask(&StreamStop { stream: 2 }).produced, bytes);
    let whole = text.rsplit_once("\r\n").unwrap().0;
    whole.split("\r\n").map(checked).collect()
}

/// NMEA 0183: the exclusive or of all characters between `$` and `*`, in two hexadecimal digits.
fn checked(sentence: &str) -> String {
    assert!(sentence.len() <= 80, "82 with its end: {sentence}");
    let (body, checksum) = sentence.strip_prefix('$').unwrap().split_once('*').unwrap();
    let mut sum = 0_u8;
    for byte in body.as_bytes() {
        sum ^= byte;
    }
    assert_eq!(format!("{sum:02X}"), checksum, "{sentence}");
    body.to_owned()
}

fn degrees(field: &str, digits: usize) -> f64 {
    field[..digits].parse::<f64>().unwrap() + field[digits..].parse::<f64>().unwrap() / 60.0
}

/// Board time at which a fix was first reported, and whether the time of day was known before it.
fn time_to_fix_s(host: &mut Host, start: u8) -> (f64, bool) {
    host.ask(&GnssRestart { start });
    let restarted_us = host.bench.truth().board_time_us;
    host.frames.clear();
    host.ask(&StreamStart { stream: 2, rate_hz: 0, count: 0, samples_per_frame: 0 });
    let mut time_before = false;
    let fix_us = loop {
        host.run_until(|frame| frame.header.kind == gnc_protocol::Kind::Stream);
        let mut fix = None;
        for frame in host.streamed(2) {
            let text = String::from_utf8_lossy(&frame.samples).into_owned();
            let Some((_, tail)) = text.split_once("$GPRMC,") else { continue };
            let fields: Vec<&str> = tail.split(',').collect();
            match fields[1] {
                "A" => fix = fix.or(Some(frame.head.board_time_us)),
                _ => time_before |= !fields[0].is_empty(),
            }
        }
        if let Some(fix) = fix {
            break fix;
        }
    };
    host.ask(&StreamStop { stream: 2 });
    ((fix_us - restarted_us) as f64 * 1e-6, time_before)
}

#[test]
fn starts_take_the_time_of_their_kind() {
    let mut host = Host::powered("good");
    // An epoch every 0.2 s, and 0.06 s until its sentences are out, add to the receiver's own time.
    for (start, shortest_s, longest_s) in [(1, 1.1, 2.1), (2, 17.9, 24.3), (3, 24.9, 32.3)] {
        let (span_s, time_before) = time_to_fix_s(&mut host, start);
        assert!((shortest_s..longest_s).contains(&span_s), "start {start}: {span_s}");
        assert!(time_before);
    }
}

#[test]
fn positions_lie_round_the_antenna() {
    let mut host = Host::powered("good");
    time_to_fix_s(&mut host, 1);
    let site = host.bench.truth().site;
    let sentences = sentences(&mut host, 300_000);
    let mut errors = Vec::new();
    for gga in sentences.iter().filter(|s| s.starts_with("GPGGA")) {
        let f: Vec<&str> = gga.split(',').collect();
        assert_eq!((f[3], f[5], f[6]), ("N", "E", "1"));
        assert_eq!(f[7], "10", "satellites above the mask");
        let north_m = (degrees(f[2], 2) - site.latitude_deg) * 110_930.0;
        let east_m = (degrees(f[4], 3) - site.longitude_deg) * 111_320.0 * site.latitude_deg.to_radians().cos();
        // Ellipsoidal height is the height above the sea plus the geoid's.
        let up_m = f[9].parse::<f64>().unwrap() + f[11].parse::<f64>().unwrap() - site.height_m;
        errors.push((north_m.hypot(east_m), up_m.abs()));
    }
    assert!(errors.len() > 500);
    let rms = |pick: fn(&(f64, f64)) -> f64| {
        (errors.iter().map(|e| pick(e).powi(2)).sum::<f64>() / errors.len() as f64).sqrt()
    };
    // 2.2 m in each of two axes, 3.8 m up; two minutes are only a few correlation times.
    assert!((0.5..6.0).contains(&rms(|e| e.0)), "{}", rms(|e| e.0));
    assert!((0.5..9.0).contains(&rms(|e| e.1)), "{}", rms(|e| e.1));
    let speeds: Vec<f64> = sentences
        .iter()
        .filter(|s| s.starts_with("GPRMC"))
        .map(|s| s.split(',').nth(7).unwrap().parse::<f64>().unwrap() * 1852.0 / 3600.0)
        .collect();
    let rms_mps = (speeds.iter().map(|v| v * v).sum::<f64>() / speeds.len() as f64).sqrt();
    assert!((rms_mps / 0.0424 - 1.0).abs() < 0.2, "{rms_mps}");
}

#[test]
fn epochs_follow_each_other_at_5_hz_and_tell_the_date() {
    let mut host = Host::powered("good");
    time_to_fix_s(&mut host, 1);
    let rmc: Vec<String> = sentences(&mut host, 20_000).into_iter().filter(|s| s.starts_with("GPRMC")).collect();
    let hundredths = |s: &String| {
        let time = s.split(',').nth(1).unwrap().replace('.', "").parse::<u64>().unwrap();
        (time / 1_000_000 * 3600 + time / 10_000 % 100 * 60) * 100 + time % 10_000
    };
    assert!(rmc.windows(2).all(|pair| hundredths(&pair[1]) - hundredths(&pair[0]) == 20));
    assert!(rmc.iter().all(|s| s.split(',').nth(9) == Some("221126")));
    let truth_s = host.bench.truth().utc_s % 86_400.0;
    let last_s = hundredths(rmc.last().unwrap()) as f64 / 100.0;
    assert!((0.0..0.5).contains(&(truth_s - last_s)), "{truth_s} {last_s}");
}

#[test]
fn without_a_sky_there_is_no_fix_no_satellite_and_no_pulse() {
    let mut host = Host::powered("no-sky");
    host.ask(&StreamStart { stream: 3, rate_hz: 0, count: 0, samples_per_frame: 0 });
    let sentences = sentences(&mut host, 20_000);
    let field = |kind: &str, index: usize| {
        let of_kind = sentences.iter().filter(|s| s.starts_with(kind));
        let mut values: Vec<String> = of_kind.map(|s| s.split(',').nth(index).unwrap().to_owned()).collect();
        values.dedup();
        values
    };
    assert_eq!(field("GPGGA", 6), ["0"]);
    assert_eq!(field("GPGGA", 2), [""]);
    assert_eq!(field("GPRMC", 2), ["V"]);
    assert_eq!(field("GPGSA", 2), ["1"]);
    assert_eq!(field("GPGSV", 3), ["00"]);
    assert!(host.streamed(3).is_empty());
}

/// True seconds by the board's clock, which is 3 ppm fast, on its 10 ns grid, within five times its scatter of 15 ns.
#[test]
fn pulses_come_each_second_by_the_boards_clock() {
    let mut host = Host::powered("good");
    time_to_fix_s(&mut host, 1);
    host.ask(&StreamStart { stream: 3, rate_hz: 0, count: 20, samples_per_frame: 0 });
    while host.streamed(3).len() < 20 {
        host.run_until(|frame| frame.header.kind == gnc_protocol::Kind::Stream);
    }
    let captures: Vec<u64> =
        host.streamed(3).iter().map(|frame| PpsCapture::from_payload(&frame.samples).unwrap().board_time_ns).collect();
    assert!(captures.iter().all(|ns| ns % 10 == 0));
    for pair in captures.windows(2) {
        let span_ns = (pair[1] - pair[0]) as f64;
        assert!((span_ns - 1_000_003_000.0).abs() < 5.0 * 15.0 * 1.5 + 20.0, "{span_ns}");
    }
}

#[test]
fn faults_are_in_the_sky_and_the_wires() {
    let mut repeated = Host::powered("gnss-wrong-place");
    time_to_fix_s(&mut repeated, 1);
    let latitude_deg = repeated.bench.truth().site.latitude_deg;
    let gga = sentences(&mut repeated, 3000).into_iter().find(|s| s.starts_with("GPGGA")).unwrap();
    let north_m = (degrees(gga.split(',').nth(2).unwrap(), 2) - latitude_deg) * 110_930.0;
    assert!((north_m - 500.0).abs() < 15.0, "{north_m}");
    let mut lost = Host::powered("gnss-loses-fix");
    time_to_fix_s(&mut lost, 1);
    let quality: Vec<String> = sentences(&mut lost, 10_000)
        .iter()
        .filter(|s| s.starts_with("GPGGA"))
        .map(|s| s.split(',').nth(6).unwrap().to_owned())
        .collect();
    assert_eq!((quality.first().unwrap().as_str(), quality.last().unwrap().as_str()), ("1", "0"));
}

/// Three satellites on the horizon 120 deg apart and one overhead: worked out by hand, HDOP = VDOP = 2/sqrt(3).
#[test]
fn dilution_of_a_known_geometry() {
    let at = |elevation_deg, azimuth_deg| Satellite { prn: 1, elevation_deg, azimuth_deg, cn0_dbhz: 40.0 };
    let sky = [at(0.0, 10.0), at(0.0, 130.0), at(0.0, 250.0), at(90.0, 0.0)];
    let found = dilution(&sky).unwrap();
    let expected = 2.0 / 3.0_f64.sqrt();
    assert!((found.hdop - expected).abs() < 1e-9 && (found.vdop - expected).abs() < 1e-9);
    assert!((found.pdop - (8.0_f64 / 3.0).sqrt()).abs() < 1e-9);
    assert!(dilution(&sky[..3]).is_none());
}

#[test]
fn dates_of_known_days() {
    assert_eq!(civil(0), (1970, 1, 1));
    assert_eq!(civil(11_016), (2000, 2, 29));
    assert_eq!(civil(20_779), (2026, 11, 22));
    assert_eq!(civil(-1), (1969, 12, 31));
}
