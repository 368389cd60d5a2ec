//! No command writes what a person asks for where only a station writes: it would be a finding for ever.

use std::fs;
use std::os::unix::fs::symlink;
use std::path::Path;

use gnc_tests::Place;

use super::{STATION, check};

const PASSING: &str = "name = \"io\"\nversion = \"1\"\n[[item]]\nid = \"io\"\nlimits.wrong_reads = \"<= 0\"\n";

/// All that stands in a folder, by its paths.
fn all(folder: &Path) -> Vec<String> {
    let mut found = Vec::new();
    for entry in fs::read_dir(folder).expect("a folder") {
        let path = entry.expect("an entry").path();
        found.push(path.to_string_lossy().into_owned());
        if path.is_dir() && !path.is_symlink() {
            found.extend(all(&path));
        }
    }
    found.sort();
    found
}

#[test]
fn nothing_is_written_among_runs() {
    let place = Place::new(STATION);
    place.write("p.toml", PASSING);
    place.write("t.csv", "x\n1\n2\n3\n");
    check(&place.run(["--auto", "p.toml", "--sim", "--sim-speed", "max", "--serial-number", "T-1"]), 0, &[]);
    let run = place.runs().remove(0);
    let shown = run.to_string_lossy().into_owned();
    symlink(&run, place.path().join("link")).expect("a link");
    let day = run.ancestors().nth(2).expect("a day").to_string_lossy().into_owned();
    let before = all(place.path());
    let in_run = format!("lies in the folder of the run {shown} and would be a finding");
    let in_day = format!("lies among the runs of {day} and would be a finding");
    let counter = "records/COUNTER would stand for the counter of the records";
    let places = [
        (format!("{shown}/more"), &*in_run),
        ("link/more".to_owned(), &in_run),
        ("link/../more".to_owned(), &in_day),
        (format!("{day}/T-2/more"), &in_day),
        ("records/2030-01-01".to_owned(), "lies among the runs of "),
        ("records/../records/COUNTER".to_owned(), "would stand for the counter of the records"),
        ("records/COUNTER".to_owned(), counter),
    ];
    for (path, why) in &places {
        let refused = |args: &[&str], option: &str| {
            let hint = match option {
                "--records" => {
                    "try: choose another folder with records = under [station] of the bench file or with --records"
                        .to_owned()
                }
                _ => format!("try: name a place outside of the records folder with {option}"),
            };
            check(&place.run(args.iter().copied()), 2, &[path, why, &hint]);
            assert_eq!(all(place.path()), before, "{args:?}");
        };
        refused(&["export", &shown, "--out", path], "--out");
        refused(&["records", "key", path], "FILE");
        refused(&["compute", "psd", "t.csv", "--column", "x", "--rate", "10", "--plot", path], "--plot");
        let auto = ["--auto", "p.toml", "--sim", "--sim-speed", "max", "--serial-number", "T-1"];
        refused(&[&auto[..], &["--junit", path]].concat(), "--junit");
        if path.contains("more") {
            refused(&["man", "--dir", path], "--dir");
            refused(&[&auto[..], &["--records", path]].concat(), "--records");
        }
    }
    // Without --out the tables come into this folder.
    let here = place.station(["export", &shown]).current_dir(&run).output().expect("the station");
    let said = String::from_utf8_lossy(&here.stderr);
    assert!(here.status.code() == Some(2) && said.contains(&in_run), "{said}");
    assert_eq!(all(place.path()), before);
    check(&place.run(["records", "verify"]), 0, &[]);
    // Beside the days there may be other things.
    check(&place.run(["records", "key", "records/station.key"]), 0, &[]);
    check(&place.run(["records", "verify"]), 0, &[]);
}
