//! What holds of every scene in every language at every size: nothing is cut off unseen, no border is written over, the
//! verdict and the keys of a question are in sight, and no English is left on a Chinese or Russian screen.

use std::collections::{BTreeMap, BTreeSet};

use super::scenes::SCENES;
use crate::phrases::english::latin;
use crate::tui::keymap::{BINDINGS, KeyContext, bindings, name};
use crate::tui::lang::Lang;
use crate::tui::model::RunView;
use crate::tui::scene::Scene;
use crate::tui::view::text_width;

/// Sizes with panels: the usual ones, one with a status line, the smallest one.
const WITH_PANELS: [(u16, u16); 6] = [(80, 24), (160, 50), (100, 30), (120, 40), (80, 23), (80, 16)];
/// Sizes without panels.
const SMALL: [(u16, u16); 4] = [(79, 24), (60, 16), (40, 12), (30, 10)];
/// A size at which all texts of all scenes have room.
const WIDE: (u16, u16) = (240, 70);

/// A screen cell by cell. The second half of a wide character is `None`.
struct Screen {
    rows: Vec<Vec<Option<char>>>,
    text: String,
}

impl Screen {
    fn of(scene: &mut Scene, (width, height): (u16, u16)) -> Self {
        scene.resize(width, height);
        let text = scene.text();
        let row = |line: &str| {
            let cells = line.chars().flat_map(|character| {
                let wide = text_width(&character.to_string()) == 2;
                std::iter::once(Some(character)).chain(wide.then_some(None))
            });
            let mut cells: Vec<_> = cells.collect();
            cells.resize(cells.len().max(usize::from(width)), Some(' '));
            cells
        };
        Self { rows: text.lines().map(row).collect(), text }
    }

    fn at(&self, x: usize, y: usize) -> char {
        self.rows.get(y).and_then(|row| row.get(x)).copied().flatten().unwrap_or(' ')
    }

    /// The first cell in a row that holds the character, from a place on.
    fn find(&self, wanted: char, y: usize, from: usize) -> Option<usize> {
        (from..self.rows[y].len()).find(|x| self.at(*x, y) == wanted)
    }

    /// The place of the question: columns and rows of its corners.
    fn question(&self) -> Option<([usize; 2], [usize; 2])> {
        let (top, left) = (0..self.rows.len()).find_map(|y| Some((y, self.find('╔', y, 0)?)))?;
        let right = self.find('╗', top, left)?;
        let bottom = (top..self.rows.len()).find(|y| self.at(left, *y) == '╚')?;
        Some(([left, right], [top, bottom]))
    }

    /// The texts between borders: row, first column, and the cells up to the next border.
    fn segments(&self) -> Vec<(usize, usize, String)> {
        let mut segments = Vec::new();
        for (y, row) in self.rows.iter().enumerate() {
            let (mut from, mut text) = (0, String::new());
            for (x, cell) in row.iter().enumerate() {
                match cell {
                    Some(character) if BORDERS.contains(*character) => {
                        segments.push((y, from, std::mem::take(&mut text)));
                        from = x + 1;
                    }
                    Some(character) => text.push(*character),
                    None => {}
                }
            }
            segments.push((y, from, text));
        }
        segments.retain(|(_, _, text)| !text.trim().is_empty());
        segments
    }
}

const BORDERS: &str = "│║┌┐└┘╔╗╚╝";

/// Plays each scene in each language once, and looks at it at sizes.
fn each(sizes: &[(u16, u16)], look: impl Fn(&str, Lang, &mut Scene, (u16, u16), &Screen)) {
    for (name, play) in SCENES.iter().copied() {
        for lang in Lang::ALL {
            let mut scene = play(lang, sizes[0]);
            for size in sizes {
                let screen = Screen::of(&mut scene, *size);
                look(name, lang, &mut scene, *size, &screen);
            }
        }
    }
}

fn all_sizes() -> Vec<(u16, u16)> {
    WITH_PANELS.into_iter().chain(SMALL).collect()
}

#[test]
fn no_line_is_wider_than_the_screen() {
    each(&all_sizes(), |name, lang, _, size, screen| {
        for line in screen.text.lines() {
            assert!(text_width(line) <= usize::from(size.0), "{name} {lang:?} {size:?}: {line}");
        }
    });
}

/// From each corner a border runs to the next one, but for titles in it, and a question before it.
#[test]
fn no_border_is_written_over() {
    each(&WITH_PANELS, |name, lang, _, size, screen| {
        let question = screen.question();
        let hidden = |x: usize, y: usize| {
            question.is_some_and(|(columns, rows)| {
                (columns[0]..=columns[1]).contains(&x) && (rows[0]..=rows[1]).contains(&y)
            })
        };
        let fault =
            |what: &str, x: usize, y: usize| panic!("{name} {lang:?} {size:?}: {what} at {x}, {y}\n{}", screen.text);
        let mut corners = 0;
        for y in 0..screen.rows.len() {
            for left in 0..screen.rows[y].len() {
                if screen.at(left, y) != '┌' || hidden(left, y) {
                    continue;
                }
                let Some(right) = screen.find('┐', y, left) else { fault("no upper right corner", left, y) };
                let bottom = (y + 1..screen.rows.len()).find(|row| {
                    let side = |x: usize| hidden(x, *row) || screen.at(x, *row) == '│';
                    !(side(left) && side(right))
                });
                let Some(bottom) = bottom else { fault("no lower border", left, y) };
                let is = |x: usize, corner: char| hidden(x, bottom) || screen.at(x, bottom) == corner;
                if !is(left, '└') || !is(right, '┘') {
                    fault("a broken side", left, bottom);
                }
                corners += 3;
            }
        }
        if let Some((columns, rows)) = question {
            for y in rows[0] + 1..rows[1] {
                if columns.iter().any(|x| screen.at(*x, y) != '║') {
                    fault("a broken side of the question", columns[0], y);
                }
            }
            if screen.at(columns[1], rows[1]) != '╝' {
                fault("a broken corner of the question", columns[1], rows[1]);
            }
        }
        if question.is_none() {
            // A lower left corner is also where the axes of a chart meet.
            let all = screen.text.chars().filter(|character| "┌┐┘".contains(*character)).count();
            assert_eq!(all, corners, "{name} {lang:?} {size:?}: a corner without its panel\n{}", screen.text);
        }
    });
}

/// Texts that a screen may show, whole.
struct Known {
    words: BTreeSet<String>,
    /// How texts end behind the last place to fill in.
    ends: Vec<String>,
    /// The same without spaces, for a language that has none.
    joined: Vec<String>,
}

impl Known {
    fn new(lang: Lang, wide: &Screen) -> Self {
        let (mut words, mut ends, mut joined) = (BTreeSet::new(), Vec::new(), Vec::new());
        let mut take = |text: &str| {
            words.extend(text.split_whitespace().map(str::to_owned));
            joined.push(text.split_whitespace().collect::<String>());
            ends.extend(text.rsplit_once("{}").map(|(_, end)| end.trim().to_owned()).filter(|end| end.len() > 3));
        };
        let printed = format!("{:#?}", lang.texts());
        printed.lines().filter_map(|line| line.split_once(": \"")).for_each(|(_, text)| {
            take(text.trim_end_matches(',').trim_end_matches('"'));
        });
        for binding in BINDINGS {
            let key = (lang.texts().key)(binding.action);
            // Where there is little room, the name of a key stands at its word.
            take(&format!("{}{}", name(binding.key), key.short));
            take(key.short);
            take(key.long);
        }
        let mut columns: BTreeMap<usize, String> = BTreeMap::new();
        for (_, from, text) in wide.segments() {
            take(&text);
            columns.entry(from).or_default().push_str(&text);
        }
        columns.values().for_each(|text| take(text));
        Self { words, ends, joined }
    }

    /// Whether the word is whole, or goes on with the next one.
    fn ends_with(&self, word: &str, next: Option<&str>) -> bool {
        let spaced = !word.chars().any(|character| text_width(&character.to_string()) == 2);
        let goes_on = next.and_then(|next| next.chars().next()).is_some_and(|first| {
            let both = format!("{word}{first}");
            self.joined.iter().any(|text| text.contains(&both))
        });
        let whole = self.words.contains(word) || self.ends.iter().any(|end| word.ends_with(end));
        whole || goes_on || (!spaced && self.words.iter().any(|known| known.ends_with(word)))
    }
}

/// "1-19/20": which lines of how many are in sight.
fn is_scroll_mark(word: &str) -> bool {
    word.contains('-') && word.contains('/') && word.chars().all(|c| c.is_ascii_digit() || "-/".contains(c))
}

/// A word at the right edge of its place is whole, goes on in the next line, or ends with the mark of a shortening.
#[test]
fn nothing_is_cut_off_unseen() {
    let faults = std::cell::RefCell::new(Vec::new());
    for (name, play) in SCENES.iter().copied() {
        for lang in Lang::ALL {
            let mut scene = play(lang, WIDE);
            let known = Known::new(lang, &Screen::of(&mut scene, WIDE));
            for size in all_sizes() {
                let screen = Screen::of(&mut scene, size);
                let segments = screen.segments();
                let question = screen.question();
                for (y, from, text) in &segments {
                    // What stands behind a question is covered by it.
                    let behind = |(columns, rows): ([usize; 2], [usize; 2])| {
                        (rows[0]..=rows[1]).contains(y) && !(columns[0]..columns[1]).contains(from)
                    };
                    if question.is_some_and(behind) {
                        continue;
                    }
                    let cells = text_width(text);
                    let free = cells - text_width(text.trim_end());
                    let Some(word) = text.split_whitespace().last() else { continue };
                    if free > 1 || word.ends_with('…') || is_scroll_mark(word) || !word.contains(char::is_alphanumeric)
                    {
                        continue;
                    }
                    let next = segments.iter().find(|(row, column, _)| *row == y + 1 && column == from);
                    let next = next.and_then(|(_, _, text)| text.split_whitespace().next());
                    let mut below = segments.iter().filter(|(row, ..)| *row == y + 1);
                    if below.any(|(_, _, text)| text.split_whitespace().last().is_some_and(is_scroll_mark)) {
                        // It goes on in a line that is out of sight, and the mark says so.
                        continue;
                    }
                    if !known.ends_with(word, next) {
                        faults.borrow_mut().push(format!("{name} {lang:?} {size:?}: {word} in {text}"));
                    }
                }
            }
        }
    }
    let faults = faults.into_inner();
    assert!(faults.is_empty(), "{} cut off:\n{}", faults.len(), faults.join("\n"));
}

/// The outcome is in words or in large letters at every size.
#[test]
fn the_verdict_is_in_sight_at_every_size() {
    let judged = std::cell::Cell::new(0);
    each(&all_sizes(), |name, lang, scene, size, screen| {
        let Some(verdict) = scene.model.run.as_ref().and_then(RunView::verdict) else { return };
        let texts = lang.texts();
        let told = screen.text.to_lowercase();
        let words = [texts.word_of(verdict), (texts.verdict)(verdict)];
        let shown = words.iter().any(|word| told.contains(&word.to_lowercase()));
        assert!(shown, "{name} {lang:?} {size:?}: no {words:?}\n{}", screen.text);
        judged.set(judged.get() + 1);
    });
    assert!(judged.get() >= 4 * 3 * 10, "the scenes have verdicts");
}

/// A question has all its words, and its keys with what they do, at every size.
#[test]
fn questions_are_whole_with_their_keys() {
    let asked = std::cell::Cell::new(0);
    each(&all_sizes(), |name, lang, scene, size, screen| {
        let place = scene.model.place();
        let asks = [
            KeyContext::Confirm,
            KeyContext::Changed,
            KeyContext::Interrupted,
            KeyContext::Stopping,
            KeyContext::GivingUp,
            KeyContext::Prompt,
        ];
        if !asks.contains(&place) {
            return;
        }
        let Some((columns, rows)) = screen.question() else {
            panic!("{name} {lang:?} {size:?}: no question\n{}", screen.text)
        };
        let inside: String = (rows[0] + 1..rows[1])
            .flat_map(|y| (columns[0] + 1..columns[1]).map(move |x| (x, y)))
            .map(|(x, y)| screen.at(x, y))
            .collect();
        let letters = |text: &str| text.chars().filter(|c| c.is_alphanumeric()).collect::<String>();
        let shown = letters(&inside);
        let keys = bindings(place).filter(|binding| binding.footer);
        for binding in keys.filter(|binding| binding.action != crate::tui::keymap::KeyAction::Stop) {
            let key = name_and_word(&scene.model, binding);
            assert!(shown.contains(&letters(&key)), "{name} {lang:?} {size:?}: no {key}\n{}", screen.text);
        }
        if let Some(prompt) = scene.model.run.as_ref().and_then(|run| run.prompt.as_ref()) {
            let words = (lang.texts().ask)(&prompt.ask);
            // On a screen without panels a long request ends with a mark.
            let marked = size.0 < 80 && inside.contains('…');
            let whole = shown.contains(&letters(&words));
            assert!(whole || marked, "{name} {lang:?} {size:?}: not all of {words}\n{}", screen.text);
        }
        asked.set(asked.get() + 1);
    });
    assert!(asked.get() >= 14 * 3 * 10, "the scenes have questions: {}", asked.get());
}

fn name_and_word(model: &crate::tui::model::ScreenModel, binding: &crate::tui::keymap::Binding) -> String {
    format!("{} {}", name(binding.key), crate::tui::view::key_label(model, binding.action))
}

/// That a simulated bench, or one that does not prove its board, proves nothing is in sight at every size.
#[test]
fn a_bench_that_proves_nothing_is_marked_at_every_size() {
    each(&all_sizes(), |name, lang, _, size, screen| {
        let texts = lang.texts();
        let head = screen.text.lines().next().unwrap_or_default();
        let words = match name {
            "unproven" => [texts.unproven, texts.unproven_short],
            _ => [texts.simulated, texts.simulated_short],
        };
        let marked = words.iter().any(|word| head.contains(word));
        assert!(marked, "{name} {lang:?} {size:?}: {head}");
    });
}

/// Latin words that are the same in all languages, with the reason.
const NAMES: &[(&str, &str)] = &[
    (
        "what the factory, the plan and the operator named",
        "DEMO-1 DEMO-2 GNC-POP-26 line-2 Zhang Wei good functional calibration",
    ),
    ("words of a plan, in the language of who wrote it", "Close the lid of the shield"),
    (
        "files, folders and versions",
        "test-plans/functional.toml test-plans/limits.toml test-plans/mine.toml sim 140500-functional records/2026-11-22/DEMO-1 records/2026-11-22/DEMO-1/143000-functional",
    ),
    ("what the board says of itself, and where it is", "SIM-BOARD-1 /dev/pts/7 0x0000004a 0x0000005a"),
    ("names of measured values", "gyro_x gyro_y measured"),
    ("messages as the interface document names them", "SciEcho"),
    ("a standard", "SHA-256"),
    ("a command, and what it prints a line for", "3f9a0c1d2b4e 8e5d7c6b1a20 gnc-station plan check --sim plans"),
    ("numbers of the system's errors", "os error"),
    (
        "devices as they are printed on the module and in the interface document",
        "AD CAN COMP CPU DIP GNC GNSS IMU IO RAM RS-422 SCI SDRAM SPI 1PPS",
    ),
    ("what is printed on a switch", "ON OFF"),
    ("units", "bit/s deg/h deg/s degC gauss mg min ms"),
    ("symbols of metrology", "Allan HDOP X/Y alpha"),
    ("what is printed on keys", "Ctrl-A Ctrl-C Ctrl-L Ctrl-R Down End Enter Esc Home PgDn PgUp Space Up"),
];

/// Sentences that are English in every language still. The list only gets shorter: a sentence that no scene shows any more
/// fails the test, and its length stands in its type.
const STILL_ENGLISH: [(&str, &str); 2] = [
    ("lines of a plan, as they are written, and the names that it may have meant", "id = \"imo\" imu"),
    ("what a later version has written", "event `weighed`"),
];

/// A Chinese or Russian screen has no English word but names and what is listed above.
#[test]
fn no_english_is_left() {
    let mut names: BTreeMap<String, bool> =
        NAMES.iter().flat_map(|(_, words)| latin(words)).map(|word| (word.to_owned(), false)).collect();
    let (mut said, mut left) = (BTreeSet::new(), BTreeMap::<String, BTreeSet<String>>::new());
    for (name, play) in SCENES.iter().copied() {
        for lang in [Lang::Zh, Lang::Ru] {
            let mut scene = play(lang, WIDE);
            let screen = Screen::of(&mut scene, WIDE);
            let shown: BTreeSet<&str> = latin(&screen.text).collect();
            let here = |(_, sentence): &&(&str, &str)| latin(sentence).all(|word| shown.contains(word));
            let here: Vec<_> = STILL_ENGLISH.iter().filter(here).collect();
            said.extend(here.iter().map(|(_, sentence)| *sentence));
            let allowed: BTreeSet<&str> = here.iter().flat_map(|(_, sentence)| latin(sentence)).collect();
            let items = scene.model.plan.ready().map(|plan| plan.items.as_slice()).unwrap_or_default();
            for word in &shown {
                if let Some(seen) = names.get_mut(*word) {
                    *seen = true;
                } else if !allowed.contains(word) && !items.iter().any(|item| item.name == *word) {
                    left.entry((*word).to_owned()).or_default().insert(format!("{name} {lang:?}"));
                }
            }
        }
    }
    assert!(left.is_empty(), "English is left: {left:#?}");
    let stale: Vec<_> = STILL_ENGLISH.iter().filter(|(_, sentence)| !said.contains(sentence)).collect();
    assert!(stale.is_empty(), "no screen says this any more, so take it out: {stale:?}");
    let unused: Vec<_> = names.iter().filter(|(_, seen)| !**seen).collect();
    assert!(unused.is_empty(), "no screen has these names: {unused:?}");
}
