//! `gnc-station completions` and `gnc-station man`: what shells and `man` read, made from the command line itself.

use std::io::{self, Write as _};
use std::path::Path;
use std::process::ExitCode;

use clap::{Command, ValueEnum};
use clap_complete::shells;

use crate::outputs::may_write;
use crate::refusal::refuse;

/// The name that people type.
const PROGRAM: &str = "gnc-station";

/// A shell whose completion is written.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum Shell {
    /// For ~/.local/share/bash-completion/completions/gnc-station.
    Bash,
    /// For a file _gnc-station in a folder of $fpath.
    Zsh,
    /// For ~/.config/fish/completions/gnc-station.fish.
    Fish,
}

/// Writes the completion for a shell.
pub(crate) fn completions(shell: Shell, mut command: Command) -> ExitCode {
    let mut text = Vec::new();
    let shell = match shell {
        Shell::Bash => shells::Shell::Bash,
        Shell::Zsh => shells::Shell::Zsh,
        Shell::Fish => shells::Shell::Fish,
    };
    clap_complete::generate(shell, &mut command, PROGRAM, &mut text);
    write("the completion", with_one_name(&String::from_utf8_lossy(&text)).as_bytes())
}

/// The script of clap_complete 4.6.12 for bash spells a program's name with a hyphen in two ways, so that nothing is
/// offered behind a command.
fn with_one_name(script: &str) -> String {
    script.replace(&PROGRAM.replace('-', "__subcmd__"), &PROGRAM.replace('-', "__"))
}

/// Writes the manual page, or all pages into a folder.
pub(crate) fn man(command: Command, dir: Option<&Path>) -> ExitCode {
    let Some(dir) = dir else {
        let mut text = Vec::new();
        let rendered = clap_mangen::Man::new(command).render(&mut text);
        return match rendered {
            Ok(()) => write("the page", &text),
            Err(error) => refuse(format_args!("the page cannot be written: {error}"), ""),
        };
    };
    if let Err(refused) = may_write(&dir.join(PROGRAM), "--dir") {
        return refuse(refused.what, &refused.try_this);
    }
    match clap_mangen::generate_to(command, dir) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            let what = format!("the pages cannot be written into {}: {error}", gnc_text::shown_path(dir));
            refuse(what, "name a folder that is there and that you may write")
        }
    }
}

fn write(what: &str, text: &[u8]) -> ExitCode {
    let mut out = io::stdout().lock();
    match out.write_all(text).and_then(|()| out.flush()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) if error.kind() == io::ErrorKind::BrokenPipe => ExitCode::SUCCESS,
        Err(error) => refuse(format_args!("{what} cannot be written: {error}"), "check where the output goes"),
    }
}
