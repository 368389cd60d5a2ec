//! What a resumed run does about the heat of the module, and about all else that an item leaves in it.

use std::fs;
use std::path::Path;

use gnc_tests::{Place, bad_items, read_json};

use crate::inside::{self, Bench, Deed};
use crate::{SHORT, STATION, WARM, values};

/// The labels of an item's captures in a run.
fn labels(run: &Path, file: &str) -> Vec<String> {
    let read = gnc_records::store::captures::read(&run.join(file)).expect("captures");
    read.captures.iter().map(|capture| capture.about.label.clone()).collect()
}

fn room(room_c: f64) -> String {
    WARM.replace("[heat]", &format!("[heat]\nroom_c = {room_c:.1}"))
}

/// A run that is stopped in the middle of six-position in a room of 23 degC, and taken up in another room.
fn in_another_room(plan: &str, room_c: f64) -> inside::Ended {
    let first = Bench::start(WARM, 1);
    let broken = first.run(&inside::request(plan), Some(("six-position", 0.5, Deed::Stop)));
    assert_eq!(broken.outcome, "aborted", "{}", broken.log());
    let second = Bench::of(&room(room_c), 2, &first);
    let mut again = inside::request(plan);
    again.resume = Some(broken.folder);
    second.run(&again, None)
}

/// The room is two kelvins colder than before: the module never gets there. That is no fault of the module.
#[test]
fn what_cannot_be_as_warm_again_is_errored() {
    let plan = SHORT.replace("[resume]", "[resume]\nwait = \"5 min\"");
    let ended = in_another_room(&plan, 21.0);
    assert_eq!(ended.outcome, "errored", "{}", ended.log());
    let record = read_json(&ended.folder.join("run.json"));
    assert_eq!(bad_items(&record), ["six-position", "rotation"]);
    let error = &record["items"][2]["attempts"][0]["error"];
    let text = error["text"].as_str().expect("a reason");
    assert!(text.contains("degC after 300 s of waiting") && text.contains("they are not within 0.2 degC"), "{text}");
    assert!(error["hint"].as_str().is_some_and(|hint| hint.contains("resume again")), "{error}");
    // All waits together take no more, so the next item is told after one look.
    let text = record["items"][4]["attempts"][0]["error"]["text"].as_str().expect("a reason");
    assert!(text.contains("after 305 s of waiting"), "{text}");
    // With a wider limit it is good enough.
    let ended = in_another_room(&plan.replace("0.2 degC", "3 degC").replace("<= 0.5 degC", "<= 5 degC"), 21.0);
    assert_eq!(ended.outcome, "passed", "{}", ended.log());
}

/// The room is two kelvins warmer: the module goes through the old temperature and on. The drift is that of the room.
#[test]
fn a_drift_between_two_rooms_is_no_fault_of_the_module() {
    let ended = in_another_room(SHORT, 25.0);
    let record = read_json(&ended.folder.join("run.json"));
    assert_eq!(ended.outcome, "errored", "{}", ended.log());
    assert_eq!(bad_items(&record), ["six-position"]);
    let attempt = &record["items"][2]["attempts"][0];
    let text = attempt["error"]["text"].as_str().expect("a reason");
    assert!(
        text.starts_with("temperature_drift is outside its limit, and a part of the captures is taken over"),
        "{text}"
    );
    let drift =
        attempt["measurements"].as_array().expect("measurements").iter().find(|one| one["name"] == "temperature_drift");
    assert_eq!(drift.map(|drift| &drift["outcome"]), Some(&"failed".into()), "the value stays as it was judged");
    // Years later the same figures come to the same: the module is not accused then either.
    let again = Place::new(STATION).run(["recompute".as_ref(), ended.folder.as_os_str()]);
    assert_eq!(again.code, Some(0), "{}{}", again.stdout, again.stderr);
}

/// The time of an item does not include the wait.
#[test]
fn a_wait_is_no_time_of_the_item() {
    let plan = SHORT.replace("id = \"six-position\"\n", "id = \"six-position\"\ntimeout = \"240 s\"\n");
    let ended = in_another_room(&plan, 23.0);
    assert_eq!(ended.outcome, "passed", "{}", ended.log());
    assert!(ended.log().contains("of waiting"), "{}", ended.log());
}

/// A run that is taken up and dies before it takes everything over has lost nothing.
#[test]
fn a_run_that_took_up_another_one_passes_on_what_it_had_not_reached() {
    let bench = Bench::start(WARM, 1);
    let first = bench.run(&inside::request(SHORT), Some(("rotation", 0.5, Deed::Stop)));
    let turns = labels(&first.folder, "05-rotation/attempt-1.mcap");
    assert!((1..6).contains(&turns.len()), "{turns:?}");
    // The second one ends in its first item.
    let mut again = inside::request(SHORT);
    again.resume = Some(first.folder);
    let second = bench.run(&again, Some(("imu", 0.0, Deed::Stop)));
    assert!(!second.folder.join("05-rotation").exists(), "it came too far");
    again.resume = Some(second.folder);
    let third = bench.run(&again, None);
    assert_eq!(third.outcome, "passed", "{}", third.log());
    let said = format!("Taken over from the interrupted run: {}.", turns.join(", "));
    assert!(third.log().contains(&said), "{}", third.log());
}

const ROUNDS: &str = "name = \"rounds\"\nversion = \"1\"\n\
    [[item]]\nid = \"six-position\"\nrepeats = 3\nparams = { dwell = \"20 s\", settle = \"2 s\", rate = \"100 Hz\" }\n\
    limits.residual_rms = \"<= 5 mg\"\n";

/// Each round of a repeated item takes over its own captures, and no others.
#[test]
fn each_round_takes_over_its_own_captures() {
    let bench = Bench::start(&WARM.replace("30.0", "5.0"), 1);
    // The rounds have one guidance after the other, so the third of the second one is told by its file.
    let broken = bench.run(&inside::request(ROUNDS), Some(("six-position", 0.5, Deed::StopInRound(2))));
    let file = |run: &Path, round: u32| {
        let more = if round == 1 { String::new() } else { format!("-{round}") };
        run.join(format!("01-six-position/attempt-1{more}.mcap"))
    };
    let read = |path: &Path| gnc_records::store::captures::read(path).expect("captures").captures;
    let before = [1, 2].map(|round| read(&file(&broken.folder, round)));
    assert!(before[0].len() == 6 && (1..6).contains(&before[1].len()), "{:?}", before.map(|round| round.len()));
    let mut again = inside::request(ROUNDS);
    again.resume = Some(broken.folder);
    let ended = bench.run(&again, None);
    assert_eq!(ended.outcome, "passed", "{}", ended.log());
    let after = [1, 2, 3].map(|round| read(&file(&ended.folder, round)));
    assert_eq!(after.each_ref().map(Vec::len), [6; 3]);
    assert!(after[0] == before[0] && after[1][..before[1].len()] == before[1][..]);
    assert!(after[2].iter().zip(&after[0]).all(|(one, other)| one.samples != other.samples), "the third round is new");
}

const REPEATED: &str = "name = \"repeated\"\nversion = \"1\"\n[resume]\nwithin = \"0.1 degC\"\n\
    [[item]]\nid = \"magnetometer-ellipsoid\"\n\
    params = { positions = \"12\", dwell = \"10 s\", settle = \"2 s\", rate = \"20 Hz\" }\n\
    limits.field = \"0.1 gauss .. 0.7 gauss\"\n\
    [[item]]\nid = \"scale-factor-repeatability\"\n\
    params = { sensors = [\"accel\"], calibrations = 3, dwell = \"20 s\", settle = \"2 s\", rate = \"100 Hz\" }\n\
    [item.limits]\n\"scale_factor_repeatability_accel_*\" = \"<= 400 ppm\"\n";

/// Calibrations after power-ons: the third one is torn, and made anew as a whole on a module that is as warm as it was. A cold one
/// would differ by 4 K times 300 ppm.
#[test]
fn a_torn_series_is_made_anew_on_a_warm_module() {
    let bench = Bench::start(WARM, 1);
    let broken = bench.run(&inside::request(REPEATED), Some(("scale-factor-repeatability", 0.8, Deed::Stop)));
    let file = "02-scale-factor-repeatability/attempt-1.mcap";
    let had = labels(&broken.folder, file);
    assert!((13..18).contains(&had.len()), "{had:?}");
    let second = Bench::of(WARM, 2, &bench);
    let mut again = inside::request(REPEATED);
    again.resume = Some(broken.folder.clone());
    let ended = second.run(&again, None);
    assert!(["passed", "marginal"].contains(&&*ended.outcome), "{}", ended.log());
    let read = |run: &Path| gnc_records::store::captures::read(&run.join(file)).expect("captures").captures;
    let (before, after) = (read(&broken.folder), read(&ended.folder));
    assert_eq!(after.len(), 18);
    assert!(after[..12] == before[..12], "two series are taken over");
    assert!(after[12].samples != before[12].samples, "the torn series is new");
    assert!(ended.log().contains("is as warm as at the end"), "{}", ended.log());
}

/// A module that stores the coefficients of the interrupted run: what it compensated is captured anew, with the coefficients of the
/// new run. The raw captures do not depend on them.
#[test]
fn what_the_module_compensated_is_captured_anew() {
    let plan = format!(
        "{SHORT}\n[[item]]\nid = \"magnetometer-ellipse\"\nparams = {{ duration = \"20 s\", settle = \"2 s\" }}\n\
         limits.radius = \"0.1 gauss .. 0.7 gauss\"\n\
         [[item]]\nid = \"calibration-download\"\nlimits.coefficients_altered = \"<= 0\"\n\
         [[item]]\nid = \"calibration-check\"\nparams = {{ dwell = \"20 s\", settle = \"2 s\" }}\n\
         [item.limits]\n\"force_error_*\" = \"-2 mg .. 2 mg\"\nangle_error = \"-0.1 % .. 0.1 %\"\n"
    );
    let bench = Bench::start(WARM, 1);
    let broken = bench.run(&inside::request(&plan), Some(("calibration-check", 0.7, Deed::Stop)));
    let file = "08-calibration-check/attempt-1.mcap";
    assert_eq!(labels(&broken.folder, file), ["z+"], "the turn was interrupted");
    let mut again = inside::request(&plan);
    again.resume = Some(broken.folder.clone());
    let ended = bench.run(&again, None);
    assert_eq!(ended.outcome, "passed", "{}", ended.log());
    assert!(!ended.log().contains("had a module with the calibration"), "{}", ended.log());
    let read = |run: &Path, file: &str| gnc_records::store::captures::read(&run.join(file)).expect("captures").captures;
    assert!(read(&ended.folder, file)[0].compensated != read(&broken.folder, file)[0].compensated, "it was taken over");
    let still = "03-six-position/attempt-1.mcap";
    assert!(read(&ended.folder, still) == read(&broken.folder, still));
}

/// All captures exist and the item was not judged: nothing moves, nothing is waited for, and the figures are the same.
#[test]
fn an_item_that_was_not_judged_is_judged_from_its_captures() {
    let place = Place::new(STATION);
    place.write("p.toml", SHORT);
    place.write("module.toml", WARM);
    let args = ["--auto", "p.toml", "--sim=module.toml", "--serial-number", "C-1", "--sim-speed", "max"];
    let only = ["--only", "magnetometer-ellipsoid,six-position"];
    let whole = place.run(args.into_iter().chain(only));
    assert_eq!(whole.code, Some(5), "{}{}", whole.stdout, whole.stderr);
    let run = place.runs().remove(0);
    // The journal as a power cut leaves it before the first figure, and nothing else.
    let journal = fs::read_to_string(run.join("events.jsonl")).expect("a journal");
    let figure = "\"kind\":\"measured\",\"item\":\"six-position\"";
    let cut = journal.find(figure).and_then(|at| journal[..at].rfind('\n')).expect("a figure");
    let expected = values::of(&run);
    for file in fs::read_dir(&run).expect("a run").map(|entry| entry.expect("a file").path()) {
        if file.is_file() {
            fs::remove_file(file).expect("a file");
        }
    }
    fs::write(run.join("events.jsonl"), &journal[..=cut]).expect("writable");
    let records = place.path().join("records");
    fs::remove_file(records.join("COUNTER")).expect("a counter");
    fs::remove_file(run.ancestors().nth(2).expect("a day").join("CHAIN")).expect("a chain");
    let resume = ["--resume", run.to_str().expect("UTF-8"), "--seed", "2"];
    let ended = place.run(args.into_iter().chain(only).chain(resume));
    assert_eq!(ended.code, Some(5), "{}{}", ended.stdout, ended.stderr);
    assert!(!ended.stdout.contains("waits until"), "{}", ended.stdout);
    assert_eq!(values::of(&place.runs().pop().expect("a run")), expected);
}

/// A closed run whose files, digests and all were changed is not taken up: the chain has other digests.
#[test]
fn a_forged_run_is_not_taken_up() {
    let bench = Bench::start(WARM, 1);
    let broken = bench.run(&inside::request(SHORT), Some(("six-position", 0.7, Deed::Stop)));
    // The journal itself names the bytes of raw files; the log stands in the digests alone.
    let log = broken.folder.join("log.txt");
    let (old, sums) = (digest(&log), broken.folder.join("SHA256SUMS"));
    fs::write(&log, "another log").expect("writable");
    let text = fs::read_to_string(&sums).expect("digests").replace(&old, &digest(&log));
    fs::write(&sums, text).expect("writable");
    assert!(gnc_records::store::as_written::verify(&broken.folder).is_empty(), "the digests fit");
    let mut again = inside::request(SHORT);
    again.resume = Some(broken.folder);
    let refused = bench.refused(&again);
    assert!(refused.contains("fails its verification: SHA256SUMS was changed after the run was closed"), "{refused}");
}

/// What was captured longer ago than a pass counts would pass with the date of today, and so would what was captured while the
/// clock was ahead.
#[test]
fn captures_are_not_older_than_a_pass() {
    let bench = Bench::start(WARM, 1);
    let at = |text: &str| Some(chrono::DateTime::parse_from_rfc3339(text).expect("a time"));
    let mut request = inside::request(&SHORT.replacen("version", "valid_days = 7\nversion", 1));
    request.began = at("2026-11-01T08:00:00+08:00");
    let broken = bench.run(&request, Some(("six-position", 0.7, Deed::Stop)));
    request.resume = Some(broken.folder.clone());
    for (now, said) in [
        (
            "2026-11-08T08:01:00+08:00",
            "began 2026-11-01 08:00, 7.1 days ago, and the plan takes nothing older than 7 days",
        ),
        (
            "2026-12-31T08:00:00+08:00",
            "began 2026-11-01 08:00, 60.0 days ago, and the plan takes nothing older than 7 days",
        ),
        ("2026-11-01T07:49:00+08:00", "began 2026-11-01 08:00, later than this computer's clock (2026-11-01 07:49)"),
    ] {
        request.began = at(now);
        assert_eq!(bench.refused(&request), format!("the run to resume {said}"));
    }
    // Seven days to the minute.
    request.began = at("2026-11-08T07:59:00+08:00");
    let ended = bench.run(&request, None);
    assert!(gnc_tests::read_json(&ended.folder.join("run.json"))["resumed"].is_object(), "{}", ended.log());
}

fn digest(path: &Path) -> String {
    let said = std::process::Command::new("sha256sum").arg(path).output().expect("sha256sum").stdout;
    String::from_utf8(said).expect("text").split(' ').next().expect("a digest").to_owned()
}
