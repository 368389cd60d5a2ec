//! `gnc-station board check`: checks a slave board against the interface document, for those who write its firmware.

use std::hash::{BuildHasher as _, RandomState};
use std::io::Write as _;
use std::path::PathBuf;
use std::process::ExitCode;

use clap::{Args, Subcommand};
use gnc_conformance::{
    CheckEvent, CheckOptions, Ended, Finding, NoBoard, Outcome, TAKES, demands, run as carry_out, section_title,
    selects,
};
use gnc_executive::outcome::Outcome as RunOutcome;
use gnc_link::Link;
use gnc_text::{printable, with_causes};
use tokio::signal::unix::{SignalKind, signal};
use tokio::sync::watch;

use crate::args::SimLink;
use crate::exit_code;
use crate::refusal::{CommandRefusal, complain, refuse};
use crate::setup::{self, BoardLine};

pub(crate) const EXIT_CODES: &str = "\
Exit codes:
  0  the board does all that was checked
  1  it does not: at least one check failed
  2  the command line or the bench file is refused
  3  no board answers, its port cannot be opened, or the findings cannot be written
  4  stopped by a person or a signal";

/// What to do with a board.
#[derive(Debug, Subcommand)]
pub(crate) enum BoardCommand {
    /// Checks the board against docs/ICD.md, section by section; the module is switched on and off meanwhile.
    #[command(after_help = EXIT_CODES)]
    Check(CheckArgs),
}

/// Which board, and which checks.
#[derive(Debug, Args)]
pub(crate) struct CheckArgs {
    /// The bench file; by default `bench.toml`, if it exists.
    #[arg(long, value_name = "FILE")]
    bench: Option<PathBuf>,
    /// Checks a simulated board: a good one, or the one that FILE (or a built-in name) describes.
    #[arg(long, value_name = "FILE", num_args = 0..=1, require_equals = true, default_missing_value = "good", conflicts_with = "bench")]
    sim: Option<PathBuf>,
    /// The link to the simulated board.
    #[arg(long, value_name = "LINK", value_enum, default_value_t = SimLink::Rs422, requires = "sim")]
    sim_link: SimLink,
    /// Allows the file of the simulated board to name a playback of another folder.
    #[arg(long, requires = "sim")]
    allow_outside: bool,
    /// Writes an array of JSON to standard output, and all text for people to standard error.
    #[arg(long)]
    json: bool,
    /// Only the checks of this section of the document, or those whose names begin so: `9`, `watchdog`, `hello.nonce`.
    #[arg(long, value_name = "SECTION")]
    only: Option<String>,
}

/// Carries out the command.
pub(crate) fn run(command: &BoardCommand) -> ExitCode {
    let BoardCommand::Check(args) = command;
    if let Err(refusal) = selected(args.only.as_deref()) {
        return refuse(refusal.what, &refusal.try_this);
    }
    let simulated = args.sim.as_deref().map(|sim| (sim, args.sim_link, crate::args::reach(args.allow_outside)));
    let line = match setup::board_line(args.bench.as_deref(), simulated) {
        Ok(line) => line,
        Err(refusal) => return refuse(refusal.what, &refusal.try_this),
    };
    match check(args, &line) {
        Ok(Ok(ended)) => conclude(args, &ended),
        Ok(Err(no_board)) => {
            complain(printable(&no_board.to_string()), no_board_hint(&no_board));
            exit_code::of_command(RunOutcome::Errored)
        }
        Err(refusal) => {
            complain(refusal.what, &refusal.try_this);
            exit_code::of_command(RunOutcome::Errored)
        }
    }
}

fn no_board_hint(no_board: &NoBoard) -> &'static str {
    if no_board.gone.is_some() {
        "check the cable and the adapter; `gnc-station ports` lists what is there"
    } else {
        "check the board's power, the wiring and the rate; section 16 of docs/ICD.md goes step by step"
    }
}

/// Refuses a selection without a check.
fn selected(only: Option<&str>) -> Result<(), CommandRefusal> {
    let Some(only) = only else { return Ok(()) };
    if demands().any(|demand| selects(only, &demand)) {
        return Ok(());
    }
    let mut sections: Vec<u8> = demands().map(|demand| demand.section).collect();
    sections.dedup();
    let sections = sections.iter().map(u8::to_string).collect::<Vec<_>>().join(", ");
    let what = format!("no check is named {}", gnc_text::quoted(only));
    Err(CommandRefusal::new(what, &format!("name a section ({sections}) or the beginning of a check, such as hello")))
}

fn check(args: &CheckArgs, line: &BoardLine) -> Result<Result<Ended, NoBoard>, CommandRefusal> {
    let system = |error: std::io::Error| CommandRefusal::new(format!("cannot start the checks: {error}"), "");
    let runtime = crate::threads::beside().map_err(system)?;
    runtime.block_on(async {
        let link =
            Link::open(&line.target).map_err(|error| CommandRefusal::new(with_causes(&error), error.try_this()))?;
        let (stop, stopped) = watch::channel(false);
        heed_signals(stop).map_err(system)?;
        // Nothing of a check must be closed.
        crate::ending::at_second_signal(|| false, || {}, || {}).map_err(system)?;
        let options = CheckOptions {
            rate_bps: line.target.rate_bps(),
            // Two runs must not have a nonce in common, and no more: the hasher's chance is enough.
            nonce: RandomState::new().hash_one(()) as u32,
            simulated: args.sim.is_some(),
            only: args.only.clone(),
        };
        let mut face = Face::new(args);
        face.begin(&line.target.to_string(), args.only.as_deref());
        Ok(carry_out(link, &options, stopped, &mut |event| face.show(&event)).await)
    })
}

/// Tells the checks to stop when a signal comes.
fn heed_signals(stop: watch::Sender<bool>) -> std::io::Result<()> {
    let mut interrupt = signal(SignalKind::interrupt())?;
    let mut terminate = signal(SignalKind::terminate())?;
    let mut hangup = signal(SignalKind::hangup())?;
    tokio::spawn(async move {
        tokio::select! {
            _ = interrupt.recv() => {}
            _ = terminate.recv() => {}
            _ = hangup.recv() => {}
        }
        stop.send_replace(true);
        // Whoever listens still must not take an ended sender for a stop that was missed.
        std::future::pending::<()>().await;
    });
    Ok(())
}

/// Shows what happens.
struct Face {
    json: bool,
    simulated: bool,
    /// The section whose title was shown last.
    section: u8,
}

impl Face {
    fn new(args: &CheckArgs) -> Self {
        Self { json: args.json, simulated: args.sim.is_some(), section: 0 }
    }

    /// Text for people. A reader who has gone needs none.
    fn say(&self, text: &str) {
        let text = gnc_text::printable_lines(text);
        let _ = if self.json {
            writeln!(std::io::stderr().lock(), "{text}")
        } else {
            writeln!(std::io::stdout().lock(), "{text}")
        };
    }

    fn begin(&self, target: &str, only: Option<&str>) {
        let (checks, takes) = match only {
            None => (demands().count(), format!(" This takes about {} s.", TAKES.as_secs())),
            Some(only) => (demands().filter(|demand| selects(only, demand)).count(), String::new()),
        };
        self.say(&format!(
            "{checks} {} against docs/ICD.md over {}.{takes} Nothing else may use the board meanwhile.",
            if checks == 1 { "check" } else { "checks" },
            printable(target)
        ));
        let calibration = if self.simulated {
            "one calibration is committed to the simulated module"
        } else {
            "its calibration stays as it is"
        };
        self.say(&format!(
            "The module in the socket must be a good one. Flash checks write to its scratch sectors only, {calibration}, \
             and at the end the board is made safe."
        ));
    }

    fn show(&mut self, event: &CheckEvent<'_>) {
        match event {
            CheckEvent::Board(board) => self.say(&format!(
                "Board {}, firmware {}, capabilities 0x{:X}.",
                printable(&board.serial),
                printable(&board.firmware),
                board.capabilities
            )),
            CheckEvent::Powers => self.say("The next checks switch the module on and off."),
            CheckEvent::Found(finding) => self.found(finding),
        }
    }

    fn found(&mut self, finding: &Finding) {
        let demand = &finding.demand;
        if self.section != demand.section {
            self.section = demand.section;
            self.say(&format!("\n{} {}", demand.section, section_title(demand.section)));
        }
        let measured = printable(&finding.measured);
        match finding.outcome {
            Outcome::Passed | Outcome::NotApplicable => {
                self.say(&format!("  {:<4} {:<28} {measured}", finding.outcome.word(), demand.id));
            }
            Outcome::Failed => {
                self.say(&format!("  FAIL {:<28} {measured}", demand.id));
                self.say(&format!("       section {} demands: {}", demand.section, demand.demand));
            }
        }
    }
}

fn conclude(args: &CheckArgs, ended: &Ended) -> ExitCode {
    let face = Face::new(args);
    let written = if args.json { write_json(&ended.findings) } else { Ok(()) };
    let count = |outcome| ended.findings.iter().filter(|finding| finding.outcome == outcome).count();
    let (passed, failed, rest) = (count(Outcome::Passed), count(Outcome::Failed), count(Outcome::NotApplicable));
    let stopped = if ended.stopped { "stopped; " } else { "" };
    face.say(&format!("\n{stopped}{passed} passed, {failed} failed, {rest} not applicable"));
    if !ended.safe {
        complain(
            "the board did not say that it is in its safe state",
            "switch the module off by hand before you touch it",
        );
    }
    if let Err(error) = written {
        complain(
            format_args!("cannot write the findings: {error}"),
            "make room on the disk, then run the checks again",
        );
        return exit_code::of_command(RunOutcome::Errored);
    }
    match (failed, ended.stopped) {
        (_, true) => exit_code::of_command(RunOutcome::Aborted),
        (0, false) => exit_code::of_command(RunOutcome::Passed),
        (_, false) => exit_code::of_command(RunOutcome::Failed),
    }
}

/// Writes the findings for programs. A reader who has gone needs none.
fn write_json(findings: &[Finding]) -> std::io::Result<()> {
    let mut out = std::io::stdout().lock();
    match writeln!(out, "{}", json(findings)).and_then(|()| out.flush()) {
        Err(error) if error.kind() == std::io::ErrorKind::BrokenPipe => Ok(()),
        written => written,
    }
}

/// The findings for programs.
fn json(findings: &[Finding]) -> serde_json::Value {
    let one = |finding: &Finding| {
        serde_json::json!({
            "id": finding.demand.id,
            "section": finding.demand.section,
            "demand": finding.demand.demand,
            "measured": finding.measured,
            "outcome": finding.outcome.word(),
        })
    };
    findings.iter().map(one).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_selection_names_a_section_or_the_beginning_of_a_name() {
        for only in [None, Some("6"), Some("hello"), Some("hello.nonce")] {
            assert!(selected(only).is_ok(), "{only:?}");
        }
        for only in ["2", "66", "nonce", "HELLO", "hello.nonce2"] {
            let refusal = selected(Some(only)).unwrap_err();
            assert!(refusal.what.contains(only) && refusal.try_this.contains("6"), "{refusal:?}");
        }
    }
}
