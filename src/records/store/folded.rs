//! Names as a file system leaves them that folds names: a memory stick or a disk of another system that has no capital letters, or
//! puts other signs in the place of those that it does not take. Such a copy is no forgery, and the records prove nothing there.

use std::fs;
use std::path::Path;

/// What is left of a name: letters in one case, and one sign for all others.
pub(super) fn fold(name: &str) -> String {
    name.chars()
        .flat_map(char::to_lowercase)
        .map(|mark| if mark.is_alphanumeric() || mark == '/' { mark } else { '_' })
        .collect()
}

/// The path below a folder that has this name but for what is folded; `None` if there is none, or that name itself.
pub(super) fn find(below: &Path, name: &str) -> Option<String> {
    let mut found = String::new();
    for part in name.split('/') {
        let exact = below.join(&found).join(part);
        let part = if exact.symlink_metadata().is_ok() {
            part.to_owned()
        } else {
            let mut names =
                fs::read_dir(below.join(&found)).ok()?.filter_map(|entry| entry.ok()?.file_name().into_string().ok());
            names.find(|name| fold(name) == fold(part))?
        };
        if !found.is_empty() {
            found.push('/');
        }
        found.push_str(&part);
    }
    (found != name).then_some(found)
}
