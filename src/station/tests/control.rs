//! What people ask of the run service and of a run that goes on, on the simulated bench: rounds, a pause, the end of an
//! item, a look without a run.

#![cfg(feature = "sim")]
#![expect(clippy::expect_used, clippy::panic, reason = "a test says what it expected")]

#[path = "played/played.rs"]
mod played;

use std::path::Path;
use std::time::Duration;

use gnc_bench::control::RunControl;
use gnc_bench::runner::{Ending, Live, looking};
use gnc_bench::service::{Observer, Rounds, RunRequest};
use gnc_board::{BoardClient, BoardLease, Readings};
use gnc_executive::event::{BuildInfo, Event, EventKind, ProgramVersion};
use gnc_executive::outcome::Outcome;
use gnc_executive::plan::OnFail;
use gnc_executive::state::RunState;
use gnc_executive::verdict::Verdict;
use gnc_link::{Link, Target};
use gnc_protocol::calibration::{Calibration, CalibrationCommit, CalibrationWrite};
use gnc_protocol::message::ModulePower;
use gnc_records::store::{RunFolder, Watcher};
use hw_mocks::{BenchOptions, RunningBench, Speed};
use played::{outcomes, request, run_plan, serve};
use tokio::sync::watch;

const PLAN: &str = r#"
name = "short"
version = "1"
[[item]]
id = "cpu"
[item.limits]
core1_register_errors = "<= 0"
[[item]]
id = "imu"
requires = ["cpu"]
params = { samples = 5000, rate = "50 Hz" }
timeout = "200 s"
[item.limits]
gyro_x = "0 +- 1 deg/s"
[[item]]
id = "timers"
requires = ["cpu"]
[item.limits]
"timer1_interrupts_missing" = "<= 0"
"#;

/// Two streams. A line of 115,200 baud carries only one of them at a time.
const CROWDED: &str = r#"
name = "crowded"
version = "1"
[[item]]
id = "gnss"
params = { start = "hot", window = "3 s" }
[item.limits]
fix_type = "== 3D"
[[item]]
id = "imu"
params = { samples = 400, rate = "200 Hz" }
[item.limits]
gyro_x = "0 +- 1 deg/s"
"#;

/// Runs the short plan. `watch` sees every event and may ask for anything. Returns the run as it ended.
fn run(speed: Speed, watch: impl Fn(&Event, &RunControl) + Send + 'static) -> RunState {
    run_plan(PLAN, &BenchOptions { speed, ..BenchOptions::default() }, watch)
}

/// What happens to a round.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Fate {
    Shown,
    /// The face cannot show it.
    Unshown,
    /// Its record cannot be opened.
    Unwritable,
    /// Its folder is removed while it runs.
    Removed,
}

/// The fates of the rounds in order; later rounds are shown.
struct Fated<'a> {
    fates: std::slice::Iter<'a, Fate>,
}

impl Observer for Fated<'_> {
    fn begin(&mut self, folder: &RunFolder) -> std::io::Result<Watcher> {
        let (fate, folder) = (self.fates.next().copied().unwrap_or(Fate::Shown), folder.path().to_owned());
        if fate == Fate::Unshown {
            return Err(std::io::Error::other("no thread"));
        }
        if fate == Fate::Unwritable {
            // The plan cannot be filed in a file.
            std::fs::write(folder.join("plan"), "")?;
        }
        Ok(Box::new(move |event| {
            if fate == Fate::Removed && matches!(event.kind, EventKind::ItemStarted { .. }) {
                let _ = std::fs::remove_dir_all(&folder);
            }
            true
        }))
    }

    async fn end(&mut self, _: &Path, _: &Ending) {}
}

/// Checks the outcomes of the rounds, and the refusal of the last round that was asked for.
#[track_caller]
fn check_rounds(rounds: Rounds, on_fail: Option<OnFail>, limit: &str, fates: &[Fate], expected: (&[Outcome], &str)) {
    let plan = format!(
        "name = \"short\"\nversion = \"1\"\n[[item]]\nid = \"cpu\"\nlimits.core1_register_errors = \"{limit}\"\n"
    );
    let request = RunRequest { rounds, on_fail, ..request(&plan) };
    let options = BenchOptions { speed: Speed::Max, ..BenchOptions::default() };
    let done =
        serve(&request, &options, &RunControl::default(), Fated { fates: fates.iter() }, |_| {}).expect("one round");
    let refused = done.refused.as_ref().map(|error| gnc_text::with_causes(error)).unwrap_or_default();
    let ended: Vec<Option<Outcome>> = done.verdicts.iter().map(|verdict| verdict.of_module()).collect();
    let wanted: Vec<Option<Outcome>> = expected.0.iter().copied().map(Some).collect();
    assert_eq!((ended, refused.as_str()), (wanted, expected.1));
}

#[test]
fn rounds_end_when_there_is_a_reason() {
    use Outcome::{Errored, Failed, Passed};
    let (good, bad) = ("<= 0", "1 .. 2");
    let stop = Some(OnFail::Stop);
    check_rounds(Rounds::Once, None, good, &[], (&[Passed], ""));
    check_rounds(Rounds::Count(3), None, bad, &[], (&[Failed; 3], ""));
    check_rounds(Rounds::Count(3), stop, good, &[], (&[Passed; 3], ""));
    check_rounds(Rounds::Count(3), stop, bad, &[], (&[Failed], ""));
    check_rounds(Rounds::For(Duration::ZERO), None, good, &[], (&[Passed], ""));
    // A module is not tested further without a record, nor without a face that shows it.
    check_rounds(Rounds::Count(3), None, good, &[Fate::Shown, Fate::Removed], (&[Passed, Errored], ""));
    let unshown = (&[Passed, Errored][..], "cannot start: no thread");
    check_rounds(Rounds::Count(3), None, good, &[Fate::Shown, Fate::Unshown], unshown);
}

/// A signal that comes as a round ends: after which round, and the handle that it asks.
struct Signal<'a> {
    after: usize,
    control: &'a RunControl,
}

impl Observer for Signal<'_> {
    fn begin(&mut self, _: &RunFolder) -> std::io::Result<Watcher> {
        Ok(Box::new(|_| true))
    }

    async fn end(&mut self, _: &Path, _: &Ending) {
        self.after -= 1;
        if self.after == 0 {
            self.control.stop("SIGTERM");
        }
    }
}

/// A stop between rounds is no pass of the rounds that were asked for, though each round that was begun passed. One that
/// comes when all is done stops nothing.
#[test]
fn a_stop_between_rounds_is_no_pass() {
    let plan = "name = \"short\"\nversion = \"1\"\n[[item]]\nid = \"cpu\"\nlimits.core1_register_errors = \"<= 0\"\n";
    let options = BenchOptions { speed: Speed::Max, ..BenchOptions::default() };
    let hour = Duration::from_secs(3600);
    for (rounds, after, verdict, told) in [
        (Rounds::Count(3), 1, Outcome::Aborted, Some("stopped by SIGTERM: 2 of 3 rounds were not begun")),
        (Rounds::Count(2), 2, Outcome::Passed, None),
        (Rounds::Once, 1, Outcome::Passed, None),
        (
            Rounds::For(hour),
            2,
            Outcome::Aborted,
            Some("stopped by SIGTERM after round 2, before the time for rounds was over"),
        ),
    ] {
        let control = RunControl::default();
        let request = RunRequest { rounds, ..request(plan) };
        let done = serve(&request, &options, &control, Signal { after, control: &control }, |_| {}).expect("rounds");
        assert_eq!(done.verdicts, vec![Verdict::Module(Outcome::Passed); after], "{rounds:?}");
        let stopped = done.stopped.as_ref().map(ToString::to_string);
        assert_eq!((done.verdict(), stopped.as_deref()), (Verdict::Module(verdict), told), "{rounds:?}");
    }
}

/// If the first round cannot begin, nothing is run.
#[test]
fn a_first_round_that_cannot_begin_is_refused() {
    let options = BenchOptions { speed: Speed::Max, ..BenchOptions::default() };
    let refused = |request: &RunRequest, fates: &[Fate]| {
        let refused = serve(request, &options, &RunControl::default(), Fated { fates: fates.iter() }, |_| {});
        gnc_text::with_causes(&refused.expect_err("refused"))
    };
    let asked = request(PLAN);
    assert_eq!(refused(&asked, &[Fate::Unshown]), "cannot start: no thread");
    let unwritable = refused(&asked, &[Fate::Unwritable]);
    assert!(unwritable.starts_with("cannot create "), "{unwritable}");
    let unknown = RunRequest { selection: Some(vec!["cpo".to_owned()]), ..asked.clone() };
    assert!(refused(&unknown, &[]).contains("cpo"), "{}", refused(&unknown, &[]));
    let gone = RunRequest { resume: Some("records/gone".into()), ..asked };
    let told = "the run to resume cannot be read: cannot read records/gone/events.jsonl: ";
    assert!(refused(&gone, &[]).starts_with(told), "{}", refused(&gone, &[]));
}

/// A clock from before the program's commit is no date for a record: the module gets no power.
#[test]
fn a_clock_before_the_program_is_refused() {
    let options = BenchOptions { speed: Speed::Max, ..BenchOptions::default() };
    let at = |text: &str| chrono::DateTime::parse_from_rfc3339(text).expect("a time");
    let committed = at("2026-11-28T12:00:00+08:00");
    let build = BuildInfo { commit: "0".repeat(40), committed, modified: false };
    let program = ProgramVersion { build: Some(build), ..request(PLAN).program };
    let run = |began: &str| {
        let asked = RunRequest { began: Some(at(began)), program: program.clone(), ..request(PLAN) };
        serve(&asked, &options, &RunControl::default(), Fated { fates: [].iter() }, |_| {})
    };
    let refused = run("1970-01-01T00:01:00+00:00").expect_err("refused");
    let told = "the clock says 1970-01-01 00:01:00 +00:00, but the sources of this program are of 2026-11-28";
    assert_eq!(gnc_text::with_causes(&refused), told);
    assert!(refused.try_this().contains("--clock-is-right"), "{}", refused.try_this());
    assert_eq!(run("2026-11-28T12:00:00+08:00").expect("a run").verdicts.len(), 1);
}

/// A capture of 100 s at true speed ends at once when its item is given up. The run goes on with the next item, and is
/// aborted.
#[test]
fn an_item_that_is_given_up_ends_and_the_run_goes_on() {
    let state = run(Speed::Times(1.0), |event, control| {
        if matches!(&event.kind, EventKind::ItemStarted { item, .. } if item == "imu") {
            control.give_up("imu");
        }
    });
    assert_eq!(outcomes(&state), [Outcome::Passed, Outcome::Aborted, Outcome::Passed]);
    assert!(state.stop().is_none(), "nobody wanted the run to end");
}

/// The pause is asked for while the first item runs. It ends with the note that nothing runs any more.
#[test]
fn a_pause_holds_the_next_item_and_is_in_the_log() {
    let state = run(Speed::Max, |event, control| match &event.kind {
        EventKind::ItemStarted { item, .. } if item == "cpu" => control.pause(true),
        EventKind::Note { text, .. } if text.starts_with("paused") => control.pause(false),
        _ => {}
    });
    assert_eq!(outcomes(&state), [Outcome::Passed; 3]);
    let notes: Vec<&str> = state.notes().iter().map(|note| note.text.as_str()).collect();
    assert!(notes.iter().any(|note| note.starts_with("paused")), "{notes:?}");
    assert!(notes.iter().any(|note| note.starts_with("the run continued after a pause")), "{notes:?}");
}

#[test]
fn a_stop_ends_a_pause_and_the_run() {
    let state = run(Speed::Max, |event, control| match &event.kind {
        EventKind::ItemStarted { item, .. } if item == "cpu" => control.pause(true),
        EventKind::Note { text, .. } if text.starts_with("paused") => control.stop("SIGTERM"),
        _ => {}
    });
    assert_eq!(outcomes(&state), [Outcome::Passed, Outcome::NotRun, Outcome::NotRun]);
    assert_eq!(state.verdict_so_far(), Verdict::Module(Outcome::Aborted));
}

/// The second stream is refused while the first one runs. Both get their verdict, one after the other.
#[test]
fn what_does_not_fit_beside_others_runs_after_them() {
    let state = run_plan(
        CROWDED,
        &BenchOptions { rate_baud: 115_200, speed: Speed::Times(4.0), ..BenchOptions::default() },
        |_, _| {},
    );
    assert_eq!(outcomes(&state), [Outcome::Passed; 2]);
    let crowded = |text: &str| text.starts_with("the item did not fit on the line beside the others");
    assert!(state.notes().iter().any(|note| crowded(&note.text)), "{:?}", state.notes());
}

/// Looks at a bench until the readings are complete.
async fn look_until(bench: &RunningBench, whole: impl Fn(&Readings) -> bool) -> Readings {
    let target = Target::Serial { port: bench.port().to_owned(), rate_baud: 921_600 };
    let (live, control) = (Live::default(), RunControl::default());
    let mut shown = live.readings.subscribe();
    let look = looking::look(&target, &control, &live.readings);
    let watch = async {
        let seen = shown.wait_for(|seen| whole(seen)).await.expect("somebody shows").clone();
        control.stop("the operator");
        seen
    };
    tokio::pin!(look);
    let seen = tokio::select! {
        ended = &mut look => panic!("ended by itself: {ended:?}"),
        seen = watch => seen,
    };
    look.await.expect("a board");
    seen
}

/// Raw values are shown without a run: a module that lies level shows 1 g on Z, and its AD channels. A module that was
/// never calibrated shows no roll angle.
#[test]
fn raw_values_are_shown_without_a_run() {
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().expect("a runtime");
    let bench = RunningBench::start(&BenchOptions::default()).expect("a simulated bench");
    let whole = |seen: &Readings| seen.imu.is_some() && seen.gnss.is_some() && seen.ad_v.iter().all(Option::is_some);
    let seen = runtime.block_on(look_until(&bench, whole));
    let (_, sample) = seen.imu.expect("a sample");
    let up_g = f64::from(sample.accel[2]) / gnc_protocol::stream::ACCEL_LSB_PER_G;
    assert!((up_g - 1.0).abs() < 0.05, "{up_g} g");
    assert_eq!((seen.correction, seen.compensated), (None, None));
}

/// A calibrated module shows the roll angle that it works out itself, and the correction with which it can be checked.
#[test]
fn the_roll_angle_of_a_calibrated_module_is_shown() {
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().expect("a runtime");
    let bench = RunningBench::start(&BenchOptions::default()).expect("a simulated bench");
    // Unusual coefficients: the values read back must be the values written.
    let scale =
        |per_count: f64| [0, 1, 2].map(|row| [0, 1, 2].map(|column| if row == column { per_count } else { 0.0 }));
    let calibration = Calibration {
        id: 7,
        accel_matrix: scale(9.80665 / gnc_protocol::stream::ACCEL_LSB_PER_G),
        gyro_matrix: scale(1f64.to_radians() / gnc_protocol::stream::GYRO_LSB_PER_DPS),
        mag_dx: 0.125,
        mag_dy: -0.0625,
        mag_ky: 1.25,
        mag_sin_alpha: 0.1,
        ..Calibration::default()
    };
    let seen = runtime.block_on(async {
        let target = Target::Serial { port: bench.port().to_owned(), rate_baud: 921_600 };
        let link = Link::open(&target).expect("a port");
        let board = BoardClient::connect(link, 1, watch::Sender::default()).await.expect("a board");
        let lease = BoardLease::new(&board, watch::Sender::default());
        lease.call(&ModulePower { on: 1 }).await.expect("power");
        lease.call(&CalibrationWrite { calibration: calibration.clone() }).await.expect("written");
        lease.call(&CalibrationCommit { checksum: calibration.checksum() }).await.expect("stored");
        drop(lease);
        board.close().await;
        look_until(&bench, |seen| seen.imu.is_some() && seen.compensated.is_some()).await
    });
    let correction = seen.correction.expect("a correction");
    let read = [correction.dx, correction.dy, correction.ky, correction.sin_alpha];
    assert_eq!(read, [0.125, -0.0625, 1.25, 0.1]);
    let [x, y, _] = seen.imu.expect("a sample").1.mag.map(|counts| f64::from(counts) / 1_250_000.0);
    let y = 1.25 * (y + 0.0625);
    let x = ((x - 0.125) - 0.1 * y) / (1.0_f64 - 0.01).sqrt();
    let by_hand_deg = (-y).atan2(x).to_degrees();
    let by_board_deg = (f64::from(seen.compensated.expect("a sample").1.roll) * 1e-8).to_degrees();
    let apart_deg = (by_hand_deg - by_board_deg + 180.0).rem_euclid(360.0) - 180.0;
    // The two samples need not be the same one, so some noise lies between them.
    assert!(apart_deg.abs() < 1.0, "{by_hand_deg} deg here, {by_board_deg} deg on the board");
}
