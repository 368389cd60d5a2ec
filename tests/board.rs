//! The simulated board as a separate program.

use std::io::{BufRead as _, BufReader, Write as _};
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};

/// A running board; dropping it ends the program.
#[derive(Debug)]
pub struct Board {
    child: Child,
    stdin: ChildStdin,
    stdout: BufReader<ChildStdout>,
    /// The port that the host opens.
    pub port: String,
}

impl Board {
    /// Starts the program with these arguments, and waits until it tells its port.
    ///
    /// # Panics
    /// The program does not start.
    #[must_use]
    pub fn start(program: &str, args: &[&str]) -> Self {
        let mut command = Command::new(program);
        command.args(args).stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::null());
        let mut child = command.spawn().expect("the board");
        let stdin = child.stdin.take().expect("its input");
        let mut stdout = BufReader::new(child.stdout.take().expect("its output"));
        let mut line = String::new();
        stdout.read_line(&mut line).expect("its first line");
        let port = line.strip_prefix("port ").expect("port PATH").trim().to_owned();
        Self { child, stdin, stdout, port }
    }

    /// Sends a command and waits until it is done.
    ///
    /// # Panics
    /// The command is refused.
    pub fn command(&mut self, command: &str) {
        writeln!(self.stdin, "{command}").expect("alive");
        assert_eq!(self.line(), "ok", "{command}");
    }

    /// A figure of the true state.
    ///
    /// # Panics
    /// There is no figure of this name.
    pub fn truth(&mut self, name: &str) -> String {
        self.command("truth");
        let mut found = None;
        loop {
            let line = self.line();
            let (figure, value) = line.split_once(' ').unwrap_or((&line, ""));
            if figure == name {
                found = Some(value.to_owned());
            }
            // The temperature is the last figure.
            if figure == "temperature_c" {
                return found.unwrap_or_else(|| panic!("the truth without {name}"));
            }
        }
    }

    /// The text of a bench file with this board's port.
    #[must_use]
    pub fn bench_file(&self, station: &str) -> String {
        format!("[station]\nid = \"{station}\"\n[socket]\nport = \"{}\"\n", self.port)
    }

    /// Ends the program at once, like an adapter that is pulled out.
    ///
    /// # Panics
    /// The program had ended before.
    pub fn kill(&mut self) {
        self.child.kill().expect("alive");
        self.child.wait().expect("its end");
    }

    fn line(&mut self) -> String {
        let mut line = String::new();
        assert_ne!(self.stdout.read_line(&mut line).expect("a line"), 0, "the board ended");
        line.trim_end().to_owned()
    }
}

impl Drop for Board {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
