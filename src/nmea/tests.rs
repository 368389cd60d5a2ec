//! Sentences of real receivers, kind by kind. The checksums were made by hand and by the peers of their protocols.

use chrono::NaiveDate;
use nmea::{ParseResult, parse_str};

use super::*;

mod frames;

/// A sentence with its checksum.
fn sentence(body: &str) -> String {
    let sum = body.bytes().fold(0, |sum, byte| sum ^ byte);
    format!("${body}*{sum:02X}\r\n")
}

fn text(bodies: &[&str]) -> String {
    bodies.iter().map(|body| sentence(body)).collect()
}

/// The result for some bytes. It is the same for every way to cut them.
fn heard(bytes: &[u8]) -> (Vec<Epoch>, Sentences) {
    let listen = |piece: usize| {
        let mut sentences = Sentences::default();
        let mut epochs: Vec<Epoch> = bytes.chunks(piece).flat_map(|piece| sentences.push(piece)).collect();
        epochs.extend(sentences.finish());
        (epochs, sentences)
    };
    let (epochs, sentences) = listen(bytes.len().max(1));
    for piece in [1, 7, 492] {
        let (again, counts) = listen(piece);
        assert_eq!((&again, counts.counts()), (&epochs, sentences.counts()), "in pieces of {piece}");
    }
    (epochs, sentences)
}

fn of(bodies: &[&str]) -> (Vec<Epoch>, Sentences) {
    heard(text(bodies).as_bytes())
}

/// A GGA of a second with this quality.
fn gga(talker: &str, second: u32, quality: u32) -> String {
    format!("{talker}GGA,1200{second:02}.00,3413.92600,N,10854.92400,E,{quality},08,1.0,442.0,M,-30.0,M,,")
}

fn rmc(talker: &str, second: u32, status: char) -> String {
    format!("{talker}RMC,1200{second:02},{status},3413.926,N,10854.924,E,0.5,,221126,,")
}

const GSA_3D: &str = "GPGSA,A,3,02,05,07,11,,,,,,,,,1.8,1.0,1.5";

/// The fix of each epoch; the last epoch is not over yet.
fn fixes(bodies: &[String]) -> Vec<Fix> {
    let bodies: Vec<&str> = bodies.iter().map(String::as_str).collect();
    let (epochs, sentences) = of(&bodies);
    assert_eq!(sentences.counts().errors, 0, "{:?}", sentences.fault());
    assert_eq!(sentences.counts().repeated, 0);
    epochs.iter().map(|epoch| epoch.fix).collect()
}

/// The only fault of some bodies.
fn fault(bodies: &[&str]) -> String {
    let (_, sentences) = of(bodies);
    assert_eq!((sentences.counts().errors, sentences.counts().faults), (1, 1), "{bodies:?}");
    sentences.fault().map(ToString::to_string).unwrap_or_default()
}

#[test]
fn an_epoch_is_all_that_is_said_of_a_time() {
    let (epochs, _) = of(&[&rmc("GP", 0, 'A'), &gga("GP", 0, 1), GSA_3D, &rmc("GP", 1, 'A')]);
    let [epoch] = &epochs[..] else { panic!("{epochs:?}") };
    assert_eq!(epoch.fix, Fix::ThreeD);
    assert!((epoch.latitude_deg.unwrap() - (34.0 + 13.926 / 60.0)).abs() < 1e-12);
    assert!((epoch.longitude_deg.unwrap() - (108.0 + 54.924 / 60.0)).abs() < 1e-12);
    assert_eq!((epoch.altitude_m, epoch.height_m), (Some(442.0), Some(412.0)));
    // The speed is half a knot.
    assert!((epoch.ground_speed_mps.unwrap() - 0.257_222).abs() < 1e-6);
    assert_eq!((epoch.satellites_used, epoch.hdop, epoch.vdop), (Some(8), Some(1.0), Some(1.5)));
    assert_eq!(epoch.date, NaiveDate::from_ymd_opt(2026, 11, 22));
}

/// 6, 7 and 8 are not a fix by satellites; NovAtel uses 9 for satellite corrections.
#[test]
fn the_quality_says_what_a_fix_is_made_of() {
    let expected = [
        (0, Fix::None),
        (1, Fix::ThreeD),
        (2, Fix::ThreeD),
        (3, Fix::ThreeD),
        (4, Fix::ThreeD),
        (5, Fix::ThreeD),
        (6, Fix::Estimated),
        (7, Fix::Manual),
        (8, Fix::Simulated),
        (9, Fix::ThreeD),
    ];
    for (quality, fix) in expected {
        assert_eq!(fixes(&[gga("GN", 0, quality), GSA_3D.into(), gga("GN", 1, quality)]), [fix], "{quality}");
    }
}

#[test]
fn without_gsa_the_dimensions_are_unknown() {
    assert_eq!(fixes(&[gga("GP", 0, 4), gga("GP", 1, 4), gga("GP", 2, 0)]), [Fix::DimensionsUnknown; 2]);
}

/// A GSA counts for the usual time between two GSA, and no longer.
#[test]
fn gsa_is_carried_to_the_next_one() {
    let said = |seconds: u32, has_gsa: fn(u32) -> bool| -> Vec<Fix> {
        let each = (0..seconds).flat_map(|second| {
            let gsa = has_gsa(second).then(|| GSA_3D.to_owned());
            [Some(gga("GP", second, 1)), gsa].into_iter().flatten()
        });
        fixes(&each.collect::<Vec<_>>())
    };
    assert_eq!(said(22, |second| second % 5 == 0), [Fix::ThreeD; 21]);
    // From the eleventh second on no GSA comes. The carried one serves until the next is missed.
    let stopped = said(20, |second| second % 5 == 0 && second <= 10);
    assert_eq!(stopped[..15], [Fix::ThreeD; 15]);
    assert_eq!(stopped[15..], [Fix::DimensionsUnknown; 4]);
    // If each epoch has a GSA, a missing GSA is noticed at once.
    let missed = said(5, |second| second < 2);
    assert_eq!(missed, [Fix::ThreeD, Fix::ThreeD, Fix::DimensionsUnknown, Fix::DimensionsUnknown]);
    // Before the first GSA the dimensions are unknown.
    let late = said(6, |second| second == 3);
    assert_eq!(late[..3], [Fix::DimensionsUnknown; 3]);
    assert_eq!(late[3..], [Fix::ThreeD; 2]);
}

/// A broken GSA is an error of the line, not a lost fix.
#[test]
fn a_broken_gsa_is_bridged_once() {
    let mut log = String::new();
    for second in 0..6 {
        log += &sentence(&gga("GP", second, 1));
        log += &if second == 3 { sentence(GSA_3D).replace("02", "03") } else { sentence(GSA_3D) };
    }
    let (epochs, sentences) = heard(log.as_bytes());
    assert_eq!(epochs.iter().map(|epoch| epoch.fix).collect::<Vec<_>>(), [Fix::ThreeD; 5]);
    assert_eq!((sentences.counts().errors, sentences.counts().faults), (1, 0));
}

/// u-blox M8 without and F9 with the number of the system; a system without a satellite; a talker for each system.
#[test]
fn several_gsa_are_one() {
    let many = [
        vec![
            "GNGSA,A,3,01,11,31,14,22,32,04,25,03,,,,1.56,0.91,1.27",
            "GNGSA,A,3,67,83,76,82,68,,,,,,,,1.56,0.91,1.27",
        ],
        vec![
            "GNGSA,A,3,08,10,23,27,32,,,,,,,,1.05,0.69,1.27,1",
            "GNGSA,A,3,08,10,69,84,83,,,,,,,,1.05,0.69,1.27,2",
            "GNGSA,A,3,21,34,19,12,,,,,,,,,1.05,0.69,1.27,4",
            "GNGSA,A,1,,,,,,,,,,,,,99.9,99.9,99.9,5",
        ],
        vec!["GPGSA,A,3,01,02,03,04,05,06,07,08,09,10,11,12,1.5,0.9,1.27", "GPGSA,A,3,13,14,,,,,,,,,,,1.5,0.9,1.27"],
        vec![
            "GLGSA,A,1,,,,,,,,,,,,,,,",
            "GPGSA,A,3,01,02,03,04,05,06,07,08,09,10,,,1.5,0.9,1.27",
            "BDGSA,A,2,1,2,3,4,,,,,,,,,,,",
        ],
        // One sentence has room for twenty-four satellites, without the system and with it.
        vec!["GPGSA,A,3,1,2,3,4,5,6,7,8,9,10,11,12,13,14,,,,,,,,,,,1.5,0.9,1.27,1"],
        vec!["GPGSA,A,3,1,2,3,4,5,6,7,8,9,10,11,12,13,14,,,,,,,,,,,1.5,0.9,1.27"],
    ];
    for gsa in &many {
        let (first, second) = (gga("GN", 0, 1), gga("GN", 1, 1));
        // The same sentence twice without an epoch between is not another page.
        let bodies: Vec<&str> = [&first[..]]
            .into_iter()
            .chain(gsa.iter().copied())
            .chain(gsa.iter().copied())
            .chain([&second[..]])
            .collect();
        let (epochs, sentences) = of(&bodies);
        assert_eq!(sentences.counts().errors, 0, "{gsa:?} {:?}", sentences.fault());
        assert_eq!(
            (epochs[0].fix, epochs[0].satellites_used, epochs[0].vdop),
            (Fix::ThreeD, Some(14), Some(1.27)),
            "{gsa:?}"
        );
    }
}

#[test]
fn gsa_of_two_dimensions_needs_no_dilution() {
    for gsa in
        ["GPGSA,A,2,02,05,07,,,,,,,,,,,3.2,", "GPGSA,M,2,02,05,07,,,,,,,,,,4.1,3.2", "GPGSA,A,2,2,5,7,,,,,,,,,,,,"]
    {
        assert_eq!(fixes(&[gga("GP", 0, 1), gsa.into(), gga("GP", 1, 1)]), [Fix::TwoD], "{gsa}");
    }
}

#[test]
fn gga_of_each_system_is_one_epoch() {
    let (gps, glonass) = (gga("GP", 0, 1), gga("GL", 0, 0));
    let next = gga("GP", 1, 1);
    let (epochs, sentences) =
        of(&[&glonass, &gps, GSA_3D, "GNGGA,120000.00,3413.0,N,10854.0,E,1,14,0.5,440.0,M,-30.0,M,,", &next]);
    assert_eq!((epochs.len(), sentences.counts().repeated), (1, 0));
    // The combined solution counts.
    assert_eq!((epochs[0].fix, epochs[0].satellites_used, epochs[0].hdop), (Fix::ThreeD, Some(14), Some(0.5)));
    // Without a combined solution, the first solution with a fix counts.
    let (epochs, sentences) = of(&[&glonass, &gps, GSA_3D, &next]);
    assert_eq!((epochs.len(), epochs[0].fix, sentences.counts().repeated), (1, Fix::ThreeD, 0));
}

#[test]
fn the_same_moment_again_is_none_of_its_own() {
    let first = gga("GP", 0, 1);
    let (epochs, sentences) = of(&[&first, GSA_3D, &first, GSA_3D, &first, GSA_3D]);
    assert_eq!((epochs.len(), sentences.counts().repeated), (1, 1));
    // Before the first fix a receiver's clock may stand still.
    let none = gga("GP", 0, 0);
    let (epochs, sentences) = of(&[&none, &none, &none, &gga("GP", 1, 1)]);
    assert_eq!((epochs.len(), sentences.counts().repeated), (3, 0));
}

/// The time of day is empty until the receiver knows it. The first epoch that knows it does not count as repeated.
#[test]
fn time_begins_at_some_epoch() {
    let unknown = ["GPRMC,,V,,,,,,,,,,N", "GPGGA,,,,,,0,00,99.99,,M,,M,,", "GPGSA,A,1,,,,,,,,,,,,,99.99,99.99,99.99"];
    let (first, second) = ([rmc("GP", 0, 'A'), gga("GP", 0, 1)], [rmc("GP", 1, 'A'), gga("GP", 1, 1)]);
    let bodies: Vec<&str> = unknown.into_iter().chain(unknown).collect();
    let bodies: Vec<&str> =
        bodies.into_iter().chain(first.iter().map(String::as_str)).chain(second.iter().map(String::as_str)).collect();
    let (epochs, sentences) = of(&bodies);
    assert_eq!((epochs.len(), sentences.counts()), (3, Counts::default()));
    assert!(epochs[2].has_fix() && epochs[2].date.is_some());
}

#[test]
fn gns_is_a_fix_by_its_letters() {
    let gns = |second: u32, modes: &str| {
        format!("GNGNS,1200{second:02}.00,3413.92600,N,10854.92400,E,{modes},10,0.90,442.0,-30.0,,,V")
    };
    for (modes, fix) in [
        ("AAN", Fix::ThreeD),
        ("NA", Fix::ThreeD),
        ("RRNN", Fix::ThreeD),
        ("DAAANN", Fix::ThreeD),
        ("A", Fix::ThreeD),
        ("NNNN", Fix::None),
        ("EE", Fix::Estimated),
        ("M", Fix::Manual),
        ("SSS", Fix::Simulated),
        ("", Fix::None),
    ] {
        let bodies = [gns(0, modes), GSA_3D.to_owned(), gns(1, modes)];
        assert_eq!(fixes(&bodies), [fix], "{modes}");
    }
    let (epochs, _) = of(&[&gns(0, "AAN"), "GPGNS,120000.00,,,,,,5,,,,5.2,23", &gns(1, "AAN")]);
    assert_eq!((epochs[0].height_m, epochs[0].satellites_used), (Some(412.0), Some(10)));
}

/// RMC, or GLL, of a receiver that sends no GGA. The first epoch may have been under way.
#[test]
fn a_receiver_may_say_rmc_or_gll_alone() {
    let each = |body: &dyn Fn(u32) -> String| fixes(&(0..4).map(body).collect::<Vec<_>>());
    assert_eq!(each(&|second| rmc("GP", second, 'A')), [Fix::DimensionsUnknown; 2]);
    assert_eq!(each(&|second| rmc("GP", second, 'V')), [Fix::None; 2]);
    let gll = |mode: &'static str| move |second| format!("GPGLL,3413.926,N,10854.924,E,1200{second:02},{mode}");
    assert_eq!(each(&gll("A")), [Fix::DimensionsUnknown; 2]);
    assert_eq!(each(&gll("A,E")), [Fix::Estimated; 2]);
    assert_eq!(each(&gll("V,N")), [Fix::None; 2]);
    // Beside GGA, RMC and GLL make no epoch.
    let (epochs, _) = of(&[&gga("GP", 0, 1), &rmc("GP", 1, 'A'), &gga("GP", 2, 1), &gll("A")(3), &gga("GP", 4, 1)]);
    assert_eq!(epochs.len(), 2);
}

/// Times pass midnight and a leap second, come at 10 Hz, differ in their decimals, or are empty until known.
#[test]
fn epochs_follow_the_time_of_day() {
    let at = |time: &str| format!("GPGGA,{time},3413.9,N,10854.9,E,1,08,1.0,442.0,M,-30.0,M,,");
    let times = ["235958", "235959.0", "235960", "000000.00", "000001.000", "000001.2", "000001.4000"];
    assert_eq!(fixes(&times.map(at)).len(), times.len() - 1);
    assert_eq!(fixes(&["235959.80", "240000.00", "000000.20"].map(at)).len(), 2);
    let ten_hz: Vec<String> = (0..30).map(|tenth| at(&format!("1200{:02}.{}", tenth / 10, tenth % 10))).collect();
    assert_eq!(fixes(&ten_hz).len(), 29);
    let bodies = [
        "GPGGA,120000.199,3413.9,N,10854.9,E,1,08,1.0,442.0,M,-30.0,M,,",
        "GPRMC,120000.19,A,3413.9,N,10854.9,E,1.0,,010127,,,A,V",
    ];
    let (epochs, _) = of(&[bodies[0], bodies[1], &at("120001")]);
    assert_eq!(epochs[0].date, NaiveDate::from_ymd_opt(2027, 1, 1));
    let unknown = "GPGGA,,,,,,0,00,99.99,,,,,,";
    assert_eq!(fixes(&[unknown, unknown, unknown].map(str::to_owned)), [Fix::None; 2]);
}

#[test]
fn places_at_the_ends_of_the_earth() {
    for (place, expected) in [
        ("9000.0000,S,00000.0000,E", (-90.0, 0.0)),
        ("0000.0000,N,18000.0000,W", (0.0, -180.0)),
        ("0000,N,17959.9999,E", (0.0, 179.999_998_333)),
    ] {
        let bodies = [format!("GPGGA,120000,{place},1,08,1.0,-28.0,M,-106.0,M,,"), gga("GP", 1, 1)];
        let (epochs, _) = of(&[&bodies[0], &bodies[1]]);
        let found = (epochs[0].latitude_deg.unwrap(), epochs[0].longitude_deg.unwrap());
        assert!((found.0 - expected.0).abs() + (found.1 - expected.1).abs() < 1e-9, "{place}: {found:?}");
        assert_eq!(epochs[0].height_m, Some(-134.0));
    }
}

/// An empty field gives no value and is not an error.
#[test]
fn empty_fields_are_no_figures() {
    let (epochs, sentences) = of(&[
        "GPGGA,120000,3413.9,N,10854.9,E,1,,,442.0,M,,M,,",
        "GPRMC,120000,A,3413.9,N,10854.9,E,,,,,,A",
        "GPGGA,120001,3413.9,N,10854.9,E,1",
        "GPRMC,120001,V,,S,,W,,,141102,,",
        "GPRMC,120002,V,,,,,,,000000,,,N",
    ]);
    assert_eq!(epochs[0], Epoch { vdop: None, ..epochs[0].clone() });
    assert_eq!((epochs[0].altitude_m, epochs[0].height_m, epochs[0].hdop), (Some(442.0), None, None));
    assert_eq!((epochs[0].satellites_used, epochs[0].ground_speed_mps, epochs[0].date), (None, None, None));
    // The second epoch contradicts itself.
    assert_eq!(sentences.counts().errors, 1);
}

/// VTG and ZDA stand in for RMC.
#[test]
fn speed_and_date_have_other_sources() {
    let (first, next) = (gga("GN", 0, 1), gga("GN", 1, 1));
    let (epochs, _) = of(&[&first, "GNVTG,,T,,M,1.0,N,1.852,K,A", "GNZDA,120000.00,06,04,2019,00,00", &next]);
    assert!((epochs[0].ground_speed_mps.unwrap() - 0.514_444).abs() < 1e-6);
    assert_eq!(epochs[0].date, NaiveDate::from_ymd_opt(2019, 4, 6));
}

#[test]
fn what_cannot_be_is_named() {
    let place =
        |place: &str| fault(&[&format!("GPGGA,120000.00,{place},1,08,1.0,442.0,M,-30.0,M,,"), "GPTXT,01,01,02,x"]);
    assert_eq!(place("3473.926,N,10854.924,E"), "GGA: latitude `3473.926` has minutes of 60 or more");
    assert_eq!(place("3460.000,N,10854.924,E"), "GGA: latitude `3460.000` has minutes of 60 or more");
    assert_eq!(
        place("3413.926,N,1854.924,E"),
        "GGA: longitude `1854.924` has 4 digits before the point, and should have 5"
    );
    assert_eq!(place("9000.001,N,10854.924,E"), "GGA: latitude `9000.001` is beyond 90 deg");
    assert_eq!(place("3413.926,N,18000.010,E"), "GGA: longitude `18000.010` is beyond 180 deg");
    assert_eq!(place("3413.926,,10854.924,E"), "GGA: latitude has the hemisphere ``");
    assert_eq!(place("3413.926,N,-0854.924,E"), "GGA: longitude is `-0854.924`");
    let field = |hdop: &str, altitude: &str, geoid: &str| {
        fault(&[&format!("GPGGA,120000.00,3413.92,N,10854.92,E,1,08,{hdop},{altitude},M,{geoid},M,,"), GSA_3D])
    };
    assert_eq!(field("nan", "400.0", "12.0"), "GGA: HDOP is `nan`");
    assert_eq!(field("-1.0", "400.0", "12.0"), "GGA: HDOP is `-1.0`");
    assert_eq!(field("1.0", "nan", "12.0"), "GGA: altitude is `nan`");
    assert_eq!(field("1.0", "400.0", "-inf"), "GGA: geoid separation is `-inf`");
    assert_eq!(field("1.0", "1e39", "12.0"), "GGA: altitude is `1e39`");
    // The fault quotes only the beginning of the field.
    assert_eq!(field("1.0", &"9".repeat(40), "12.0"), format!("GGA: altitude is `{}`", "9".repeat(24)));
    assert_eq!(fault(&["GPGGA,126000,,,,,0,,,,,,,,", GSA_3D]), "GGA: time is `126000`");
    assert_eq!(fault(&["GPGGA,12000,,,,,0,,,,,,,,", GSA_3D]), "GGA: time is `12000`");
    assert_eq!(fault(&["GPGGA,120000,,"]), "GGA ends after 3 fields");
    assert_eq!(fault(&["GPGSA,A,4,1,2,3,4,,,,,,,,,1.8,1.1,1.2"]), "GSA: dimensions is `4`");
    assert_eq!(fault(&["GPGSA,A,3,1,2,3,4,,,,,,,,,1.8,1.1,nan"]), "GSA: VDOP is `nan`");
    assert_eq!(fault(&["GPRMC,120000.00,A,3413.92,N,10854.92,E,-inf,,010124,,,A"]), "RMC: speed is `-inf`");
    assert_eq!(fault(&["GPRMC,120000.00,A,3413.92,N,10854.92,E,0.0,,310226,,,A"]), "RMC: date is `310226`");
    let (fix, void, next) = (gga("GP", 0, 1), rmc("GP", 0, 'V'), gga("GP", 1, 1));
    assert_eq!(fault(&[&fix, GSA_3D, &void, &next]), "RMC is void where GGA of the same time says a fix");
}

/// Without a fix a receiver may send any place and date.
#[test]
fn what_is_void_is_not_believed() {
    let (_, sentences) = of(&[
        "GPRMC,120000,V,0000.0000,N,0000.0000,E,,,320015,,,N",
        "GPGGA,120000,9999.0000,N,0000.0000,E,0,00,99.9,,M,,M,,",
        "GPGGA,120001,9999.0000,N,0000.0000,E,0,00,99.9,,M,,M,,",
    ]);
    assert_eq!(sentences.counts(), Counts::default(), "{:?}", sentences.fault());
}

/// An impossible GGA gives no epoch, even if RMC is good: a receiver that sends GGA is judged by its GGA.
#[test]
fn an_impossible_solution_is_no_fix() {
    let bad = |second: u32| format!("GPGGA,1200{second:02}.00,3473.92600,N,10854.92400,E,1,10,0.9,442.0,M,-30.0,M,,");
    let bodies: Vec<String> = (0..5).flat_map(|second| [rmc("GP", second, 'A'), bad(second), GSA_3D.into()]).collect();
    let (epochs, sentences) = of(&bodies.iter().map(String::as_str).collect::<Vec<_>>());
    assert_eq!((epochs.len(), sentences.counts().faults), (0, 5));
}

/// Both read a sentence alike if both read it. The other list holds sentences that this version of the peer refuses.
#[test]
fn the_peer_reads_the_same() {
    let bodies = [
        "GPGGA,133605.5,5521.75946,N,03731.93769,E,2,11,0.84,142.3,M,-14.7,M,,",
        "GNGGA,085001.20,3454.3736140,S,13836.4871940,W,5,12,1.1,28.849,M,1.662,M,3.0,0120",
        "GPGGA,,,,,,0,00,99.99,,,,,,",
    ];
    for body in bodies {
        let whole = sentence(body);
        let Ok(ParseResult::GGA(peer)) = parse_str(whole.trim_end()) else { panic!("the peer refuses {body}") };
        let (epochs, _) = of(&[body, GSA_3D, &gga("GP", 0, 1)]);
        let close = |ours: Option<f64>, peer: Option<f64>| match (ours, peer) {
            (Some(ours), Some(peer)) => (ours - peer).abs() < 1e-5,
            (ours, peer) => ours.is_none() && peer.is_none(),
        };
        let epoch = &epochs[0];
        assert!(close(epoch.latitude_deg, peer.latitude) && close(epoch.longitude_deg, peer.longitude), "{body}");
        assert!(close(epoch.altitude_m, peer.altitude.map(f64::from)), "{body}");
        assert!(close(epoch.hdop, peer.hdop.map(f64::from)), "{body}");
        assert_eq!(epoch.fix.is_fix(), peer.fix_type.is_some_and(nmea::sentences::FixType::is_valid), "{body}");
    }
    let refused = [
        "GPGSA,A,2,02,05,07,,,,,,,,,,,3.2,",
        "GNGNS,120000.00,3413.926,N,10854.924,E,AAN,10,0.90,442.0,-30.0,,,V",
        "GPGGA,235960.00,3413.926,N,10854.924,E,1,08,1.0,442.0,M,-30.0,M,,",
        "GPRMC,143255.28,V,,S,,W,,,141102,,",
    ];
    for body in refused {
        assert!(parse_str(sentence(body).trim_end()).is_err(), "the peer reads {body} now: use it");
        assert_eq!(of(&[body]).1.counts().errors, 0, "{body}");
    }
}
