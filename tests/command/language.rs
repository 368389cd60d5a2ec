//! Errors of the command line in the language of the locale.

use gnc_tests::Place;

use super::STATION;

/// What the station says of a plan file that is not there and of a bench without a port.
fn said(locale: &str) -> [String; 2] {
    let place = Place::new(STATION);
    place.write("bench.toml", "[station]\nid = \"x\"\n[socket]\nport = \"/dev/ttyNOWHERE\"\n");
    let plan = gnc_tests::functional_plan();
    let plan = plan.to_str().expect("UTF-8");
    [["--auto", "gone.toml", "--sim"].as_slice(), &["--auto", plan, "--bench", "bench.toml"]].map(|args| {
        let mut command = place.station(args.iter().copied().chain(["--serial-number", "A"]));
        let out = command.env("LC_ALL", locale).env("TERM", "xterm").output().expect("the station");
        String::from_utf8(out.stderr).expect("UTF-8")
    })
}

#[test]
fn errors_and_hints_are_in_the_language_of_the_locale() {
    let english = said("C.UTF-8");
    for (locale, of_it) in [("zh_CN.UTF-8", '\u{4e00}'..='\u{9fff}'), ("ru_RU.UTF-8", '\u{400}'..='\u{4ff}')] {
        for (english, other) in english.iter().zip(said(locale)) {
            assert!(english.lines().count() == other.lines().count(), "{english}{other}");
            // Lines of a plan are shown as they are written.
            for line in other.lines().filter(|line| !line.contains(" | ")) {
                assert!(line.chars().any(|c| of_it.contains(&c)), "{locale}: {line}");
            }
        }
    }
    // A terminal that cannot show the language gets English.
    assert_eq!(said("zh_CN.GB18030"), english);
}
