//! The standing of a module in the words of a language. The rule behind it, and the English words for texts without a
//! screen, are those of [`gnc_executive::standing`].

use gnc_executive::standing::{Flaw, PastRun, Standing};
use gnc_executive::verdict::Verdict;
use gnc_text::printable;

use super::{Texts, fill};

/// Most names of chosen items in a sentence; more are counted.
const NAMED_ITEMS: usize = 3;

/// "only identity passed 2026-11-28 14:30: simulated".
fn past_run(texts: &Texts, run: &PastRun) -> String {
    let mut words = match &run.items {
        None => printable(&run.plan).into_owned(),
        Some(items) if items.len() <= NAMED_ITEMS => fill(texts.standing_only, &[&printable(&items.join(", "))]),
        Some(items) => fill(texts.standing_only_items, &[&items.len().to_string()]),
    };
    if let Some(outcome) = run.verdict.map(Verdict::of_items).filter(|_| !run.flaws.contains(&Flaw::Interrupted)) {
        words.push_str(&format!(" {}", (texts.outcome_word)(outcome)));
    }
    if let Some(at) = run.at {
        words.push_str(&format!(" {}", at.format("%F %H:%M")));
    }
    let flaws: Vec<&str> = run.flaws.iter().filter_map(|flaw| (texts.flaw)(*flaw)).collect();
    if flaws.is_empty() { words } else { format!("{words}: {}", flaws.join(", ")) }
}

/// "functional passed 2026-11-28 14:30", "incoming passed 2026-11-28 14:30; functional never".
pub(crate) fn standing(texts: &Texts, standing: &Standing) -> String {
    let plan = printable(&standing.plan);
    match (&standing.counts, &standing.beside) {
        (Some(counts), beside) => {
            let mut words = past_run(texts, counts);
            if let Some(simulated) = (texts.flaw)(Flaw::Simulated).filter(|_| counts.simulated) {
                words.push_str(&format!(", {simulated}"));
            }
            match beside {
                Some(beside) => fill(texts.standing_then, &[&words, &past_run(texts, beside)]),
                None => words,
            }
        }
        (None, Some(beside)) if beside.plan == standing.plan => past_run(texts, beside),
        (None, Some(beside)) => fill(texts.standing_other, &[&past_run(texts, beside), &plan]),
        (None, None) => texts.never_tested.to_owned(),
    }
}
