//! The board: times, refusals, restarts, safe state.

use std::time::Duration;

use gnc_protocol::error::{FaultCode, NakCode};
use gnc_protocol::frame::{Kind, Payload};
use gnc_protocol::message::{
    Abort, AdRead, CpuFloats, CpuIntegers, CpuWords, ErrorKind, ErrorRecords, FlashErase, Heartbeat, Identity,
    IdentityReply, IoTest, LinkCounters, MakeSafe, ModulePower, RamTest, SciEcho, SpiTransfer, StreamStart, StreamStop,
    TimerMeasure, event,
};
use gnc_protocol::wire::{List, Wire};
use hw_mocks::{BenchOptions, Speed};

use crate::host::{Host, options};

fn list<T: Clone, const N: usize>(values: &[T]) -> List<T, N> {
    List::from_slice(values).unwrap_or_else(|_| panic!("at most {N}"))
}

#[test]
fn requests_take_their_board_time_to_the_microsecond() {
    let mut host = Host::new("good");
    assert_eq!(host.timed(&ModulePower { on: 1 }).0, 150_000);
    assert_eq!(host.timed(&Identity {}).0, 20_000);
    assert_eq!(host.timed(&RamTest { ram: 0, pattern: 0 }).0, 7_864);
    assert_eq!(host.timed(&AdRead { channels: 1, samples: 100 }).0, 11_000);
    assert_eq!(host.timed(&IoTest { driver: 0, reader: 1, level: 1 }).0, 1_000);
    let spi = SpiTransfer { direction: 0, clock_hz: 1_000_000, data: list(&[7; 100]) };
    assert_eq!(host.timed(&spi).0, 1_000);
    let sci = SciEcho { rate_baud: 1_000_000, data: list(&[7; 99]) };
    assert_eq!(host.timed(&sci).0, 1_500);
    assert_eq!(host.timed(&CpuWords { core: 2, target: 0, words: list(&[1; 50]) }).0, 1_100);
    // 20 intervals of 5 ms, 12 ppm long.
    assert_eq!(host.timed(&TimerMeasure { timer: 1, period_us: 5000, count: 20 }).0, 100_001);
}

#[test]
fn timers_keep_their_rate_and_count_their_interrupts() {
    let measure =
        |personality: &str| Host::powered(personality).ask(&TimerMeasure { timer: 0, period_us: 1000, count: 100 });
    let mean = |intervals: &[u32]| intervals.iter().map(|ns| f64::from(*ns)).sum::<f64>() / intervals.len() as f64;
    let good = measure("good");
    assert_eq!((good.interrupts, good.intervals_ns.len()), (100, 100));
    assert!((mean(&good.intervals_ns) - 1_000_012.0).abs() < 5.0);
    // The scatter of two latencies of 60 ns gives 85 ns for an interval.
    assert!(good.intervals_ns.iter().all(|ns| ns.abs_diff(1_000_012) < 500));
    let fast = measure("timer-fast");
    assert!((mean(&fast.intervals_ns) - 980_000.0).abs() < 5.0);
    let missing = measure("timer-misses-interrupts");
    assert_eq!((missing.interrupts, missing.intervals_ns.len()), (90, 90));
    assert_eq!(missing.intervals_ns.iter().filter(|ns| **ns > 1_900_000).count(), 9, "the tenth is at the end");
}

#[test]
fn cores_compute_as_the_message_says() {
    let mut host = Host::powered("good");
    let pairs = list(&[[i32::MIN, -1], [7, -2], [-7, 2], [i32::MAX, 2]]);
    let expected: &[[i32; 5]] = &[
        [i32::MAX, i32::MIN + 1, i32::MIN, i32::MIN, 0],
        [5, 9, -14, -3, 1],
        [-5, -9, -14, -3, -1],
        [-2_147_483_647, 2_147_483_645, -2, 1_073_741_823, 1],
    ];
    assert_eq!(host.ask(&CpuIntegers { core: 1, pairs: pairs.clone() }).results.as_slice(), expected);
    let floats = host.ask(&CpuFloats { core: 2, pairs: list(&[[1.0, 3.0]]) });
    assert_eq!(floats.results[0].map(f64::to_bits), [4.0, -2.0, 3.0, 0.333_333_333_333_333_3].map(f64::to_bits));
    let mut dead = Host::powered("core-2-dead");
    let (head, _) = dead.call(&CpuIntegers { core: 2, pairs: pairs.clone() }).unwrap();
    assert_eq!(head.status, FaultCode::DeviceTimeout);
    assert_eq!(dead.ask(&CpuIntegers { core: 1, pairs }).results.as_slice(), expected);
}

#[test]
fn refusals_name_what_is_wrong() {
    let mut host = Host::new("good");
    assert_eq!(
        host.refusal(&Identity {}),
        (NakCode::NotPowered as u16, "switch the module's supply on first".to_owned())
    );
    host.ask(&ModulePower { on: 1 });
    let bad = NakCode::BadParameter as u16;
    let cases = [
        (host.refusal(&TimerMeasure { timer: 7, period_us: 500, count: 1 }), "timer 7 is not in 0 to 2"),
        (host.refusal(&TimerMeasure { timer: 0, period_us: 99, count: 1 }), "period_us 99 is not in 100 to 100000"),
        (host.refusal(&AdRead { channels: 0, samples: 1 }), "channels 0 is not in 1 to 255"),
        (host.refusal(&IoTest { driver: 2, reader: 2, level: 0 }), "driver and reader are both line 2"),
        (host.refusal(&RamTest { ram: 2, pattern: 0 }), "ram 2 is not one of 0 (internal), 1 (SDRAM)"),
        (host.refusal(&CpuIntegers { core: 1, pairs: list(&[[1, 1], [1, 0]]) }), "b of pair 1 is 0; it must not be 0"),
        (
            host.refusal(&CpuFloats { core: 1, pairs: list(&[[f64::NAN, 1.0]]) }),
            "pair 0 (NaN, 1e0): operands must be finite, and b not 0",
        ),
        (host.refusal(&CpuWords { core: 0, target: 0, words: list(&[]) }), "core 0 is not in 1 to 2"),
        (
            host.refusal(&StreamStart { stream: 1, rate_hz: 1001, count: 0, samples_per_frame: 0 }),
            "rate_hz 1001 is not in 1 to 1000",
        ),
    ];
    for ((code, text), expected) in cases {
        assert_eq!((code, text.as_str()), (bad, expected));
    }
    let (code, text) = host.refusal(&FlashErase { flash: 1, sector: 4 });
    assert_eq!(
        (code, text.as_str()),
        (NakCode::Protected as u16, "sector 4 is not a scratch sector; those are 0 to 3")
    );
}

/// 60 payload bytes make a frame of 75 bytes on the line; a thousand of them a second at 10 bits are 6.5 times what
/// 115200 baud carry.
#[test]
fn stream_that_does_not_fit_is_refused_with_the_arithmetic() {
    let mut host = Host::with(&BenchOptions { rate_baud: 115_200, ..options("good", Speed::Max) });
    host.ask(&ModulePower { on: 1 });
    let (code, text) = host.refusal(&StreamStart { stream: 1, rate_hz: 1000, count: 0, samples_per_frame: 1 });
    assert_eq!(code, NakCode::DoesNotFit as u16);
    assert_eq!(text, "1000 Hz / 1 per frame * 75 B * 10 bit / 115200 baud = 6510 permille, others 0; at most 900");
    // Streams add up.
    host.ask(&StreamStart { stream: 2, rate_hz: 0, count: 0, samples_per_frame: 0 });
    let (_, text) = host.refusal(&StreamStart { stream: 1, rate_hz: 200, count: 0, samples_per_frame: 12 });
    assert!(text.contains("others 321"), "{text}");
}

#[test]
fn requests_that_share_a_device_conflict_and_others_do_not() {
    let mut host = Host::powered("good");
    let erase = host.post(&FlashErase { flash: 0, sector: 0 });
    let sdram = host.post(&RamTest { ram: 1, pattern: 4 });
    let (code, text) = host.refusal(&FlashErase { flash: 0, sector: 1 });
    assert_eq!((code, text.as_str()), (NakCode::Busy as u16, "in use by another request: SPI flash"));
    let (code, _) = host.refusal(&ModulePower { on: 0 });
    assert_eq!(code, NakCode::Busy as u16);
    host.ask(&IoTest { driver: 0, reader: 1, level: 1 });
    let io = host.post(&IoTest { driver: 0, reader: 1, level: 1 });
    let (code, text) = host.refusal(&SpiTransfer { direction: 0, clock_hz: 100_000, data: list(&[1]) });
    assert_eq!((code, text.as_str()), (NakCode::Busy as u16, "in use by another request: IO pins"));
    for request in [io, erase, sdram] {
        assert!(host.wait(request).is_ok());
    }
}

#[test]
fn abort_frees_the_device_but_a_flash_finishes_its_erase() {
    let mut host = Host::powered("good");
    let sdram = host.post(&RamTest { ram: 1, pattern: 4 });
    assert_eq!(host.ask(&Abort { request: sdram }).was_running, 1);
    host.ask(&RamTest { ram: 1, pattern: 2 });
    let erase = host.post(&FlashErase { flash: 0, sector: 0 });
    host.ask(&Abort { request: erase });
    assert_eq!(host.refusal(&FlashErase { flash: 0, sector: 0 }).0, NakCode::Busy as u16);
    host.ask(&RamTest { ram: 1, pattern: 0 });
    host.ask(&FlashErase { flash: 0, sector: 0 });
    assert_eq!(host.bench.truth().spi_flash_erases, 2);
    assert_eq!(host.ask(&Abort { request: 999 }).was_running, 0);
}

#[test]
fn make_safe_ends_everything() {
    let mut host = Host::powered("good");
    host.ask(&StreamStart { stream: 1, rate_hz: 100, count: 0, samples_per_frame: 0 });
    host.post(&RamTest { ram: 1, pattern: 4 });
    host.ask(&MakeSafe {});
    assert!(!host.bench.truth().powered);
    let beat = host.run_until(|f| f.header.kind == Kind::Event && f.header.message == event::HEARTBEAT);
    assert_eq!(Heartbeat::from_payload(&beat.payload).unwrap().state, 1, "session open, nothing else");
}

#[test]
fn board_without_a_host_makes_itself_safe_within_two_seconds() {
    let mut host = Host::powered("good");
    let silent_since = host.now;
    while host.bench.truth().powered {
        assert!(host.now - silent_since < Duration::from_secs(2), "{:?}", host.now - silent_since);
        host.now = host.bench.next_due(host.now).max(host.now + Duration::from_micros(1));
        host.bench.advance(host.now);
        let count = host.bench.output(host.now).len();
        host.bench.consume(count);
    }
}

#[test]
fn reboot_changes_the_boot_id_and_forgets_session_and_power() {
    let mut host = Host::powered("reboots-in-sdram");
    let boot_id = |frame: &gnc_protocol::Frame| Heartbeat::from_payload(&frame.payload).unwrap().boot_id;
    let is_beat = |f: &gnc_protocol::Frame| f.header.kind == Kind::Event && f.header.message == event::HEARTBEAT;
    let before = boot_id(&host.run_until(is_beat));
    assert_eq!(host.ask(&RamTest { ram: 0, pattern: 4 }).mismatches, 0, "the trigger is the SDRAM alone");
    host.post(&RamTest { ram: 1, pattern: 4 });
    let beat = host.run_until(|f| is_beat(f) && boot_id(f) != before);
    let beat = Heartbeat::from_payload(&beat.payload).unwrap();
    assert!(beat.board_time_us < 250_000 && beat.state == 0, "{beat:?}");
    assert_eq!(host.refusal(&Identity {}).0, NakCode::NoSession as u16);
    host.hello(2);
    assert_eq!(host.refusal(&Identity {}).0, NakCode::NotPowered as u16);
    host.ask(&ModulePower { on: 1 });
    assert_eq!(host.ask(&RamTest { ram: 0, pattern: 4 }).mismatches, 0);
    let truth = host.bench.truth();
    assert_eq!(truth.restarts, 1);
    host.post(&RamTest { ram: 1, pattern: 0 });
    host.run_until(|f| is_beat(f) && boot_id(f) != before && boot_id(f) != beat.boot_id);
}

#[test]
fn error_records_are_bounded_and_numbered() {
    let mut host = Host::powered("io-shorted");
    let pairs = || (0..4_u8).flat_map(|d| (0..4_u8).map(move |r| (d, r))).filter(|(d, r)| d != r);
    for _ in 0..4 {
        for ((driver, reader), level) in pairs().flat_map(|pair| [(pair, 0), (pair, 1)]) {
            host.ask(&IoTest { driver, reader, level });
        }
    }
    let first = host.ask(&ErrorRecords { from: 0 });
    // A pair other than 2-3 that includes line 2 or 3 shows the short: 8 ordered pairs, both levels, four times.
    assert_eq!(first.total, 64);
    assert_eq!(first.records.len(), 16);
    assert_eq!(first.records[0].kind, ErrorKind::IoMismatch as u16);
    assert_eq!(first.records[0].place, 2, "driver 0, reader 2");
    let last = host.ask(&ErrorRecords { from: 60 });
    assert_eq!(last.records.iter().map(|r| r.index).collect::<Vec<_>>(), [60, 61, 62, 63]);
    host.ask(&IoTest { driver: 0, reader: 2, level: 0 });
    assert_eq!(host.ask(&ErrorRecords { from: 0 }).records[0].index, 1, "the oldest gave way");
    host.hello(7);
    assert_eq!(host.ask(&ErrorRecords { from: 0 }).total, 0);
}

#[test]
fn supply_is_read_and_a_bad_one_recorded() {
    let reply = Host::new("good").ask(&ModulePower { on: 1 });
    assert!(reply.supply_uv.abs_diff(5_012_000) < 6_000 && reply.supply_ua.abs_diff(487_000) < 3_000, "{reply:?}");
    let mut low = Host::new("supply-low");
    low.ask(&ModulePower { on: 1 });
    let log = low.ask(&ErrorRecords { from: 0 });
    assert_eq!((log.records[0].kind, log.records[0].expected), (ErrorKind::Supply as u16, 5_000_000));
    assert!(low.ask(&ModulePower { on: 0 }).supply_uv < 20_000);
}

/// Power-on 3 is late by 750 ms, power-on 4 starts no module, power-on 5 finds another module in the socket.
#[test]
fn starts_go_wrong_at_the_power_ons_that_are_named() {
    let faults = "[start]\nlate_every = 3\nlate_ms = 750\nhangs_every = 4\n[module]\nswapped_after = 4\n";
    let mut host = Host::new(faults);
    let mut answers = Vec::new();
    for _ in 0..5 {
        host.ask(&ModulePower { on: 1 });
        let mut tries = 1;
        let serial_number = loop {
            let (head, body) = host.call(&Identity {}).unwrap();
            if head.status == FaultCode::None {
                break IdentityReply::from_payload(&body).unwrap().serial_number.as_str().to_owned();
            }
            assert_eq!((head.status, head.elapsed_us), (FaultCode::DeviceTimeout, 100_000));
            tries += 1;
            if tries > 20 {
                break String::new();
            }
        };
        answers.push((tries, serial_number));
        host.ask(&ModulePower { on: 0 });
    }
    let own = answers[0].1.clone();
    assert!(own != "SIM-OTHER" && !own.is_empty());
    // The supply settles for 150 ms, and the module starts at the end of that time: eight tries of 100 ms find it
    // silent.
    let expected = [(1, own.clone()), (1, own.clone()), (9, own), (21, String::new()), (1, "SIM-OTHER".to_owned())];
    assert_eq!(answers, expected);
}

/// The switch is welded, the meter has died after its first look, and the board answers for the module.
#[test]
fn a_board_that_lies_about_the_supply() {
    let faults =
        "[supply]\noff_voltage_v = 5.0\noff_current_a = 0.48\nmeter_holds = true\n[board]\ncaches_identity = true\n";
    let mut host = Host::powered(faults);
    let said = host.ask(&Identity {});
    let first = host.ask(&ModulePower { on: 1 });
    let off = host.ask(&ModulePower { on: 0 });
    assert!(off.supply_uv > 4_900_000 && off.supply_ua > 470_000, "{off:?}");
    assert_eq!(host.ask(&Identity {}), said);
    assert_eq!(host.ask(&ModulePower { on: 1 }), first);
}

#[test]
fn sci_faults_show_in_counters_and_bytes() {
    let data = list(&(0..=255).collect::<Vec<u8>>());
    let echo = SciEcho { rate_baud: 921_600, data };
    let good = Host::powered("good").ask(&echo);
    assert_eq!((good.data.as_slice(), good.framing_errors), (echo.data.as_slice(), 0));
    let lossy = Host::powered("sci-loses-bytes").ask(&echo);
    assert_eq!((lossy.data.len(), lossy.framing_errors), (255, 1));
    assert!(!lossy.data.contains(&199));
    let mut flipping = Host::powered("sci-flips-bits");
    flipping.ask(&echo);
    let flipped = flipping.ask(&echo);
    assert_eq!((flipped.data[43], flipped.framing_errors), (42, 0), "byte 300 of two blocks");
}

#[test]
fn damaged_frames_are_counted() {
    let mut host = Host::powered("good");
    let before = host.ask(&LinkCounters {});
    host.bench.receive(b"\0\x03xy\0rubbish\0", host.now);
    let after = host.ask(&LinkCounters {});
    assert_eq!(after.malformed + after.bad_checksum - before.malformed - before.bad_checksum, 2);
}

#[test]
fn true_speed_takes_wall_time_and_the_lines_pace() {
    let mut host = Host::with(&options("good", Speed::Times(1.0)));
    let started = host.now;
    let (elapsed_us, _) = host.timed(&ModulePower { on: 1 });
    assert_eq!(elapsed_us, 150_000);
    let span = host.now - started;
    assert!((Duration::from_millis(150)..Duration::from_millis(152)).contains(&span), "{span:?}");
    // A request of 272 and an answer of 280 bytes at 921600 baud: 6 ms of line beside 3.3 ms of SCI.
    let started = host.now;
    host.ask(&SciEcho { rate_baud: 921_600, data: list(&[5; 256]) });
    let span = host.now - started;
    assert!((Duration::from_millis(9)..Duration::from_millis(13)).contains(&span), "{span:?}");
    let mut fast = Host::with(&options("good", Speed::Times(10.0)));
    let started = fast.now;
    fast.ask(&ModulePower { on: 1 });
    let span = fast.now - started;
    assert!((Duration::from_millis(15)..Duration::from_millis(17)).contains(&span), "{span:?}");
}

#[test]
fn at_most_speed_time_stands_still_until_somebody_waits() {
    let mut host = Host::powered("good");
    let before = host.bench.bench_time_ns();
    for _ in 0..50 {
        host.turn();
        host.now += Duration::from_millis(100);
    }
    assert_eq!(host.bench.bench_time_ns(), before);
    let (done, woken) = std::sync::mpsc::channel();
    host.bench.sleep(Duration::from_secs(600), done);
    host.turn();
    assert!(woken.try_recv().is_ok());
    assert_eq!(host.bench.bench_time_ns(), before + 600_000_000_000);
}

#[test]
fn a_silent_board_says_nothing_and_a_late_one_says_it_late() {
    let mut silent = Host::without_session(&options("silent-board", Speed::Max));
    silent.send(Kind::Hello, 0, 0, Payload::new());
    for _ in 0..20 {
        assert!(silent.turn().is_empty());
    }
    let mut late = Host::with(&options("late-board", Speed::Max));
    let started = late.now;
    late.post(&ModulePower { on: 1 });
    late.run_until(|frame| frame.header.kind == Kind::Accept);
    assert!(late.now - started >= Duration::from_millis(80));
}

/// produced = received + dropped, for every kind of end of the stream.
#[test]
fn the_account_of_a_stream_closes_after_power_off_and_make_safe() {
    for by_power in [true, false] {
        let mut host = Host::powered("good");
        host.ask(&StreamStart { stream: 1, rate_hz: 1000, count: 0, samples_per_frame: 12 });
        host.ask(&TimerMeasure { timer: 0, period_us: 1000, count: 100 });
        if by_power {
            host.ask(&ModulePower { on: 0 });
        } else {
            host.ask(&MakeSafe {});
        }
        let stopped = host.ask(&StreamStop { stream: 1 });
        let received: u32 = host.streamed(1).iter().map(|frame| u32::from(frame.head.count)).sum();
        assert!(received >= 96, "{received}");
        assert_eq!(stopped.produced, received + stopped.dropped, "{stopped:?}");
        assert!(if by_power { stopped.dropped == 0 } else { (1..12).contains(&stopped.dropped) }, "{stopped:?}");
    }
}

#[test]
fn answers_go_ahead_of_samples_that_wait() {
    for rate_baud in [115_200, 921_600] {
        let mut host = Host::with(&BenchOptions { rate_baud, ..options("good", Speed::Times(1.0)) });
        host.ask(&ModulePower { on: 1 });
        let rate_hz = if rate_baud == 115_200 { 200 } else { 1000 };
        host.ask(&StreamStart { stream: 1, rate_hz, count: 0, samples_per_frame: 10 });
        // The output is not read.
        for _ in 0..8 {
            host.send(Kind::Event, 0, event::KEEP_ALIVE, Payload::new());
            for _ in 0..25 {
                host.now += Duration::from_millis(10);
                host.bench.advance(host.now);
            }
        }
        let before = host.frames.len();
        let counters = host.post(&LinkCounters {});
        host.run_until(|frame| frame.header.kind == Kind::Accept && frame.header.request == counters);
        let ahead = host.frames[before..].iter().take_while(|frame| frame.header.kind != Kind::Accept).count();
        assert!(ahead <= 8, "{ahead} frames came first at {rate_baud} baud");
        let stopped = host.ask(&StreamStop { stream: 1 });
        let received: u32 = host.streamed(1).iter().map(|frame| u32::from(frame.head.count)).sum();
        assert_eq!(stopped.produced, received + stopped.dropped, "{stopped:?}");
        assert!(stopped.dropped > 0, "{stopped:?}");
    }
}
