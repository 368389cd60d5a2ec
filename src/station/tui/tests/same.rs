//! What was asked for is what runs: the screen and `--auto` get the same words on the command line, and their journals say the same.

use std::fs;
use std::path::{Path, PathBuf};
use std::time::Instant;

use clap::Parser as _;
use gnc_bench::runner::Live;
use gnc_records::store::reader;
use serde_json::{Value, json};
use tempfile::TempDir;
use tokio::sync::mpsc;

use crate::args::RunArgs;
use crate::auto;
use crate::refusal::CommandRefusal;
use crate::tui::decode::Key;
use crate::tui::model::{Loaded, MessageWeight, Over};
use crate::tui::session::{ScreenSession, Signals};
use crate::tui::update::{Effect, Msg, update};
use crate::tui::{ScreenClock, first_model, number_given, to_resume};

/// Messages and commands that may wait: more than a run of these plans has.
const WAITING: usize = 1 << 14;

#[derive(Debug, clap::Parser)]
struct Words {
    #[command(flatten)]
    run: RunArgs,
}

/// A folder with a plan and a module.
struct Place {
    folder: TempDir,
}

impl Place {
    fn new(plan: &str) -> Self {
        let place = Self { folder: tempfile::tempdir().expect("a folder") };
        place.write("p.toml", plan);
        place.write("module.toml", "description = \"A good module.\"\n");
        place
    }

    fn write(&self, name: &str, text: &str) {
        fs::write(self.folder.path().join(name), text).expect("writable");
    }

    fn path(&self, name: &str) -> String {
        self.folder.path().join(name).display().to_string()
    }

    /// The words of the command line. Each face has records of its own.
    fn args(&self, face: &str, plan: &str, more: &[&str]) -> RunArgs {
        let sim = format!("--sim={}", self.path("module.toml"));
        let (path, records) = (self.path("p.toml"), self.path(face));
        let fixed = ["gnc-station", plan, &path, &sim, "--sim-speed", "max", "--records", &records];
        let fixed = fixed.into_iter().chain(["--serial-number", "C-1", "--operator", "Li"]);
        Words::try_parse_from(fixed.chain(more.iter().copied())).unwrap_or_else(|error| panic!("{error}")).run
    }

    /// The runs of a face, oldest first, and why it refused to run more.
    fn said(&self, face: &str, refused: Option<String>) -> (Vec<Value>, Option<String>) {
        let records = self.folder.path().join(face);
        let runs = if records.exists() { reader::list(&records).expect("records") } else { Vec::new() };
        (runs.iter().map(|run| journal(&run.path)).collect(), refused)
    }
}

/// A text without its numbers, which differ from run to run.
fn without_numbers(text: &str) -> String {
    let mut told: String = text.chars().map(|c| if c.is_ascii_digit() { '#' } else { c }).collect();
    while told.contains("##") || told.contains("#.#") {
        told = told.replace("##", "#").replace("#.#", "#");
    }
    told
}

/// What a journal says, item by item, without times, chance and ports.
fn journal(run: &Path) -> Value {
    let text = fs::read_to_string(run.join("events.jsonl")).expect("a journal");
    let mut events: Vec<Value> = text.lines().map(|line| serde_json::from_str(line).expect("an event")).collect();
    // How often the station asked again says how busy this computer was.
    events.retain(|event| !event["text"].as_str().is_some_and(|text| text.starts_with("the line was not clean")));
    for event in &mut events {
        let fields = event.as_object_mut().expect("an object");
        let _ = ["seq", "at", "elapsed_us", "boot_id", "link", "details", "record", "voltage_v", "current_a"]
            .map(|key| fields.remove(key));
        // The samples are those of the run, and so are their digests.
        let _ = ["bytes", "sha256", "journal_sha256"].map(|key| fields.remove(key));
        if let Some(bench) = fields.get_mut("header").and_then(|header| header["bench"].as_object_mut()) {
            bench.remove("port");
        }
        if let Some(measured) = fields.get_mut("measurement") {
            *measured = json!([measured["name"], measured["low"], measured["high"], measured["outcome"]]);
        }
        for key in ["text", "hint"] {
            if let Some(Value::String(text)) = fields.get_mut(key) {
                *text = without_numbers(text);
            }
        }
        if let Some(error) = fields.get_mut("error").filter(|error| error.is_object()) {
            *error = json!(without_numbers(&error["text"].to_string()));
        }
    }
    // The items that took longest are told in the order of chance.
    events.retain(|event| !event["text"].as_str().is_some_and(|text| text.starts_with("critical path")));
    // Items overlap by chance, and each keeps its own order.
    events.sort_by_key(|event| event["item"].as_str().unwrap_or_default().to_owned());
    Value::Array(events)
}

/// Runs the plan by `--auto`. `meanwhile` happens between the check and the run. Returns why it is refused.
fn by_auto(args: &RunArgs, meanwhile: impl FnOnce()) -> Option<String> {
    let refused = |refusal: CommandRefusal| Some(refusal.what);
    let (request, setup, habits) = match auto::prepare(args) {
        Ok(prepared) => prepared,
        Err(refusal) => return refused(refusal),
    };
    meanwhile();
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().expect("a runtime");
    let done = runtime.block_on(auto::all_rounds(args, &request, setup, &habits, None));
    runtime.shutdown_background();
    done.map_or_else(refused, |_| None)
}

/// Runs the plan on the screen: F5, and the answers of an operator who wants what was shown.
fn by_screen(args: &RunArgs, meanwhile: impl FnOnce()) -> Option<String> {
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().expect("a runtime");
    let said = runtime.block_on(async {
        let plan = args.plan.clone().expect("a plan");
        let resume = args.resume.as_deref().map(|run| to_resume(args, run)).transpose();
        let resume = match resume {
            Ok(resume) => resume,
            Err(refusal) => return Some(refusal.what),
        };
        let clock = ScreenClock { began: Instant::now() };
        let mut model = first_model(args, Some(&plan), args.serial_number.clone(), resume, clock);
        let (screen, mut messages) = mpsc::channel(WAITING);
        let (commands, asked) = mpsc::channel(WAITING);
        let signals = Signals::new().expect("signals");
        let session = ScreenSession::new((args.clone(), Some(plan)), screen, asked, signals, Live::default());
        let operator = async {
            let mut meanwhile = Some(meanwhile);
            while let Some(msg) = messages.recv().await {
                let over = matches!(msg, Msg::RunOver { .. });
                let mut effect = update(&mut model, msg);
                if let Loaded::Refused(why) = &model.plan {
                    let _ = commands.send(Effect::Leave).await;
                    return Some(why.clone());
                }
                let ready = model.plan.ready().is_some() && model.bench.ready().is_some();
                if ready && let Some(meanwhile) = meanwhile.take() {
                    meanwhile();
                    effect = update(&mut model, Msg::Key(Key::F(5)));
                }
                let answer = match model.over.last() {
                    Some(Over::Changed(_)) => Some(Key::F(6)),
                    Some(Over::Interrupted(_) | Over::Again(_)) => Some(Key::F(2)),
                    Some(Over::NoResume { why }) => {
                        let _ = commands.send(Effect::Leave).await;
                        return Some(why.clone());
                    }
                    _ => None,
                };
                if let Some(key) = answer {
                    effect = update(&mut model, Msg::Key(key));
                }
                // Nothing is asked and nothing runs: the screen says why.
                let refused = effect.is_none() && answer.is_none() && meanwhile.is_none() && model.run.is_none();
                if refused
                    && model.pending.is_none()
                    && model.message.as_ref().is_some_and(|(weight, _)| *weight != MessageWeight::Info)
                {
                    commands.send(Effect::Leave).await.expect("a session");
                    break;
                }
                let effect = if over { Some(Effect::Leave) } else { effect };
                if let Some(effect) = effect {
                    commands.send(effect).await.expect("a session");
                }
                if over {
                    break;
                }
            }
            model.message.clone().filter(|(weight, _)| *weight != MessageWeight::Info).map(|(_, text)| text)
        };
        let both = async { tokio::join!(session.serve(), operator).1 };
        // A screen that waits for ever fails the test.
        tokio::time::timeout(DEADLINE, both).await.expect("the screen has an end")
    });
    runtime.shutdown_background();
    said
}

/// Both faces with the same words: what they say of it.
#[track_caller]
fn same(place: &Place, more: &[&str], meanwhile: impl Fn(&Place)) -> (Vec<Value>, Option<String>) {
    let before = ["p.toml", "module.toml"].map(|name| (name, fs::read_to_string(place.path(name)).expect("a file")));
    let auto = by_auto(&place.args("auto", "--auto", more), || meanwhile(place));
    before.iter().for_each(|(name, text)| place.write(name, text));
    let screen = by_screen(&place.args("screen", "--plan", more), || meanwhile(place));
    let (auto, screen) = (place.said("auto", auto), place.said("screen", screen));
    assert_eq!(auto.0.len(), screen.0.len(), "{:?} and {:?}", auto.1, screen.1);
    for (auto, screen) in auto.0.iter().zip(&screen.0) {
        for (auto, screen) in auto.as_array().into_iter().flatten().zip(screen.as_array().into_iter().flatten()) {
            assert_eq!(auto, screen);
        }
        assert_eq!(auto, screen);
    }
    assert_eq!(auto.1.is_some(), screen.1.is_some(), "{:?} and {:?}", auto.1, screen.1);
    auto
}

/// Far longer than any of these runs.
const DEADLINE: std::time::Duration = std::time::Duration::from_secs(120);

fn nothing(_: &Place) {}

const PLAN: &str = "name = \"short\"\nversion = \"1\"\n\
    [[item]]\nid = \"identity\"\nlimits.serial_number = \"== $serial_number\"\n\
    [[item]]\nid = \"cpu\"\nlimits.core1_register_errors = \"<= 0\"\n\
    [[item]]\nid = \"timers\"\nrequires = [\"cpu\"]\nlimits.timer1_interrupts_missing = \"<= 0\"\n\
    [[item]]\nid = \"io\"\nlimits.wrong_reads = \"<= 0\"\n";

/// The end of the run in a journal.
fn ends(runs: &[Value]) -> Vec<&str> {
    let of =
        |run: &'_ Value| run.as_array().expect("events").iter().find(|event| event["kind"] == "run_ended").cloned();
    runs.iter()
        .map(|run| {
            match of(run)
                .and_then(|end| end["outcome"].as_str().or(end["selection_outcome"].as_str()).map(str::to_owned))
                .as_deref()
            {
                Some("passed") => "passed",
                Some("failed") => "failed",
                _ => "other",
            }
        })
        .collect()
}

#[test]
fn a_whole_plan() {
    let (runs, refused) = same(&Place::new(PLAN), &[], nothing);
    assert_eq!((ends(&runs), refused), (vec!["passed"], None));
    let (runs, _) = same(&Place::new(PLAN), &["--one-by-one"], nothing);
    assert_eq!(ends(&runs), ["passed"]);
}

/// The order of the words does not matter, nor does a name that stands twice, nor that all items are named.
#[test]
fn a_selection() {
    for only in ["cpu", "io,identity", "cpu,io,cpu", "io,timers,cpu,identity"] {
        let (runs, refused) = same(&Place::new(PLAN), &["--only", only], nothing);
        assert_eq!((runs.len(), refused), (1, None), "{only}");
        let selection = runs[0][0]["header"]["selection"].as_array().expect("a selection");
        assert!(!selection.is_empty(), "{only}");
    }
}

#[test]
fn rounds_of_a_plan_with_a_failing_item() {
    for on_fail in ["continue", "stop"] {
        let bad = PLAN.replace("core1_register_errors = \"<= 0\"", "core1_register_errors = \">= 1\"");
        for more in [&["--on-fail", "continue"][..], &["--on-fail", "stop"], &[]] {
            let plan = bad.replacen("version = \"1\"\n", &format!("version = \"1\"\non_fail = \"{on_fail}\"\n"), 1);
            let words = [&["--loops", "3"], more].concat();
            let (runs, refused) = same(&Place::new(&plan), &words, nothing);
            let rounds = if more.contains(&"stop") { 1 } else { 3 };
            assert_eq!((runs.len(), refused), (rounds, None), "{on_fail} {more:?}");
            assert!(ends(&runs).iter().all(|end| *end == "failed"));
        }
    }
}

/// A round that is begun is finished, and a time of less than a minute is no minute.
#[test]
fn rounds_until_a_time_is_over() {
    let (runs, refused) = same(&Place::new(PLAN), &["--until", "1 us"], nothing);
    assert_eq!((ends(&runs), refused), (vec!["passed"], None));
    assert_eq!(runs[0][0]["header"]["loop"], json!({ "index": 1, "count": null }));
}

/// Edited after the check: what was checked runs.
#[test]
fn files_that_are_edited_after_the_check() {
    let place = Place::new(PLAN);
    let (runs, refused) = same(&place, &[], |place| place.write("p.toml", &PLAN.replace("<= 0", ">= 1")));
    assert_eq!((ends(&runs), refused), (vec!["passed"], None));
    let place = Place::new(PLAN);
    let (runs, _) = same(&place, &[], |place| place.write("module.toml", "[cpu]\ndead_cores = [1]\n"));
    assert_eq!(ends(&runs), ["passed"]);
}

#[test]
fn what_is_refused() {
    // A name that the plan does not have, beside one that it has: nothing runs.
    let place = Place::new(PLAN);
    let words = ["--only", "cpu,cpo"];
    assert!(by_auto(&place.args("auto", "--auto", &words), || {}).is_some_and(|why| why.contains("cpo")));
    assert!(by_screen(&place.args("screen", "--plan", &words), || {}).is_some_and(|why| why.contains("cpo")));
    assert!(place.said("auto", None).0.is_empty() && place.said("screen", None).0.is_empty());
    let nobody = "name = \"p\"\nversion = \"1\"\n[[item]]\nid = \"cpo\"\n";
    let place = Place::new(PLAN);
    assert!(by_auto(&place.args("auto", "--auto", &["--resume", "gone"]), || {}).is_some());
    assert!(by_screen(&place.args("screen", "--plan", &["--resume", "gone"]), || {}).is_some());
    let place = Place::new(nobody);
    assert!(by_auto(&place.args("auto", "--auto", &[]), || {}).is_some_and(|why| why.contains("cpo")));
    assert!(by_screen(&place.args("screen", "--plan", &[]), || {}).is_some_and(|why| why.contains("cpo")));
}

const CAPTURES: &str = "name = \"captures\"\nversion = \"1\"\n\
    [[item]]\nid = \"six-position\"\nparams = { dwell = \"10 s\", settle = \"0 s\", rate = \"50 Hz\" }\nlimits.residual_rms = \"<= 5 mg\"\n\
    [[item]]\nid = \"cpu\"\nlimits.core1_register_errors = \"<= 0\"\n";

/// The journal of a run as a power cut leaves it after the captures. Returns the run's name below the records.
fn broken(place: &Place, faces: [&str; 2]) -> String {
    assert_eq!(by_auto(&place.args("whole", "--auto", &[]), || {}), None);
    cut_off(place, faces)
}

/// Gives each face the whole run as it was after the captures. Returns its name.
fn cut_off(place: &Place, faces: [&str; 2]) -> String {
    let records = place.folder.path().join("whole");
    let run = reader::list(&records).expect("records").remove(0).path;
    let journal = fs::read_to_string(run.join("events.jsonl")).expect("a journal");
    let figure = "\"kind\":\"measured\",\"item\":\"six-position\"";
    let cut = journal.find(figure).and_then(|at| journal[..at].rfind('\n')).expect("a figure");
    let name = run.strip_prefix(&records).expect("below").to_owned();
    for face in faces {
        let folder = place.folder.path().join(face).join(&name);
        let raw = PathBuf::from("01-six-position/attempt-1.mcap");
        fs::create_dir_all(folder.join("01-six-position")).expect("a folder");
        fs::copy(run.join(&raw), folder.join(&raw)).expect("captures");
        fs::write(folder.join("events.jsonl"), &journal[..=cut]).expect("a journal");
    }
    name.display().to_string()
}

#[test]
fn a_run_that_broke_off() {
    let place = Place::new(CAPTURES);
    let name = broken(&place, ["auto", "screen"]);
    let (runs, refused) = same(&place, &["--resume", &name], nothing);
    assert_eq!((runs.len(), refused), (2, None));
    assert_eq!(ends(&runs)[1], "passed");
    assert!(runs[1].to_string().contains("Taken over from the interrupted run"));
    // Another plan is refused by both, and nothing runs.
    let place = Place::new(CAPTURES);
    let name = broken(&place, ["auto", "screen"]);
    place.write("p.toml", &CAPTURES.replace("<= 5 mg", "<= 6 mg"));
    let (runs, refused) = same(&place, &["--resume", &name], nothing);
    assert_eq!(runs.len(), 1);
    assert!(refused.is_some_and(|why| why.contains("had the plan with the digest")));
}

/// A version that took all signs filed a run that broke off. It is taken up, and no new run of that module begins.
#[test]
fn a_run_that_broke_off_with_a_number_that_is_refused_today() {
    let place = Place::new(CAPTURES);
    place.write("module.toml", "description = \"A good module.\"\n[module]\nserial_number = \"模-1\"\n");
    let args = place.args("whole", "--auto", &[]);
    let (mut request, setup, habits) = auto::prepare(&args).unwrap_or_else(|refusal| panic!("{}", refusal.what));
    request.serial_number = "模-1".into();
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().expect("a runtime");
    let done = runtime.block_on(auto::all_rounds(&args, &request, setup, &habits, None));
    runtime.shutdown_background();
    assert!(done.is_ok());
    let name = cut_off(&place, ["auto", "screen"]);
    let args = |face: &str, plan: &str, more: &[&str]| {
        let mut args = place.args(face, plan, more);
        args.serial_number = Some("模-1".into());
        args
    };
    let refused = by_auto(&args("auto", "--auto", &[]), || {});
    assert!(refused.is_some_and(|why| why.contains("do not allow")));
    assert!(number_given(&args("screen", "--plan", &[]), "模-1").is_err());
    let resume = ["--resume", &*name];
    assert_eq!(by_auto(&args("auto", "--auto", &resume), || {}), None);
    assert_eq!(number_given(&args("screen", "--plan", &resume), "模-1").as_deref(), Ok("模-1"));
    assert_eq!(by_screen(&args("screen", "--plan", &resume), || {}), None);
    for face in ["auto", "screen"] {
        let (runs, _) = place.said(face, None);
        assert_eq!((runs.len(), ends(&runs)[1]), (2, "passed"), "{face}");
        assert!(runs[1].to_string().contains("Taken over from the interrupted run"), "{face}");
    }
}
