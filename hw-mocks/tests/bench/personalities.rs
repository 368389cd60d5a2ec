//! Personality files: what comes with the library is well formed, what is wrong is refused with its place.

use hw_mocks::devices::inertial::SensorModels;
use hw_mocks::devices::inertial::bandwidth::Order;
use hw_mocks::devices::inertial::model::PUBLISHED;
use hw_mocks::{Options, Personality, boards};

use crate::host::Host;

const ITEMS: [&str; 14] = [
    "identity",
    "cpu",
    "timers",
    "internal-ram",
    "sdram",
    "spi-flash",
    "internal-flash",
    "imu",
    "gnss",
    "ad",
    "io",
    "spi",
    "sci",
    "can",
];

#[test]
fn embedded_boards_are_well_formed_and_expect_known_items() {
    assert!(boards().len() >= 30);
    assert_eq!(boards()[0].0, "good");
    assert_eq!(Personality::good().name, "good");
    for (name, text) in boards() {
        let personality = Personality::from_toml(name, text).unwrap_or_else(|error| panic!("{error}"));
        assert!(!personality.description.is_empty(), "{name}");
        let expected = &personality.expect["functional"];
        assert!(["passed", "failed", "errored"].contains(&expected.outcome.as_str()), "{name}");
        match expected.outcome.as_str() {
            "failed" => assert!(!expected.items.is_empty(), "{name}"),
            "passed" => assert!(expected.items.is_empty(), "{name}"),
            // A line that is bad may show in some items or let none begin.
            _ => {}
        }
        assert!(expected.items.iter().all(|item| ITEMS.contains(&item.as_str())), "{name}");
    }
}

/// What a whole acceptance finds is in the file beside what the functional table finds: a bad module fails one of them
/// in items that are named, and the five good ones pass both but for what chance decides.
#[test]
fn boards_for_acceptance_say_how_they_end() {
    let mut bad = 0;
    for (name, text) in boards() {
        let personality = Personality::from_toml(name, text).unwrap();
        let Some(expected) = personality.expect.get("acceptance") else { continue };
        assert_eq!(
            personality.expect["functional"].outcome, "passed",
            "{name}: acceptance begins with the functional table"
        );
        match expected.outcome.as_str() {
            "passed" => assert!(expected.items.is_empty() && expected.figures.is_empty(), "{name}"),
            "failed" => {
                bad += 1;
                // A capture that breaks off leaves no figure.
                assert!(!expected.items.is_empty(), "{name}");
            }
            other => panic!("{name}: {other}"),
        }
    }
    assert_eq!(bad, 19);
}

/// The files of the five modules hold the figures of the table.
#[test]
fn the_five_modules_are_those_of_the_table() {
    for (name, published) in ["good", "good-2", "good-3", "good-4", "good-5"].iter().zip(&PUBLISHED) {
        let host = Host::powered(name);
        assert_eq!(host.bench.truth().sensors, SensorModels::published(published), "{name}");
    }
}

#[test]
fn every_file_in_the_folder_is_embedded() {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/boards");
    let mut files: Vec<String> = std::fs::read_dir(folder)
        .unwrap()
        .map(|entry| entry.unwrap().path().file_stem().unwrap().to_string_lossy().into_owned())
        .collect();
    files.sort();
    let mut embedded: Vec<&str> = boards().iter().map(|(name, _)| *name).collect();
    embedded.sort_unstable();
    assert_eq!(files, embedded);
}

fn refused(text: &str, expected: &str) {
    let error = Personality::from_toml("mine", text).unwrap_err();
    assert_eq!(error.to_string(), expected);
}

#[test]
fn mistakes_are_told_with_line_and_column() {
    refused("[timers]\nrate_error_ppm = 1e9\n", "mine:2:18: rate_error_ppm 1000000000 is not in -500000 to 500000");
    refused("[timers]\nrate_error_ppm = nan\n", "mine:2:18: rate_error_ppm NaN is not in -500000 to 500000");
    refused("[io]\nshorted = [[2, 2]]\n", "mine:2:16: line 2 twice: two different ones are needed");
    refused("[gyro]\nstuck_axes = [\"x\", \"w\"]\n", "mine:2:20: axis \"w\" is not one of x, y, z");
    refused(
        "[reboot]\non = \"dram\"\n",
        "mine:2:6: \"dram\" is not one of power, identity, cpu, timers, internal-ram, sdram, spi-flash, \
         internal-flash, imu, calibration, gnss, ad, io, spi, sci, can",
    );
    refused(
        "[gyro]\nbias_stability_dph = 3.0\n",
        "mine:2:22: bias_stability and bias_repeatability belong together: the noise follows from both",
    );
    refused("[internal_ram]\nstuck_data_line = { line = 16, level = 0 }\n", "mine:2:28: line 16 is not in 0 to 15");
    let unknown = Personality::from_toml("mine", "[timers]\n\nspeed = 3\n").unwrap_err();
    assert_eq!((unknown.mistakes[0].line, unknown.mistakes[0].column), (3, 1));
    assert!(unknown.mistakes[0].message.contains("unknown field `speed`"), "{unknown}");
    let syntax = Personality::from_toml("mine", "[timers\n").unwrap_err();
    assert_eq!(syntax.mistakes[0].line, 1);
}

#[test]
fn units_in_names_are_those_of_the_sensor() {
    refused("[gyro]\nturn_on_dph = [1.0, -2.0, 0.0]\n", "mine:2:15: turn_on -2 is not in 0 to 1000000");
    refused("[mag]\nresponse = [[1, 0, 0], [0, nan, 0], [0, 0, 1]]\n", "mine:2:28: response NaN is not in -100 to 100");
    refused("[turntable]\nslew_s = 1e9\n", "mine:2:10: slew_s 1000000000 is not in 0 to 600");
    refused("[calibration]\nlost_bit = { byte = 300, bit = 0 }\n", "mine:2:21: byte 300 is not in 0 to 299");
    let two = Personality::from_toml("mine", "[gyro]\ndrift_dph_per_h = [1, 2]\n").unwrap_err();
    assert!(two.to_string().contains("an array of length 3"), "{two}");
    for text in ["[accel]\noffset_g = [0.0, 0.0, 0.025]\n", "[gyro]\noffset_dps = [1, 0, 0]\n"] {
        assert!(Personality::from_toml("mine", text).is_ok(), "{text}");
    }
}

#[test]
fn what_real_sensors_do_is_checked() {
    refused("[gyro]\nbandwidth_hz = -3\n", "mine:2:16: bandwidth_hz -3 is not in 0.1 to 100000");
    refused("[gyro]\nbandwidth_order = 3\n", "mine:2:19: bandwidth_order 3 is not in 1 to 2");
    refused("[mag]\nbandwidth_order = 1\n", "mine:2:19: bandwidth_order has no bandwidth_hz beside it");
    refused("[accel]\nupdate_rate_hz = 0\n", "mine:2:18: update_rate_hz 0 is not in 0.01 to 100000");
    refused("[accel]\nclip_low_g = nan\n", "mine:2:14: clip_low NaN is no number");
    refused(
        "[accel]\nclip_low_g = [-inf, -inf, 2.0]\nclip_high_g = [inf, inf, 1.0]\n",
        "mine:3:15: clip_high is not above clip_low",
    );
    refused(
        "[gyro]\nspikes = { share = 0.1, size_dps = 1, axis = \"w\" }\n",
        "mine:2:46: axis \"w\" is not one of x, y, z",
    );
    refused("[gyro]\nspikes = { share = 1.1, size_dps = 1 }\n", "mine:2:20: share 1.1 is not in 0 to 1");
    refused(
        "[mag]\nfailed_reads = { share = 0.1, code = 7 }\n",
        "mine:2:38: code 7 is not one of 0, -1, 8388607, -8388608",
    );
    refused("[imu]\nfailed_reads = { share = -0.1, code = 0 }\n", "mine:2:26: share -0.1 is not in 0 to 1");
    refused("[[vibration]]\nfrequency_hz = inf\n", "mine:2:16: frequency_hz inf is not in 0.001 to 100000");
    let five = "[[vibration]]\nfrequency_hz = 10\n".repeat(5);
    refused(&five, "mine:10:16: more than 4 vibrations");
    let bandwidth = |text: &str| {
        let personality = Personality::from_toml("mine", text).unwrap();
        Host::with(&Options { personality, ..Options::default() })
            .bench
            .truth()
            .sensors
            .gyro
            .bandwidth
            .map(|known| (known.cutoff_hz, known.order))
    };
    assert_eq!(bandwidth(""), Some((80.0, Order::Second)));
    assert_eq!(bandwidth("[gyro]\nbandwidth_hz = 0\n"), None);
    assert_eq!(bandwidth("[gyro]\nbandwidth_order = 1\n"), Some((80.0, Order::First)));
    assert_eq!(bandwidth("[gyro]\nbandwidth_hz = 25\n"), Some((25.0, Order::Second)));
}

#[test]
fn a_personality_tells_all_its_mistakes() {
    let refused = |text: &str, expected: &str| {
        let error = Personality::from_toml("mine", text).err().map(|error| error.to_string());
        assert_eq!(error.unwrap_or_default(), expected, "{text}");
    };
    // Of every kind: an unknown key, a wrong type, values out of range in a list, in a row of three and in a table.
    let text = "\
[module]
colour = \"red\"
protocol = \"one\"
[gyro]
offset_dps = [1e9, 0.0, -1e9]
noise_factor = -1.0
failed_reads = { share = 0.5, code = 7 }
[cpu]
dead_cores = [1, 3, 7]
[sdram]
stuck_cells = [{ index = 1, bit = 99, level = 0 }, { indx = 2, bit = 3, level = 0 }, { index = 3, bit = 3, level = 5 }]
shorted_address_lines = [5, 5]
";
    let error = Personality::from_toml("mine", text).unwrap_err();
    let places: Vec<(usize, usize)> = error.mistakes.iter().map(|mistake| (mistake.line, mistake.column)).collect();
    let expected =
        [(2, 1), (3, 12), (5, 15), (6, 16), (7, 38), (9, 18), (9, 21), (11, 35), (11, 54), (11, 116), (12, 29)];
    assert_eq!(places, expected, "{error}");
    // Numbers of a log that cannot be read are no second mistake.
    refused(
        "[gnss]\nplayback = \"no.nmea\"\nplayback_hz = 2.0\n[rails]\nv5_v = 7.0\n",
        "mine:2:12: playback = \"no.nmea\": files are read beside a board's own file only\n\
         mine:5:8: v5_v 7 is not in 0 to 6",
    );
    // Syntax stands alone.
    let error = Personality::from_toml("mine", "[gyro\nnoise_factor = -1.0\n").unwrap_err();
    assert_eq!(error.mistakes.len(), 1, "{error}");
    let many = (0..80).map(|k| format!("unknown_{k} = 1\n")).collect::<String>();
    assert_eq!(Personality::from_toml("mine", &many).unwrap_err().mistakes.len(), 50);
}
