//! A run is the same one however a person names its folder.

use std::os::unix::fs::symlink;

use super::*;
use crate::standing::Face;
use crate::store::chain::{Against, ChainBook, ChainStanding, standing, was_closed_otherwise};
use crate::store::located::located;
use crate::store::reader;

/// The names of a run: by links that stand elsewhere, and by `..`. `links` is an empty folder.
fn names_of(run: &Path, links: &Path) -> Vec<PathBuf> {
    let above: Vec<&Path> = run.ancestors().skip(1).take(3).collect();
    let [module, day, records] = above[..] else { panic!("{}", run.display()) };
    let [run_name, module_name] = [run, module].map(|folder| folder.file_name().unwrap());
    symlink(run, links.join("run")).unwrap();
    symlink(module, links.join("module")).unwrap();
    symlink(day, links.join("day")).unwrap();
    // As the folder of a day is called where no records are.
    symlink(day, links.join(DAY)).unwrap();
    symlink(records, links.join("records")).unwrap();
    // A link within the records that has not the name of a day.
    let _ = symlink(DAY, records.join("today"));
    let in_day = Path::new(module_name).join(run_name);
    vec![
        run.to_owned(),
        links.join("run"),
        links.join("module").join(run_name),
        links.join("day").join(&in_day),
        links.join(DAY).join(&in_day),
        links.join("records").join(DAY).join(&in_day),
        records.join("today").join(&in_day),
        run.join("."),
        run.join("..").join(run_name),
        run.join(PLAN).join(".."),
        day.join("SN-0/..").join(&in_day),
        links.join("day/..").join(DAY).join(&in_day),
        links.join("run/..").join(run_name),
    ]
}

#[test]
fn a_run_is_the_same_however_its_folder_is_named() {
    type Expected = (Face, ChainStanding, bool, bool);
    let passed = gnc_executive::verdict::Verdict::Module(Outcome::Passed);
    let check = |what: &str, change: fn(&Shelf, &Path), expected: Expected| {
        let (shelf, links) = (Shelf::new(), tempfile::tempdir().unwrap());
        shelf.closed("SN-0", "10:00:00");
        let run = shelf.ended("SN-1", STATION, "14:30:00");
        if expected.1 == ChainStanding::Late {
            shelf.start();
        } else {
            close_now(&run);
        }
        change(&shelf, &run);
        let problems = as_written::verify(&run);
        let of_chain = ChainBook::read(shelf.path()).unwrap().of_run(&run, &Against { keys: &[], heads: &[] });
        for name in names_of(&run, links.path()) {
            let path = located(&name).unwrap();
            assert_eq!(path, run.canonicalize().unwrap(), "{what}: {}", name.display());
            let records = path.ancestors().nth(3).unwrap();
            let face = Seals::new(records).face(&reader::found(path.clone())).unwrap();
            let late = LateCloses::default().of(&name).unwrap().is_some();
            let otherwise = was_closed_otherwise(&name).unwrap();
            let found = (face, standing(&name).unwrap(), late, otherwise);
            assert_eq!(found, expected, "{what}: {}", name.display());
            assert_eq!(as_written::verify(&name), problems, "{what}: {}", name.display());
            let book = ChainBook::read(records).unwrap();
            assert_eq!(book.of_run(&path, &Against { keys: &[], heads: &[] }), of_chain, "{what}: {}", name.display());
            assert_eq!(chain::place_of(&name).unwrap(), chain::place_of(&run).unwrap(), "{what}");
        }
    };
    check("good", |_, _| (), (Face::Ended(passed), ChainStanding::Held, false, false));
    check("late", |_, _| (), (Face::Late(passed), ChainStanding::Late, true, false));
    let edit = |_: &Shelf, run: &Path| {
        let digests = run.join(DIGESTS);
        let text = fs::read_to_string(&digests).unwrap();
        fs::write(digests, text.lines().skip(1).fold(String::new(), |all, line| all + line + "\n")).unwrap();
    };
    check("changed", edit, (Face::Changed, ChainStanding::Other, false, true));
    let lose = |shelf: &Shelf, _: &Path| {
        fs::remove_file(shelf.path().join(DAY).join(CHAIN)).unwrap();
        shelf.closed("SN-2", "15:00:00");
    };
    check("not in the chain", lose, (Face::NotInChain(passed), ChainStanding::Missing, false, false));
}

#[test]
fn a_link_in_the_place_of_a_run_stays_a_finding() {
    let (shelf, elsewhere) = (Shelf::new(), tempfile::tempdir().unwrap());
    let run = shelf.closed("SN-1", "14:30:00");
    let copy = run.with_file_name("143001-functional");
    symlink(&run, &copy).unwrap();
    assert_eq!(located(&copy).unwrap(), run.canonicalize().unwrap().with_file_name("143001-functional"));
    assert_eq!(standing(&copy).unwrap(), ChainStanding::Missing);
    // A whole day that was taken away, and a link to it.
    let day = shelf.path().join(DAY);
    fs::rename(&day, elsewhere.path().join(DAY)).unwrap();
    symlink(elsewhere.path().join(DAY), &day).unwrap();
    assert_eq!(
        located(&run).unwrap(),
        shelf.path().canonicalize().unwrap().join(run.strip_prefix(shelf.path()).unwrap())
    );
}

#[test]
fn a_run_that_is_not_there_keeps_its_name() {
    let shelf = Shelf::new();
    let gone = shelf.path().join(DAY).join("SN-1/143000-functional");
    assert_eq!(located(&gone).unwrap(), gone);
    shelf.closed("SN-0", "10:00:00");
    let records = shelf.path().canonicalize().unwrap();
    assert_eq!(located(&gone).unwrap(), records.join(gone.strip_prefix(shelf.path()).unwrap()));
    assert!(located(Path::new("")).is_err());
}
