//! Errors and findings of the command line in the language of the locale.

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

/// What the station finds, as a person and as a program reads it.
fn found(locale: &str, args: &[&str]) -> String {
    let place = Place::new(STATION);
    place.write("bench.toml", "[station]\nid = \"x\"\n[socket]\nport = \"/dev/ttyNOWHERE\"\nrate = \"921600 bit/s\"\n");
    place.write("still.csv", "t,w\n0,1\n1,2\n2,1\n3,4\n4,1\n5,2\n6,1\n7,4\n");
    let out = place.station(args).env("LC_ALL", locale).env("TERM", "xterm").output().expect("the station");
    String::from_utf8(out.stdout).expect("UTF-8")
}

/// The text without figures: the clock goes on between two looks, and the disk fills.
fn without_figures(text: &str) -> String {
    text.chars().filter(|character| !character.is_ascii_digit()).collect()
}

/// Standard output has the language of the locale where a person reads it, and none where a program does.
#[test]
fn findings_are_in_the_language_of_the_locale() {
    let plan = gnc_tests::functional_plan();
    let plan = plan.to_str().expect("UTF-8");
    let stability: &[&str] = &["compute", "stability", "still.csv", "--column", "w", "--block", "2", "--rate", "1"];
    let for_people: [&[&str]; 5] = [
        &["doctor"],
        &["plan", "check", plan],
        &["plan", "check", "gone.toml"],
        &["plan", "check", plan, "--part", "A"],
        stability,
    ];
    for (locale, of_it) in [("zh_CN.UTF-8", '\u{4e00}'..='\u{9fff}'), ("ru_RU.UTF-8", '\u{400}'..='\u{4ff}')] {
        for args in for_people {
            let (english, other) = (found("C", args), found(locale, args));
            assert!(english.is_ascii() && !english.is_empty(), "{english}");
            assert!(english.lines().count() == other.lines().count(), "{english}{other}");
            assert!(other.chars().any(|c| of_it.contains(&c)), "{locale}: {other}");
            // A terminal that cannot show the language gets English.
            assert_eq!(without_figures(&found("zh_CN.GB18030", args)), without_figures(&english));
        }
        let json = [stability, &["--json"]].concat();
        assert_eq!(found(locale, &json), found("C", &json), "programs read the same in every language");
        assert!(found("C", &json).starts_with('{'));
    }
}
