//! The captures of a killed run are exchanged before it is taken up again.

use std::fs::{self, File};
use std::path::Path;

use gnc_records::raw::{self, RawWriter, pieces};
use gnc_records::store::{as_written, captures};
use nix::sys::signal::Signal;

use crate::WARM;
use crate::interruptions::{SPEED, args, bad, interrupt, place};

const SIX: &str = "03-six-position/attempt-1.mcap";
const NOT_TAKEN: &str = "captures of the run to resume are not taken over and are made again";

fn log(run: &Path) -> String {
    fs::read_to_string(run.join("log.txt")).expect("a log")
}

/// The captures of a good module in a file that says that it is of the run of the bad one.
fn exchange(good: &Path, killed: &Path) {
    let file = killed.join(SIX);
    let own = captures::read(&file).expect("captures");
    let good = raw::read(File::open(good.join(SIX)).expect("a file")).expect("captures");
    let mut out = RawWriter::new(File::create(&file).expect("room"), own.origin.as_ref()).expect("a head");
    for piece in good.captures.iter().flat_map(pieces) {
        out.write(piece).expect("room");
    }
    out.finish().expect("room");
    assert!(captures::read(&file).is_ok_and(|now| now.captures.len() == own.captures.len()), "it reads as its own");
}

/// A bad module stays bad: the captures of a good one are found, and its own are made again. Untouched ones are taken over.
#[test]
fn captures_of_another_module_are_not_taken_over() {
    let good = place(WARM);
    let whole = good.run(args("max", "1"));
    assert_eq!(whole.code, Some(0), "{}{}", whole.stdout, whole.stderr);
    let good = good.runs().remove(0);
    for is_exchanged in [false, true] {
        let place = place(&bad());
        let (killed, open) =
            interrupt(&place, &args(SPEED, "2"), ("05-rotation/attempt-1.mcap", 20_000), Signal::SIGKILL);
        assert!(open, "the kill came in time");
        if is_exchanged {
            exchange(&good, &killed);
        }
        let resume = ["--resume".to_owned(), killed.display().to_string()];
        let ended = place.run([&args("max", "3")[..], &resume].concat());
        assert_eq!(ended.code, Some(1), "{}{}", ended.stdout, ended.stderr);
        let said = log(place.runs().last().expect("a run"));
        let found = format!("{NOT_TAKEN}: {SIX} is not the one that was captured: ");
        assert_eq!(said.contains(&found), is_exchanged, "{said}");
        assert!(said.contains("taken over"), "the other captures are: {said}");
        let problems = as_written::verify(&killed);
        assert_eq!(problems.len(), usize::from(is_exchanged), "{problems:?}");
    }
}
