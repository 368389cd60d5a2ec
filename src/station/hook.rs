//! Tells a program of the bench file each verdict: a light, a sound, a printer of labels.
//!
//! The program reads one JSON object from its standard input. It runs beside the tests, on a thread of its own: no test
//! waits for it, and nothing that it does changes a verdict. What goes wrong with it is told to the operator.

use std::future::Future;
use std::io;
use std::path::{Path, PathBuf};
use std::pin::pin;
use std::process::Stdio;
use std::sync::mpsc::{Receiver, SyncSender, TrySendError, sync_channel};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use chrono::{DateTime, FixedOffset};
use gnc_executive::bench::Hook;
use gnc_executive::event::{BenchKind, OtherModule, PlanInfo};
use gnc_executive::outcome::Outcome;
use gnc_executive::record::RunRecord;
use gnc_executive::verdict::Verdict;
use gnc_records::store::reader;
use gnc_text::{printable, quoted};
use nix::sys::signal::{Signal, killpg};
use nix::unistd::{AccessFlags, Pid, access};
use serde::Serialize;
use tokio::io::{AsyncReadExt as _, AsyncWriteExt as _};
use tokio::process::{Child, Command};
use tokio::sync::{oneshot, watch};

use crate::refusal::complain;

/// Version of the object that the program reads.
const SCHEMA: &str = "gnc-verdict/1";
/// Largest number of verdicts that wait for the program: a line that outruns its label printer by more has no use for
/// the labels.
const WAITING: usize = 64;
/// Most bytes of the program's errors that are shown: one line of a terminal.
const SHOWN_BYTES: u64 = 300;
/// Longest wait of the end of the program for the verdicts that are not told yet.
const END_WAITS: Duration = Duration::from_secs(10);
/// Longest wait for a program that was killed: it ends at once, unless it waits for a disk or a device.
const KILL_WAITS: Duration = Duration::from_secs(1);
/// Time for the last words of a program that has ended.
const LAST_WORDS: Duration = Duration::from_millis(100);

/// What can be tried with a program that does not start.
const NO_START: &str = "check the path in `hook` of the bench file, and make the program executable with `chmod +x`";

/// A program that is told each verdict, ready to be started.
#[derive(Debug, Clone)]
pub(crate) struct HookProgram {
    /// The program; a path with a slash starts at the folder of the bench file.
    program: PathBuf,
    arguments: Vec<String>,
    /// The folder in which it runs: that of the bench file.
    folder: PathBuf,
    limit: Duration,
}

impl HookProgram {
    /// The program of a bench file in this folder.
    pub(crate) fn new(hook: &Hook, folder: Option<&Path>) -> Option<Self> {
        let (first, arguments) = hook.command.split_first()?;
        let folder = folder.filter(|folder| !folder.as_os_str().is_empty()).unwrap_or_else(|| Path::new("."));
        let program = if first.contains('/') { folder.join(first) } else { PathBuf::from(first) };
        // A program that runs in another folder is found by its full path.
        let program = if first.contains('/') { std::path::absolute(&program).unwrap_or(program) } else { program };
        let limit = Duration::try_from_secs_f64(hook.limit_s).ok()?;
        Some(Self { program, arguments: arguments.to_vec(), folder: folder.to_owned(), limit })
    }

    /// Why the program cannot be started, as far as its file shows, and what can be tried. A name without a slash is looked for as
    /// the system does, in the folders of `PATH`.
    pub(crate) fn doubt(&self) -> Option<(String, &'static str)> {
        let is_path = self.program.components().count() > 1;
        let folders = std::env::var_os("PATH").unwrap_or_default();
        let in_path =
            || std::env::split_paths(&folders).map(|folder| folder.join(&self.program)).find(|at| at.is_file());
        let at = if is_path { None } else { in_path() }.unwrap_or_else(|| self.program.clone());
        let why = match at.metadata() {
            Err(error) => error.to_string(),
            Ok(meta) if !meta.is_file() => "it is no program".to_owned(),
            Ok(_) => io::Error::from(access(&at, AccessFlags::X_OK).err()?).to_string(),
        };
        Some((format!("{} cannot be started: {why}", self.name()), NO_START))
    }

    /// "the hook ./light.sh", for messages.
    fn name(&self) -> String {
        format!("the hook {}", gnc_text::shown_path(&self.program))
    }
}

/// A run whose verdict is to be told.
#[derive(Debug)]
struct Ended {
    folder: PathBuf,
    verdict: Verdict,
    serial_number: String,
}

/// The thread that tells verdicts, one after the other.
#[derive(Debug)]
pub(crate) struct Hooks {
    verdicts: SyncSender<Ended>,
    /// Returns how many verdicts were not told because the program was killed.
    thread: JoinHandle<usize>,
    /// True: the program is to be killed, and no further verdict is told.
    kill: watch::Sender<bool>,
    name: String,
}

impl Hooks {
    /// Starts the thread. `trouble` hears in words what goes wrong with the program.
    ///
    /// # Errors
    /// The system starts no thread.
    pub(crate) fn start(program: HookProgram, trouble: impl Fn(String) + Send + 'static) -> io::Result<Self> {
        let (verdicts, ended) = sync_channel(WAITING);
        let (kill, killed) = watch::channel(false);
        let name = program.name();
        let thread = std::thread::Builder::new().name("hook".into());
        let thread = thread.spawn(move || serve(&program, &ended, killed, &trouble))?;
        Ok(Self { verdicts, thread, kill, name })
    }

    /// Has the verdict of a run told. Returns at once; the error says why the verdict is not told.
    pub(crate) fn tell(&self, folder: &Path, serial_number: &str, verdict: Verdict) -> Result<(), String> {
        let ended = Ended { folder: folder.to_owned(), verdict, serial_number: serial_number.to_owned() };
        self.verdicts.try_send(ended).map_err(|error| match error {
            TrySendError::Full(_) => format!("the hook is {WAITING} verdicts behind, so it is not told this one"),
            TrySendError::Disconnected(_) => "the hook has ended".to_owned(),
        })
    }

    /// Waits a while until every verdict is told, and says so if some are not. Once `interrupted` is ready, it kills the
    /// program and waits no longer.
    pub(crate) async fn finish(self, interrupted: impl Future<Output = ()>) {
        let Self { verdicts, thread, kill, name } = self;
        drop(verdicts);
        let (done, mut is_done) = oneshot::channel();
        let waits = std::thread::Builder::new().name("hook-end".into()).spawn(move || {
            let _ = done.send(thread.join().unwrap_or_default());
        });
        let kept = "the records hold every verdict";
        tokio::select! {
            ended = tokio::time::timeout(END_WAITS, &mut is_done) => {
                if waits.is_err() || ended.is_err() {
                    let what = format!("the hook is not done with the last verdicts after {} s", END_WAITS.as_secs());
                    complain(what, &format!("{kept}; shorten hook_time, or mend the program"));
                }
            }
            () = interrupted => {
                let _ = kill.send(true);
                let untold = tokio::time::timeout(KILL_WAITS, is_done).await;
                let untold = untold.ok().and_then(Result::ok).map_or_else(String::new, |count| {
                    format!("; verdicts that it was not told or did not finish: {count}")
                });
                complain(format!("{name} was killed by ctrl-C{untold}"), kept);
            }
        }
    }
}

/// Tells verdicts until there are no more. Returns how many were not told because the program was killed.
fn serve(
    program: &HookProgram,
    ended: &Receiver<Ended>,
    mut killed: watch::Receiver<bool>,
    trouble: &impl Fn(String),
) -> usize {
    let runtime = match crate::threads::beside() {
        Ok(runtime) => runtime,
        Err(error) => {
            trouble(format!("{} cannot be started: {error}", program.name()));
            return 0;
        }
    };
    let mut untold = 0;
    for run in ended {
        if *killed.borrow() {
            untold += 1;
            continue;
        }
        let note = serde_json::to_vec(&Note::of(&run)).unwrap_or_default();
        match runtime.block_on(tell(program, note, &mut killed)) {
            Ok(()) => {}
            Err(Untold::Killed) => untold += 1,
            Err(Untold::Trouble(what)) => {
                trouble(format!("{} {what}; the verdict of {} stands", program.name(), printable(&run.serial_number)));
            }
        }
    }
    untold
}

/// Why the program has not done its work.
#[derive(Debug)]
enum Untold {
    /// A predicate: "ended with code 1".
    Trouble(String),
    /// The operator does not want to wait.
    Killed,
}

/// Starts the program with a verdict and waits for its end.
async fn tell(program: &HookProgram, mut note: Vec<u8>, killed: &mut watch::Receiver<bool>) -> Result<(), Untold> {
    note.push(b'\n');
    let mut command = Command::new(&program.program);
    command.args(&program.arguments).current_dir(&program.folder).kill_on_drop(true);
    // A group of its own: an interrupt of the terminal is meant for the station, and the group is killed as a whole.
    command.process_group(0).stdin(Stdio::piped()).stdout(Stdio::null()).stderr(Stdio::piped());
    let mut child = command.spawn().map_err(|error| Untold::Trouble(format!("cannot be started: {error}")))?;
    let group = child.id().and_then(|id| i32::try_from(id).ok()).map(Pid::from_raw);
    let deadline = Instant::now() + program.limit;
    let why = tokio::select! {
        served = tokio::time::timeout_at(deadline.into(), follow(&mut child, &note)) => match served {
            Ok(served) => return served.map_err(Untold::Trouble),
            Err(_) => Untold::Trouble(format!("still ran after {} s and was killed", program.limit.as_secs_f64())),
        },
        // Without a sender nobody can ask for it any more.
        Ok(_) = killed.wait_for(|killed| *killed) => Untold::Killed,
    };
    if let Some(group) = group {
        let _ = killpg(group, Signal::SIGKILL);
    }
    let _ = child.wait().await;
    Err(why)
}

/// Gives a program its input and hears its errors until it ends.
async fn follow(child: &mut Child, note: &[u8]) -> Result<(), String> {
    let (input, errors) = (child.stdin.take(), child.stderr.take());
    let give = async {
        if let Some(mut input) = input {
            // A program that does not read its input, like a plain buzzer, is none the worse for it.
            let _ = input.write_all(note).await;
        }
    };
    let mut said = Vec::new();
    let status = {
        let listen = async {
            if let Some(mut errors) = errors {
                let _ = (&mut errors).take(SHOWN_BYTES).read_to_end(&mut said).await;
                // A program that says more must not wait for a reader.
                let _ = tokio::io::copy(&mut errors, &mut tokio::io::sink()).await;
            }
        };
        let ends = async { tokio::join!(child.wait(), give).0 };
        let (mut listen, mut ends) = (pin!(listen), pin!(ends));
        tokio::select! {
            status = &mut ends => {
                // What the program has left in the background may hold its standard error open for ever.
                let _ = tokio::time::timeout(LAST_WORDS, &mut listen).await;
                status
            }
            () = &mut listen => ends.await,
        }
    };
    let status = status.map_err(|error| format!("is lost: {error}"))?;
    if status.success() {
        return Ok(());
    }
    let how = match status.code() {
        Some(code) => format!("ended with code {code}"),
        None => "was ended by a signal".to_owned(),
    };
    let said = String::from_utf8_lossy(&said);
    let first = said.lines().map(str::trim).find(|line| !line.is_empty());
    Err(first.map_or(how.clone(), |line| format!("{how} and says {}", quoted(line))))
}

/// What the program reads. New versions only add fields.
#[derive(Debug, Serialize)]
struct Note {
    schema: &'static str,
    serial_number: String,
    /// How the run ended. The record has the last word on everything but this: a run whose record could not be written
    /// is errored. Null if only chosen items ran, and on an unproven bench.
    outcome: Option<Outcome>,
    /// How chosen items ended; absent if the whole plan ran, and on an unproven bench.
    #[serde(skip_serializing_if = "Option::is_none")]
    selection_outcome: Option<Outcome>,
    /// How a run on an unproven bench ended, else absent. It stands apart, so that a program that knows nothing of such
    /// benches shows no pass.
    #[serde(skip_serializing_if = "Option::is_none")]
    unproven_outcome: Option<Outcome>,
    /// Whether the module was a simulated one.
    simulated: bool,
    /// Whether the link to the board does not prove that there is one.
    unproven: bool,
    /// The scanned number and that of the module in the socket, if they differ; else null. The run is of neither.
    other_module: Option<OtherModule>,
    /// The folder of the record.
    record: PathBuf,
    /// What the record says; null if it cannot be read.
    run: Option<Told>,
}

/// What a record says.
#[derive(Debug, Serialize)]
struct Told {
    plan: PlanInfo,
    station: String,
    operator: Option<String>,
    started: DateTime<FixedOffset>,
    finished: Option<DateTime<FixedOffset>>,
    elapsed_s: f64,
    /// Every item that ran and did not pass.
    not_passed: Vec<NotPassed>,
}

#[derive(Debug, Serialize)]
struct NotPassed {
    name: String,
    title: String,
    outcome: Outcome,
}

impl Note {
    fn of(ended: &Ended) -> Self {
        let record = reader::read(&ended.folder).ok();
        let unproven = record.as_ref().is_some_and(|record| record.bench.kind == BenchKind::Unproven);
        let tested = Some(ended.verdict).filter(|_| !unproven);
        Self {
            schema: SCHEMA,
            serial_number: ended.serial_number.clone(),
            outcome: tested.and_then(Verdict::of_module),
            selection_outcome: tested.and_then(Verdict::of_selection),
            unproven_outcome: unproven.then(|| ended.verdict.of_items()),
            other_module: record.as_ref().and_then(|record| record.other_module.clone()),
            simulated: record.as_ref().is_some_and(|record| record.bench.kind == BenchKind::Simulated),
            unproven,
            record: std::path::absolute(&ended.folder).unwrap_or_else(|_| ended.folder.clone()),
            run: record.map(Told::of),
        }
    }
}

impl Told {
    fn of(record: RunRecord) -> Self {
        let not_passed = record.items.into_iter().filter(|item| item.selected && item.outcome != Outcome::Passed);
        let not_passed = not_passed.map(|item| NotPassed { name: item.name, title: item.title, outcome: item.outcome });
        Self {
            plan: record.plan,
            station: record.station,
            operator: record.operator,
            started: record.started,
            finished: record.finished,
            elapsed_s: record.elapsed_s,
            not_passed: not_passed.collect(),
        }
    }
}

#[cfg(test)]
mod tests;
