//! Personality files: those in the library are well formed, and mistakes are refused with their place.

use gnc_config::Mistake;
use hw_mocks::devices::inertial::SensorModels;
use hw_mocks::devices::inertial::bandwidth::FilterOrder;
use hw_mocks::devices::inertial::model::PUBLISHED;
use hw_mocks::{BenchOptions, Personality, boards};

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
            // A bad line may show in some items, or prevent all items.
            _ => {}
        }
        assert!(expected.items.iter().all(|item| ITEMS.contains(&item.as_str())), "{name}");
    }
}

/// The results of a whole acceptance stand in the file beside those of the functional plan. A bad module fails one of
/// the plans in items that are named. The five good ones pass both, except where chance decides.
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
                // A capture that breaks off gives no figure.
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

/// All messages about a text: line, column, the mistake, and what can be tried.
fn told(text: &str) -> Vec<String> {
    let Err(mistakes) = Personality::from_toml("mine", text) else { return Vec::new() };
    let line = |mistake: &Mistake| {
        let place = mistake.place.as_ref().expect("a place");
        let hint = if mistake.hint.is_empty() { String::new() } else { format!(" [{}]", mistake.hint) };
        format!("{}:{}: {}{hint}", place.line, place.column, mistake.what)
    };
    mistakes.iter().map(line).collect()
}

#[track_caller]
pub(crate) fn refused(text: &str, expected: &[&str]) {
    assert_eq!(told(text), expected, "{text}");
}

#[test]
fn mistakes_are_told_with_line_and_column() {
    refused("[timers]\nrate_error_ppm = 1e9\n", &["2:18: rate_error_ppm is 1e9, and must be -500000 to 500000"]);
    refused("[timers]\nrate_error_ppm = nan\n", &["2:18: rate_error_ppm is nan, and must be -500000 to 500000"]);
    refused("[io]\nshorted = [[2, 2]]\n", &["2:16: 2 is twice in shorted [write two different numbers]"]);
    refused("[gyro]\nstuck_axes = [\"x\", \"w\"]\n", &["2:20: stuck_axes cannot be \"w\" [it may be x, y, z]"]);
    refused("[reboot]\non = \"dram\"\n", &["2:6: on cannot be \"dram\" [did you mean \"sdram\"?]"]);
    refused(
        "[reboot]\non = \"module\"\n",
        &["2:6: on cannot be \"module\" [it may be power, identity, cpu, timers, internal-ram, sdram, spi-flash, \
           internal-flash, imu, calibration, gnss, ad, io, spi, sci, can]"],
    );
    refused(
        "[gyro]\nbias_stability_dph = 3.0\n",
        &["2:1: bias_stability and bias_repeatability belong together: the noise follows from both \
           [write both, or neither]"],
    );
    refused("[internal_ram]\nstuck_data_line = { line = 16, level = 0 }\n", &["2:28: line is 16, and must be 0 to 15"]);
    refused(
        "[timers]\n\nspeed = 3\n",
        &["3:1: unknown key \"speed\" [the keys are jitter_ns, miss_every, rate_error_ppm]"],
    );
    refused("[timers]\njiter_ns = 3\n", &["2:1: unknown key \"jiter_ns\" [did you mean \"jitter_ns\"?]"]);
    refused("[timer]\n", &["1:2: unknown key \"timer\" [did you mean \"timers\"?]"]);
    // A mistake of syntax is reported alone.
    let syntax = told("[gyro\nnoise_factor = -1.0\n");
    assert!(syntax.len() == 1 && syntax[0].starts_with("1:"), "{syntax:?}");
}

/// A figure in another unit is wrong by a factor that does not show: 3600 between deg/s and deg/h.
#[test]
fn a_unit_of_another_sensor_is_refused() {
    let other = |key: &str, unit: &str, stem: &str, table: &str, right: &str| {
        format!("2:1: \"{key}\" is not in {unit}, the unit of {stem} in [{table}] [give it in {unit} as {right}]")
    };
    // Each table has its own units for the signal of its sensors, for their bias, and for a bias per hour.
    let tables = [
        ("gyro", ("dps", "deg/s"), Some(("dph", "deg/h"))),
        ("accel", ("g", "g"), Some(("mg", "mg"))),
        ("mag", ("gauss", "gauss"), None),
    ];
    let units = ["", "_dps", "_g", "_gauss", "_dph", "_mg", "_mgauss"];
    let of_signal = ["deadband", "step", "range", "offset", "clip_low", "clip_high"];
    let of_bias = ["turn_on", "flicker", "wander"];
    for (table, signal, bias) in tables {
        for unit in units {
            for stem in of_signal {
                let (key, right) = (format!("{stem}{unit}"), format!("{stem}_{}", signal.0));
                let expected = if key == right { vec![] } else { vec![other(&key, signal.1, stem, table, &right)] };
                assert_eq!(told(&format!("[{table}]\n{key} = 0.5\n")), expected);
            }
            for (stem, per_hour) in of_bias.map(|stem| (stem, "")).into_iter().chain([("drift", "_per_h")]) {
                let key = format!("{stem}{unit}{per_hour}");
                let expected = match bias {
                    None => vec![format!(
                        "2:1: [{table}] takes no \"{key}\": its noise has no published figures \
                         [remove it; noise_factor makes the noise larger]"
                    )],
                    Some((own, _)) if unit == format!("_{own}") => vec![],
                    Some((own, shown)) => {
                        let shown = if per_hour.is_empty() { shown.to_owned() } else { format!("{shown} per hour") };
                        vec![other(&key, &shown, stem, table, &format!("{stem}_{own}{per_hour}"))]
                    }
                };
                assert_eq!(told(&format!("[{table}]\n{key} = 0.5\n")), expected);
            }
        }
    }
    refused(
        "[gyro]\nbias_stability_mg = 3\nbias_repeatability_mg = 1\n",
        &[
            "2:1: \"bias_stability_mg\" is not in deg/h, the unit of bias_stability in [gyro] \
             [give it in deg/h as bias_stability_dph]",
            "3:1: \"bias_repeatability_mg\" is not in deg/h, the unit of bias_repeatability in [gyro] \
             [give it in deg/h as bias_repeatability_dph]",
        ],
    );
    refused(
        "[accel]\nspikes = { share = 0.1, size_dps = 1 }\n",
        &["2:25: \"size_dps\" is not in g, the unit of size in [accel] [give it in g as size_g]"],
    );
    refused("[accel]\nspikes = { share = 0.1 }\n", &["2:1: size_g is missing [write how large spikes are, in g]"]);
}

/// A hint names the keys that a table takes, and none that it refuses.
#[test]
fn a_hint_names_no_key_that_is_refused() {
    for refused in ["bias_stability_mg = 1", "y_skew_us = 1"] {
        let text = format!("[gyro]\n{refused}\nqqqqqq = 3\n");
        let mistakes = Personality::from_toml("x", &text).unwrap_err().to_string();
        let hint = mistakes.split("unknown key \"qqqqqq\"").nth(1).expect("its own mistake");
        let key = refused.split(' ').next().expect("a key");
        assert!(hint.contains("bias_stability_dph") && !hint.contains(key), "{mistakes}");
    }
}

/// A key that is read and then changes nothing lets its writer believe in a fault that is not there.
#[test]
fn a_key_without_effect_is_refused() {
    refused("[gyro]\ny_skew_us = 10\n", &["2:1: [gyro] takes no y_skew_us [write it in [mag]]"]);
    refused("[gyro]\nwander_s = 10\n", &["2:1: wander_s changes nothing alone [write wander_dph beside it]"]);
    refused(
        "[wire.both]\ndelay_ms = 10\nstalled_frames_per_million = 1\n",
        &[
            "2:1: delay_ms changes nothing alone [write delayed_frames_per_million beside it]",
            "3:1: stalled_frames_per_million changes nothing alone [write stall_ms beside it]",
        ],
    );
    refused(
        "[can_wire.to_host]\nstall_ms = 10\n",
        &["2:1: stall_ms changes nothing alone [write stalled_frames_per_million beside it]"],
    );
    refused(
        "[reboot]\nnth = 2\n",
        &[
            "1:2: [reboot] does not say when the board restarts [write on = \"sdram\", or at_board_time_s = 60.0]",
            "2:1: nth changes nothing alone [write on beside it]",
        ],
    );
    refused(
        "[gnss]\nno_sky = true\nplayback = \"no.nmea\"\n",
        &[
            "2:1: no_sky changes nothing beside a playback [remove one of the two]",
            "3:12: playback \"no.nmea\" cannot be read: files are read beside a board's own file only \
             [name a log of NMEA or UBX in the folder of this file]",
        ],
    );
    refused("[operator]\nforgets_from = 2\n", &["2:1: forgets_from changes nothing alone [write forgets beside it]"]);
    refused("[gnss]\nplayback_hz = 2.0\n", &["2:1: playback_hz changes nothing alone [write playback beside it]"]);
}

#[test]
fn values_are_held_to_their_ranges() {
    refused("[gyro]\nturn_on_dph = [1.0, -2.0, 0.0]\n", &["2:21: turn_on_dph is -2.0, and must be 0 to 1000000"]);
    refused(
        "[mag]\nresponse = [[1, 0, 0], [0, nan, 0], [0, 0, 1]]\n",
        &["2:28: response is nan, and must be -100 to 100"],
    );
    refused("[turntable]\nslew_s = 1e9\n", &["2:10: slew_s is 1e9, and must be 0 to 600"]);
    refused("[turntable]\nramp_share = 0.6\n", &["2:14: ramp_share is 0.6, and must be 0.01 to 0.5"]);
    refused("[operator]\nswitches_on = [6]\n", &["2:16: switches_on is 6, and must be 1 to 5"]);
    refused("[operator]\nforgets = 0\n", &["2:11: forgets is 0, and must be 1 to 100"]);
    refused("[calibration]\nlost_bit = { byte = 300, bit = 0 }\n", &["2:21: byte is 300, and must be 0 to 299"]);
    refused(
        "[gyro]\ndrift_dph_per_h = [1, 2]\n",
        &["2:19: \"drift_dph_per_h\" has 2 elements, and must be a number, or three for X, Y and Z"],
    );
    refused(
        "[gyro]\ndrift_dph_per_h = \"3\"\n",
        &["2:19: \"drift_dph_per_h\" is a text, and must be a number, or three for X, Y and Z"],
    );
    refused("[sdram]\nstuck_cells = [{ index = 1, bit = 2 }]\n", &["2:16: \"level\" is missing [it may be 0 to 1]"]);
    refused("[module]\nprotocol = 1.5\n", &["2:12: \"protocol\" is a decimal number, and must be a whole number"]);
    refused(
        "[module]\npart = \"123456789012345678901234567890123\"\n",
        &["2:8: part has 33 bytes [it may have at most 32]"],
    );
    refused(
        "[expect.functional]\nitems = [\"imu\"]\n",
        &["1:9: \"outcome\" is missing [it may be passed, failed or errored]"],
    );
    for text in ["[accel]\noffset_g = [0.0, 0.0, 0.025]\n", "[gyro]\noffset_dps = [1, 0, 0]\n"] {
        refused(text, &[]);
    }
}

#[test]
fn what_real_sensors_do_is_checked() {
    refused("[gyro]\nbandwidth_hz = -3\n", &["2:16: bandwidth_hz is -3, and must be 0 to 100000"]);
    refused("[gyro]\nbandwidth_hz = 0.01\n", &["2:16: bandwidth_hz is 0.01 [it may be 0, for none, or 0.1 to 100000]"]);
    refused("[gyro]\nbandwidth_order = 3\n", &["2:19: bandwidth_order is 3, and must be 1 to 2"]);
    refused(
        "[mag]\nbandwidth_order = 1\n",
        &["2:1: bandwidth_order changes nothing without a low-pass [write bandwidth_hz = 80.0 beside it]"],
    );
    refused(
        "[gyro]\nbandwidth_hz = 0\nbandwidth_order = 1\n",
        &["3:1: bandwidth_order changes nothing without a low-pass [write bandwidth_hz = 80.0 beside it]"],
    );
    refused("[accel]\nupdate_rate_hz = 0\n", &["2:18: update_rate_hz is 0, and must be 0.01 to 100000"]);
    refused("[accel]\nclip_low_g = nan\n", &["2:14: clip_low_g is nan, and must be -inf to inf"]);
    refused(
        "[accel]\nclip_low_g = [-inf, -inf, 2.0]\nclip_high_g = [inf, inf, 1.0]\n",
        &["3:15: clip_high is not above clip_low [write a larger clip_high or a smaller clip_low]"],
    );
    refused(
        "[gyro]\nspikes = { share = 0.1, size_dps = 1, axis = \"w\" }\n",
        &["2:46: axis cannot be \"w\" [it may be x, y, z]"],
    );
    refused("[gyro]\nspikes = { share = 1.1, size_dps = 1 }\n", &["2:20: share is 1.1, and must be 0 to 1"]);
    refused(
        "[mag]\nfailed_reads = { share = 0.1, code = 7 }\n",
        &["2:38: code is 7 [it may be 0, -1, 8388607, -8388608]"],
    );
    refused("[imu]\nfailed_reads = { share = -0.1, code = 0 }\n", &["2:26: share is -0.1, and must be 0 to 1"]);
    refused("[[vibration]]\nfrequency_hz = inf\n", &["2:16: frequency_hz is inf, and must be 0.001 to 100000"]);
    let five = "[[vibration]]\nfrequency_hz = 10\n".repeat(5);
    refused(&five, &["9:1: more than 4 vibrations [remove some of them]"]);
    let bandwidth = |text: &str| {
        let personality = Personality::from_toml("mine", text).unwrap();
        Host::with(&BenchOptions { personality, ..BenchOptions::default() })
            .bench
            .truth()
            .sensors
            .gyro
            .bandwidth
            .map(|known| (known.cutoff_hz, known.order))
    };
    assert_eq!(bandwidth(""), Some((80.0, FilterOrder::Second)));
    assert_eq!(bandwidth("[gyro]\nbandwidth_hz = 0\n"), None);
    assert_eq!(bandwidth("[gyro]\nbandwidth_order = 1\n"), Some((80.0, FilterOrder::First)));
    assert_eq!(bandwidth("[gyro]\nbandwidth_hz = 25\n"), Some((25.0, FilterOrder::Second)));
}

#[test]
fn a_personality_tells_all_its_mistakes() {
    // All kinds of mistakes: an unknown key, a wrong type, values out of range in a list, in a row of three and in a
    // table.
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
    let told_of = told(text);
    let places: Vec<&str> = told_of.iter().filter_map(|line| line.split_once(": ")).map(|(place, _)| place).collect();
    let expected =
        ["2:1", "3:12", "5:15", "5:25", "6:16", "7:38", "9:18", "9:21", "11:35", "11:52", "11:54", "11:116", "12:29"];
    assert_eq!(places, expected, "{told_of:#?}");
    // The numbers of a log that cannot be read are not a second mistake.
    refused(
        "[gnss]\nplayback = \"no.nmea\"\nplayback_hz = 2.0\n[rails]\nv5_v = 7.0\n",
        &[
            "2:12: playback \"no.nmea\" cannot be read: files are read beside a board's own file only \
             [name a log of NMEA or UBX in the folder of this file]",
            "5:8: v5_v is 7.0, and must be 0 to 6",
        ],
    );
    let many = (0..80).map(|k| format!("unknown_{k} = 1\n")).collect::<String>();
    let refused = Personality::from_toml("mine", &many).unwrap_err();
    assert_eq!((refused.count(), refused.iter().count()), (80, 50));
}
