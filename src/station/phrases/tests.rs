use std::collections::BTreeMap;

use super::table::Sentence;
use super::*;

fn zh(text: &str) -> Cow<'_, str> {
    in_language(text, Lang::Zh)
}

#[test]
fn a_sentence_has_its_values_where_the_language_has_them() {
    assert_eq!(
        zh("port /dev/ttyUSB0 is in use by minicom (process 12)"),
        "端口 /dev/ttyUSB0 正被 minicom (process 12) 占用"
    );
    assert_eq!(zh("port /dev/ttyUSB0 is in use by another program"), "端口 /dev/ttyUSB0 正被另一个程序占用");
    assert_eq!(
        in_language("port /dev/ttyUSB0 is in use by another program", Lang::Ru),
        "порт /dev/ttyUSB0 занят: другой программой"
    );
}

#[test]
fn causes_and_hints_behind_a_sentence_are_translated_too() {
    assert_eq!(
        zh(
            "no answer from the board to HELLO: asked 10 times in 2511 ms; nothing else was heard from it; check the board's power, \
            the two pairs (A and B swapped?) and the rate"
        ),
        "板卡不应答 HELLO：2511 ms 内询问 10 次；也没有收到它的其他数据；检查板卡电源、两对线（A、B 是否接反？）和波特率"
    );
}

/// A hint stands behind "try:" on a line of its own. Its "; then" joins no two runs.
#[test]
fn each_hint_behind_try_is_whole() {
    for lang in [Lang::Zh, Lang::Ru] {
        let before = if lang == Lang::Zh { "  可尝试：" } else { "  попробуйте: " };
        for sentence in
            all().iter().filter(|sentence| sentence.id.1.ends_with("_try") && !sentence.en.contains("try: "))
        {
            let hint = made(&Form::read(sentence.en).unwrap_or_default());
            let expected = format!("{before}{}", in_language(&hint, lang));
            assert_eq!(in_language(&format!("  try: {hint}"), lang), expected, "{:?}", sentence.id);
        }
    }
}

#[test]
fn the_holder_of_a_port_does_not_take_in_the_hint() {
    let hint = "wait until that program ends, or end it; then start again";
    for lang in [Lang::Zh, Lang::Ru] {
        for holder in ["gnc-station (process 982)", "another program"] {
            let busy = format!("port /dev/pts/2 is in use by {holder}");
            let between = if lang == Lang::Zh { "；" } else { "; " };
            let expected = format!("{}{between}{}", in_language(&busy, lang), in_language(hint, lang));
            assert_eq!(in_language(&format!("{busy}; {hint}"), lang), expected);
        }
    }
}

/// One word for a plan. Only the verb "planned" is another.
#[test]
fn a_plan_has_one_word_in_chinese() {
    for sentence in all() {
        assert!(!sentence.zh.replace("被计划", "").contains("计划"), "{:?}: {}", sentence.id, sentence.zh);
    }
}

#[test]
fn a_number_is_no_more_than_a_number() {
    for text in ["calibration 1.0, imu", "calibration , imu", "calibration e1 imu"] {
        assert_eq!(zh(text), text);
    }
    assert_eq!(zh("calibration 1.0 still"), "第 1.0 次标定 静止");
}

/// With no question behind it, as in the lines of a run without a screen.
#[test]
fn what_is_still_to_capture_is_told_with_and_without_a_question() {
    let text = "Taken over from the interrupted run: p0, p1. Still to capture: p2, p3.";
    assert_eq!(zh(text), "沿用中断运行的采集：p0, p1。尚待采集：p2, p3。");
    let asked = zh("Taken over from the interrupted run: p0. Still to capture: p2. a question").into_owned();
    assert_eq!(asked, "沿用中断运行的采集：p0。尚待采集：p2。a question");
}

/// A value at the end of a sentence ends before the cause.
#[test]
fn a_value_does_not_take_in_what_follows() {
    let text = "cannot write records/2026-11-22/DEMO-1: No space left on device (os error 28)";
    assert_eq!(
        in_language(text, Lang::Ru),
        "не удалось записать records/2026-11-22/DEMO-1: на диске нет места (os error 28)"
    );
}

/// A sentence with many words of its own counts more than one that takes in any text.
#[test]
fn a_cause_that_nobody_knows_leaves_its_sentence() {
    assert_eq!(
        in_language("line 7 of the journal is not an event: words of a library", Lang::Ru),
        in_language("line 7 of the journal is not an event", Lang::Ru) + ": words of a library"
    );
}

/// The place of a mistake is no part of its sentence.
#[test]
fn a_value_does_not_take_in_what_stands_before() {
    let text = "my plans/plan.toml:16:16: the limit of \"words_tested\" is not a text in quotes";
    assert_eq!(zh(text), "my plans/plan.toml:16:16：\"words_tested\" 的限值不是带引号的文本");
}

#[test]
fn what_the_table_does_not_know_stays_as_it_is() {
    for text in ["", "x", ": ", "; ; ;", "SN-0001", "a sentence of a later version", "{port}"] {
        assert_eq!(zh(text), text);
    }
    assert_eq!(zh("the IMU stream; a sentence of a later version"), "IMU 数据流；a sentence of a later version");
    let long = "port x is in use by ".repeat(1000);
    assert_eq!(zh(&long), long.as_str());
    let deep = "no answer from the board to HELLO: asked 1 times in 1 ms; ".repeat(60);
    assert!(zh(&deep).ends_with("in 1 ms; "), "the end of what is bounded");
}

/// The same places in each language, of the same kinds; words of its own; braces that fit.
#[test]
fn forms_agree() {
    for sentence in all() {
        let Sentence { id, en, zh, ru } = sentence;
        let english = Form::read(en).unwrap_or_else(|| panic!("{id:?}: {en}"));
        assert!(english.own_bytes() >= 3, "{id:?}: {en} would fit any text");
        for text in [zh, ru] {
            let other = Form::read(text).unwrap_or_else(|| panic!("{id:?}: {text}"));
            let names = |form: &Form| form.places().into_keys().collect::<Vec<_>>();
            assert_eq!(names(&english), names(&other), "{id:?}: {text}");
            assert!(
                other.places().values().all(|kind| *kind == PlaceKind::Text),
                "{id:?}: kinds stand in the English form alone"
            );
        }
        assert!(!zh.is_ascii() && !ru.is_ascii(), "{id:?} is English still");
    }
}

/// A sentence, made with values.
fn made(english: &Form) -> String {
    english.fill(|name| {
        Some(match english.places()[name] {
            PlaceKind::Number => "42".into(),
            PlaceKind::Text | PlaceKind::Own | PlaceKind::Name => format!("<{name}>").into(),
            PlaceKind::Sentence => "bus in memory".into(),
        })
    })
}

/// Each sentence, made with values, is found as itself and not as another one.
#[test]
fn each_sentence_is_found_as_itself() {
    let mut seen: BTreeMap<String, (&str, &str)> = BTreeMap::new();
    for sentence in all() {
        let english = Form::read(sentence.en).unwrap_or_default();
        let made = made(&english);
        assert!(seen.insert(made.clone(), sentence.id).is_none(), "{:?} and {:?}: {made}", sentence.id, seen[&made]);
        for (lang, form) in [(Lang::Zh, sentence.zh), (Lang::Ru, sentence.ru)] {
            let expected = Form::read(form).unwrap_or_default().fill(|name| {
                Some(match (english.places()[name], lang) {
                    (PlaceKind::Number, _) => "42".into(),
                    (PlaceKind::Text | PlaceKind::Own | PlaceKind::Name, _) => format!("<{name}>").into(),
                    (PlaceKind::Sentence, Lang::Zh) => "内存中的总线".into(),
                    (PlaceKind::Sentence, _) => "шина в памяти".into(),
                })
            });
            assert_eq!(in_language(&made, lang), expected, "{:?}", sentence.id);
        }
    }
}

/// Forms and places that are tried for a text, as the tries themselves count them.
fn tried(text: &str) -> u64 {
    tried_in(|| drop(ZH.found(text, &mut Tries::of_texts(1))))
}

/// Texts that people or boards could make, as long as texts are looked up, cost no more than the budget.
#[test]
fn a_hostile_text_costs_no_more_than_the_budget() {
    let mut pieces: Vec<String> =
        ["x: ", "x; ", "x. ", "x\n", "x, ", "\"x\" ", "`x` ", "a (", ") ", "1 of ", " is ", "port x is in use by y: "]
            .map(str::to_owned)
            .into();
    // Beginnings of rows.
    pieces.extend(
        all().iter().step_by(300).map(|sentence| format!("{}: ", sentence.en.split('{').next().unwrap_or("x"))),
    );
    for piece in pieces {
        for times in [40, LONGEST] {
            let text = piece.repeat(times.min(LONGEST / piece.len()));
            assert!(tried(&text) <= u64::from(MOST_TRIES), "{times} times {piece}");
        }
    }
    for begin in ["cannot read board: ", "note: ", "the plan stops at the first bad item, and "] {
        let text = format!("{begin}{}", "x\" is \"y: ".repeat(300));
        assert!(tried(&text) <= u64::from(MOST_TRIES), "{begin}");
    }
}

/// The budget is far from what the station says of itself: sentences with causes and hints behind them.
#[test]
fn sentences_of_the_station_cost_little() {
    let made: Vec<String> = all().iter().map(|sentence| made(&Form::read(sentence.en).unwrap_or_default())).collect();
    let (mut most, mut of) = (0, String::new());
    for at in (0..made.len()).step_by(5) {
        let other = |step: usize| &made[(at + step * 97) % made.len()];
        for text in [made[at].clone(), format!("{}: {}: {}; {}", made[at], other(1), other(2), other(3))] {
            let tried = tried(&text);
            if tried > most {
                (most, of) = (tried, text);
            }
        }
    }
    assert!(most <= u64::from(MOST_TRIES / 2), "{most} for {of}");
}

#[track_caller]
fn kept(english: &str, own: &str) {
    for lang in [Lang::Zh, Lang::Ru] {
        let told = in_language(english, lang);
        assert_eq!(told.matches(own).count(), english.matches(own).count(), "{english}: {told}");
        assert!(matches!(told, Cow::Owned(_)), "{english}");
    }
}

/// What a person wrote stays as it is, even where it reads like sentences of the table.
#[test]
fn names_and_answers_stay_as_they_are() {
    for name in ["temperature", "board", "memory", "failed", "not run", "item, failed"] {
        for english in [
            format!("{name} passed 2026-11-30 14:30"),
            format!("only {name} errored 2026-11-30 14:30"),
            format!("only {name}, {name} errored 2026-11-30 14:30"),
            format!("{name} passed 2026-11-30 14:30, simulated"),
            format!("{name} passed 2026-11-30 14:30; then only {name} errored 2026-11-30 14:30: simulated"),
            format!("{name} errored 2026-11-30 14:30; {name} never"),
        ] {
            kept(&english, name);
        }
    }
    for words in ["failed", "true", "board", "board: failed", "chain; failed", "failed. true", "a, b: failed"] {
        for english in [format!("answered: {words}"), format!("x: answered: {words}")] {
            kept(&english, words);
        }
    }
    assert_eq!(zh("temperature passed 2026-11-30 14:30"), "temperature 合格 2026-11-30 14:30");
    assert_eq!(zh("only board failed 2026-11-30 14:30"), "仅 board 不合格 2026-11-30 14:30");
    assert_eq!(zh("only 4 items failed 2026-11-30 14:30"), "仅 4 个项目 不合格 2026-11-30 14:30");
    assert_eq!(zh("answered: board: failed"), "回答：board: failed");
}

/// Chinese has signs of its own behind its characters.
#[test]
fn chinese_sentences_have_chinese_signs() {
    let is_chinese = |character: &char| matches!(character, '\u{4e00}'..='\u{9fff}');
    for sentence in all() {
        let pairs = sentence.zh.chars().zip(sentence.zh.chars().skip(1));
        let wrong = pairs.filter(|(before, sign)| is_chinese(before) && ",;:?!".contains(*sign)).count();
        assert_eq!(wrong, 0, "{:?}: {}", sentence.id, sentence.zh);
    }
}
