//! A pass, and lines of the chain behind it that are known to be missing or damaged: they may be those of a failure.

use super::*;

const PASSED: &str = "functional passed 2026-11-28 14:30";
const LACKING: &str = "functional passed 2026-11-28 14:30: later lines of the chain are missing or damaged";
const NEXT_DAY: &str = "2026-11-29T10:00:00+08:00";

/// What a person or a disk does to the chain.
type Spoil = fn(&Path);

fn chain_of(shelf: &Path, day: &str) -> PathBuf {
    shelf.join(day).join("CHAIN")
}

/// Writes the lines of a day anew, with a change.
fn edit(shelf: &Path, day: &str, change: impl Fn(&mut Vec<String>)) {
    let path = chain_of(shelf, day);
    let mut lines: Vec<String> = fs::read_to_string(&path).expect("a chain").lines().map(str::to_owned).collect();
    change(&mut lines);
    fs::write(path, lines.iter().map(|line| format!("{line}\n")).collect::<String>()).expect("a chain");
}

/// A pass of SN-1, then a failure of it on the next day with its folder taken away, and a run of the same module by another plan at the end.
fn shelf() -> Shelf {
    let shelf = Shelf::new();
    shelf.run("functional", ENDED);
    let failed = shelf.run_with("functional", "2026-11-29T09:00:05+08:00", |record| {
        record["outcome"] = "failed".into();
        record["items"][0]["outcome"] = "failed".into();
    });
    fs::remove_dir_all(failed).expect("a run");
    shelf.run("other", "2026-11-29T09:10:05+08:00");
    shelf
}

fn ask(shelf: &Shelf) -> Standing {
    shelf.ask(NEXT_DAY, PlanAsked::Named("functional"), BenchKind::Real)
}

/// The line of the failure is lost in every way that leaves a trace, and the module is tested once more.
#[test]
fn a_pass_before_a_known_hole_does_not_count_and_one_behind_it_does() {
    let spoils: [(&str, Spoil); 8] = [
        ("its line is removed", |shelf| edit(shelf, "2026-11-29", |lines| drop(lines.remove(0)))),
        ("its line is damaged", |shelf| edit(shelf, "2026-11-29", |lines| lines[0].insert(70, ' '))),
        ("its line names another module", |shelf| {
            edit(shelf, "2026-11-29", |lines| lines[0] = lines[0].replace("SN-1", "SN-2"));
        }),
        ("its line has another digest", |shelf| {
            edit(shelf, "2026-11-29", |lines| {
                let digest = lines[0].split(' ').nth(2).expect("a digest").to_owned();
                lines[0] = lines[0].replace(&digest, &"0".repeat(64));
            });
        }),
        ("an editor of another system saved the chain", |shelf| {
            edit(shelf, "2026-11-29", |lines| lines.iter_mut().for_each(|line| line.push('\r')));
        }),
        ("the last lines are gone, and COUNTER is ahead", |shelf| edit(shelf, "2026-11-29", Vec::clear)),
        ("the chain of the day is gone", |shelf| fs::remove_file(chain_of(shelf, "2026-11-29")).expect("a chain")),
        ("the whole day is gone", |shelf| fs::remove_dir_all(shelf.join("2026-11-29")).expect("a day")),
    ];
    for (what, spoil) in spoils {
        let shelf = shelf();
        assert!(!ask(&shelf).passes_beyond_doubt(), "{what}, as written: {}", ask(&shelf));
        spoil(shelf.path());
        let standing = ask(&shelf);
        assert!(!standing.passes() && standing.counts.is_none(), "{what}: {standing}");
        assert!(
            standing.to_string().starts_with(PASSED) || standing.to_string().contains("is missing"),
            "{what}: {standing}"
        );
        if standing.to_string() == LACKING {
            assert!(standing.try_this().starts_with("run that plan on this module again"), "{what}");
        }
        shelf.run("functional", "2026-11-29T09:30:05+08:00");
        let healed = ask(&shelf);
        assert!(healed.passes_beyond_doubt(), "{what}, tested again: {healed}");
        // The other modules stay as they are: their lines may be those that are missing.
        shelf.run("other", "2026-11-29T09:40:05+08:00");
        assert!(ask(&shelf).passes_beyond_doubt(), "{what}, and a run behind it: {}", ask(&shelf));
    }
}

/// What is missing before a run says nothing of the module's state after it.
#[test]
fn a_hole_before_the_pass_is_none_of_its_business() {
    let shelf = Shelf::new();
    shelf.run("other", "2026-11-27T14:00:05+08:00");
    shelf.run("other", "2026-11-27T14:10:05+08:00");
    shelf.run("functional", ENDED);
    edit(shelf.path(), "2026-11-27", |lines| drop(lines.remove(1)));
    assert!(ask(&shelf).passes_beyond_doubt(), "{}", ask(&shelf));
    fs::remove_dir_all(shelf.path().join("2026-11-27")).expect("a day that was moved away");
    assert!(ask(&shelf).passes_beyond_doubt(), "{}", ask(&shelf));
    // COUNTER that is behind or gone remembers nothing that is missing.
    fs::remove_file(shelf.path().join("COUNTER")).expect("a counter");
    assert!(ask(&shelf).passes_beyond_doubt(), "{}", ask(&shelf));
}

/// A line that is missing between beginning and end of the pass is in it.
#[test]
fn a_hole_within_the_run_is_behind_its_beginning() {
    let shelf = Shelf::new();
    let run = shelf.open("functional", ENDED, |_| {});
    fs::write(run.join(JOURNAL), "begun\n").expect("a journal");
    let by = chain::Scribe { station: "bench 1", at: time(ENDED), key: None, late: None };
    chain::begin(&run, &by).expect("a chain");
    shelf.run("other", "2026-11-28T14:00:05+08:00");
    close(&run);
    assert!(ask(&shelf).passes_beyond_doubt(), "{}", ask(&shelf));
    edit(shelf.path(), "2026-11-28", |lines| drop(lines.remove(1)));
    assert_eq!(ask(&shelf).to_string(), LACKING);
}

/// A run past midnight has its lines in the day before, behind those of the next day, and a clock that was set back leaves later
/// lines in an older day: nothing is missing then.
#[test]
fn lines_of_an_older_day_are_not_missing() {
    let shelf = Shelf::new();
    shelf.run("other", "2026-11-27T14:00:05+08:00");
    shelf.run("functional", ENDED);
    shelf.run("other", "2026-11-29T09:00:05+08:00");
    shelf.run("other", "2026-11-27T15:00:05+08:00");
    shelf.run("other", "2026-11-28T15:00:05+08:00");
    shelf.run("other", "2026-11-29T09:10:05+08:00");
    assert!(ask(&shelf).passes_beyond_doubt(), "{}", ask(&shelf));
    edit(shelf.path(), "2026-11-27", |lines| drop(lines.pop()));
    assert_eq!(ask(&shelf).to_string(), LACKING);
}

/// The chain of a day on which only other modules were tested cannot be read.
#[test]
fn a_chain_that_cannot_be_read_is_missing() {
    let shelf = Shelf::new();
    shelf.run("functional", ENDED);
    let other = shelf.path().join("2026-11-29/SN-9/090000-other");
    fs::create_dir_all(&other).expect("a folder");
    close(&other);
    assert!(ask(&shelf).passes_beyond_doubt(), "{}", ask(&shelf));
    let chain = chain_of(shelf.path(), "2026-11-29");
    fs::remove_file(&chain).expect("a chain");
    fs::create_dir(&chain).expect("a folder");
    assert_eq!(ask(&shelf).to_string(), LACKING);
}

/// A failure stays a failure, whatever is missing behind it.
#[test]
fn a_failure_before_a_hole_stays_one() {
    let shelf = Shelf::new();
    shelf.run_with("functional", ENDED, |record| record["outcome"] = "failed".into());
    shelf.run("other", "2026-11-29T09:00:05+08:00");
    shelf.run("other", "2026-11-29T09:10:05+08:00");
    edit(shelf.path(), "2026-11-29", |lines| drop(lines.remove(0)));
    assert_eq!(ask(&shelf).to_string(), "functional failed 2026-11-28 14:30");
}

/// While another station writes lines of several days, none of them is called missing.
#[test]
fn lines_that_are_written_meanwhile_are_not_missing() {
    let shelf = Shelf::new();
    let passed = shelf.run("functional", ENDED);
    let days = ["2026-11-28", "2026-11-29", "2026-11-27"];
    std::thread::scope(|scope| {
        let writer = scope.spawn(|| {
            for number in 0..150 {
                let day = days[number % days.len()];
                let run = shelf.path().join(day).join("SN-9").join(format!("{number:06}-other"));
                fs::create_dir_all(&run).expect("a folder");
                close(&run);
            }
        });
        let mut looks = 0;
        while !writer.is_finished() || looks < 2 {
            assert!(!Seals::new(shelf.path()).lacks_lines_behind(&passed).expect("a chain"), "look {looks}");
            looks += 1;
        }
    });
}
