//! Boards that break the interface document: each key breaks its rule, on every link that has the rule, and no other
//! rule; a board without the key keeps them all.
//!
//! A scripted host holds one session with each board and keeps all that comes, with its times. The rules are read off
//! that record. They are written from the document and know nothing of the keys.

mod board;
mod conversation;
mod frames;
mod keys;
mod record;

use std::collections::BTreeSet;

use record::{BOTH, Link, Record};

/// A rule of the document: its name, and whether a record keeps it.
type Rule = (&'static str, fn(&Record) -> bool);

/// Keys of `[board]`, the links on which they break rules, and the rules that they break. Keys that break other rules
/// on the other link have a case for each.
type Case = (&'static str, &'static [Link], &'static [&'static str]);

/// Checks that each board breaks exactly the rules that are told, of all these rules.
fn check(rules: &[Rule], cases: &[Case], record: impl Fn(&str, Link) -> Record) {
    let broken = |keys: &str, link: Link| -> BTreeSet<&str> {
        let record = record(&format!("[board]\n{keys}\n"), link);
        rules.iter().filter(|(_, kept)| !kept(&record)).map(|(name, _)| *name).collect()
    };
    let mut wrong = Vec::new();
    let all_keys: BTreeSet<&str> = cases.iter().map(|(keys, _, _)| *keys).chain([""]).collect();
    for link in BOTH {
        for &keys in &all_keys {
            let stands = |(of, links, _): &&Case| *of == keys && links.contains(&link);
            let expected: BTreeSet<&str> =
                cases.iter().filter(stands).flat_map(|(_, _, rules)| rules.iter().copied()).collect();
            let broken = broken(keys, link);
            if broken != expected {
                wrong.push(format!("{link:?}, {keys}: broke {broken:?}, and should break {expected:?}"));
            }
        }
    }
    assert!(wrong.is_empty(), "{wrong:#?}");
    let tried: BTreeSet<&str> = cases.iter().flat_map(|(_, _, rules)| rules.iter().copied()).collect();
    let untried: Vec<_> = rules.iter().filter(|(name, _)| !tried.contains(name)).map(|(name, _)| name).collect();
    assert!(untried.is_empty(), "no board breaks {untried:?}");
}
