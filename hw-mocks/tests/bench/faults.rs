//! Tests every personality against wide common-sense bounds: exactly the items that its file names show a fault.
//!
//! The bounds are those of the specification if it has some, otherwise wide ones. They belong to this test, not to the
//! bench.

use std::collections::BTreeSet;

use gnc_protocol::frame::Kind;
use gnc_protocol::message::{
    AdRead, CpuFloats, CpuIntegers, CpuWords, FlashBlankCheck, FlashErase, FlashVerify, FlashWrite, Identity, IoTest,
    ModulePower, RamTest, SciEcho, SpiTransfer, StreamStart, StreamStop, TimerMeasure,
};
use gnc_protocol::stream::ImuSample;
use gnc_protocol::wire::{List, Wire};
use gnc_protocol::{Call, Frame};
use hw_mocks::{BenchOptions, ModuleAxis, Personality, Sign, Speed, boards};

use crate::host::{Host, options};

const SERIAL_NUMBER: &str = "LABEL-1";

/// Sends a request that may find the board gone: then the board is brought up again, and the answer is `None`, as for a
/// fault.
fn ask<C: Call>(host: &mut Host, call: &C) -> Option<C::Reply> {
    let restarts = host.bench.truth().restarts;
    let request = host.post(call);
    loop {
        let ended = |frame: &Frame| frame.header.request == request && frame.header.kind == Kind::Result;
        let came = host.turn();
        if let Some(frame) = came.iter().find(|frame| ended(frame)) {
            let (head, body) = frame.payload.split_at(6);
            let reply = (head[..2] == [0, 0]).then(|| C::Reply::from_payload(body).unwrap());
            host.frames.extend(came);
            return reply;
        }
        host.frames.extend(came);
        if host.bench.truth().restarts != restarts {
            host.run_until(|frame| frame.header.kind == Kind::Event);
            host.hello(1000 + u32::from(request));
            host.ask(&ModulePower { on: 1 });
            return None;
        }
    }
}

fn list<T: Clone, const N: usize>(values: &[T]) -> List<T, N> {
    List::from_slice(values).unwrap_or_else(|_| panic!("at most {N}"))
}

fn identity(host: &mut Host) -> Option<bool> {
    let who = ask(host, &Identity {})?;
    let supply = ask(host, &ModulePower { on: 1 })?;
    let supplied = (4_750_000..=5_250_000).contains(&supply.supply_uv);
    Some(supplied && who.serial_number.as_str() == SERIAL_NUMBER && who.firmware.as_str() == "1.4.0")
}

fn cpu(host: &mut Host) -> Option<bool> {
    let mut good = true;
    for core in [1, 2] {
        let words = list(&[0x5555_aaaa, u32::MAX, 0]);
        good &= ask(host, &CpuWords { core, target: 1, words: words.clone() })?.words == words;
        let integers = ask(host, &CpuIntegers { core, pairs: list(&[[1001, 777], [-13, 5]]) })?;
        good &= integers.results.as_slice() == [[1778, 224, 777_777, 1, 224], [-8, -18, -65, -2, -3]];
        let floats = ask(host, &CpuFloats { core, pairs: list(&[[1.5, 0.25]]) })?;
        good &= floats.results.as_slice() == [[1.75, 1.25, 0.375, 6.0]];
    }
    Some(good)
}

fn timers(host: &mut Host) -> Option<bool> {
    let mut good = true;
    for timer in 0..3 {
        let reply = ask(host, &TimerMeasure { timer, period_us: 1000, count: 20 })?;
        let near = |ns: &u32| ns.abs_diff(1_000_000) < 10_000;
        good &= reply.interrupts == 20 && reply.intervals_ns.iter().all(near);
    }
    Some(good)
}

fn ram(host: &mut Host, ram: u8) -> Option<bool> {
    let mut good = true;
    for pattern in 0..5 {
        good &= ask(host, &RamTest { ram, pattern })?.mismatches == 0;
    }
    Some(good)
}

fn flash(host: &mut Host, flash: u8, longest_us: u32) -> Option<bool> {
    let (sector, seed) = (0, 0x1234_5678);
    let erase = ask(host, &FlashErase { flash, sector })?;
    let blank = ask(host, &FlashBlankCheck { flash, sector })?;
    ask(host, &FlashWrite { flash, sector, seed })?;
    let verify = ask(host, &FlashVerify { flash, sector, seed })?;
    Some(erase.duration_us < longest_us && blank.mismatches == 0 && verify.mismatches == 0)
}

fn imu(host: &mut Host) -> Option<bool> {
    host.frames.clear();
    ask(host, &StreamStart { stream: 1, rate_hz: 200, count: 400, samples_per_frame: 0 })?;
    let mut samples: Vec<ImuSample> = Vec::new();
    while samples.len() < 400 {
        host.run_until(|frame| frame.header.kind == Kind::Stream);
        let bytes: Vec<u8> = host.streamed(1).iter().flat_map(|frame| frame.samples.to_vec()).collect();
        samples = bytes.chunks(40).map(|sample| ImuSample::from_payload(sample).unwrap()).collect();
    }
    // All channels equal (a chip that is not read), a jump, or a repeated conversion. Two of 400 prove nothing yet.
    let same = |codes: &[i32; 3]| codes[0] == codes[1] && codes[1] == codes[2];
    let middle = [0, 1, 2].map(|axis| {
        let mut codes: Vec<i32> = samples.iter().map(|sample| sample.accel[axis]).collect();
        codes.sort_unstable();
        codes[200]
    });
    // A magnetometer whose values never change is absent.
    let field_is_read = samples.windows(2).any(|pair| pair[0].mag != pair[1].mag);
    let odd = |sample: &ImuSample| {
        let jumps = (0..3).any(|axis| (sample.accel[axis] - middle[axis]).abs() > 32_000);
        same(&sample.gyro) || same(&sample.accel) || (field_is_read && same(&sample.mag)) || jumps
    };
    let stale =
        samples.windows(2).filter(|pair| pair[0].gyro == pair[1].gyro || pair[0].accel == pair[1].accel).count();
    if stale > 2 || samples.iter().filter(|sample| odd(sample)).count() > 2 {
        return Some(false);
    }
    samples.retain(|sample| !odd(sample));
    let good = |pick: &dyn Fn(&ImuSample) -> i32, expected: f64, within: f64, noise: f64, lsb: f64| {
        let values: Vec<f64> = samples.iter().map(|sample| f64::from(pick(sample)) / lsb).collect();
        let n = values.len() as f64;
        let mean = values.iter().sum::<f64>() / n;
        let deviation = (values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (n - 1.0)).sqrt();
        (mean - expected).abs() < within && deviation < noise && deviation > 1e-6
    };
    Some((0..3).all(|axis| {
        let up = f64::from(u8::from(axis == 2));
        good(&|s| s.gyro[axis], 0.0, 0.5, 0.1, 20_000.0) && good(&|s| s.accel[axis], up, 0.05, 0.005, 160_000.0)
    }))
}

fn gnss(host: &mut Host) -> Option<bool> {
    host.frames.clear();
    ask(host, &StreamStart { stream: 3, rate_hz: 0, count: 0, samples_per_frame: 0 })?;
    ask(host, &StreamStart { stream: 2, rate_hz: 0, count: 12_000, samples_per_frame: 0 })?;
    let text = loop {
        let text: Vec<u8> = host.streamed(2).iter().flat_map(|frame| frame.samples.to_vec()).collect();
        if text.len() == 12_000 {
            break String::from_utf8(text).unwrap();
        }
        host.run_until(|frame| frame.header.kind == Kind::Stream);
    };
    ask(host, &StreamStop { stream: 3 })?;
    let last = text.lines().rfind(|line| line.starts_with("$GPGGA") && line.contains('*')).unwrap();
    let fields: Vec<&str> = last.split(',').collect();
    let north_m = |field: &str| (field[2..].parse::<f64>().unwrap() - 13.926) * 1852.0;
    let near = fields[6] == "1" && fields[2].starts_with("34") && north_m(fields[2]).abs() < 30.0;
    Some(near && host.streamed(3).len() >= 2)
}

fn ad(host: &mut Host) -> Option<bool> {
    let mut good = true;
    let read = |host: &mut Host| {
        let reply = ask(host, &AdRead { channels: 0xff, samples: 50 })?;
        Some(reply.channels.iter().map(|channel| f64::from(channel.mean_uv) * 1e-6).collect::<Vec<f64>>())
    };
    let off = read(host)?;
    for (index, rail_v) in [5.0, 3.3, 1.2, 0.0, 0.0].into_iter().enumerate() {
        host.bench.set_switch(index as u8 + 1, true);
        good &= (read(host)?[index + 3] - rail_v).abs() < 0.05 * rail_v + 0.06;
        host.bench.set_switch(index as u8 + 1, false);
    }
    host.bench.set_axis_up(ModuleAxis::X, Sign::Plus);
    let turned = read(host)?;
    host.bench.set_axis_up(ModuleAxis::Z, Sign::Plus);
    Some(good && (0..3).all(|axis| (turned[axis] - off[axis]).abs() > 0.05))
}

fn io(host: &mut Host) -> Option<bool> {
    let mut good = true;
    for (driver, reader) in (0..4_u8).flat_map(|d| (0..4_u8).map(move |r| (d, r))).filter(|(d, r)| d != r) {
        for level in [0, 1] {
            let pair = 1 << driver | 1 << reader;
            let expected = if level == 1 { pair } else { 15 ^ pair };
            good &= ask(host, &IoTest { driver, reader, level })?.levels == expected;
        }
    }
    Some(good)
}

fn spi(host: &mut Host) -> Option<bool> {
    let data = list(&(0..=255).collect::<Vec<u8>>());
    let mut good = true;
    for direction in [0, 1] {
        good &= ask(host, &SpiTransfer { direction, clock_hz: 1_000_000, data: data.clone() })?.data == data;
    }
    Some(good)
}

fn sci(host: &mut Host) -> Option<bool> {
    let data = list(&(0..=255).collect::<Vec<u8>>());
    let mut good = true;
    for _ in 0..2 {
        let reply = ask(host, &SciEcho { rate_baud: 921_600, data: data.clone() })?;
        good &= reply.data == data && reply.framing_errors == 0;
    }
    Some(good)
}

type Probe = fn(&mut Host) -> Option<bool>;

const PROBES: [(&str, Probe); 13] = [
    ("identity", identity),
    ("cpu", cpu),
    ("timers", timers),
    ("internal-ram", |host| ram(host, 0)),
    ("sdram", |host| ram(host, 1)),
    ("spi-flash", |host| flash(host, 0, 400_000)),
    ("internal-flash", |host| flash(host, 1, 1_000_000)),
    ("imu", imu),
    ("gnss", gnss),
    ("ad", ad),
    ("io", io),
    ("spi", spi),
    ("sci", sci),
];

fn failing(personality: Personality) -> BTreeSet<String> {
    let base = options("good", Speed::Max);
    let mut host = Host::with(&BenchOptions { personality, serial_number: Some(SERIAL_NUMBER.to_owned()), ..base });
    host.ask(&ModulePower { on: 1 });
    let wrong = PROBES.iter().filter(|(_, probe)| probe(&mut host) != Some(true));
    let wrong: BTreeSet<String> = wrong.map(|(item, _)| (*item).to_owned()).collect();
    // A module that is another one or lacks supply is not tested further: consequences of that are not named.
    if wrong.contains("identity") { BTreeSet::from(["identity".to_owned()]) } else { wrong }
}

#[test]
fn each_personality_shows_in_exactly_the_items_it_names() {
    for (name, text) in boards() {
        let personality = Personality::from_toml(name, text).unwrap();
        if personality.expect["functional"].outcome == "errored" {
            // The line is bad, which says nothing about the module.
            continue;
        }
        // CAN has no probe here: `can.rs` tests its faults frame by frame.
        let items = personality.expect["functional"].items.iter().filter(|item| *item != "can");
        let expected: BTreeSet<String> = items.cloned().collect();
        assert_eq!(failing(personality), expected, "{name}");
    }
}

/// Half and twice the bound of each quantity that a file may set, against the bounds of this test.
#[test]
fn quantities_pass_at_half_and_fail_at_twice_a_bound() {
    let cases = [
        ("timers", "[timers]\nrate_error_ppm = ", 10_000.0, ""),
        ("imu", "[accel]\noffset_g = [0.0, 0.0, ", 0.05, "]"),
        ("ad", "[rails]\nv3v3_v = ", 3.3 - 0.225, ""),
    ];
    for (item, before, bound, after) in cases {
        let value = |factor: f64| if item == "ad" { 3.3 - factor * (3.3 - bound) } else { factor * bound };
        for (factor, expected) in [(0.5, vec![]), (2.0, vec![item.to_owned()])] {
            let text = format!("{before}{}{after}\n", value(factor));
            let personality = Personality::from_toml("mine", &text).unwrap();
            assert_eq!(failing(personality), expected.into_iter().collect(), "{text}");
        }
    }
}
