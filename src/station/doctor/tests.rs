//! Findings about a faulty bench, with folders in place of the kernel's.

mod asking;
mod languages;
mod others;

use std::fs;
use std::path::Path;

use super::*;
use crate::locale::Lang;
use crate::phrases::english;

/// A folder as the kernel shows an interface.
fn interface(kind: &str, flags: &str, queue: &str) -> (tempfile::TempDir, Sys) {
    let folder = tempfile::tempdir().expect("a folder");
    let net = folder.path().join("net/can0");
    fs::create_dir_all(&net).expect("a folder");
    for (name, text) in [("type", kind), ("flags", flags), ("tx_queue_len", queue)] {
        fs::write(net.join(name), format!("{text}\n")).expect("a file");
    }
    let sys = Sys(folder.path().to_owned());
    (folder, sys)
}

/// Names in findings, which no language changes: of files, messages, keys, programs and wires, and units.
const NAMES: &str = "HELLO CAN SB-17 dev/ttyUSB0 bit/s ms b0071dea MB ohm root RS-422 os error";

/// Checks that each finding has its words and its numbers in every language; `names` are those of this case.
#[track_caller]
fn speak_all(findings: &[Finding], names: &[&str]) {
    let is_name = |word: &str| NAMES.split(' ').chain(names.iter().copied()).any(|name| name == word);
    for finding in findings {
        let english = finding.to_string();
        for lang in [Lang::Zh, Lang::Ru] {
            let line = finding.line(lang);
            english::holds_none(&english, &line, lang, &is_name);
            // What was found begins in the same column.
            let begins = line.char_indices().find(|(at, _)| crate::wording::width(&line[..*at]) >= 9);
            assert!(begins.is_some_and(|(at, c)| line[..at].ends_with(' ') && c != ' '), "{line}");
        }
    }
}

fn health(findings: &[Finding]) -> Vec<Health> {
    let devices: Vec<&str> = findings.iter().flat_map(|finding| english::latin(&finding.what)).collect();
    let devices: Vec<&str> = devices.into_iter().filter(|word| word.starts_with("dev/")).collect();
    speak_all(findings, &[&devices[..], &["can0", "etc", "bus-off", "ERROR-PASSIVE", "CAN_H", "CAN_L"]].concat());
    findings.iter().map(|finding| finding.health).collect()
}

#[test]
fn an_interface_that_is_up_is_good() {
    let (_folder, sys) = interface("280", "0x1", "1000");
    assert_eq!(health(&bus::state("can0", &sys)), [Health::Good]);
}

#[test]
fn an_interface_that_is_down_or_has_a_short_queue_has_its_command() {
    let (_folder, sys) = interface("280", "0x80", "10");
    let found = bus::state("can0", &sys);
    assert_eq!(health(&found), [Health::Bad, Health::Warning]);
    assert_eq!(found[0].mend, "sudo ip link set can0 up type can bitrate 500000");
    assert_eq!(found[1].mend, "sudo ip link set can0 txqueuelen 1000");
}

#[test]
fn what_is_no_can_interface_is_said() {
    let (_folder, sys) = interface("1", "0x1", "1000");
    assert_eq!(bus::state("can0", &sys)[0].what, "can0 is not a CAN interface");
    assert_eq!(bus::state("can9", &sys)[0].what, "there is no interface can9");
    assert_eq!(health(&bus::state("../../etc", &sys)), [Health::Bad]);
}

/// The output of iproute2 6.1 for a CAN card.
#[test]
fn a_controller_at_another_rate_or_in_trouble_has_its_command() {
    let check = |rate: u32, state: &str, restart_ms: u32, expected: &[Health], mend: &str| {
        let text = format!(
            r#"[{{"ifname":"can0","operstate":"UP","linkinfo":{{"info_kind":"can","info_data":{{"state":"{state}",
            "berr_counter":{{"tx":0,"rx":0}},"restart_ms":{restart_ms},"bittiming":{{"bitrate":{rate},"sample_point":"0.875"}},
            "clock":8000000}}}}}}]"#
        );
        let found = bus::controller("can0", &serde_json::from_str(&text).expect("JSON"));
        assert_eq!(health(&found), expected, "{rate} {state} {restart_ms}");
        assert!(found.iter().any(|finding| finding.mend.contains(mend)), "{mend}");
    };
    check(500_000, "ERROR-ACTIVE", 100, &[Health::Good], "");
    check(250_000, "ERROR-ACTIVE", 100, &[Health::Bad], "up type can bitrate 500000");
    check(500_000, "BUS-OFF", 100, &[Health::Good, Health::Bad], "sudo ip link set can0 type can restart");
    check(500_000, "ERROR-PASSIVE", 100, &[Health::Good, Health::Warning], "60 ohm");
    check(500_000, "ERROR-ACTIVE", 0, &[Health::Good, Health::Warning], "restart-ms 100");
    let vcan = r#"[{"ifname":"vcan0","linkinfo":{"info_kind":"vcan"}}]"#;
    assert_eq!(bus::controller("vcan0", &serde_json::from_str(vcan).expect("JSON")), []);
}

#[test]
fn a_port_that_is_missing_or_a_file_is_said() {
    let sys = Sys::default();
    let found = port::look(Path::new("/dev/ttyNOWHERE"), 921_600, &sys);
    assert_eq!(found[0].what, "port /dev/ttyNOWHERE is not there");
    let file = tempfile::NamedTempFile::new().expect("a file");
    let found = port::look(file.path(), 921_600, &sys);
    assert!(found[0].what.ends_with("is not a serial port"), "{}", found[0]);
}

/// A pseudo-terminal that can be opened is a good port.
#[test]
fn a_port_that_opens_is_good() {
    let pty = nix::pty::openpty(None, None).expect("a pseudo-terminal");
    let port = nix::unistd::ttyname(&pty.slave).expect("its name");
    assert_eq!(health(&port::look(&port, 921_600, &Sys::default())), [Health::Good]);
}

/// The doctor warns of an adapter that keeps bytes back for 16 ms.
#[test]
fn the_latency_timer_is_read() {
    let pty = nix::pty::openpty(None, None).expect("a pseudo-terminal");
    let port = nix::unistd::ttyname(&pty.slave).expect("its name");
    let name = port.file_name().expect("a name").to_owned();
    let folder = tempfile::tempdir().expect("a folder");
    let device = folder.path().join("tty").join(name).join("device");
    fs::create_dir_all(&device).expect("a folder");
    fs::write(device.join("latency_timer"), "16\n").expect("a file");
    let found = port::look(&port, 921_600, &Sys(folder.path().to_owned()));
    assert_eq!(health(&found), [Health::Good, Health::Warning]);
    assert!(found[1].mend.starts_with("echo 1 | sudo tee "), "{}", found[1]);
}

#[test]
fn a_clock_before_the_newest_record_is_bad() {
    let folder = tempfile::tempdir().expect("a folder");
    assert_eq!(place::clock(Some(folder.path())).health, Health::Good);
    fs::create_dir_all(folder.path().join("2999-01-01/SN-1")).expect("a folder");
    let found = place::clock(Some(folder.path()));
    assert_eq!(found.health, Health::Bad);
    assert!(found.what.ends_with("there are records of 2999-01-01"), "{found}");
}

#[test]
fn a_bench_file_with_mistakes_is_bad_and_one_that_is_missing_a_warning() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("bench.toml");
    fs::write(&file, "[station]\nname = 1\n").expect("a file");
    let found = look(Some(&file), Some(folder.path()), &Sys::default(), &Proc::default());
    assert_eq!(found[0].health, Health::Bad, "{}", found[0]);
    let found = look(Some(&folder.path().join("none.toml")), Some(folder.path()), &Sys::default(), &Proc::default());
    assert_eq!(found[0].health, Health::Bad, "a file that was named must be there: {}", found[0]);
}

/// The plan with which the screen opens: a bench whose own plan cannot run is not good.
#[test]
fn a_plan_of_the_bench_file_that_is_refused_is_bad() {
    let folder = tempfile::tempdir().expect("a folder");
    let found = |plan: &str| {
        let text = format!("[station]\nid = \"line-2\"\n{plan}");
        let bench = BenchFile::read("bench.toml", text.into_bytes()).expect("a bench");
        let found = plans(&bench, folder.path());
        let gone = folder.path().join("gone.toml").display().to_string();
        speak_all(&found, &english::latin(&gone).collect::<Vec<_>>());
        found
    };
    assert_eq!(found("").iter().map(|one| one.health).collect::<Vec<_>>(), [Health::Good]);
    let gone = found("plan = \"gone.toml\"\n");
    assert!(matches!(&gone[..], [one] if one.health == Health::Bad && one.what.contains("gone.toml")), "{gone:?}");
    assert!(!gone[0].mend.is_empty());
    let text = format!(
        "plans = {{ incoming = \"sha256:{}\" }}\n[station]\nid = \"x\"\nplan = \"plan.toml\"\n",
        "a".repeat(64)
    );
    fs::write(folder.path().join("plan.toml"), "name = \"incoming\"\n").expect("a file");
    let bench = BenchFile::read("bench.toml", text.into_bytes()).expect("a bench");
    let mistaken = plans(&bench, folder.path());
    assert!(!mistaken.is_empty() && mistaken.iter().all(|one| one.health == Health::Bad), "{mistaken:?}");
}

/// Who repairs a bench learns before the shift that no run will count, and what to do.
#[test]
fn a_line_that_a_program_may_play_is_a_warning() {
    let (_pty, port) = others::pseudo_terminal();
    let names = port.display().to_string();
    let names: Vec<&str> = english::latin(&names).chain(["gnc-station", "ports"]).collect();
    for target in [
        gnc_link::Target::Serial { port: port.clone(), rate_baud: 921_600 },
        gnc_link::Target::Can(gnc_link::can::CanTarget::Slcan(port.clone())),
    ] {
        let found = lines::unproven(&target).expect("a finding");
        assert_eq!(found.health, Health::Warning);
        let what = format!(
            "port {} is a pseudo-terminal; runs on this bench are unproven and count for no module",
            port.display()
        );
        assert_eq!(found.what, what);
        assert!(!found.mend.is_empty());
        speak_all(&[found], &names);
    }
    // The kernel's answers that no computer of a test gives.
    for doubt in [
        gnc_link::Doubt::PortWithoutDevice("/dev/ttyr00".into()),
        gnc_link::Doubt::VirtualInterface { interface: "can0".into(), kind: "vxcan".into() },
        gnc_link::Doubt::InterfaceWithoutDevice("can0".into()),
        gnc_link::Doubt::ControllerWithoutDevice("can0".into()),
        gnc_link::Doubt::InterfaceNotAsked("can0".into()),
    ] {
        let names = "dev/ttyr00 dev/ttyACM0 can0 vxcan CAN sys slcan AF_NETLINK RestrictAddressFamilies systemd seccomp port ip br link type can";
        let names: Vec<&str> = names.split(' ').collect();
        speak_all(&[lines::warning(&doubt)], &names);
    }
}
