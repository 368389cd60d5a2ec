use super::*;
use crate::event::{BenchInfo, EventKind};
use crate::journal;
use crate::state::RunState;
use crate::test_run::{SMALL, TestRun, header, job, small_run};
use crate::verdict::Verdict;

fn record() -> RunRecord {
    RunRecord::from_state(&small_run(header()).state).unwrap()
}

#[test]
fn one_line_for_each_item() {
    let lines: Vec<String> = record().items.iter().map(item_line).collect();
    insta::assert_snapshot!(lines.join("\n"), @r#"
    marginal  identity             1.25 s  supply_current 0.468 A (0.4655 .. 0.5145 A)
    failed    sdram                1.75 s  mismatches_solid 4096 (== 0) and 1 more
    errored   imu                  1.75 s  attempt 2  the slave board restarted during the request
    skipped   io                           requires sdram, which failed
    "#);
}

#[test]
fn the_failing_rows_say_what_to_look_at() {
    insta::assert_snapshot!(failing_rows(&record()), @r#"
    identity marginal
      marginal  supply_current 0.468 A (0.4655 .. 0.5145 A)
                look at: Too much: look for a short or a wrongly placed part; too little: a part is missing or does not start.
    sdram failed
      failed    mismatches_solid 4096 (== 0)
                look at: Bits stay 0 or 1: the first failing address and word in the error record name the line or the cell.
      failed    test_time 2.0000004 s (<= 2 s)
                look at: The memory answers slowly: check its clock and its wait states.
      board:    mismatch at 0x80001000: expected 0xffffffff, got 0xfffffffe (board time 1.23 s)
    imu errored
      error:    the slave board restarted during the request
                try: check its supply
    "#);
}

#[test]
fn a_bench_without_a_proven_board_is_called_unproven() {
    let mut header = header();
    header.bench = BenchInfo::real().in_doubt(Some("port /tmp/\u{1b}board is a pseudo-terminal".to_owned()));
    let record = RunRecord::from_state(&small_run(header).state).unwrap();
    insta::assert_snapshot!(format!("{}\n{}", banners(&record).join("\n"), verdict_line(&record)), @r"
    UNPROVEN BENCH (port /tmp/\u{1b}board is a pseudo-terminal): no evidence about any module
    ERRORED (unproven)  DEMO-1  small 1.0  1 marginal, 1 failed, 1 errored, 1 skipped  in 6.50 s
    ");
    assert!(log_txt(&record).starts_with("*** UNPROVEN BENCH"));
    let bench = log_txt(&record).lines().find(|line| line.starts_with("Bench")).unwrap().to_owned();
    insta::assert_snapshot!(bench, @r"Bench         unproven, port /tmp/\u{1b}board is a pseudo-terminal");
    // A simulated bench is that whatever its link is, and without a doubt a bench stays what it is.
    let simulated = BenchInfo::simulated("good-1", "max", 7);
    assert_eq!(simulated.clone().in_doubt(Some("a pseudo-terminal".to_owned())), simulated);
    assert_eq!(BenchInfo::real().in_doubt(None), BenchInfo::real());
}

#[test]
fn the_verdict_never_hides_what_it_is_worth() {
    let mut header = header();
    header.bench = BenchInfo::simulated("boards/good\u{1b}.toml", "max", 7);
    header.selection = Some(vec!["identity".to_owned(), "sdram".to_owned()]);
    header.serial_number = "../\u{1b}[2JX".to_owned();
    let run = small_run(header);
    let record = RunRecord::from_state(&run.state).unwrap();
    insta::assert_snapshot!(format!("{}\n{}", banners(&record).join("\n"), verdict_line(&record)), @r#"
    SIMULATED BENCH (boards/good\u{1b}.toml): no evidence about any module
    SELECTION (identity, sdram): not a pass of the module
    ERRORED (simulated, selection)  ../\u{1b}[2JX  small 1.0  1 marginal, 1 failed, 1 errored, 1 skipped  in 6.50 s
    "#);
    assert!(log_txt(&record).starts_with("*** SIMULATED BENCH"));
    let lines: String = run.events.iter().take(8).map(|event| journal::line(event).unwrap()).collect();
    let cut = journal::fold(lines.as_bytes()).unwrap();
    let record = RunRecord::from_state(&cut.state).unwrap();
    insta::assert_snapshot!(format!("{}\n{}", banners(&record).join("\n"), verdict_line(&record)), @r#"
    SIMULATED BENCH (boards/good\u{1b}.toml): no evidence about any module
    SELECTION (identity, sdram): not a pass of the module
    INTERRUPTED: the run has no end, and its record shows what is known
    INTERRUPTED (simulated, selection)  ../\u{1b}[2JX  small 1.0  4 not run  in 1.75 s
    "#);
    assert_eq!(RunRecord::from_state(&RunState::new()), None);
}

/// Good items of a selection have a word of their own, and judging samples again is marked like a simulation.
#[test]
fn a_selection_and_a_second_judgement_are_called_what_they_are() {
    let record = |selection: Option<Vec<String>>, recomputed: Option<crate::event::EarlierRun>| {
        let mut run = TestRun::new(&job(SMALL), crate::event::RunHeader { selection, recomputed, ..header() });
        run.emit(EventKind::RunEnded(Verdict::new(Outcome::Passed, run.state.is_selection())));
        RunRecord::from_state(&run.state).unwrap()
    };
    let of = crate::event::EarlierRun { run: "143015-small".to_owned(), journal_sha256: "00".repeat(32) };
    let told = [record(Some(vec!["identity".to_owned()]), None), record(None, Some(of))].map(|record| {
        let log = log_txt(&record);
        assert!(banners(&record).iter().all(|banner| log.matches(banner).count() == 2), "{log}");
        format!("{}\n{}", verdict_line(&record), banners(&record).join("\n"))
    });
    insta::assert_snapshot!(told.join("\n"), @r#"
    PARTIAL (selection)  DEMO-1  small 1.0  4 not run  in 0.25 s
    SELECTION (identity): not a pass of the module
    PASSED (re-judged)  DEMO-1  small 1.0  4 not run  in 0.25 s
    RE-JUDGED (the samples of run 143015-small by these limits): the module was not tested again
    "#);
}

#[test]
fn the_log_holds_everything() {
    let mut header = header();
    header.bench = BenchInfo::simulated("good-1", "1", 42);
    let record = RunRecord::from_state(&small_run(header).state).unwrap();
    insta::assert_snapshot!(log_txt(&record), @r#"
    *** SIMULATED BENCH (good-1): no evidence about any module ***
    Serial number DEMO-1
    Plan          small 1.0, SHA-256 0000000000000000000000000000000000000000000000000000000000000000
    Station       line-2
    Operator      Li Wei
    Program       gnc-station 0.1.0
    Bench         simulated, personality good-1, speed 1, seed 42
    Board         SB-7, firmware 1.4.0, protocol 1, boot 77, /dev/ttyUSB0 at 921600 bit/s
    Start         2026-11-22 14:30:15.000 +08:00
    Elapsed       6.500 s
    End           2026-11-22 14:30:21.500 +08:00

    marginal  identity             1.25 s  supply_current 0.468 A (0.4655 .. 0.5145 A)
      attempt 1: marginal, start 2026-11-22 14:30:15.750 +08:00, elapsed 1.00 s
        passed    serial_number DEMO-1 (== DEMO-1)
        -         firmware 2.1\u{1b}[31m
        marginal  supply_current 0.468 A (0.4655 .. 0.5145 A)

    failed    sdram                1.75 s  mismatches_solid 4096 (== 0) and 1 more
      attempt 1: failed, start 2026-11-22 14:30:17.250 +08:00, elapsed 1.50 s
        failed    mismatches_solid 4096 (== 0)
        -         words_tested 33554432
        failed    test_time 2.0000004 s (<= 2 s)
        board:    mismatch at 0x80001000: expected 0xffffffff, got 0xfffffffe (board time 1.23 s)

    errored   imu                  1.75 s  attempt 2  the slave board restarted during the request
      attempt 1: errored, start 2026-11-22 14:30:19.250 +08:00, elapsed 0.50 s
        errored   gyro_x NaN (-2 .. 2 deg/s)
      attempt 2: errored, start 2026-11-22 14:30:20.000 +08:00, elapsed 0.50 s
        error:    the slave board restarted during the request

    skipped   io                           requires sdram, which failed

    Notes
      2026-11-22 14:30:20.250 +08:00       5.250 s  error    imu: the slave board restarted
      2026-11-22 14:30:20.750 +08:00       5.750 s  info     supply off\u{7}

    Not good
    identity marginal
      marginal  supply_current 0.468 A (0.4655 .. 0.5145 A)
                look at: Too much: look for a short or a wrongly placed part; too little: a part is missing or does not start.
    sdram failed
      failed    mismatches_solid 4096 (== 0)
                look at: Bits stay 0 or 1: the first failing address and word in the error record name the line or the cell.
      failed    test_time 2.0000004 s (<= 2 s)
                look at: The memory answers slowly: check its clock and its wait states.
      board:    mismatch at 0x80001000: expected 0xffffffff, got 0xfffffffe (board time 1.23 s)
    imu errored
      error:    the slave board restarted during the request
                try: check its supply

    ERRORED (simulated)  DEMO-1  small 1.0  1 marginal, 1 failed, 1 errored, 1 skipped  in 6.50 s
    *** SIMULATED BENCH (good-1): no evidence about any module ***
    "#);
}

#[test]
fn no_control_character_leaves_this_module() {
    let hostile = "\u{1b}[2J\u{9b}A\u{7}\u{202e}x\r\n";
    let mut header = header();
    header.serial_number = hostile.to_owned();
    header.operator = Some(hostile.to_owned());
    header.station = hostile.to_owned();
    header.plan.name = hostile.to_owned();
    header.bench = BenchInfo::simulated(hostile, hostile, 1);
    header.selection = Some(vec![hostile.to_owned()]);
    let mut record = RunRecord::from_state(&small_run(header).state).unwrap();
    for item in &mut record.items {
        item.name = hostile.to_owned();
        for attempt in &mut item.attempts {
            for measurement in &mut attempt.measurements {
                measurement.name = hostile.to_owned();
                measurement.value = Reading::Text(hostile.to_owned());
                measurement.expected = Some(hostile.to_owned());
            }
        }
    }
    let text = format!("{}{}{}", log_txt(&record), verdict_line(&record), failing_rows(&record));
    assert!(!text.chars().any(|c| c.is_control() && c != '\n' || c == '\u{202e}'), "{text:?}");
}

#[test]
fn lines_stay_lines_whatever_a_barcode_reader_delivers() {
    let mut header = header();
    header.serial_number = "9".repeat(10_000);
    let mut record = RunRecord::from_state(&small_run(header).state).unwrap();
    if let Some(error) = &mut record.items[2].attempts[1].error {
        error.text = "x".repeat(10_000);
    }
    assert!(verdict_line(&record).len() < 200);
    assert!(item_line(&record.items[2]).chars().count() < 200);
    assert!(log_txt(&record).contains(&"9".repeat(10_000)), "the log has all of it");
}

#[test]
fn durations_read_well() {
    for (seconds, expected) in [
        (0.0, "0.00 s"),
        (0.314, "0.31 s"),
        (9.99, "9.99 s"),
        (9.996, "10.0 s"),
        (59.94, "59.9 s"),
        (59.96, "1 min 00 s"),
        (125.4, "2 min 05 s"),
        (3599.7, "1 h 00 min"),
        (7380.0, "2 h 03 min"),
        (f64::NAN, "unknown"),
        (-1.0, "unknown"),
        (1e300, "unknown"),
    ] {
        assert_eq!(duration(seconds), expected, "{seconds}");
    }
}
