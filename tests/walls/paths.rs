//! Paths for people are shown through `gnc_text::shown_path`, since a name on a disk may hold a line end or a terminal escape.

use crate::{WORKSPACE, none_of};

/// What gives a path as it is.
const AS_IT_IS: &str = ".display()";

/// Files that give a path as it is: and why. A folder stands for all files in it.
const ALLOWED: [(&str, &str); 8] = [
    ("src/records/store/digest.rs", "lines of SHA256SUMS, which name files that the station wrote"),
    ("src/records/store/reader.rs", "the place of a run for programs"),
    ("src/records/reuse.rs", "the place of a run, kept as it is and shown through `printable`"),
    ("src/station/tui/session/files.rs", "names in fields of the form, which are opened again"),
    ("src/station/tui.rs", "the name of the plan in the form, which is opened again"),
    ("src/link/target.rs", "the port as the bench file names it, kept in records"),
    ("src/link/can.rs", "the bus as the bench file names it, kept in records"),
    ("hw-mocks/", "the simulated bench's own program for developers"),
];

#[test]
fn a_path_for_people_is_shown_safely() {
    let mut used = [false; ALLOWED.len()];
    let mut mistakes = Vec::new();
    let root = gnc_tests::repository();
    for module in WORKSPACE.as_ref().unwrap().iter().flat_map(|one| &one.modules) {
        let text = std::fs::read_to_string(root.join(&module.file)).unwrap();
        // Tests stand behind the code.
        let code = text.split("#[cfg(test)]\nmod tests {").next().unwrap_or_default();
        let file = module.file.strip_prefix(&root).unwrap_or(&module.file).display().to_string();
        let places = code.lines().enumerate().filter(|(_, line)| line.contains(AS_IT_IS));
        for (line, _) in places {
            match ALLOWED.iter().position(|(allowed, _)| file.starts_with(allowed)) {
                Some(at) => used[at] = true,
                None => mistakes.push(format!("{file}:{}: use gnc_text::shown_path, or add a reason here", line + 1)),
            }
        }
    }
    let idle = ALLOWED.iter().zip(used).filter(|(_, used)| !used);
    mistakes.extend(idle.map(|((file, _), _)| format!("{file} gives no path as it is")));
    none_of(&mistakes);
}
