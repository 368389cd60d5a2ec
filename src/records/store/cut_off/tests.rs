use std::collections::BTreeMap;
use std::path::PathBuf;

use sha2::{Digest as _, Sha256};
use tempfile::TempDir;

use super::*;
use crate::raw::read;

const RAW: &str = "01-imu/attempt-1.mcap";

/// A run's folder with a raw file that is cut after so many bytes.
fn run(bytes: &[u8]) -> (TempDir, RunFolder) {
    let folder = tempfile::tempdir().unwrap();
    fs::create_dir(folder.path().join("01-imu")).unwrap();
    fs::write(folder.path().join(RAW), bytes).unwrap();
    let run = RunFolder::existing(folder.path());
    (folder, run)
}

/// A file as earlier versions wrote it, with five captures in one chunk.
fn whole() -> &'static [u8] {
    include_bytes!("../../raw/implicit-presence.mcap")
}

fn contents(folder: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    let files = digest::files_below(folder).unwrap();
    files.into_iter().map(|file| (file.clone(), fs::read(folder.join(file)).unwrap())).collect()
}

#[test]
fn a_file_with_an_end_is_left_alone() {
    let (folder, run) = run(whole());
    let before = contents(folder.path());
    assert_eq!(complete(&run).unwrap().files, []);
    assert_eq!(contents(folder.path()), before);
}

/// Kept and torn bytes together are the file as the station left it, and the report about it is true.
#[test]
fn nothing_that_was_filed_is_lost() {
    for length in (0..whole().len()).step_by(211) {
        let original = &whole()[..length];
        let (folder, run) = run(original);
        let report = complete(&run).unwrap();
        let [found] = report.files.as_slice() else { panic!("{length}: {report:?}") };
        assert_eq!((found.file.as_str(), found.original_bytes), (RAW, length as u64));
        assert_eq!(found.original_sha256, digest::hexadecimal(&Sha256::digest(original)));
        let after = contents(folder.path());
        let kept = usize::try_from(found.kept_bytes).unwrap();
        let torn = found.torn.as_ref().map_or(Vec::new(), |torn| after[Path::new(torn)].clone());
        assert_eq!([&after[Path::new(RAW)][..kept], &torn].concat(), original, "{length} bytes");
        assert!(read(after[Path::new(RAW)].as_slice()).unwrap().cut_off);
        assert!(found.in_words().contains("its end was written when the run was sealed"), "{}", found.in_words());
        let filed: CutOffReport = serde_json::from_slice(&after[Path::new(CUT_OFF)]).unwrap();
        assert_eq!(filed, report);
    }
}

/// A second kill at any step: the next start comes to the same result.
#[test]
fn it_comes_to_the_same_end_after_another_kill() {
    let original = &whole()[..whole().len() - 3];
    let (folder, run_folder) = run(original);
    let report = complete(&run_folder).unwrap();
    let after = contents(folder.path());
    let torn = PathBuf::from(format!("{RAW}.torn"));
    let part = |file: &str| PathBuf::from(format!("{file}.part"));
    // A file is first written under a part name and then renamed.
    let steps = [
        (part(&format!("{RAW}.torn")), &b"half"[..]),
        (torn.clone(), after[&torn].as_slice()),
        (part(CUT_OFF), &b"{"[..]),
        (PathBuf::from(CUT_OFF), after[Path::new(CUT_OFF)].as_slice()),
        (part(RAW), &original[..100]),
        (PathBuf::from(RAW), after[Path::new(RAW)].as_slice()),
    ];
    for done in 0..=steps.len() {
        let (folder, run_folder) = run(original);
        for (file, bytes) in &steps[..done] {
            fs::write(folder.path().join(file), bytes).unwrap();
            let _ = fs::remove_file(folder.path().join(part(&file.to_string_lossy())));
        }
        assert_eq!(complete(&run_folder).unwrap(), report, "after {done} steps");
        assert!(contents(folder.path()) == after, "after {done} steps: other files");
        assert_eq!(complete(&run_folder).unwrap(), report, "once more");
        assert!(contents(folder.path()) == after, "once more: other files");
    }
}

/// The power fails, and the file is longer than what was written.
#[test]
fn zeros_at_the_end_are_no_part_of_a_file() {
    for zeros in [1, 8, 9, 4096, 200_000] {
        for length in [0, 5, whole().len() / 2, whole().len() - 4000, whole().len() - 3] {
            let original = [&whole()[..length], &vec![0; zeros]].concat();
            let (folder, run) = run(&original);
            let report = complete(&run).unwrap();
            let found = &report.files[0];
            assert_eq!(found.damaged, None, "{length} bytes and {zeros} zeros");
            assert_eq!(found.original_bytes, original.len() as u64);
            let after = contents(folder.path());
            assert!(read(after[Path::new(RAW)].as_slice()).unwrap().cut_off);
            let kept = usize::try_from(found.kept_bytes).unwrap();
            let torn = &after[Path::new(found.torn.as_ref().unwrap())];
            assert_eq!([&after[Path::new(RAW)][..kept], torn].concat(), original);
        }
    }
}

/// Damage that a kill cannot cause is not repaired: the file stays, and the record says so.
#[test]
fn a_damaged_file_stays_as_it_is() {
    let mut damaged = whole()[..whole().len() - 3].to_vec();
    damaged[2000] ^= 1;
    let (folder, run) = run(&damaged);
    let report = complete(&run).unwrap();
    let words = report.files[0].in_words();
    assert!(words.contains("is left as it was: it is damaged behind byte "), "{words}");
    assert!(fs::read(folder.path().join(RAW)).unwrap() == damaged);
    assert_eq!(complete(&run).unwrap(), report);
}

/// A report of an earlier start is checked: it may name a file outside the folder, or a file may have been replaced.
#[test]
fn only_the_file_that_was_looked_at_gets_its_end() {
    let original = &whole()[..whole().len() - 3];
    let (done, run_folder) = run(original);
    complete(&run_folder).unwrap();
    let told = fs::read_to_string(done.path().join(CUT_OFF)).unwrap();

    let (folder, run_folder) = run(&whole()[..whole().len() - 4]);
    fs::write(folder.path().join(CUT_OFF), &told).unwrap();
    let refused = with_causes(&complete(&run_folder).unwrap_err());
    assert!(refused.ends_with("it is not the file that was looked at"), "{refused}");

    let outside = tempfile::NamedTempFile::with_suffix(".mcap").unwrap();
    fs::write(outside.path(), original).unwrap();
    fs::write(folder.path().join(CUT_OFF), told.replace(RAW, &outside.path().to_string_lossy())).unwrap();
    assert!(complete(&run_folder).is_err());
    assert!(fs::read(outside.path()).unwrap() == original, "another folder's file was changed");
}
