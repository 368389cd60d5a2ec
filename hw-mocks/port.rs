//! Opens the port at the board's end of the line: a new pseudo-terminal, or a serial port of the computer.

use std::io;
use std::os::fd::OwnedFd;
use std::path::{Path, PathBuf};

use nix::fcntl::{FcntlArg, OFlag, fcntl, open};
use nix::pty::openpty;
use nix::sys::stat::Mode;
use nix::sys::termios::{
    BaudRate, ControlFlags, FlushArg, SetArg, cfgetospeed, cfmakeraw, cfsetspeed, tcflush, tcgetattr, tcsetattr,
};
use nix::unistd::ttyname;

/// The board's end of the line, raw and non-blocking.
#[derive(Debug)]
pub(crate) struct Tty {
    /// The end that the board reads and writes.
    pub(crate) end: OwnedFd,
    /// The path that the host opens, or the device itself.
    pub(crate) name: PathBuf,
    /// Without an open slave end the master of a pseudo-terminal hangs up whenever the host closes its own.
    pub(crate) kept_open: Option<OwnedFd>,
}

impl Tty {
    /// A new pseudo-terminal.
    pub(crate) fn pseudo_terminal() -> io::Result<Self> {
        let pty = openpty(None, None)?;
        let mut settings = tcgetattr(&pty.slave)?;
        cfmakeraw(&mut settings);
        tcsetattr(&pty.slave, SetArg::TCSANOW, &settings)?;
        let name = ttyname(&pty.slave)?;
        let flags = OFlag::from_bits_truncate(fcntl(&pty.master, FcntlArg::F_GETFL)?);
        fcntl(&pty.master, FcntlArg::F_SETFL(flags | OFlag::O_NONBLOCK))?;
        Ok(Self { end: pty.master, name, kept_open: Some(pty.slave) })
    }

    /// A serial port: 8 data bits, no parity, 1 stop bit, no flow control, modem lines ignored.
    pub(crate) fn device(name: &Path, rate_baud: u32) -> io::Result<Self> {
        let rate = standard_rate(rate_baud)?;
        // Do not wait for a modem, and do not make the port the controlling terminal.
        let end = open(name, OFlag::O_RDWR | OFlag::O_NOCTTY | OFlag::O_NONBLOCK | OFlag::O_CLOEXEC, Mode::empty())?;
        let mut settings = tcgetattr(&end)?;
        cfmakeraw(&mut settings);
        settings.control_flags.remove(ControlFlags::CRTSCTS | ControlFlags::CSTOPB | ControlFlags::HUPCL);
        settings.control_flags.insert(ControlFlags::CLOCAL | ControlFlags::CREAD);
        cfsetspeed(&mut settings, rate)?;
        tcsetattr(&end, SetArg::TCSANOW, &settings)?;
        // A driver without this rate keeps another one and reports success.
        if cfgetospeed(&tcgetattr(&end)?) != rate {
            return Err(io::Error::other("the port does not support this rate"));
        }
        // Discard bytes from before the board was there.
        tcflush(&end, FlushArg::TCIOFLUSH)?;
        Ok(Self { end, name: name.to_owned(), kept_open: None })
    }
}

impl Drop for Tty {
    fn drop(&mut self) {
        // Closing a serial port waits up to 30 s for bytes that the other end does not take. They are no longer needed.
        if self.kept_open.is_none() {
            let _ = tcflush(&self.end, FlushArg::TCOFLUSH);
        }
    }
}

/// The rates that every system defines; other rates need a call that not every driver supports.
fn standard_rate(rate_baud: u32) -> io::Result<BaudRate> {
    Ok(match rate_baud {
        1200 => BaudRate::B1200,
        2400 => BaudRate::B2400,
        4800 => BaudRate::B4800,
        9600 => BaudRate::B9600,
        19_200 => BaudRate::B19200,
        38_400 => BaudRate::B38400,
        57_600 => BaudRate::B57600,
        115_200 => BaudRate::B115200,
        230_400 => BaudRate::B230400,
        460_800 => BaudRate::B460800,
        921_600 => BaudRate::B921600,
        1_000_000 => BaudRate::B1000000,
        2_000_000 => BaudRate::B2000000,
        3_000_000 => BaudRate::B3000000,
        4_000_000 => BaudRate::B4000000,
        _ => return Err(io::Error::new(io::ErrorKind::InvalidInput, "not a standard rate of serial ports")),
    })
}

#[cfg(test)]
mod tests {
    use std::io::{Read as _, Write as _};

    use super::*;

    /// Every byte passes both ways, also bytes with a meaning for terminals.
    #[test]
    fn a_device_is_raw() {
        let all: Vec<u8> = (0..=255).collect();
        let cable = openpty(None, None).unwrap();
        let port = Tty::device(&ttyname(&cable.slave).unwrap(), 115_200).unwrap();
        let (mut host, mut board) =
            (std::fs::File::from(cable.master), std::fs::File::from(port.end.try_clone().unwrap()));
        let mut read = vec![0; all.len()];
        host.write_all(&all).unwrap();
        board.read_exact(&mut read).unwrap();
        assert_eq!(read, all);
        read.fill(0);
        board.write_all(&all).unwrap();
        host.read_exact(&mut read).unwrap();
        assert_eq!(read, all);
    }

    #[test]
    fn what_is_no_port_or_no_rate_is_refused() {
        let why = |name: &str, rate_baud| Tty::device(Path::new(name), rate_baud).unwrap_err().to_string();
        assert!(why("/dev/null", 115_200).contains("ioctl"), "{}", why("/dev/null", 115_200));
        assert!(why("/dev/does-not-exist", 115_200).contains("No such file"));
        assert!(why("/dev/null", 123_456).contains("not a standard rate"));
    }
}
