//! The four IO lines: every ordered pair at both levels, and shorts between lines.

use gnc_executive::catalogue::ports::{FAULTY_PAIRS, SHORTED_LINES, WRONG_READS};
use gnc_protocol::message::IoTest;

use super::{ProcedureContext, ProcedureError, Recorder};

const LINES: u8 = 4;

/// Readings of all four lines while one line drives another.
#[derive(Debug, Clone, Copy)]
struct Observation {
    driver: u8,
    reader: u8,
    level: bool,
    levels: u8,
}

impl Observation {
    fn reads(self, line: u8) -> bool {
        self.levels >> line & 1 == 1
    }

    fn connected(self, line: u8) -> bool {
        line == self.driver || line == self.reader
    }
}

pub(super) async fn run(bench: &ProcedureContext<'_>, recorder: &Recorder<'_>) -> Result<(), ProcedureError> {
    let mut seen = Vec::new();
    for driver in 0..LINES {
        for reader in (0..LINES).filter(|reader| *reader != driver) {
            for level in [false, true] {
                let reply = bench.board.call(&IoTest { driver, reader, level: level.into() }).await?;
                seen.push(Observation { driver, reader, level, levels: reply.levels });
            }
        }
    }
    // Connected lines are at the driven level; the two others are at the level to which they are pulled.
    let wrong_line = |seen: &Observation, line| seen.reads(line) != (seen.level == seen.connected(line));
    let wrong_reads: usize = seen.iter().map(|seen| (0..LINES).filter(|line| wrong_line(seen, *line)).count()).sum();
    recorder.count(&WRONG_READS, wrong_reads as u64).await?;
    let wrong: Vec<&Observation> = seen.iter().filter(|seen| seen.reads(seen.reader) != seen.level).collect();
    let mut pairs: Vec<String> = wrong.iter().map(|seen| format!("{}>{}", seen.driver, seen.reader)).collect();
    pairs.dedup();
    recorder.text(&FAULTY_PAIRS, &list(&pairs)).await?;
    Ok(recorder.text(&SHORTED_LINES, &list(&shorts(&seen))).await?)
}

/// Two lines are shorted if the second follows the first each time the board connects only the first and leaves the
/// second to its pull.
fn shorts(seen: &[Observation]) -> Vec<String> {
    let mut found = Vec::new();
    for a in 0..LINES {
        for b in a + 1..LINES {
            let mut apart = seen.iter().filter(|seen| seen.connected(a) != seen.connected(b)).peekable();
            let follows = |seen: &Observation| {
                let loose = if seen.connected(a) { b } else { a };
                seen.reads(loose) == seen.level
            };
            if apart.peek().is_some() && apart.all(follows) {
                found.push(format!("{a}-{b}"));
            }
        }
    }
    found
}

fn list(names: &[String]) -> String {
    if names.is_empty() { "none".to_owned() } else { names.join(" ") }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Four ideal lines, with a wire between the lines of `short`.
    fn lines(short: Option<(u8, u8)>) -> Vec<Observation> {
        let mut seen = Vec::new();
        for driver in 0..LINES {
            for reader in (0..LINES).filter(|reader| *reader != driver) {
                for level in [false, true] {
                    let mut driven = 1 << driver | 1 << reader;
                    if let Some((a, b)) = short
                        && driven & (1 << a | 1 << b) != 0
                    {
                        driven |= 1 << a | 1 << b;
                    }
                    let levels = if level { driven } else { !driven & 0x0f };
                    seen.push(Observation { driver, reader, level, levels });
                }
            }
        }
        seen
    }

    #[test]
    fn a_short_is_named_and_no_other() {
        assert!(shorts(&lines(None)).is_empty());
        for (a, b) in [(0, 1), (1, 3), (2, 3)] {
            assert_eq!(shorts(&lines(Some((a, b)))), [format!("{a}-{b}")]);
        }
    }
}
