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

/// Names of folders that file servers and systems make on each disk that they see, whatever the case of their letters. No name of the
/// station has such letters: it writes them in digits.
const FOLDERS: [&str; 5] = ["@eaDir", "#recycle", "$RECYCLE.BIN", "System Volume Information", "lost+found"];

/// Whether what stands among days, modules or runs is a folder with such a name: `@eaDir`, `.Trash-1000`, `$RECYCLE.BIN`. A link is none.
pub(super) fn is_litter_folder(folder: &Path) -> bool {
    let name = folder.file_name().unwrap_or_default().to_string_lossy();
    let is_named = name.starts_with('.') || FOLDERS.iter().any(|litter| name.eq_ignore_ascii_case(litter));
    is_named && folder.symlink_metadata().is_ok_and(|meta| meta.is_dir())
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
