//! What cannot be read, and what stands in the place of another run.

use std::fs::Permissions;
use std::os::unix::fs::PermissionsExt as _;

use super::*;

/// The superuser reads everything, so this thread looks as another user.
fn as_another_user() {
    if nix::unistd::geteuid().is_root() {
        let other = nix::unistd::Uid::from_raw(65_534);
        nix::unistd::setfsuid(other);
    }
}

fn rights(path: &Path, mode: u32) {
    fs::set_permissions(path, Permissions::from_mode(mode)).expect("rights");
}

#[test]
fn a_run_of_another_module_in_this_folder_is_a_change() {
    let shelf = Shelf::new();
    shelf.run("functional", ENDED);
    assert!(shelf.standing_at(LATER).passes());
    shelf.run_with("functional", "2026-11-28T14:40:05+08:00", |record| record["serial_number"] = json!("SN-2"));
    let standing = shelf.standing_at(LATER);
    assert!(!standing.passes_beyond_doubt(), "{standing}");
    assert_eq!(standing.beside.expect("a run").flaws, [Flaw::Changed]);
}

#[test]
fn what_cannot_be_read_is_not_called_changed() {
    for file in [RECORD, DIGESTS] {
        let shelf = Shelf::new();
        let run = shelf.run("functional", ENDED);
        rights(shelf.path(), 0o755);
        rights(&run.join(file), 0o000);
        as_another_user();
        let seal = Seals::new(shelf.path()).seal(&run).expect("a chain");
        let standing = shelf.standing_at(LATER);
        nix::unistd::setfsuid(nix::unistd::geteuid());
        assert_eq!(seal, Seal::Flawed(Flaw::Unreadable), "{file}");
        assert!(!standing.passes(), "{standing}");
    }
}

#[test]
fn a_module_whose_folder_cannot_be_read_has_no_standing() {
    for levels in [1, 2] {
        let shelf = Shelf::new();
        shelf.run("functional", "2026-11-27T14:30:05+08:00");
        let run = shelf.run("functional", ENDED);
        let closed = run.ancestors().nth(levels).expect("a folder");
        rights(shelf.path(), 0o755);
        rights(closed, 0o000);
        as_another_user();
        let plan = plan_info("functional", DIGEST);
        let question = Question {
            serial_number: "SN-1",
            plan: PlanAsked::This(&plan),
            valid_days: 30,
            bench: BenchKind::Real,
            now: time(LATER),
        };
        let standing = read(shelf.path(), &question, &[]);
        nix::unistd::setfsuid(nix::unistd::geteuid());
        rights(closed, 0o755);
        assert!(matches!(standing, Err(StoreError::File { .. })), "{standing:?}");
    }
}
