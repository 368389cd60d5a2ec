use super::*;

#[test]
fn a_bench_file_is_read() {
    let text = r#"
[station]
id = "line-2"
records = "records"
key = "station.key"
trusted_keys = ["line-1.key.pub", "line-3.key.pub"]
[site]
name = "hall 3"
latitude = "39.9042 deg"
longitude = "116.4074 deg"
height = "0.044 km"
gravity = "9.80151 m/s^2"
field = "55 uT"
[socket]
port = "/dev/ttyUSB0"
rate = "921.6 kbit/s"
"#;
    let bench = BenchFile::read("bench.toml", text.into()).unwrap_or_else(|mistakes| panic!("{mistakes}"));
    assert_eq!((bench.station_id.as_str(), bench.records.as_deref()), ("line-2", Some("records")));
    assert_eq!(bench.key.as_deref(), Some("station.key"));
    assert_eq!(bench.trusted_keys, ["line-1.key.pub", "line-3.key.pub"]);
    let site = bench.site.unwrap();
    assert_eq!(site.place, Some(SitePlace { latitude_deg: 39.9042, longitude_deg: 116.4074, height_m: 44.0 }));
    assert_eq!((site.gravity_mps2, site.field_gauss), (Some(9.80151), Some(0.55)));
    assert_eq!(bench.socket, Some(TestSocket::Rs422 { port: "/dev/ttyUSB0".to_owned(), rate_bps: 921_600 }));
    let small = BenchFile::read("bench.toml", b"[station]\nid = \"a\"\n[socket]\nport = \"p\"".to_vec()).unwrap();
    assert_eq!(small.socket, Some(TestSocket::Rs422 { port: "p".to_owned(), rate_bps: DEFAULT_RATE_BPS }));
    assert_eq!(small.can, None);
}

#[test]
fn mistakes_of_a_bench_file() {
    let text = r#"
[sttion]
id = "line-2"
[site]
latitude = "91 deg"
longitude = "116.4074"
gravity = "1 g"
field = "9.8 m/s^2"
[socket]
prot = "/dev/ttyUSB0"
rate = "5 bit/s"
"#;
    insta::assert_snapshot!(BenchFile::read("bench.toml", text.into()).unwrap_err(), @r#"
    bench.toml:1:1: the table [station] is missing
     1 | 
       | ^
       = try: write [station] and id = "line-2" below it

    bench.toml:2:2: unknown key "sttion"
     2 | [sttion]
       |  ^^^^^^
       = try: did you mean "station"?

    bench.toml:4:2: the place of the antenna is incomplete
     4 | [site]
       |  ^^^^
       = try: write latitude, longitude and height

    bench.toml:5:12: latitude is 91 deg
     5 | latitude = "91 deg"
       |            ^^^^^^^^
       = try: it may be -90 deg to 90 deg

    bench.toml:6:13: "116.4074" has no unit
     6 | longitude = "116.4074"
       |             ^^^^^^^^^^
       = try: an angle is written in deg, rad

    bench.toml:8:9: "9.8 m/s^2" is an acceleration, and "field" is a magnetic field
     8 | field = "9.8 m/s^2"
       |         ^^^^^^^^^^^
       = try: a magnetic field is written in gauss, mgauss, T, mT, uT, nT

    bench.toml:9:2: "port" is missing
     9 | [socket]
       |  ^^^^^^
       = try: write port = "/dev/ttyUSB0" below [socket]

    bench.toml:10:1: unknown key "prot"
     10 | prot = "/dev/ttyUSB0"
        | ^^^^
        = try: did you mean "port"?

    bench.toml:11:8: rate is 5 bit/s
     11 | rate = "5 bit/s"
        |        ^^^^^^^^^
        = try: it may be a whole number from 1200 bit/s to 4000000 bit/s
    "#);
    let large = BenchFile::read("bench.toml", vec![b'#'; 100_000]).unwrap_err();
    insta::assert_snapshot!(large, @r#"
    "bench.toml" has more than 65536 bytes
      try: is this the right file?
    "#);
}

#[test]
fn the_fixture_is_read_or_has_stated_defaults() {
    let read = |fixture: &str| {
        let text = format!("[station]\nid = \"a\"\n{fixture}");
        BenchFile::read("bench.toml", text.into()).unwrap_or_else(|mistakes| panic!("{mistakes}")).site
    };
    assert_eq!(read(""), None);
    assert_eq!(BenchSite::fixture(read("").as_ref()), BenchImperfections::default());
    let known = BenchSite::fixture(
        read(
            "[fixture]\nmounting = [\"0.012 deg\", \"-0.6 deg\", \"1 deg\"]\nmounting_u = \"0.002 deg\"\nfield_u = \"50 nT\"\nboard_clock_u = \"5 ppm\"",
        )
        .as_ref(),
    );
    let mounting = known.mounting_rad.unwrap().map(f64::to_degrees);
    assert!(mounting.iter().zip([0.012, -0.6, 1.0]).all(|(read, written)| (read - written).abs() < 1e-12));
    assert!((known.mounting_u_rad.to_degrees() - 0.002).abs() < 1e-12 && (known.field_u_gauss - 0.5e-3).abs() < 1e-12);
    assert_eq!(known.ambient_u_gauss, BenchImperfections::default().ambient_u_gauss);
    assert_eq!((known.board_clock_u_ppm, BenchImperfections::default().board_clock_u_ppm), (Some(5.0), None));
}

/// Records keep what the bench file states. Records from before a key lack it.
#[test]
fn a_fixture_comes_back_from_a_record() {
    let known = BenchImperfections { board_clock_u_ppm: Some(5.0), ..BenchImperfections::default() };
    for fixture in [known, BenchImperfections::default()] {
        let text = serde_json::to_string(&fixture).unwrap();
        assert_eq!(text.contains("board_clock_u_ppm"), fixture.board_clock_u_ppm.is_some(), "{text}");
        assert_eq!(serde_json::from_str::<BenchImperfections>(&text).unwrap(), fixture);
    }
}

#[test]
fn mistakes_of_a_fixture() {
    let text = "[station]\nid = \"a\"\n[fixture]\nmounting = [\"0.1 deg\", \"7 deg\"]\nmounting_u = \"-1 deg\"\nfeld_u = \"1 uT\"\nambient_u = \"1 deg\"\nboard_clock_u = \"1 %\"\n";
    insta::assert_snapshot!(BenchFile::read("bench.toml", text.into()).unwrap_err(), @r#"
    bench.toml:4:12: mounting is not three angles about X, Y and Z
     4 | mounting = ["0.1 deg", "7 deg"]
       |            ^^^^^^^^^^^^^^^^^^^^
       = try: write three angles: mounting = ["0.01 deg", "-0.02 deg", "0 deg"]

    bench.toml:4:24: mounting is 7 deg
     4 | mounting = ["0.1 deg", "7 deg"]
       |                        ^^^^^^^
       = try: it may be -5 deg to 5 deg

    bench.toml:5:14: mounting_u is -1 deg
     5 | mounting_u = "-1 deg"
       |              ^^^^^^^^
       = try: it may be 0 deg to 5 deg

    bench.toml:6:1: unknown key "feld_u"
     6 | feld_u = "1 uT"
       | ^^^^^^
       = try: did you mean "field_u"?

    bench.toml:7:13: "1 deg" is an angle, and "ambient_u" is a magnetic field
     7 | ambient_u = "1 deg"
       |             ^^^^^^^
       = try: a magnetic field is written in gauss, mgauss, T, mT, uT, nT

    bench.toml:8:17: board_clock_u is 1 %
     8 | board_clock_u = "1 %"
       |                 ^^^^^
       = try: it may be 0 ppm to 1000 ppm
    "#);
}

fn small_bench() -> BenchFile {
    BenchFile::read("bench.toml", b"[station]\nid = \"a\"".to_vec()).unwrap()
}

#[test]
fn habits_of_a_bench_are_read() {
    let text = r#"
[station]
id = "a"
plan = "plans/functional.toml"
[operator]
required = true
name = "A. Chen"
[verdict]
bell = true
hook = ["./light.sh", "socket 1"]
hook_time = "0.5 min"
[screen]
pictures = "sixel"
[shift]
begins = ["22:00", "06:00", "14:00"]
"#;
    let bench = BenchFile::read("bench.toml", text.into()).unwrap_or_else(|mistakes| panic!("{mistakes}"));
    assert_eq!(bench.plan.as_deref(), Some("plans/functional.toml"));
    assert_eq!(bench.operator, OperatorHabit { required: true, name: Some("A. Chen".into()) });
    let hook = Hook { command: vec!["./light.sh".into(), "socket 1".into()], limit_s: 30.0 };
    assert_eq!(bench.verdict, VerdictHabit { bell: true, hook: Some(hook) });
    assert_eq!((bench.pictures, small_bench().pictures), (DrawPictures::Sixel, DrawPictures::Auto));
    assert_eq!(bench.shifts.iter().map(ToString::to_string).collect::<Vec<_>>(), ["06:00:00", "14:00:00", "22:00:00"]);
    let small = small_bench();
    assert_eq!((small.operator, small.verdict, small.shifts), Default::default());
}

#[test]
fn mistakes_of_habits() {
    let text = "[station]\nid = \"a\"\n[operator]\nrequired = \"yes\"\n[verdict]\nhook_time = \"0 s\"\nhok = [\"./light.sh\"]\n\
                [shift]\nbegins = [\"6:00\", \"06:00\", \"24:00\"]\n[screen]\npictures = \"sixels\"\n";
    insta::assert_snapshot!(BenchFile::read("bench.toml", text.into()).unwrap_err(), @r#"
    bench.toml:4:12: "required" is a text, and must be true or false
     4 | required = "yes"
       |            ^^^^^

    bench.toml:5:2: there is a hook_time and no hook
     5 | [verdict]
       |  ^^^^^^^
       = try: write hook = ["./light.sh"]: the program first, then its arguments

    bench.toml:6:13: hook_time is 0 s
     6 | hook_time = "0 s"
       |             ^^^^^
       = try: it may be 0.1 s to 600 s

    bench.toml:7:1: unknown key "hok"
     7 | hok = ["./light.sh"]
       | ^^^
       = try: did you mean "hook"?

    bench.toml:9:19: two shifts begin at 06:00
     9 | begins = ["6:00", "06:00", "24:00"]
       |                   ^^^^^^^
       = try: write each time once

    bench.toml:9:28: "24:00" is not a time of day
     9 | begins = ["6:00", "06:00", "24:00"]
       |                            ^^^^^^^
       = try: write begins = ["06:00", "14:00", "22:00"]

    bench.toml:11:12: "sixels" is no way to draw pictures
     11 | pictures = "sixels"
        |            ^^^^^^^^
        = try: write "auto", "kitty", "iterm2", "sixel" or "off"
    "#);
}

#[test]
fn scanner_and_pattern() {
    let text = "[station]\nid = \"a\"\nserial_number = \"SN-[0-9]{4}\"\n[scanner]\nport = \"/dev/ttyACM0\"\n";
    let bench = BenchFile::read("bench.toml", text.into()).unwrap();
    assert_eq!(bench.serial_number, SerialNumberPattern::new("SN-[0-9]{4}").ok());
    assert_eq!(bench.scanner, Some(ScannerSettings { port: "/dev/ttyACM0".to_owned(), rate_bps: 9600 }));
    let bench = BenchFile::read("bench.toml", format!("{text}rate = \"115200 bit/s\"").into()).unwrap();
    assert_eq!(bench.scanner.map(|scanner| scanner.rate_bps), Some(115_200));
    let text = r#"
[station]
id = "a"
serial_number = "SN-[0-9"
[socket]
port = "/dev/ttyUSB0"
[can]
port = "slcan:/dev/ttyACM0"
[scanner]
port = "/dev/ttyUSB0"
rate = "9600"
baud = 9600
"#;
    insta::assert_snapshot!(BenchFile::read("bench.toml", text.into()).unwrap_err(), @r#"
    bench.toml:4:17: the pattern "SN-[0-9" cannot be read: found unclosed character class
     4 | serial_number = "SN-[0-9"
       |                 ^^^^^^^^^
       = try: write a regular expression, like "SN-[0-9]{4}"

    bench.toml:10:8: the board is at "/dev/ttyUSB0" too
     10 | port = "/dev/ttyUSB0"
        |        ^^^^^^^^^^^^^^
        = try: name the port of the scanner; `gnc-station ports` lists the ports

    bench.toml:11:8: "9600" has no unit
     11 | rate = "9600"
        |        ^^^^^^
        = try: a bit rate is written in bit/s, kbit/s

    bench.toml:12:1: unknown key "baud"
     12 | baud = 9600
        | ^^^^
        = try: the keys are port, rate
    "#);
    let can = "[station]\nid = \"a\"\n[can]\nport = \"slcan:/dev/ttyACM0\"\n[scanner]\nport = \"/dev/ttyACM0\"\n";
    insta::assert_snapshot!(BenchFile::read("bench.toml", can.into()).unwrap_err(), @r#"
    bench.toml:6:8: the CAN bus is at "/dev/ttyACM0" too
     6 | port = "/dev/ttyACM0"
       |        ^^^^^^^^^^^^^^
       = try: name the port of the scanner; `gnc-station ports` lists the ports
    "#);
}
