//! The pages of an item that captures.

use super::scene;
use crate::tui::decode::Key;
use crate::tui::lang::Lang;
use crate::tui::scene::Scene;

/// The middle of the six positions, on the tests page.
pub(super) fn still(lang: Lang, size: (u16, u16)) -> Scene {
    Scene::capturing(lang, size, "six-position", 3).expect("memory")
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
