//! The pages of an item that captures.

use super::{SIZES, scene};
use crate::tui::decode::Key;
use crate::tui::lang::Lang;
use crate::tui::scene::Scene;

#[test]
fn pictures_of_captures() {
    type Play = fn(Lang, (u16, u16)) -> std::io::Result<Scene>;
    let plays: [(&str, Play); 4] = [
        ("captures-field", |lang, size| Scene::spinning(lang, size, 20_000)),
        ("captures-field-early", |lang, size| Scene::spinning(lang, size, 12)),
        ("captures-allan", |lang, size| Scene::resting(lang, size, 60_000)),
        ("captures-allan-early", |lang, size| Scene::resting(lang, size, 3)),
    ];
    for (name, play) in plays {
        for lang in Lang::ALL {
            for size in SIZES {
                let mut scene = play(lang, size).expect("memory");
                scene.key(Key::F(9));
                insta::assert_snapshot!(format!("{name}-{lang:?}-{}", size.0), scene.text());
            }
        }
    }
}

/// Plays a scene in the middle of captures, and looks at its own page and at the tests page.
fn check_captures(name: &str, item: &str, finished: usize) {
    for lang in Lang::ALL {
        for size in SIZES {
            let mut scene = Scene::capturing(lang, size, item, finished).expect("memory");
            if name == "captures-still" {
                insta::assert_snapshot!(format!("{name}-tests-{lang:?}-{}", size.0), scene.text());
            }
            scene.key(Key::F(9));
            insta::assert_snapshot!(format!("{name}-{lang:?}-{}", size.0), scene.text());
        }
    }
}

/// The roll angle from stale raw samples is not shown beside the board's newer angle.
#[test]
fn a_roll_angle_of_long_ago_is_not_compared() {
    let mut scene = scene(Lang::En);
    scene.key(Key::F(9));
    scene.readings_of_a_calibrated_module();
    assert!(scene.text().contains("Roll  host -62.64°  board -57.30°"), "{}", scene.text());
    if let Some((board_time_us, _)) = &mut scene.model.live.newest.compensated {
        *board_time_us += 2_000_000;
    }
    assert!(scene.text().contains("Roll  host -  board -57.30°"), "{}", scene.text());
}

#[test]
fn captures() {
    check_captures("captures-still", "six-position", 3);
    check_captures("captures-turn", "rotation", 1);
    for lang in Lang::ALL {
        for (width, height) in SIZES {
            let mut scene = Scene::calibration(lang, width, height).expect("memory");
            scene.key(Key::F(9));
            insta::assert_snapshot!(format!("captures-none-{lang:?}-{width}"), scene.text());
        }
    }
}
