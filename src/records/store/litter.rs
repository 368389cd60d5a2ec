//! Files that file managers, editors and file servers leave in each folder that they show. No station writes them.

use std::path::Path;

/// Their names, whatever the case of their letters.
const NAMES: [&str; 5] = ["Thumbs.db", "ehthumbs.db", "desktop.ini", "@eaDir", "Icon\r"];

/// Whether a file has such a name, or stands in a folder with one: `.DS_Store`, `._run.json`, `Thumbs.db`, `run.json~`.
pub(super) fn is_litter(file: &Path) -> bool {
    file.iter().any(|name| {
        let name = name.to_string_lossy();
        name.starts_with('.') || name.ends_with('~') || NAMES.iter().any(|litter| name.eq_ignore_ascii_case(litter))
    })
}

/// What to say of a file that was added to a closed run.
pub(super) fn added(file: &Path, all_else_is_as_written: bool) -> String {
    let file = gnc_text::shown_path(file);
    match all_else_is_as_written {
        true => format!(
            "{file} was added, perhaps by a file manager: all files that the station wrote are as they were; remove it and verify again"
        ),
        false => format!("{file} was added"),
    }
}
