//! Checks the lines of a bench: port or interface first, then who else uses them, then the board at the other end.

use std::path::{Path, PathBuf};

use chrono::Local;
use gnc_executive::bench::{BenchFile, TestSocket};
use gnc_link::can::{CanTarget, slcan};
use gnc_link::{Doubt, Link, Target, serial};
use gnc_protocol::message::capability;
use gnc_text::with_causes;

use super::board::{self, Heard, MayAsk};
use super::holders::Proc;
use super::{Finding, Health, Sys, bus, port};

/// A line of the bench.
struct Line {
    target: Target,
    /// Whether runs speak with the board over it. The other line is the bus of the item `can`.
    carries_runs: bool,
}

impl Line {
    /// The device of a serial port.
    fn device(&self) -> Option<(&Path, u32)> {
        match &self.target {
            Target::Serial { port, rate_baud } => Some((port, *rate_baud)),
            Target::Can(CanTarget::Slcan(port)) => Some((port, slcan::RATE_BAUD)),
            Target::Can(_) | Target::Memory(_) => None,
        }
    }

    /// The findings about the port or interface itself.
    fn itself(&self, sys: &Sys) -> Vec<Finding> {
        match (&self.target, self.device()) {
            (_, Some((device, rate_baud))) => port::look(device, rate_baud, sys),
            (Target::Can(CanTarget::Interface(name)), _) => bus::look(name, sys),
            _ => Vec::new(),
        }
    }
}

/// Checks all lines of the bench. Another program on one of them may be at work with the board: then none is asked, since
/// the board has one session for all its links.
pub(super) fn look(bench: &BenchFile, sys: &Sys, proc: &Proc) -> Vec<Finding> {
    let mut findings = Vec::new();
    let (mut usable, mut taken) = (Vec::new(), false);
    for line in lines(bench) {
        // First who has it: to open a port sets its lines, and may reset a board that another program works with.
        let others = others(&line, proc);
        if !others.is_empty() {
            taken = true;
            findings.extend(others);
            findings.extend(unproven(&line.target));
            continue;
        }
        let itself = line.itself(sys);
        // The kernel's list of locks may be hidden, so a port that another program has locked may show itself only now.
        let busy = line.device().is_some_and(|(device, rate_baud)| port::is_busy(device, rate_baud));
        let opens = !busy && itself.iter().all(|finding| finding.health != Health::Bad);
        findings.extend(itself);
        if opens || busy {
            findings.extend(unproven(&line.target));
        }
        taken |= busy;
        if opens {
            usable.push(line);
        }
    }
    if taken {
        let what = "the board was not asked, since a HELLO would end the session of another program";
        findings.push(Finding::warning(what, "end the other program, or wait for it; then run doctor again"));
    }
    let runtime = match crate::threads::beside() {
        Ok(runtime) => runtime,
        Err(error) => {
            let what = format!("the board was not asked: {error}");
            findings.push(Finding::warning(what, "raise the limit of open files: `ulimit -n`; then run doctor again"));
            return findings;
        }
    };
    findings.extend(runtime.block_on(boards(usable, !taken, proc)));
    runtime.shutdown_background();
    findings
}

/// Why runs over this line prove nothing of a module: who repairs a bench learns it before the shift.
pub(super) fn unproven(target: &Target) -> Option<Finding> {
    target.doubt().as_ref().map(warning)
}

pub(super) fn warning(doubt: &Doubt) -> Finding {
    Finding::warning(format!("{doubt}; runs on this bench are unproven and count for no module"), doubt.try_this())
}

fn lines(bench: &BenchFile) -> Vec<Line> {
    let mut lines = Vec::new();
    if let Some(TestSocket::Rs422 { port, rate_bps }) = &bench.socket {
        let target = Target::Serial { port: PathBuf::from(port), rate_baud: *rate_bps };
        lines.push(Line { target, carries_runs: true });
    }
    if let Some(can) = &bench.can {
        let carries_runs = matches!(bench.socket, Some(TestSocket::Can));
        lines.push(Line { target: Target::Can(CanTarget::parse(&can.port)), carries_runs });
    }
    lines
}

/// A finding for the program that has locked the port, or for each that has it open. The port is not opened for that.
fn others(line: &Line, proc: &Proc) -> Vec<Finding> {
    let Some((device, _)) = line.device().filter(|(device, _)| port::may_be_one(device)) else { return Vec::new() };
    if let Some(error) = serial::locked(device) {
        return vec![Finding::warning(error.to_string(), error.try_this())];
    }
    let shown = gnc_text::shown_path(device);
    let told = |holder: super::holders::Holder| {
        let what = format!(
            "port {shown} is open in another program too: process {} ({}); each of the two gets a part of the bytes",
            holder.process, holder.command
        );
        Finding::bad(what, format!("end that program: kill {}", holder.process))
    };
    proc.holders(device).found.into_iter().map(told).collect()
}

/// Listens to each line, and asks the board where that is allowed.
async fn boards(lines: Vec<Line>, may_ask: bool, proc: &Proc) -> Vec<Finding> {
    let mut findings = Vec::new();
    let mut has_can = None;
    for line in lines {
        // What shares a serial port with another program would take bytes away from it.
        if !may_ask && line.device().is_some() {
            continue;
        }
        if !line.carries_runs && has_can == Some(false) {
            let what = format!("{}: not asked, since the board says that it has no CAN", line.target.port());
            findings.push(Finding::good(what));
            continue;
        }
        let receivers = match &line.target {
            Target::Can(CanTarget::Interface(name)) => proc.can_receivers(name),
            _ => 0,
        };
        let link = match Link::open(&line.target) {
            Ok(link) => link,
            Err(error) => {
                findings.push(Finding::bad(with_causes(&error), error.try_this()));
                continue;
            }
        };
        let may_ask = match (may_ask, receivers) {
            (false, _) => MayAsk::No,
            (true, 0) => MayAsk::Yes,
            (true, _) => MayAsk::AfterHeartbeat,
        };
        let heard = board::ask(link, nonce(), may_ask).await;
        if line.carries_runs {
            has_can = heard.answer.as_ref().map(|(hello, _)| hello.capabilities & capability::CAN != 0);
        }
        let mut found = board::findings(&heard);
        if !line.carries_runs {
            found.iter_mut().for_each(Finding::soften);
        }
        findings.extend(found);
        findings.extend(hidden(&line, &heard, receivers, proc));
    }
    findings
}

/// What cannot be seen of other programs, where the line has trouble that they may cause.
fn hidden(line: &Line, heard: &Heard, receivers: usize, proc: &Proc) -> Option<Finding> {
    if heard.answer.is_some() && heard.damaged == 0 {
        return None;
    }
    if receivers > 0 {
        let what = format!(
            "{receivers} receivers of other programs listen to {}; the kernel does not tell whose",
            line.target.port()
        );
        return Some(Finding::warning(what, "end the other programs that use the interface, then run doctor again"));
    }
    let (device, _) = line.device()?;
    let hidden = proc.holders(device).hidden;
    (hidden > 0).then(|| {
        let what = format!(
            "{hidden} processes of other users cannot be seen; one of them may read {}",
            gnc_text::shown_path(device)
        );
        Finding::warning(what, "sudo gnc-station doctor")
    })
}

/// Another number each time, so that a board never takes the session for an earlier one.
fn nonce() -> u32 {
    let now = Local::now();
    now.timestamp().cast_unsigned() as u32 ^ now.timestamp_subsec_nanos().rotate_left(2) ^ std::process::id() << 16
}
