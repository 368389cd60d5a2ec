//! Cases that a check once passed without a word: a folder without runs, a module whose run was taken away, a folder that another
//! program holds, a head that a person types, files without rights, and files of a file manager.

use std::ffi::OsStr;
use std::fs::{self, File};
use std::os::unix::fs::{PermissionsExt as _, chown};

use gnc_tests::{UNPRIVILEGED, without_rights};

use super::*;

const FAILED: &str = "2026-11-28/T-2/091000-small";

/// A wrong path is no pass, and so is a folder whose runs have all been taken away.
#[test]
fn a_folder_without_a_run_is_no_pass() {
    let place = tempfile::tempdir().expect("a folder");
    let records = place.path().join("records");
    let kept = Kept::new();
    for day in ["", "2026-11-28", "2026-11-28/T-1", "pictures"] {
        fs::create_dir_all(records.join(day)).expect("a folder");
        let (code, said) = asked(&records, &[]);
        assert_eq!(code, 2, "{day}: {said}");
        assert_eq!(
            said.replace(&place.path().display().to_string(), "PLACE"),
            "gnc-station: there is no run to verify in PLACE/records\n  \
             try: name the folder with --records DIR, or the bench file that names it with --bench FILE\n"
        );
        let (code, said) = asked(&records, &["--head".into(), kept.head.clone()]);
        assert!(code == 1 && said.contains("the newest runs are missing"), "{said}");
    }
}

/// One module is verified by its number, or one run by its name, and the run is gone or has another name.
#[test]
fn a_module_is_not_verified_without_its_runs() {
    let kept = Kept::new();
    let (_place, records) = copied(&kept);
    let whole = asked(&records, &["T-2".into()]);
    assert_eq!(whole.0, 0, "{}", whole.1);
    let to = records.join("2026-11-28/T-9");
    fs::create_dir_all(&to).expect("a folder");
    fs::rename(records.join(FAILED), to.join("091000-small")).expect("a run");
    let name = records.join(FAILED).to_string_lossy().into_owned();
    for asked_for in ["T-2", FAILED, &name, &format!("{name}/")] {
        let (code, said) = asked(&records, &[asked_for.to_owned()]);
        assert_eq!(code, 1, "{asked_for}: {said}");
        assert!(
            said.contains(&format!(
                "chain: line 4 of the chain ({FAILED}): the run was closed, and its folder is missing\n"
            )),
            "{said}"
        );
    }
    let (code, said) = asked(&records, &["T-1".to_owned()]);
    assert_eq!(code, 0, "another module: {said}");
    // All runs of a module are gone, and a number that was never tested.
    fs::remove_dir_all(records.join("2026-11-29/T-3")).expect("a module");
    let (code, said) = asked(&records, &["T-3".to_owned()]);
    assert!(code == 1 && said.contains("was closed, and its folder is missing"), "{said}");
    assert_eq!(asked(&records, &["T-4".to_owned()]).0, 2);
}

/// An auditor gets the folder of one run by mail. Its files agree with each other in any case; that its station wrote them, its key alone
/// shows.
#[test]
fn a_run_that_was_sent_alone_is_proved_by_its_key() {
    let kept = Kept::new();
    let place = tempfile::tempdir().expect("a folder");
    let sent = place.path().join("mail/T-2/091000-small");
    plant(&tree(&kept.records().join(FAILED)).expect("a run"), &sent).expect("a copy");
    let name = sent.to_string_lossy().into_owned();
    let key = || ["--key".to_owned(), kept.public_key.to_string_lossy().into_owned(), name.clone()];
    let said =
        |(code, said): (i32, String)| format!("{code}\n{}", said.replace(&place.path().display().to_string(), "PLACE"));
    insta::assert_snapshot!("sent_alone", said(asked(&kept.records(), std::slice::from_ref(&name))));
    insta::assert_snapshot!("sent_alone_with_its_key", said(asked(&kept.records(), &key())));
    // A file is exchanged with its digest, and the signature taken away.
    fs::write(sent.join("log.txt"), "passed").expect("a log");
    assert_eq!(asked(&kept.records(), std::slice::from_ref(&name)).0, 1);
    crate::attack::sums_anew(place.path()).expect("digests");
    assert_eq!(asked(&kept.records(), &key()).0, 1);
    fs::remove_file(sent.join("SHA256SUMS.sig")).expect("a signature");
    assert_eq!(asked(&kept.records(), &key()).0, 1);
}

/// A run that was killed is moved into the folder of another module, or its capture is exchanged: verify names it, whether all runs are asked
/// for or that module alone, and calls it no run that the next start mends.
#[test]
fn a_killed_run_that_was_moved_is_a_finding() {
    let kept = Kept::with_a_killed_run();
    let (_place, records) = copied(&kept);
    let (code, said) = asked(&records, &["T-4".to_owned()]);
    assert_eq!(code, 3, "as the kill left it: {said}");
    fs::create_dir_all(records.join("2026-11-29/T-3")).expect("a module");
    fs::rename(records.join("2026-11-29/T-4/090000-small"), records.join("2026-11-29/T-3/090000-small"))
        .expect("a run");
    let told = "the journal names the serial number \"T-4\", and the folder is not that of its module";
    for asked_for in [Vec::new(), vec!["T-3".to_owned()], vec!["2026-11-29/T-3/090000-small".to_owned()]] {
        let (code, said) = asked(&records, &asked_for);
        assert!(code == 1 && said.contains(told), "{asked_for:?}: {code} {said}");
    }
    let (_place, records) = copied(&kept);
    fs::write(records.join("2026-11-29/T-4/090000-small/01-cpu/attempt-1.mcap"), "x").expect("a capture");
    let (code, said) = asked(&records, &["T-4".to_owned()]);
    assert!(code == 1 && said.contains("is not the one that was captured"), "{code} {said}");
}

/// One module is verified by its number, and strangers stand among its runs.
#[test]
fn a_module_is_not_verified_with_strangers_in_it() {
    let kept = Kept::new();
    let (_place, records) = copied(&kept);
    fs::write(records.join("2026-11-28/T-2/notes.txt"), "x").expect("a file");
    let (code, said) = asked(&records, &["T-2".to_owned()]);
    let told = "chain: 2026-11-28/T-2/notes.txt was added: no station writes it there\n";
    assert!(code == 1 && said.contains(told), "{said}");
    assert_eq!(asked(&records, &["T-1".to_owned()]).0, 0);
}

/// A folder is planted, and a program holds its lock as a station does.
#[test]
fn a_folder_that_is_held_is_no_run_that_goes_on() {
    let kept = Kept::new();
    let (_place, records) = copied(&kept);
    let planted = records.join("2026-11-29/T-9/090000-small");
    plant(&tree(&records.join(FAILED)).expect("a run"), &planted).expect("a copy");
    let held = File::open(&planted).expect("a folder");
    held.lock().expect("a lock");
    for without in [None, Some("SHA256SUMS")] {
        if let Some(file) = without {
            fs::remove_file(planted.join(file)).expect("a file");
        }
        for named in [Vec::new(), vec![planted.to_string_lossy().into_owned()]] {
            let (code, said) = asked(&records, &named);
            assert_eq!(code, 1, "{without:?}: {said}");
        }
    }
    let (_, said) = asked(&records, &[]);
    let expected =
        "2026-11-29/T-9/090000-small is held as a run that goes on, and no line of the chain says that it began";
    assert!(said.contains(expected), "{said}");
}

/// Number and link are typed from paper.
#[test]
fn a_head_is_typed_in_capitals() {
    let kept = Kept::new();
    let typed = |head: &str| asked(&kept.records(), &[format!("--head={head}")]);
    let (number, link) = kept.head.split_once(' ').expect("a head");
    let capitals = format!("\t {number} {}  ", link.to_uppercase());
    assert_eq!(typed(&capitals).0, 0, "{}", typed(&capitals).1);
    let (half, rest) = link.split_at(32);
    for wrong in [
        format!("{number}  {link}"),
        format!("{number} {half} {rest}"),
        format!("+{number} {link}"),
        format!("{number} {half}-{rest}"),
    ] {
        assert_eq!(typed(&wrong).0, 2, "{wrong}: {}", typed(&wrong).1);
    }
}

/// Runs a command on the records of a place as a user who has no right to this part of them. Returns the exit code, and what it said.
fn without_rights_to(spoiled: &Path, place: &tempfile::TempDir, arguments: &[&OsStr]) -> (Option<i32>, String) {
    fs::set_permissions(place.path(), fs::Permissions::from_mode(0o755)).expect("rights");
    if nix::unistd::geteuid().is_root() {
        for found in tree(place.path()).expect("a tree").into_keys() {
            chown(place.path().join(found), Some(UNPRIVILEGED), Some(UNPRIVILEGED)).expect("an owner");
        }
    }
    fs::set_permissions(spoiled, fs::Permissions::from_mode(0o000)).expect("rights");
    let mut command = without_rights(STATION, place.path());
    command.args(arguments).arg("--records").arg(place.path().join("records"));
    command.stdin(Stdio::null()).env("NO_COLOR", "1").env("LC_ALL", "C.UTF-8").current_dir(place.path());
    let output = command.output().expect("the station");
    fs::set_permissions(spoiled, fs::Permissions::from_mode(0o755)).expect("rights");
    (output.status.code(), String::from_utf8_lossy(&[output.stdout, output.stderr].concat()).into_owned())
}

/// A folder that may not be read may hold a failed run: a list names it, and its module is not called one without runs.
#[test]
fn a_list_names_the_folders_that_it_may_not_read() {
    let kept = Kept::new();
    for path in ["2026-11-28", "2026-11-28/T-2"] {
        let (place, records) = copied(&kept);
        let spoiled = records.join(path);
        let said = |words: &[&str]| {
            let words: Vec<&OsStr> = words.iter().map(OsStr::new).collect();
            without_rights_to(&spoiled, &place, &words)
        };
        for more in
            [&["records", "list"][..], &["records", "list", "--json"], &["records", "list", "--serial-number", "T-2"]]
        {
            let (code, said) = said(more);
            assert_eq!(code, Some(2), "{path}, {more:?}: {said}");
            assert!(said.contains(&format!("cannot read {}", spoiled.display())), "{path}, {more:?}: {said}");
        }
        let (code, shown) = said(&["records", "show", "T-2"]);
        assert_eq!(code, Some(2), "{path}: {shown}");
        assert!(shown.contains("cannot read") && !shown.contains("there is no run"), "{path}: {shown}");
        // Another module's list says nothing of this one's folder.
        let (code, other) = said(&["records", "list", "--serial-number", "T-9"]);
        assert_eq!(code, Some(if path == "2026-11-28" { 2 } else { 0 }), "{path}: {other}");
    }
}

/// Nothing that is there and may not be read is called missing, changed or cut off.
#[test]
fn what_may_not_be_read_is_called_unreadable() {
    let kept = Kept::new();
    let run = FAILED;
    let of_run =
        ["SHA256SUMS.sig", "run.json", "events.jsonl", "SHA256SUMS", "report.html"].map(|file| format!("{run}/{file}"));
    let others =
        ["2026-11-28/CHAIN", "2026-11-29/CHAIN", "COUNTER", "2026-11-28", "2026-11-28/T-2", run].map(str::to_owned);
    for path in of_run.into_iter().chain(others) {
        let (place, records) = copied(&kept);
        let key = place.path().join("key.pub");
        fs::copy(&kept.public_key, &key).expect("a key");
        let arguments: [&OsStr; 4] = ["records".as_ref(), "verify".as_ref(), "--key".as_ref(), key.as_ref()];
        let (code, said) = without_rights_to(&records.join(&path), &place, &arguments);
        assert_eq!(code, Some(2), "{path}: {said}");
        // Told once, with what to do, and not as a change.
        assert_eq!(said.matches("Permission denied").count(), 1, "{path}: {said}");
        let closing = "gnc-station: some of these records cannot be read, so nothing shows whether they are as they were written\n  \
                       try: run it as the station's user, or give this user the right to read them; then verify again\n";
        assert!(said.ends_with(closing) && !said.contains("prove nothing"), "{path}: {said}");
        for wrong in
            ["missing", "was changed", "not in the chain", "does not begin", "does not say", "is gone", "cut off"]
        {
            assert!(!said.contains(wrong), "{path}: {said}");
        }
    }
}

/// A change wins over what cannot be read, wherever it is: in the same run, behind a folder that is closed, and in another run.
#[test]
fn what_may_not_be_read_hides_no_change() {
    let kept = Kept::new();
    let changes = ["2026-11-28/T-2/091000-small/run.json", "2026-11-28/T-1/090000-small/run.json"];
    let closed = ["events.jsonl", "report.html", "plan", "SHA256SUMS.sig"].map(|file| format!("{FAILED}/{file}"));
    for (change, closed) in changes.iter().flat_map(|change| closed.iter().map(move |closed| (change, closed))) {
        let (place, records) = copied(&kept);
        let Some(changed) = fs::read_to_string(records.join(change)).ok() else { continue };
        fs::write(records.join(change), changed.replace("small", "large")).expect("a change");
        let (code, said) = without_rights_to(&records.join(closed), &place, &["records".as_ref(), "verify".as_ref()]);
        assert_eq!(code, Some(1), "{change}, {closed}: {said}");
        assert!(said.contains("run.json was changed") && !said.contains("missing"), "{change}, {closed}: {said}");
    }
}

/// The system gives fewer and fewer descriptors: good records are never called changed.
#[test]
fn without_descriptors_nothing_is_called_changed() {
    let kept = Kept::new();
    let (_place, records) = copied(&kept);
    let mut unread = 0;
    for descriptors in 3..16 {
        let mut command = Command::new("sh");
        command.args([
            "-c",
            "ulimit -n $0; exec \"$@\"",
            &descriptors.to_string(),
            STATION,
            "records",
            "verify",
            "--records",
        ]);
        command.arg(&records).arg("--key").arg(&kept.public_key).stdin(Stdio::null()).env("LC_ALL", "C.UTF-8");
        let output = command.output().expect("the station");
        let said = String::from_utf8_lossy(&[output.stdout, output.stderr].concat()).into_owned();
        // With too few of them the program itself does not start.
        if said.contains("gnc-station: some of these records cannot be read") {
            unread += 1;
            assert!(output.status.code() == Some(2) && said.contains("`ulimit -n`"), "{descriptors}: {said}");
        }
        assert_ne!(output.status.code(), Some(1), "{descriptors}: {said}");
        assert!(!said.contains("prove nothing"), "{descriptors}: {said}");
    }
    assert!(unread > 0, "the bound was never met within the records");
}

/// A list says of an edited record that it was changed, though it takes verdicts from the journal.
#[test]
fn a_list_names_a_record_that_was_edited() {
    let kept = Kept::new();
    let (place, records) = copied(&kept);
    let list = |option: &[&str]| {
        let mut command = Command::new(STATION);
        command.args(["records", "list", "--records"]).arg(&records).args(option).current_dir(place.path());
        let output = command.env("LC_ALL", "C.UTF-8").stdin(Stdio::null()).output().expect("the station");
        String::from_utf8_lossy(&output.stdout).into_owned()
    };
    assert!(!list(&[]).contains("changed"), "{}", list(&[]));
    let record = records.join(FAILED).join("run.json");
    let text = fs::read_to_string(&record).expect("a record");
    fs::write(record, text.replace("\"failed\"", "\"passed\"")).expect("a record");
    let told = list(&[]);
    let line = told.lines().find(|line| line.contains("091000-small")).expect("the run");
    assert!(line.contains("record was changed"), "{told}");
    assert_eq!(list(&["--json"]).matches("\"seal\":\"changed\"").count(), 1, "{}", list(&["--json"]));
}

/// A file manager looked at a closed run.
#[test]
fn files_of_a_file_manager_are_named_as_such() {
    let kept = Kept::new();
    let (place, records) = copied(&kept);
    fs::write(records.join(FAILED).join(".DS_Store"), "x").expect("a file");
    let key = ["--key".to_owned(), kept.public_key.to_string_lossy().into_owned()];
    let (code, said) = asked(&records, &key);
    assert_eq!(code, 1, "{said}");
    let said: String = said.replace(&place.path().display().to_string(), "PLACE");
    insta::assert_snapshot!("file_manager", said);
}

/// Without the public key it is said that no signature was looked at; with a bench file beside it, which key does it.
#[test]
fn signatures_that_are_not_checked_are_named() {
    let kept = Kept::new();
    let (_, said) = asked(&kept.records(), &[]);
    assert!(
        said.contains(
            "8 lines of the chain are signed, and no signature was checked: give the public key with --key FILE\n"
        ),
        "{said}"
    );
    fs::write(kept.place.path().join("bench.toml"), "[station]\nid = \"line-2\"\nkey = \"station.key\"\n")
        .expect("a bench");
    let (_, said) = asked(&kept.records(), &[]);
    assert!(said.contains("no signature was checked: `--key station.key.pub` does it\n"), "{said}");
    let (_, said) = asked(&kept.records(), &["--key".into(), kept.public_key.to_string_lossy().into_owned()]);
    assert!(!said.contains("was checked"), "{said}");
}

/// Folders that hold nothing are added to closed records: none of them is passed over, also with all witnesses.
#[test]
fn a_folder_that_holds_nothing_is_no_run() {
    let kept = Kept::new();
    let key = ["--key".to_owned(), kept.public_key.to_string_lossy().into_owned()];
    for (folder, expected) in [
        (format!("{FAILED}/empty"), 1),
        ("2026-11-28/x".to_owned(), 1),
        ("2026-11-28/T-2/plan".to_owned(), 1),
        ("2026-11-28/S-9/101010-first".to_owned(), 1),
        // A sudden end may have left these, and the next start takes them away.
        ("2026-11-29/x".to_owned(), 3),
        ("2026-11-29/S-9/235959-first".to_owned(), 3),
    ] {
        let (_place, records) = copied(&kept);
        fs::create_dir_all(records.join(&folder)).expect("a folder");
        let (code, said) = asked(&records, &key);
        assert_eq!((code, is_as_written(code, &said)), (expected, false), "{folder}: {said}");
        if expected == 3 {
            killed::start(&records, &kept.key());
            let (code, said) = asked(&records, &key);
            assert_eq!(code, 0, "{folder}: {said}");
        }
    }
}

/// Where all findings are of one kind, what to do fits it.
#[test]
fn what_to_do_fits_the_findings() {
    let kept = Kept::new();
    let key = ["--key".to_owned(), kept.public_key.to_string_lossy().into_owned()];
    let copy = "try: give a copy of COUNTER with --counter FILE or number and link of the newest paper with --head";
    let away = "try: a station did not put that there: move it away";
    let folder = |path: &Path| {
        fs::remove_file(path).expect("a file");
        fs::create_dir(path).expect("a folder");
    };
    type Spoil<'a> = &'a dyn Fn(&Path);
    let cases: [(&str, Spoil<'_>, &str); 4] = [
        ("COUNTER", &|path| fs::remove_file(path).expect("a file"), copy),
        ("COUNTER", &|path| fs::write(path, "x\n").expect("a file"), copy),
        ("COUNTER", &folder, away),
        ("2026-11-28/CHAIN", &folder, away),
    ];
    for (file, spoil, expected) in cases {
        let (_place, records) = copied(&kept);
        spoil(&records.join(file));
        let (code, said) = asked(&records, &key);
        assert!(code == 1 && said.contains(expected), "{file}: {code} {said}");
        // Beside another finding it would mislead.
        fs::write(records.join(FAILED).join("log.txt"), "passed").expect("a log");
        let (code, said) = asked(&records, &key);
        assert!(code == 1 && !said.contains(expected) && said.contains("restore changed files"), "{file}: {said}");
    }
    let (_place, records) = copied(&kept);
    folder(&records.join("2026-11-28/CHAIN"));
    let (code, said) = asked(&records, &[FAILED.to_owned()]);
    assert!(code == 1 && said.contains(away) && !said.contains("slipped in"), "{said}");
}

/// Records from before there was a key are not called changed.
#[test]
fn records_without_any_signature_are_called_not_signed() {
    let kept = Kept::new();
    let (_place, records) = copied(&kept);
    for path in tree(&records).expect("a tree").into_keys().filter(|path| path.ends_with("SHA256SUMS.sig")) {
        fs::remove_file(records.join(path)).expect("a signature");
    }
    crate::attack::chain_anew(&records, true).expect("a chain");
    assert_eq!(asked(&records, &[]).0, 0, "{}", asked(&records, &[]).1);
    let key = ["--key".to_owned(), kept.public_key.to_string_lossy().into_owned()];
    for named in [None, Some(FAILED.to_owned())] {
        let (code, said) = asked(&records, &key.iter().cloned().chain(named).collect::<Vec<_>>());
        let told = "gnc-station: these records are not signed, so the key proves nothing of them\n  try: verify runs from before";
        assert!(code == 1 && said.contains(told) && !said.contains("prove nothing"), "{said}");
    }
    fs::write(records.join(FAILED).join("log.txt"), "passed").expect("a log");
    let (code, said) = asked(&records, &key);
    assert!(code == 1 && said.contains("so they prove nothing"), "{said}");
}
