//! `gnc-station records list`: the runs of the records folder, for people, programs and spreadsheets.

mod table;

use std::collections::BTreeMap;
use std::io::{self, Write};
use std::path::Path;
use std::process::ExitCode;

use gnc_executive::bench::ShortDigest;
use gnc_executive::event::{BenchKind, PlanInfo};
use gnc_executive::outcome::Outcome;
use gnc_executive::standing::{Flaw, Seal};
use gnc_executive::verdict::Verdict;
use gnc_records::standing::Seals;
use gnc_records::store::StoreError;
use gnc_records::store::reader::{self, Found, FoundRun, Wanted};
use gnc_text::{printable, shown_path};

use super::place::RecordsPlace;
use crate::args::ListArgs;
use crate::exit_code::USAGE;
use crate::progress::Progress;
use crate::refusal::{complain, refuse};
use crate::wording::Lines;
use table::Line;

/// The word for a run that judged old samples again.
const REJUDGED: &str = "rejudged";

impl ListArgs {
    fn wanted(&self) -> Wanted<'_> {
        Wanted {
            since: self.day.or(self.since),
            until: self.day.or(self.until),
            serial_number: self.serial_number.as_deref().map(str::trim),
        }
    }

    fn has(&self, found: &FoundRun, seals: &mut Seals<'_>) -> bool {
        // A run that cannot be read may be any: no filter hides it.
        if found.is_unknown() {
            return true;
        }
        let plan = |plan: &String| found.run.as_ref().is_ok_and(|run| run.plan.name == *plan);
        self.plan.as_ref().is_none_or(plan) && (self.outcome.is_empty() || self.has_outcome(found, seals))
    }

    fn has_outcome(&self, found: &FoundRun, seals: &mut Seals<'_>) -> bool {
        // The writer of the list reads the chain once more, and tells why it cannot.
        let Ok(kept) = kept(found, seals) else { return true };
        let (word, worth) = (word(found, kept), worth(found, kept));
        // What a changed run says now does not hide it from a search for bad ones.
        let bad = verdict(found).filter(|verdict| !verdict.passes_module()).map(Verdict::as_str);
        let words = [Some(word), worth, bad];
        self.outcome.iter().any(|one| words.contains(&Some(one.as_str())))
    }

    fn wants_all(&self) -> bool {
        let Self { json: _, csv: _, day, since, until, serial_number, plan, outcome } = self;
        let days = day.or(*since).or(*until);
        days.is_none() && serial_number.is_none() && plan.is_none() && outcome.is_empty()
    }
}

/// The verdict of a run that is closed.
pub(super) fn verdict(found: &FoundRun) -> Option<Verdict> {
    found.run.as_ref().ok().filter(|_| found.state() == Found::Closed).map(|run| run.verdict)
}

/// The verdict of a closed run by its record: what is not in the chain as it was closed is no pass, whatever its items said. The
/// station called such a run errored, or did not live to call it anything.
fn proved(found: &FoundRun, kept: Option<Seal>) -> Option<Verdict> {
    let verdict = verdict(found)?;
    let is_flawed = matches!(kept, Some(Seal::Flawed(flaw)) if flaw != Flaw::UnderWay);
    let is_good = verdict.of_items().is_good();
    Some(if is_flawed && is_good { verdict.at_least(Outcome::Errored) } else { verdict })
}

/// Why the verdict of a closed run counts for nothing, in the word of `--outcome`; `None` if it may count.
fn worth(found: &FoundRun, kept: Option<Seal>) -> Option<&'static str> {
    let is_rejudged = verdict(found).is_some() && found.run.as_ref().is_ok_and(|run| run.recomputed.is_some());
    let is_unproven =
        verdict(found).is_some() && found.run.as_ref().is_ok_and(|run| run.bench.kind == BenchKind::Unproven);
    match kept {
        Some(Seal::Flawed(Flaw::UnderWay)) => Some(Found::Running.as_str()),
        Some(seal @ Seal::Flawed(_)) => table::seal_word(seal),
        Some(Seal::Chained) | None if is_rejudged => Some(REJUDGED),
        Some(Seal::Chained) | None => is_unproven.then_some(BenchKind::Unproven.as_str()),
    }
}

/// The verdict of a closed run, else the state of its folder. A pass that counts for nothing is called what it is: who
/// looks for passes must find no other. So is a run that was changed, whatever it says.
fn word(found: &FoundRun, kept: Option<Seal>) -> &'static str {
    let counts_for_nothing = verdict(found).is_none_or(Verdict::passes_module)
        || matches!(kept, Some(Seal::Flawed(Flaw::Changed | Flaw::Unreadable)));
    let worth = worth(found, kept).filter(|_| counts_for_nothing);
    worth.unwrap_or_else(|| verdict(found).map_or_else(|| found.state().as_str(), Verdict::as_str))
}

/// The word of a list for a run.
#[cfg(test)]
pub(super) fn word_of(found: &FoundRun, seals: &mut Seals<'_>) -> &'static str {
    word(found, kept(found, seals).expect("a chain"))
}

/// The texts that the plans of a list have: name and version stay when a limit is loosened.
#[derive(Default)]
struct PlanTexts(BTreeMap<(String, String), Vec<(String, u32)>>);

impl PlanTexts {
    /// Takes the plan of a run; the first digits of its digest if an earlier run in the list has another text under this name
    /// and version.
    fn other_text(&mut self, plan: &PlanInfo) -> Option<ShortDigest> {
        let digests = self.0.entry((plan.name.clone(), plan.version.clone())).or_default();
        match digests.iter_mut().find(|(digest, _)| *digest == plan.sha256) {
            Some((_, runs)) => *runs += 1,
            None => digests.push((plan.sha256.clone(), 1)),
        }
        (digests.len() > 1).then(|| ShortDigest::of(&plan.sha256))
    }

    /// The plans with more than one text, and how many runs each text has.
    fn of_several_texts(&self) -> impl Iterator<Item = (&(String, String), &[(String, u32)])> {
        self.0.iter().map(|(plan, digests)| (plan, digests.as_slice())).filter(|(_, digests)| digests.len() > 1)
    }
}

/// Lists runs in the order in which they were closed.
pub(super) fn list(place: &RecordsPlace, args: &ListArgs) -> ExitCode {
    let records = &place.path;
    let progress = Progress::begin("runs are read for the list");
    let runs = match reader::wanted(records, args.wanted()) {
        Ok(runs) => runs,
        Err(error) => return refuse(gnc_text::with_causes(&error), error.try_this()),
    };
    let unread = match reader::unread(records, args.wanted()) {
        Ok(unread) => unread,
        Err(error) => return refuse(gnc_text::with_causes(&error), error.try_this()),
    };
    let mut seals = Seals::new(records);
    let runs = runs.filter(|found| args.has(found, &mut seals));
    let out = io::BufWriter::new(io::stdout().lock());
    let written = if args.json {
        as_json(out, records, runs)
    } else if args.csv {
        table::csv(out, records, runs)
    } else {
        for_people(Lines::new(out), place, args, runs)
    };
    drop(progress);
    // Runs in these folders are not in the list, and one of them may have failed.
    for error in &unread {
        complain(gnc_text::with_causes(error), error.try_this());
    }
    match written {
        Ok(()) if unread.is_empty() => ExitCode::SUCCESS,
        Ok(()) => ExitCode::from(USAGE),
        // The reader has seen enough.
        Err(error) if error.kind() == io::ErrorKind::BrokenPipe => ExitCode::SUCCESS,
        Err(error) => match error.downcast::<StoreError>() {
            // The chain cannot be read, and without it nothing is known of any run.
            Ok(error) => refuse(gnc_text::with_causes(&error), error.try_this()),
            Err(error) => refuse(format_args!("the list cannot be written: {error}"), "check where the output goes"),
        },
    }
}

/// How the record of a run is kept, with an error that the writer of a list can pass on.
fn kept(found: &FoundRun, seals: &mut Seals<'_>) -> io::Result<Option<Seal>> {
    seals.kept(found).map_err(io::Error::other)
}

fn as_json(mut out: impl Write, records: &Path, runs: impl Iterator<Item = FoundRun>) -> io::Result<()> {
    write!(out, "[")?;
    let mut seals = Seals::new(records);
    for (index, found) in runs.enumerate() {
        writeln!(out, "{}", if index > 0 { "," } else { "" })?;
        let kept = kept(&found, &mut seals)?;
        serde_json::to_writer(&mut out, &Line::of(&found, records, kept))?;
    }
    writeln!(out, "\n]")?;
    out.flush()
}

fn for_people<W: Write>(
    mut out: Lines<W>,
    place: &RecordsPlace,
    args: &ListArgs,
    runs: impl Iterator<Item = FoundRun>,
) -> io::Result<()> {
    let mut none = true;
    let mut plans = PlanTexts::default();
    let mut seals = Seals::new(&place.path);
    for found in runs {
        none = false;
        let line = match &found.run {
            Ok(run) => {
                let kept = kept(&found, &mut seals)?;
                // The word for a run that is not closed stands before.
                let line = super::summary(&out.wording, word(&found, kept), run, kept.unwrap_or(Seal::Chained));
                match plans.other_text(&run.plan) {
                    Some(digest) => format!("{line}  {digest}"),
                    None => line,
                }
            }
            Err(_) if found.running => out.wording.text(word(&found, None)),
            Err(error) => {
                let why = printable(&gnc_text::with_causes(error)).into_owned();
                format!("{}{}", super::state(&out.wording, word(&found, None)), out.wording.text(&why))
            }
        };
        // Its cells have their words already, and serial numbers are no words.
        out.say_as_it_is(format_args!(
            "{line}  {}",
            shown_path(found.path.strip_prefix(&place.path).unwrap_or(&found.path))
        ))?;
    }
    for (plan, digests) in plans.of_several_texts() {
        let (name, version) = (gnc_text::exact(&plan.0), gnc_text::exact(&plan.1));
        for (digest, runs) in digests {
            let digest = ShortDigest::of(digest);
            out.try_say(format_args!("plan {name} {version} is not one text in this list: {digest} in {runs} runs"))?;
        }
    }
    if none {
        let such = if args.wants_all() { "no run" } else { "no such run" };
        out.try_say(format_args!("{such} is recorded in {}", place.in_words()))?;
    }
    out.flush()
}

#[cfg(test)]
mod tests;
