//! Dependencies between the modules of a crate, and cycles among them.

use std::collections::{BTreeMap, BTreeSet, VecDeque};

use crate::source::{Module, Named};

/// Name of a crate's root among its modules.
pub(crate) const ROOT: &str = "lib.rs";

/// Edges from a module to another, each with a place that shows it.
pub(crate) type Edges = BTreeMap<String, BTreeMap<String, String>>;

/// The edges between a crate's top-level modules and its root.
///
/// A re-export is not an edge: code that names `crate::Board` depends on the module that `Board` comes from.
#[must_use]
pub(crate) fn edges(modules: &[Module]) -> Edges {
    let tops: BTreeSet<&str> = modules.iter().filter_map(|module| single(&module.path)).collect();
    let root = modules.iter().find(|module| module.path.is_empty());
    let known: BTreeMap<&str, &Named> = root
        .into_iter()
        .flat_map(|module| &module.named)
        .filter_map(|named| Some((named.known_as.as_deref()?, named)))
        .collect();
    let mut edges = Edges::new();
    for module in modules {
        let from = module.path.first().map_or(ROOT, String::as_str);
        for named in &module.named {
            if module.path.is_empty() && named.passed_on {
                continue;
            }
            if let Some(to) = target(module, named, &tops, &known)
                && to != from
            {
                let place = format!("{}:{}: {}", module.file.display(), named.line, named.path.join("::"));
                edges.entry(from.to_owned()).or_default().entry(to.to_owned()).or_insert(place);
            }
        }
    }
    edges
}

fn single(path: &[String]) -> Option<&str> {
    match path {
        [only] => Some(only),
        _ => None,
    }
}

/// The top-level module to which the name leads; `None` if it does not belong to this crate.
fn target<'a>(
    module: &Module,
    named: &'a Named,
    tops: &BTreeSet<&'a str>,
    known: &BTreeMap<&str, &'a Named>,
) -> Option<&'a str> {
    let full = absolute(&module.path, &named.path, tops)?;
    let Some(first) = full.first().map(String::as_str) else { return Some(ROOT) };
    // A single word that equals the name of a module is not a module, unless a path begins with it.
    let is_word = module.path.is_empty() && named.path.len() == 1 && named.known_as.is_none();
    if let Some(top) = tops.get(first).filter(|_| !is_word) {
        return Some(top);
    }
    match known.get(first) {
        Some(origin) => {
            let from = absolute(&[], &origin.path, tops)?;
            Some(from.first().and_then(|first| tops.get(first.as_str()).copied()).unwrap_or(ROOT))
        }
        None if is_word => None,
        None => Some(ROOT),
    }
}

/// The name as a path from the crate's root; `None` if it begins elsewhere.
fn absolute(module: &[String], path: &[String], tops: &BTreeSet<&str>) -> Option<Vec<String>> {
    let (first, rest) = path.split_first()?;
    match first.as_str() {
        "crate" => Some(rest.to_vec()),
        "self" => Some([module, rest].concat()),
        "super" => {
            let ups = path.iter().take_while(|segment| *segment == "super").count();
            let kept = module.len().saturating_sub(ups);
            Some([&module[..kept], &path[ups..]].concat())
        }
        // At the root a path may begin with a module, or may be a single word.
        first if module.is_empty() && (tops.contains(first) || path.len() == 1) => Some(path.to_vec()),
        _ => None,
    }
}

/// A shortest cycle for each group of modules that depend on each other, written as its edges.
#[must_use]
pub(crate) fn cycles(edges: &Edges) -> Vec<String> {
    let mut found = Vec::new();
    let mut reported: BTreeSet<&str> = BTreeSet::new();
    for start in edges.keys() {
        if reported.contains(start.as_str()) {
            continue;
        }
        if let Some(cycle) = way(edges, start, start) {
            let lines = cycle.windows(2).map(|pair| {
                let (from, to) = (pair[0], pair[1]);
                format!("  {from} -> {to} ({})", edges[from][to])
            });
            found.push(lines.collect::<Vec<_>>().join("\n"));
            let knot =
                edges.keys().filter(|other| way(edges, start, other).is_some() && way(edges, other, start).is_some());
            reported.extend(knot.map(String::as_str));
        }
    }
    found
}

/// A shortest path of at least one edge, including both ends.
fn way<'a>(edges: &'a Edges, from: &'a str, to: &'a str) -> Option<Vec<&'a str>> {
    let mut came_from: BTreeMap<&str, &str> = BTreeMap::new();
    let mut waiting = VecDeque::from([from]);
    while let Some(at) = waiting.pop_front() {
        for next in edges.get(at).into_iter().flat_map(BTreeMap::keys) {
            if !came_from.contains_key(next.as_str()) {
                came_from.insert(next, at);
                waiting.push_back(next);
            }
        }
        if came_from.contains_key(to) {
            break;
        }
    }
    let mut back = vec![to, *came_from.get(to)?];
    while let Some(at) = back.last().filter(|at| **at != from) {
        back.push(came_from[at]);
    }
    back.reverse();
    Some(back)
}
