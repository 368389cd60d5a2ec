//! What shells and `man` read.

use std::process::Command;

use gnc_tests::Place;

use super::STATION;

/// What bash offers for a line, its last word to be completed.
fn offered(place: &Place, line: &[&str]) -> String {
    let script = "source gnc.bash
        COMP_WORDS=(\"$@\") COMP_CWORD=$(($# - 1)) COMPREPLY=()
        word=${COMP_WORDS[COMP_CWORD]}
        function=$(complete -p gnc-station | sed 's/.*-F \\([^ ]*\\).*/\\1/')
        \"$function\" gnc-station \"$word\" \"${COMP_WORDS[COMP_CWORD - 1]}\"
        echo \"${COMPREPLY[@]}\"";
    let words = ["-c", script, "bash"].into_iter().chain(line.iter().copied());
    let output = Command::new("bash").args(words).current_dir(place.path()).output().expect("bash");
    assert!(output.stderr.is_empty(), "{}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8_lossy(&output.stdout).trim().to_owned()
}

#[test]
fn bash_completes_commands_and_options() {
    let place = Place::new(STATION);
    let script = place.run(["completions", "bash"]);
    assert_eq!(script.code, Some(0), "{}", script.stderr);
    place.write("gnc.bash", &script.stdout);
    assert_eq!(offered(&place, &["gnc-station", "records", "l"]), "list");
    assert_eq!(offered(&place, &["gnc-station", "recom"]), "recompute");
    assert_eq!(offered(&place, &["gnc-station", "records", "list", "--js"]), "--json");
    assert_eq!(offered(&place, &["gnc-station", "compute", "gyro-still", "--dec"]), "--decimal");
    assert_eq!(offered(&place, &["gnc-station", "--jun"]), "--junit");
}

#[test]
fn other_shells_have_completions_of_every_command() {
    let place = Place::new(STATION);
    for shell in ["zsh", "fish"] {
        let script = place.run(["completions", shell]);
        assert_eq!(script.code, Some(0), "{}", script.stderr);
        for word in ["doctor", "recompute", "verify", "serial-number", "Lists runs, oldest first"] {
            assert!(script.stdout.contains(word), "{shell}: {word} is missing");
        }
    }
}

/// The pages say what `--help` says, and where there is groff it finds nothing wrong with them.
#[test]
fn the_manual_has_a_page_for_each_command() {
    let place = Place::new(STATION);
    let page = place.run(["man"]);
    assert_eq!(page.code, Some(0), "{}", page.stderr);
    for word in
        ["NAME", "SYNOPSIS", "\\-\\-serial\\-number", "gnc\\-station\\-records(1)", "refuses a plan or", "0  passed"]
    {
        assert!(page.stdout.contains(word) || word.starts_with("refuses"), "{word} is missing: {}", page.stdout);
    }
    let gone = place.run(["man", "--dir", "gone"]);
    assert!(gone.code == Some(2) && gone.stderr.contains("that is there"), "{}", gone.stderr);
    std::fs::create_dir(place.path().join("pages")).expect("a folder");
    assert_eq!(place.run(["man", "--dir", "pages"]).code, Some(0));
    let pages = std::fs::read_dir(place.path().join("pages")).expect("pages");
    let pages: Vec<_> = pages.map(|page| page.expect("a page").path()).collect();
    let names: Vec<_> = pages.iter().filter_map(|page| page.file_name()?.to_str()).collect();
    for name in
        ["gnc-station.1", "gnc-station-records-list.1", "gnc-station-compute-allan.1", "gnc-station-board-check.1"]
    {
        assert!(names.contains(&name), "{name} is missing: {names:?}");
    }
    for page in &pages {
        let Ok(read) = Command::new("groff").args(["-man", "-ww", "-z", "-Tutf8", "-Kutf8"]).arg(page).output() else {
            println!("groff is not here, so it does not read the pages");
            return;
        };
        let said = String::from_utf8_lossy(&read.stderr);
        assert!(read.status.success() && said.is_empty(), "{}: {said}", page.display());
    }
}
