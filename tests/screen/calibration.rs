//! Guidance through captures, on the simulated turntable and at a manual table.

use gnc_tests::{Place, read_json};

use crate::terminal::Terminal;
use crate::{F2, F5, F7, F9, F10, STATION, mock, open, outcomes, sim};

/// A spin of the magnetometer and six positions, just long enough to be seen.
const PLAN: &str = "name = \"guided\"\nversion = \"1\"\n\
                    [[item]]\nid = \"magnetometer-ellipse\"\nparams = { duration = \"20 s\" }\n\
                    limits.radius = \"0.1 gauss .. 0.7 gauss\"\n\
                    [[item]]\nid = \"six-position\"\nparams = { dwell = \"20 s\" }\nlimits.residual_rms = \"<= 5 mg\"\n";

/// The number behind a label, as soon as there is one.
fn number_after(screen: &vt100::Screen, label: &str) -> Option<f64> {
    let text = screen.contents();
    text.split(label).nth(1)?.split_whitespace().next()?.parse().ok()
}

/// Width of the screen.
const COLUMNS: u16 = 80;

/// What the first run has reported at its end so far.
fn said(place: &Place) -> String {
    let journal = place.runs().first().map(|run| std::fs::read_to_string(run.join("events.jsonl")));
    let journal = journal.and_then(Result::ok).unwrap_or_default();
    journal.lines().filter(|line| line.contains("error")).collect()
}

/// Number of cells of the corrected plot that hold dots, by quarter: right and left of its middle, above and below.
fn dots(screen: &vt100::Screen) -> [usize; 4] {
    let rows: Vec<Vec<char>> = screen.rows(0, COLUMNS).map(|row| row.chars().collect()).collect();
    let Some((top, left)) = rows.iter().enumerate().find_map(|(y, row)| {
        let line: String = row.iter().collect();
        Some((y, line.split("┌ corrected ").next().filter(|before| before.len() < line.len())?.chars().count()))
    }) else {
        return [0; 4];
    };
    let right = (left + 1..usize::from(COLUMNS)).find(|x| rows[top].get(*x) == Some(&'┐')).unwrap_or(left);
    let bottom = (top + 1..rows.len()).find(|y| rows[*y].get(left) == Some(&'└')).unwrap_or(top);
    let mut quarters = [0; 4];
    for (y, row) in rows.iter().enumerate().take(bottom).skip(top + 1) {
        for x in left + 1..right {
            let dotted = row.get(x).is_some_and(|cell| ('\u{2801}'..='\u{28ff}').contains(cell));
            let quarter = usize::from(2 * x < left + right) + 2 * usize::from(2 * y > top + bottom);
            quarters[quarter] += usize::from(dotted);
        }
    }
    quarters
}

#[test]
fn captures_are_guided() {
    let place = Place::new(STATION);
    let plan = place.write("p.toml", PLAN).display().to_string();
    // Five minutes in half a minute: at full speed a position would be over before it is drawn.
    let mut terminal = open(&place, &sim(&plan, &["--sim-speed", "10"]), COLUMNS, 24);
    terminal.wait_for("guided 1");
    terminal.types(F9);
    // Before the run: what it will capture, and for how long.
    terminal.wait_for("No item captures now");
    assert!(terminal.text().contains("3 min 00 s"), "six times 20 s and 10 s of settling:\n{}", terminal.text());
    terminal.types(b"G-1\r");
    terminal.wait_for("G-1: F5 starts the test.");
    terminal.types(F5);
    terminal.types(F9);
    terminal.wait_for("+Z level to the north");
    terminal.wait_for("spins at +5400 deg/s about Z");
    terminal.wait_for("to go");
    let mut ratio = None;
    terminal.wait_until("a circle of corrected points all around", |screen| {
        ratio = number_after(screen, "Sensitivity X/Y ");
        ratio.is_some() && dots(screen).iter().all(|cells| *cells > 8)
    });
    let ratio = ratio.expect("a ratio");
    terminal.wait_until("the end of the first spin", |screen| {
        let text = screen.contents();
        assert!(!text.contains("errored"), "{}", said(&place));
        text.contains("✓ spin +")
    });
    // The next item has positions, each with a mark when it is finished.
    for seen in ["✓ x+", "-Y up, +Z to 0°", "✓ y+"] {
        terminal.wait_until(seen, |screen| {
            let text = screen.contents();
            assert!(!text.contains("errored"), "{}", said(&place));
            text.contains(seen)
        });
    }
    terminal.wait_until("the end", |screen| {
        let text = screen.contents();
        assert!(!text.contains("errored"), "{}", said(&place));
        text.matches("✓ passed").count() == 2
    });
    // The next page offers this key only when no run is on.
    terminal.types(F9);
    terminal.wait_for("F5 Watch");
    terminal.types(F10);
    let (status, restored) = terminal.end();
    assert!(restored && status.code() == Some(0), "{status}");
    // The last picture agrees with what the analysis found.
    let runs = place.runs();
    let item = read_json(&runs[0].join("01-magnetometer-ellipse/item.json"));
    let measured = item["attempts"][0]["measurements"].as_array().expect("measurements");
    let found = measured.iter().find(|measurement| measurement["name"] == "sensitivity_ratio").expect("a ratio");
    let percent = found["value"].as_f64().expect("a number");
    assert!((ratio * 100.0 - percent).abs() < 1.0, "shown {ratio}, found {percent} %");
}

/// Waits for the end of a run. A key that stands there only then tells it: one that goes away is also gone for a moment while the
/// line of keys is drawn anew, and F10 during a run only asks.
fn ends(terminal: &mut Terminal) {
    terminal.wait_for("F4 Repeat");
}

/// At a bench without a turntable a person lays the module down as the picture shows.
#[test]
fn a_module_is_laid_down_by_hand() {
    let place = Place::new(STATION);
    let board = mock("good");
    place.write("bench.toml", &board.bench_file("line-2"));
    place.write(
        "p.toml",
        "name = \"by-hand\"\nversion = \"1\"\n[[item]]\nid = \"six-position\"\n\
         params = { dwell = \"10 s\", settle = \"0 s\" }\nlimits.residual_rms = \"<= 5 mg\"\n",
    );
    let mut terminal = open(&place, &["--plan", "p.toml"], 80, 24);
    terminal.wait_for("by-hand 1");
    terminal.types(b"T-1\r");
    terminal.types(F5);
    terminal.wait_for("Lay the module with +X up and +Y to 0 degrees, clockwise from");
    terminal.wait_until("a drawn module", |screen| {
        screen.contents().chars().filter(|cell| ('\u{2801}'..='\u{28ff}').contains(cell)).count() > 30
    });
    terminal.types(F2);
    terminal.wait_for("Lay the module with -X up");
    terminal.wait_for("F7 Not possible");
    terminal.types(F7);
    terminal.wait_for("the operator could not do this: Lay the module with -X up");
    ends(&mut terminal);
    terminal.types(F10);
    let (status, restored) = terminal.end();
    assert!(restored && status.code() == Some(0), "{status}");
    assert_eq!(outcomes(&place), ["errored"]);

    // The run goes on: the person learns what exists, and lays the module down for what is missing.
    let broken = place.runs()[0].display().to_string();
    let mut terminal = open(&place, &["--plan", "p.toml", "--resume", &broken], 80, 24);
    terminal.wait_for("T-1: F5 resumes");
    // The words of the command line stand there before plan and bench are read.
    terminal.wait_for("by-hand 1");
    terminal.types(F5);
    terminal.wait_for("capture the rest");
    terminal.types(F2);
    terminal.wait_for("Taken over from the interrupted run: x+. Still to capture: x-,");
    terminal.wait_for("y+, y-, z+, z-. Lay the module with -X up and +Y to 0 degrees,");
    terminal.types(F2);
    terminal.wait_for("Lay the module with +Y up");
    assert!(!terminal.text().contains("Taken over"), "it is said once:\n{}", terminal.text());
    terminal.types(F7);
    ends(&mut terminal);
    terminal.types(F10);
    let (status, restored) = terminal.end();
    assert!(restored && status.code() == Some(0), "{status}");
    let runs = place.runs();
    let new = runs.iter().find(|run| run.display().to_string() != broken).expect("a run of its own");
    let captured = gnc_records::store::captures::read(&new.join("01-six-position/attempt-1.mcap")).expect("captures");
    let labels: Vec<&str> = captured.captures.iter().map(|capture| capture.about.label.as_str()).collect();
    assert_eq!(labels, ["x+", "x-"]);
}
