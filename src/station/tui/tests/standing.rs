//! What the screen says of a module before its run, and when it asks.

use gnc_executive::outcome::Outcome;
use gnc_executive::standing::{Flaw, PastRun, Standing};
use gnc_executive::verdict::Verdict;

use super::{fail, found, has_failed, look, never, scene};
use crate::tui::decode::Key;
use crate::tui::lang::Lang;
use crate::tui::model::{Loaded, MessageWeight};
use crate::tui::scene::Scene;
use crate::tui::update::{Effect, Msg};

/// A module that was tested today is started only after a question; what failed is repeated without one.
#[test]
fn a_second_test_is_asked_for() {
    let mut scene = scene(Lang::En);
    fail(&mut scene);
    let at = chrono::DateTime::parse_from_rfc3339("2026-11-22T14:30:00+08:00").expect("a time");
    let earlier = || found(Some(has_failed(at)));
    assert_eq!(scene.key(Key::F(5)), Some(look()));
    assert_eq!(scene.tell(earlier()), None);
    assert!(scene.text().contains("Test it again?"), "{}", scene.text());
    assert_eq!(scene.key(Key::Esc), None);
    scene.key(Key::F(5));
    scene.tell(earlier());
    assert_eq!(scene.key(Key::Enter), None, "a scanner sends that");
    assert!(matches!(scene.key(Key::F(2)), Some(Effect::Start(start)) if start.selection.is_none()));
}

/// Who sets a bench up learns before the first run that none will count, and why.
#[test]
fn the_setup_page_says_why_a_bench_is_unproven() {
    for (lang, why) in [
        (Lang::En, "UNPROVEN BENCH (port /dev/pts/7 is a pseudo-terminal)"),
        (Lang::Zh, "端口 /dev/pts/7 是伪终端"),
        (Lang::Ru, "порт /dev/pts/7 — псевдотерминал"),
    ] {
        let mut scene = scene(lang);
        scene.unproven();
        scene.key(Key::F(2));
        // A wide character has two cells.
        let text = scene.text().replace(' ', "");
        assert!(text.contains(&why.replace(' ', "")), "{}", scene.text());
    }
}

/// That others may change the records stays on the screen long enough to be read, with what to do about it.
#[test]
fn the_umask_is_a_warning_with_its_hint() {
    for (lang, hint) in [
        (Lang::En, "; start the station with `umask 022`"),
        (Lang::Zh, "umask 022"),
        (Lang::Ru, "запускайте станцию с `umask 022`"),
    ] {
        let mut scene = scene(lang);
        let what = "the umask is 0000, so every user of this computer may change the records of new runs".to_owned();
        scene.model.message = Some((MessageWeight::Info, "Run X is resumed.".to_owned()));
        crate::tui::warn_of_umask(&mut scene.model, Some((what, "start the station with `umask 022`")));
        let (weight, text) = scene.model.message.clone().expect("a message");
        assert_eq!(weight, MessageWeight::Warning);
        assert!(text.contains("0000") && text.contains(hint) && text.ends_with(" Run X is resumed."), "{text}");
    }
}

/// What does not count for the module is shown as what it is. Only a whole run of this plan asks.
#[test]
fn what_does_not_count_is_shown_as_what_it_is() {
    let at = chrono::DateTime::parse_from_rfc3339("2026-11-21T14:30:00+08:00").expect("a time");
    let beside = |plan: &str, items: Option<Vec<String>>, flaws: Vec<Flaw>| {
        let verdict = Some(Verdict::new(Outcome::Passed, items.is_some()));
        let run = PastRun {
            at: Some(at),
            plan: plan.into(),
            verdict,
            items,
            bench: gnc_executive::event::BenchKind::Real,
            is_broken: false,
            flaws,
        };
        Standing { plan: "functional".into(), counts: None, beside: Some(run) }
    };
    let identity = || Some(vec!["identity".to_owned()]);
    let cases = [
        (beside("functional", identity(), vec![Flaw::Selection]), "only identity passed 2026-11-21 14:30", false),
        (beside("incoming", None, vec![Flaw::OtherPlan]), "incoming passed 2026-11-21 14:30; functional never", false),
        (
            beside("functional", None, vec![Flaw::NotClosed]),
            "functional passed 2026-11-21 14:30: record not closed",
            true,
        ),
        (
            beside("functional", None, vec![Flaw::NotInChain, Flaw::Simulated, Flaw::Rejudged]),
            "functional passed 2026-11-21 14:30: not in the chain, simulated, re-judged by other limits",
            true,
        ),
        (never(), "never tested", false),
    ];
    for (standing, words, asks) in cases {
        let mut scene = Scene::new(Lang::En, 80, 24).expect("memory");
        scene.types("DEMO-1");
        assert_eq!(scene.key(Key::Enter), Some(Effect::LookUp("DEMO-1".into())));
        scene.tell(Msg::Standing { serial_number: "DEMO-1".into(), standing: Ok(standing.clone()) });
        let shown: String = scene.text().split_whitespace().collect::<Vec<_>>().join(" ");
        for word in words.split(' ') {
            assert!(shown.contains(word), "{word} of {words}: {shown}");
        }
        scene.key(Key::F(5));
        let command = scene.tell(found(Some(standing)));
        assert_eq!(command.is_none(), asks, "{words}: {command:?}");
        assert_eq!(scene.text().contains("Test it again?"), asks, "{words}");
    }
}

/// Another plan asks the records again: the standing is by the plan on the screen.
#[test]
fn the_standing_is_by_the_plan_on_the_screen() {
    let mut scene = scene(Lang::En);
    let at = chrono::DateTime::parse_from_rfc3339("2026-11-21T14:30:00+08:00").expect("a time");
    let Loaded::Ready(plan) = &scene.model.plan else { panic!("no plan") };
    let plan = plan.clone();
    scene.types("DEMO-1");
    scene.key(Key::Enter);
    scene.tell(Msg::Standing { serial_number: "DEMO-1".into(), standing: Ok(has_failed(at)) });
    let asked = scene.tell(Msg::Plan { path: "incoming.toml".into(), plan: Loaded::Ready(plan) });
    assert_eq!(asked, Some(Effect::LookUp("DEMO-1".into())));
    assert_eq!(scene.model.scan.standing, None);
    // The answer of another module comes too late.
    scene.tell(Msg::Standing { serial_number: "DEMO-2".into(), standing: Ok(has_failed(at)) });
    assert_eq!(scene.model.scan.standing, None);
    scene.tell(Msg::Standing { serial_number: "DEMO-1".into(), standing: Err("cannot read records".into()) });
    assert!(scene.text().contains("cannot read records"), "{}", scene.text());
}
