//! `records`, `export` and `recompute` find the records where runs file them.

use std::fs;

use gnc_tests::{Place, Run};

use super::{STATION, check};

/// A folder with a bench file that names its records folder, which holds one run.
fn with_bench() -> Place {
    let place = Place::new(STATION);
    place.write("bench.toml", "[station]\nid = \"s\"\nrecords = \"archive\"\n");
    let ended = place.functional("--sim", &["--sim-speed", "max", "--only", "cpu", "--records", "archive"]);
    assert_eq!(ended.code, Some(5), "{}{}", ended.stdout, ended.stderr);
    place
}

#[test]
fn the_bench_file_of_this_folder_names_the_records() {
    let place = with_bench();
    check(&place.run(["records", "list"]), 0, &["partial", "T-1"]);
    check(&place.run(["records", "show", "T-1"]), 0, &["T-1", "cpu"]);
    check(&place.run(["records", "verify"]), 0, &["1 of 1 runs are as written"]);
    check(&place.run(["recompute", "T-1"]), 0, &["the same, bit for bit"]);
    check(&place.run(["export", "T-1"]), 2, &["holds no raw samples"]);
}

/// A relative path in a bench file starts at the folder of that file, as for runs.
#[test]
fn a_bench_file_elsewhere_names_the_records_beside_it() {
    let place = with_bench();
    fs::create_dir(place.path().join("elsewhere")).expect("a folder");
    let from = |args: &[&str]| {
        let output = place.station(args).current_dir(place.path().join("elsewhere")).output().expect("the station");
        Run {
            code: output.status.code(),
            stdout: String::from_utf8_lossy(&output.stdout).into_owned(),
            stderr: String::from_utf8_lossy(&output.stderr).into_owned(),
        }
    };
    check(&from(&["records", "list", "--bench", "../bench.toml"]), 0, &["T-1"]);
    check(&from(&["recompute", "T-1", "--bench", "../bench.toml"]), 0, &["the same, bit for bit"]);
    check(&from(&["export", "T-1", "--bench", "../bench.toml"]), 2, &["holds no raw samples"]);
}

#[test]
fn a_named_folder_wins_and_the_bench_file_is_not_read() {
    let place = with_bench();
    place.write("bench.toml", "nonsense");
    check(&place.run(["records", "list", "--records", "archive"]), 0, &["T-1"]);
    check(&place.run(["recompute", "T-1", "--records", "archive"]), 0, &["the same, bit for bit"]);
    check(&place.run(["export", "--records", "archive", "T-1"]), 2, &["holds no raw samples"]);
    // A path to a run needs no records folder.
    let folder = gnc_records::store::reader::paths(&place.path().join("archive")).expect("records").remove(0);
    check(&place.run(["recompute", &folder.to_string_lossy()]), 0, &["the same, bit for bit"]);
    // Another folder than that of the runs must not be taken instead.
    for args in [&["records", "list"][..], &["recompute", "T-1"], &["export", "T-1"], &["records", "verify"]] {
        check(&place.run(args), 2, &["bench.toml:1:"]);
    }
}

#[test]
fn what_is_not_found_names_what_was_tried() {
    let place = Place::new(STATION);
    let told = "there is no records folder: records, since neither --records nor --bench is given and this folder has no bench.toml";
    check(&place.run(["records", "list"]), 2, &[told, "--records DIR", "--bench FILE"]);
    check(&place.run(["records", "list", "--records", "gone"]), 2, &["no records folder: gone, which --records names"]);
    check(&place.run(["records", "list", "--bench", "gone.toml"]), 2, &["cannot read the bench file gone.toml"]);
    place.write("bench.toml", "[station]\nid = \"s\"\nrecords = \"gone\"\n");
    check(&place.run(["records", "verify"]), 2, &["no records folder: gone, which bench.toml names"]);
    place.write("bench.toml", "[station]\nid = \"s\"\n");
    check(&place.run(["export", "T-1"]), 2, &["no records folder: records, since bench.toml names no other"]);
    place.write("records", "a file");
    check(
        &place.run(["recompute", "T-1"]),
        2,
        &["this is no records folder: records, since bench.toml names no other"],
    );

    let place = with_bench();
    check(&place.run(["recompute", "SN-NEVER"]), 2, &["there is no run SN-NEVER in archive, which bench.toml names"]);
}
