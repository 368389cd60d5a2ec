//! Gives the examples of plans and bench files on a page to the program.

use std::fs;
use std::io;
use std::path::Path;
use std::process::Command;

/// Tables of a bench file. A plan has none of these.
const OF_BENCH: [&str; 8] =
    ["[station]", "[operator]", "[verdict]", "[shift]", "[site]", "[scanner]", "[can]", "[socket]"];
/// What an example of a part of a bench file leaves out.
const STATION: &str = "[station]\nid = \"s\"\n";
const SOCKET: &str = "[socket]\nport = \"/dev/ttyUSB0\"\n";
const CAN: &str = "[can]\nport = \"can0\"\n";
/// What an example of a part of a plan leaves out: its head, and the items that it names.
const HEAD: &str = "name = \"example\"\nversion = \"1.0\"\n";
const ITEMS: [(&str, &str); 2] = [
    ("identity", "[[item]]\nid = \"identity\"\nlimits.protocol = \"== 1\"\nlimits.supply_current = \"<= 1 A\"\n"),
    ("imu", "[[item]]\nid = \"imu\"\nlimits.gyro_x = \"0 +- 1 deg/s\"\n"),
];

/// Whether an example is a bench file or a part of one.
#[must_use]
pub(crate) fn is_bench(example: &str) -> bool {
    example.lines().any(|line| OF_BENCH.iter().any(|table| line.starts_with(table)))
}

/// Why the program does not take an example, with all that it leaves out added to it; `None` if it does.
///
/// # Errors
/// No folder can be made for it, or the program cannot be started.
pub(crate) fn refusal(program: &Path, example: &str) -> io::Result<Option<String>> {
    let folder = tempfile::tempdir()?;
    let write = |name: &str, text: &str| fs::write(folder.path().join(name), text);
    fs::create_dir(folder.path().join("pictures"))?;
    write("pictures/tp4.png", "a picture")?;
    let mut words = vec!["plan", "check", "plan.toml"];
    if is_bench(example) {
        let whole = |table: &str, rest| if example.contains(table) { "" } else { rest };
        let can = if example.contains("link = \"can\"") { whole("[can]", CAN) } else { "" };
        write("bench.toml", &[whole("[station]", STATION), can, example, whole("[socket]", SOCKET)].concat())?;
        write("plan.toml", &[HEAD, ITEMS[1].1].concat())?;
        words.extend(["--bench", "bench.toml"]);
    } else {
        // Keys at the top stand before the first table.
        let tables = example.lines().position(|line| line.starts_with('[')).unwrap_or(usize::MAX);
        let part = |of_tables: bool| -> String {
            let lines = example.lines().enumerate().filter(|(at, _)| (*at >= tables) == of_tables);
            lines.map(|(_, line)| format!("{line}\n")).collect()
        };
        let missing = ITEMS.iter().filter(|(id, _)| !example.contains(&format!("id = \"{id}\"")));
        let items: String = missing.map(|(_, text)| *text).collect();
        write("plan.toml", &[HEAD, &part(false), &items, &part(true)].concat())?;
    }
    let output = Command::new(program).current_dir(&folder).args(words).output()?;
    let said = [output.stdout, output.stderr].map(|said| String::from_utf8_lossy(&said).into_owned()).concat();
    Ok((!output.status.success()).then_some(said))
}
