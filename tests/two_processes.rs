//! Station and board as two programs with only a pseudo-terminal between them.

use std::io::{BufRead as _, BufReader};
use std::process::Stdio;

use gnc_tests::{Board, PARTIAL, Place, bad_items, functional_plan};

const STATION: &str = env!("CARGO_BIN_EXE_station-under-test");
const MOCK: &str = env!("CARGO_BIN_EXE_mock-under-test");
/// All items that need neither an operator nor a sky over simulated minutes.
const ITEMS: &str = "identity,cpu,timers,internal-ram,sdram,spi-flash,internal-flash,imu,io,spi,sci,gnss";

fn args(only: &str) -> Vec<String> {
    let plan = functional_plan();
    let args = ["--auto", &plan.to_string_lossy(), "--serial-number", "SIM-0001", "--only", only];
    args.map(str::to_owned).to_vec()
}

#[test]
fn a_station_tests_a_board_in_another_process() {
    let board = Board::start(MOCK, &["--serial-number", "SIM-0001", "--speed", "max"]);
    let place = Place::new(STATION);
    // The plan's limits on the antenna's place need the site.
    let site = "[site]\nlatitude = \"34.2321 deg\"\nlongitude = \"108.9154 deg\"\nheight = \"412 m\"\n";
    place.write("bench.toml", &format!("{}{site}", board.bench_file("two")));
    for run in 1..=2 {
        let outcome = place.run(args(ITEMS));
        assert_eq!(outcome.code, PARTIAL, "run {run}: {}{}", outcome.stdout, outcome.stderr);
    }
    let record = gnc_tests::read_json(&place.runs()[0].join("run.json"));
    // A pseudo-terminal does not prove that a board is behind it.
    assert_eq!(record["bench"]["kind"], "unproven");
    assert_eq!(record["bench"]["unproven"], format!("port {} is a pseudo-terminal", board.port));
    assert_eq!(record["bench"]["port"], board.port.as_str());
    assert_eq!(record["station"], "two");
}

/// Actions of an operator at the bench reach the module, and so the measurements.
#[test]
fn commands_turn_the_module() {
    let mut board = Board::start(MOCK, &["--serial-number", "SIM-0001", "--speed", "max"]);
    board.command("up x+");
    let place = Place::new(STATION);
    place.write("bench.toml", &board.bench_file("two"));
    let outcome = place.run(args("imu"));
    assert_eq!(outcome.code, Some(1), "{}{}", outcome.stdout, outcome.stderr);
    let record = place.record();
    assert_eq!(bad_items(&record), ["imu"]);
    let items = record["items"].as_array().expect("items");
    let imu = items.iter().find(|item| item["id"] == "imu").expect("imu");
    let measurements = imu["attempts"][0]["measurements"].as_array().expect("measurements");
    let value = |name: &str| {
        let found = measurements.iter().find(|measurement| measurement["name"] == name).expect("measured");
        found["value"].as_f64().expect("a number")
    };
    assert!((value("accel_x") - 1.0).abs() < 0.05 && value("accel_z").abs() < 0.05, "{measurements:?}");
}

/// The board's program dies during the run, like an adapter that is pulled out: the run is errored, not failed, and
/// says so.
#[test]
fn a_port_that_vanishes_is_the_bench_s_fault() {
    let mut board = Board::start(MOCK, &["--serial-number", "SIM-0001"]);
    let place = Place::new(STATION);
    place.write("bench.toml", &board.bench_file("two"));
    let mut args = args("identity,cpu,sdram,io");
    // Otherwise IO runs beside the processor's test and is over by then.
    args.extend(["--events".into(), "--one-by-one".into()]);
    let mut station = place.station(args).stdout(Stdio::piped()).stderr(Stdio::null()).spawn().expect("the station");
    let mut lines = BufReader::new(station.stdout.take().expect("its output")).lines();
    let reached = lines.by_ref().any(|line| line.expect("a line").contains(r#""kind":"item_started","item":"sdram""#));
    assert!(reached, "the SDRAM test begins");
    board.kill();
    lines.for_each(drop);
    assert_eq!(station.wait().expect("its end").code(), Some(3));
    let record = place.record();
    assert_eq!(record["selection_outcome"], "errored");
    let outcome = |id: &str| {
        let items = record["items"].as_array().into_iter().flatten();
        items.filter(|item| item["id"] == id).map(|item| item["outcome"].clone()).next()
    };
    assert_eq!(outcome("cpu"), Some("passed".into()));
    assert_eq!(outcome("sdram"), Some("errored".into()));
    assert_eq!(outcome("io"), Some("not_run".into()));
    let items = record["items"].as_array().expect("items");
    let sdram = items.iter().find(|item| item["id"] == "sdram").expect("sdram");
    let error = sdram["attempts"][0]["error"]["text"].as_str().expect("an error").to_owned();
    assert!(error.contains(&format!("port {} went away", board.port)), "{error}");
}

/// The station asks again for a result that the line lost, before the board forgets it: each attempt erases once,
/// however many other requests end meanwhile.
#[test]
fn a_flash_is_not_erased_again_because_an_answer_was_lost() {
    let folder = Place::new(STATION);
    let lossy = "description = \"A tenth of the answers is lost.\"\n[wire.to_host]\nlost_frames_per_million = 1e5\n";
    let lossy = folder.write("lossy.toml", lossy).display().to_string();
    let check = &|seed: u32| {
        let seed = seed.to_string();
        let mut board = Board::start(MOCK, &[&lossy, "--serial-number", "SIM-0001", "--speed", "max", "--seed", &seed]);
        let place = Place::new(STATION);
        place.write("bench.toml", &board.bench_file("two"));
        let outcome = place.run(args("identity,cpu,spi-flash,io"));
        let record = place.record();
        let items = record["items"].as_array().expect("items");
        let flash = items.iter().find(|item| item["id"] == "spi-flash").expect("spi-flash");
        let attempts = flash["attempts"].as_array().expect("attempts").len() as u64;
        let erases: u64 = board.truth("spi_flash_erases").parse().expect("a number");
        assert!(erases <= attempts, "seed {seed}: {erases} erases in {attempts} attempts\n{}", outcome.stdout);
    };
    std::thread::scope(|scope| {
        for seed in 1..=8 {
            scope.spawn(move || check(seed));
        }
    });
}
