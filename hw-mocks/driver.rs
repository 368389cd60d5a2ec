//! The simulated bench on real ports (a pseudo-terminal or a serial port for RS-422, another pseudo-terminal or an
//! interface for CAN), served by a separate thread.

use std::io::{self, Read, Write};
use std::os::fd::AsFd;
use std::os::unix::net::UnixStream;
use std::path::{Path, PathBuf};
use std::sync::mpsc::{self, Receiver, Sender};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use gnc_rig::Along;
use nix::errno::Errno;
use nix::poll::{PollFd, PollFlags, ppoll};
use nix::sys::time::TimeSpec;

use crate::adapter::CanPort;
use crate::bench::{BenchOptions, SimulatedBench, Truth};
use crate::board::BoardPort;
use crate::link_clock::{LOOK_EVERY, LinkClock, Wait};
use crate::port::Tty;
use crate::turntable::TableRefusal;
use crate::world::{ModuleAxis, Sign};

/// Longest wait for a full port: the kernel does not always report that it has room again.
const FULL_PORT: Duration = Duration::from_millis(5);

/// Time between two looks for a CAN interface that went away.
const INTERFACE_AWAY: Duration = Duration::from_millis(20);

/// The thread that serves the bench has ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("the simulated bench has ended")]
pub struct BenchGone;

/// Why the turntable refused a command.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum TurntableError {
    /// The bench has ended.
    #[error(transparent)]
    Gone(#[from] BenchGone),
    /// The table refused.
    #[error(transparent)]
    Refused(#[from] TableRefusal),
}

#[derive(Debug)]
enum TableMotion {
    Orient(Along, ModuleAxis, Sign, f64),
    OrientUp([f64; 3], f64),
    Rotate(f64, f64),
    Spin(f64),
    Stop,
}

#[derive(Debug)]
enum BenchCommand {
    Move(TableMotion, Sender<Result<(), TableRefusal>>),
    WaitStill(Sender<Result<(), TableRefusal>>),
    IsMoving(Sender<bool>),
    SetSwitch(u8, bool),
    OnlySwitch(Option<u8>),
    SetHeading(f64),
    SetAxisUp(ModuleAxis, Sign),
    SetTurn(ModuleAxis, f64),
    Sleep(Duration, Sender<()>),
    Truth(Sender<Truth>),
    WaitOff(Sender<()>),
    Unplug(Cable),
    PlugIn(Cable, Sender<io::Result<PathBuf>>),
    Stop,
}

/// A cable between host and bench.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Cable {
    /// RS-422: the pseudo-terminal or the serial port.
    Serial,
    /// The pseudo-terminal of the slcan adapter. A program cannot pull out an interface of the kernel.
    Slcan,
}

/// Controls the bench like an operator or a fixture. Each call returns when its action is done, so that a later request
/// to the board finds it done.
///
/// # The turntable
/// [`BenchControl::orient`], [`BenchControl::rotate`], [`BenchControl::spin`] and [`BenchControl::stop`] begin a motion
/// and return at once. The motion begins at that moment of bench time, takes the time that `turntable.rs` gives, and
/// ends without another call. [`BenchControl::wait_still`] returns when bench time has passed its end.
///
/// # Waiting
/// [`BenchControl::sleep`] and [`BenchControl::wait_still`] block their thread until that bench time is reached. At
/// maximum speed they let bench time move, even without any request or stream. At any speed but the true one bench time
/// stands still while the port of the session is full, so that a stream is never dropped: a caller that waits beside a running stream must read the stream on
/// another thread.
#[derive(Debug, Clone)]
pub struct BenchControl {
    commands: Sender<(BenchCommand, Option<Sender<()>>)>,
    wake: std::sync::Arc<UnixStream>,
}

impl BenchControl {
    /// Flips DIP switch 1 to 5.
    ///
    /// # Errors
    /// [`BenchGone`].
    pub fn set_switch(&self, number: u8, on: bool) -> Result<(), BenchGone> {
        self.order(BenchCommand::SetSwitch(number, on))
    }

    /// Asks the operator to set one DIP switch (1 to 5) on and the others off, or all off.
    ///
    /// # Errors
    /// [`BenchGone`].
    pub fn only_switch(&self, on: Option<u8>) -> Result<(), BenchGone> {
        self.order(BenchCommand::OnlySwitch(on))
    }

    /// Points the reference axis (X for Z up) at a heading, clockwise from north, and ends any turning.
    ///
    /// # Errors
    /// [`BenchGone`].
    pub fn set_heading_deg(&self, heading_deg: f64) -> Result<(), BenchGone> {
        self.order(BenchCommand::SetHeading(heading_deg))
    }

    /// Lays the module down with an axis up and ends any turning.
    ///
    /// # Errors
    /// [`BenchGone`].
    pub(crate) fn set_axis_up(&self, axis: ModuleAxis, sign: Sign) -> Result<(), BenchGone> {
        self.order(BenchCommand::SetAxisUp(axis, sign))
    }

    /// Turns the module steadily about one of its axes, right-handed.
    ///
    /// # Errors
    /// [`BenchGone`].
    pub(crate) fn set_turn(&self, axis: ModuleAxis, rate_dps: f64) -> Result<(), BenchGone> {
        self.order(BenchCommand::SetTurn(axis, rate_dps))
    }

    /// Returns when bench time has passed `span`.
    ///
    /// # Errors
    /// [`BenchGone`].
    pub fn sleep(&self, span: Duration) -> Result<(), BenchGone> {
        let (done, awake) = mpsc::channel();
        self.post(BenchCommand::Sleep(span, done), None)?;
        awake.recv().map_err(|_| BenchGone)
    }

    /// Begins to point an axis of the module along a direction, the next axis (Y for X, Z for Y, X for Z) at a heading.
    ///
    /// # Errors
    /// [`TurntableError`]: the bench has ended, or the table is moving.
    pub fn orient(&self, along: Along, axis: ModuleAxis, sign: Sign, heading_deg: f64) -> Result<(), TurntableError> {
        self.set_in_motion(TableMotion::Orient(along, axis, sign, heading_deg))
    }

    /// Begins to lay the module down in any attitude: `up`, in the module's axes and of any length, points up. The axis
    /// after the one nearest to `up` points at the heading as nearly as possible.
    ///
    /// # Errors
    /// As [`BenchControl::orient`]; or `up` is not a direction.
    pub(crate) fn orient_up(&self, up: [f64; 3], heading_deg: f64) -> Result<(), TurntableError> {
        self.set_in_motion(TableMotion::OrientUp(up, heading_deg))
    }

    /// Begins a rotation about the table's axis, which lies along the module's axis of the last orientation. The angle
    /// is positive by the right-hand rule about that axis. Ramps take 10 % of the span each: 1080 deg in 5 s peak at
    /// 240 deg/s.
    ///
    /// # Errors
    /// [`TurntableError`]: the bench has ended, the table is moving, or it cannot turn so fast.
    pub fn rotate(&self, angle_deg: f64, span_s: f64) -> Result<(), TurntableError> {
        self.set_in_motion(TableMotion::Rotate(angle_deg, span_s))
    }

    /// Begins to spin about the table's axis, without end; from another spin the table changes over to this one.
    ///
    /// # Errors
    /// As [`BenchControl::rotate`].
    pub fn spin(&self, rate_dps: f64) -> Result<(), TurntableError> {
        self.set_in_motion(TableMotion::Spin(rate_dps))
    }

    /// Begins to stop any running motion. Without a motion it does nothing and returns no error.
    ///
    /// # Errors
    /// [`TurntableError::Gone`].
    pub fn stop(&self) -> Result<(), TurntableError> {
        self.set_in_motion(TableMotion::Stop)
    }

    /// Whether the module moves. At maximum speed it continues to move until a caller lets bench time pass.
    ///
    /// # Errors
    /// [`BenchGone`].
    pub fn moving(&self) -> Result<bool, BenchGone> {
        let (told, moving) = mpsc::channel();
        self.post(BenchCommand::IsMoving(told), None)?;
        moving.recv().map_err(|_| BenchGone)
    }

    /// Returns when the module is still.
    ///
    /// # Errors
    /// [`TurntableError`]: the bench has ended, or the table spins without end, even if the spin begins during the
    /// wait.
    pub fn wait_still(&self) -> Result<(), TurntableError> {
        let (done, still) = mpsc::channel();
        self.post(BenchCommand::WaitStill(done), None)?;
        Ok(still.recv().map_err(|_| BenchGone)??)
    }

    /// Waits at most this wall time until the module is without power; returns whether it is.
    ///
    /// # Errors
    /// [`BenchGone`].
    pub fn wait_off(&self, limit: Duration) -> Result<bool, BenchGone> {
        let (done, off) = mpsc::channel();
        self.post(BenchCommand::WaitOff(done), None)?;
        match off.recv_timeout(limit) {
            Ok(()) => Ok(true),
            Err(mpsc::RecvTimeoutError::Timeout) => Ok(false),
            Err(mpsc::RecvTimeoutError::Disconnected) => Err(BenchGone),
        }
    }

    /// Pulls a cable out: the host's port is gone for good, while board and module stay as they are. What the board
    /// sends meanwhile is lost.
    ///
    /// # Errors
    /// [`BenchGone`].
    pub fn unplug(&self, cable: Cable) -> Result<(), BenchGone> {
        self.order(BenchCommand::Unplug(cable))
    }

    /// Plugs a cable in, into a new pseudo-terminal; returns the path that the host opens.
    ///
    /// # Errors
    /// The system has no pseudo-terminal left, or the bench has ended or has no such cable.
    pub fn plug_in(&self, cable: Cable) -> io::Result<PathBuf> {
        let (told, port) = mpsc::channel();
        self.post(BenchCommand::PlugIn(cable, told), None).map_err(io::Error::other)?;
        port.recv().map_err(|_| io::Error::other(BenchGone))?
    }

    fn set_in_motion(&self, motion: TableMotion) -> Result<(), TurntableError> {
        let (done, answer) = mpsc::channel();
        self.post(BenchCommand::Move(motion, done), None)?;
        Ok(answer.recv().map_err(|_| BenchGone)??)
    }

    /// The true state of the bench.
    ///
    /// # Errors
    /// [`BenchGone`].
    pub fn truth(&self) -> Result<Truth, BenchGone> {
        let (told, truth) = mpsc::channel();
        self.post(BenchCommand::Truth(told), None)?;
        truth.recv().map_err(|_| BenchGone)
    }

    fn order(&self, command: BenchCommand) -> Result<(), BenchGone> {
        let (done, answer) = mpsc::channel();
        self.post(command, Some(done))?;
        answer.recv().map_err(|_| BenchGone)
    }

    fn post(&self, command: BenchCommand, done: Option<Sender<()>>) -> Result<(), BenchGone> {
        self.commands.send((command, done)).map_err(|_| BenchGone)?;
        // A full pipe means that a wake-up is already under way.
        let _ = (&*self.wake).write(&[0]);
        Ok(())
    }
}

/// A simulated bench that is being served; dropping it ends the thread and closes the port.
#[derive(Debug)]
pub struct RunningBench {
    port: PathBuf,
    can_port: String,
    control: BenchControl,
    thread: Option<JoinHandle<io::Result<()>>>,
}

impl RunningBench {
    /// Opens a pseudo-terminal and serves the bench on it.
    ///
    /// # Errors
    /// The system has no pseudo-terminal or no thread left.
    pub fn start(options: &BenchOptions) -> io::Result<Self> {
        Self::start_with(options, None)
    }

    /// As [`RunningBench::start`], with the CAN bus on an interface of the kernel instead of an slcan adapter.
    ///
    /// # Errors
    /// As [`RunningBench::start`]; or the interface does not exist.
    pub fn start_with(options: &BenchOptions, interface: Option<&str>) -> io::Result<Self> {
        Self::serve(options, Tty::pseudo_terminal()?, interface)
    }

    /// As [`RunningBench::start_with`], on a serial port of this computer at the rate of the options. The host opens
    /// the other end of the cable.
    ///
    /// # Errors
    /// As [`RunningBench::start_with`]; or the device is not a port, or does not have the rate.
    pub(crate) fn start_on(options: &BenchOptions, device: &Path, interface: Option<&str>) -> io::Result<Self> {
        Self::serve(options, Tty::device(device, options.rate_baud)?, interface)
    }

    fn serve(options: &BenchOptions, tty: Tty, interface: Option<&str>) -> io::Result<Self> {
        let port = tty.name.clone();
        let can = match interface {
            Some(interface) => CanPort::socket(interface)?,
            None => CanPort::slcan()?,
        };
        let can_port = can.name();
        let (wake, woken) = UnixStream::pair()?;
        wake.set_nonblocking(true)?;
        woken.set_nonblocking(true)?;
        let (commands, received) = mpsc::channel();
        let mut bench = SimulatedBench::new(options);
        if interface.is_some() {
            bench.pace_can();
        }
        let clock = LinkClock::start(Instant::now(), options.speed);
        let driver = Driver { bench, tty: Some(tty), can, wait_off: Vec::new(), woken, received, clock };
        let thread = std::thread::Builder::new().name("simulated bench".to_owned()).spawn(move || driver.serve())?;
        let control = BenchControl { commands, wake: std::sync::Arc::new(wake) };
        Ok(Self { port, can_port, control, thread: Some(thread) })
    }

    /// The pseudo-terminal that the host opens, or the device on which the bench is served.
    #[must_use]
    pub fn port(&self) -> &Path {
        &self.port
    }

    /// The CAN adapter or interface that the host opens, in the form of a bench file.
    #[must_use]
    pub fn can_port(&self) -> &str {
        &self.can_port
    }

    /// The control of the bench.
    #[must_use]
    pub fn control(&self) -> BenchControl {
        self.control.clone()
    }
}

impl Drop for RunningBench {
    fn drop(&mut self) {
        // Both calls fail only if the thread has ended already, which is the aim.
        let _ = self.control.post(BenchCommand::Stop, None);
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

struct Driver {
    bench: SimulatedBench,
    /// `None`: the cable is pulled out.
    tty: Option<Tty>,
    can: CanPort,
    wait_off: Vec<Sender<()>>,
    woken: UnixStream,
    received: Receiver<(BenchCommand, Option<Sender<()>>)>,
    clock: LinkClock,
}

impl Driver {
    fn serve(mut self) -> io::Result<()> {
        loop {
            if !self.obey() {
                return Ok(());
            }
            let now = self.look();
            self.read(now)?;
            self.can.read(&mut self.bench, now)?;
            // Frames in the adapter were sent but have not left: time must not pass beyond them.
            self.bench.can_held = !self.can.is_drained();
            self.bench.advance(now);
            if !self.bench.is_powered() {
                // A caller that gave up waiting is gone.
                for done in self.wait_off.drain(..) {
                    let _ = done.send(());
                }
            }
            let full = self.write(now)?;
            let can_full = self.can.write(&mut self.bench)?;
            self.wait(full, can_full)?;
        }
    }

    /// Link time now. Excuses what is not to count of the time since the last look.
    fn look(&mut self) -> Duration {
        let now = self.clock.now();
        self.bench.excuse(self.clock.take_stood_still(), now);
        self.bench.hold(self.clock.take_port_full());
        now
    }

    /// Carries out the pending commands; returns `false` to stop.
    fn obey(&mut self) -> bool {
        while let Ok((command, done)) = self.received.try_recv() {
            let now = self.look();
            self.bench.pass_time(now);
            match command {
                BenchCommand::SetSwitch(number, on) => self.bench.set_switch(number, on),
                BenchCommand::OnlySwitch(on) => self.bench.only_switch(on),
                BenchCommand::SetHeading(heading_deg) => self.bench.set_heading_deg(heading_deg),
                BenchCommand::SetAxisUp(axis, sign) => self.bench.set_axis_up(axis, sign),
                BenchCommand::SetTurn(axis, rate_dps) => self.bench.set_turn(axis, rate_dps),
                BenchCommand::Sleep(span, done) => self.bench.sleep(span, done),
                BenchCommand::Move(motion, done) => {
                    let _ = done.send(self.set_in_motion(&motion));
                }
                BenchCommand::WaitStill(done) => self.bench.wait_still(done),
                BenchCommand::IsMoving(told) => {
                    let _ = told.send(self.bench.is_moving());
                }
                BenchCommand::Truth(told) => {
                    // A caller that has gone needs no answer.
                    let _ = told.send(self.bench.truth());
                }
                BenchCommand::WaitOff(done) => self.wait_off.push(done),
                BenchCommand::Unplug(Cable::Serial) => self.tty = None,
                BenchCommand::Unplug(Cable::Slcan) => self.can.unplug(),
                BenchCommand::PlugIn(cable, told) => {
                    let _ = told.send(self.plug_in(cable));
                }
                BenchCommand::Stop => return false,
            }
            if let Some(done) = done {
                let _ = done.send(());
            }
        }
        true
    }

    fn plug_in(&mut self, cable: Cable) -> io::Result<PathBuf> {
        match cable {
            Cable::Serial => {
                let tty = Tty::pseudo_terminal()?;
                let unheard = self.bench.output(self.clock.now()).len();
                self.bench.consume(unheard);
                Ok(self.tty.insert(tty).name.clone())
            }
            Cable::Slcan => self.can.plug_in(),
        }
    }

    fn set_in_motion(&mut self, motion: &TableMotion) -> Result<(), TableRefusal> {
        match *motion {
            TableMotion::Orient(along, axis, sign, heading_deg) => self.bench.orient(along, axis, sign, heading_deg),
            TableMotion::OrientUp(up, heading_deg) => self.bench.orient_up(up, heading_deg),
            TableMotion::Rotate(angle_deg, span_s) => self.bench.rotate(angle_deg, span_s),
            TableMotion::Spin(rate_dps) => self.bench.spin(rate_dps),
            TableMotion::Stop => {
                self.bench.stop();
                Ok(())
            }
        }
    }

    fn read(&mut self, now: Duration) -> io::Result<()> {
        let Some(tty) = &self.tty else { return Ok(()) };
        let mut buffer = [0; 4096];
        loop {
            let room = self.bench.room().min(buffer.len());
            if room == 0 {
                return Ok(());
            }
            match nix::unistd::read(&tty.end, &mut buffer[..room]) {
                Ok(0) | Err(Errno::EAGAIN) => return Ok(()),
                Ok(count) => self.bench.receive(&buffer[..count], now),
                Err(Errno::EINTR) => {}
                Err(error) => return Err(error.into()),
            }
        }
    }

    /// Writes bytes that have passed the line; returns whether the port is full.
    fn write(&mut self, now: Duration) -> io::Result<bool> {
        loop {
            let bytes = self.bench.output(now);
            if bytes.is_empty() {
                return Ok(false);
            }
            // While the cable is out, output waits until it is thrown away, and at full speed bench time waits with it.
            let Some(tty) = &self.tty else { return Ok(true) };
            match nix::unistd::write(&tty.end, bytes) {
                Ok(0) | Err(Errno::EAGAIN) => return Ok(true),
                Ok(count) => self.bench.consume(count),
                Err(Errno::EINTR) => {}
                Err(error) => return Err(error.into()),
            }
        }
    }

    /// Whether the host does not take what the board says: the port of the session is there, and full. The other port
    /// may stay full for ever, after a host that has gone.
    fn session_is_held_up(&self, full: bool, can_full: bool) -> bool {
        match self.bench.session_port() {
            BoardPort::Serial => full && self.tty.is_some(),
            BoardPort::Can => can_full,
        }
    }

    fn wait(&mut self, full: bool, can_full: bool) -> io::Result<()> {
        let now = self.clock.now();
        let until_due = self.bench.next_due(now).saturating_sub(now);
        let timeout = if full || can_full { until_due.clamp(Duration::from_micros(200), FULL_PORT) } else { until_due };
        let mut wanted = PollFlags::empty();
        if self.bench.room() > 0 {
            wanted |= PollFlags::POLLIN;
        }
        if full {
            wanted |= PollFlags::POLLOUT;
        }
        let mut can_wanted = PollFlags::empty();
        if self.bench.can_room() > 0 {
            can_wanted |= PollFlags::POLLIN;
        }
        if can_full {
            can_wanted |= PollFlags::POLLOUT;
        }
        let can = self.can.as_fd();
        let timeout = if can.is_some() { timeout } else { timeout.min(INTERFACE_AWAY) };
        let timeout = timeout.min(LOOK_EVERY);
        let mut fds = vec![PollFd::new(self.woken.as_fd(), PollFlags::POLLIN)];
        fds.extend(can.map(|can| PollFd::new(can, can_wanted)));
        fds.extend(self.tty.as_ref().map(|tty| PollFd::new(tty.end.as_fd(), wanted)));
        match ppoll(&mut fds, Some(TimeSpec::from_duration(timeout)), None) {
            Ok(_) | Err(Errno::EINTR) => {
                let wait = if self.session_is_held_up(full, can_full) { Wait::Room } else { Wait::Due };
                self.clock.waited(timeout, wait);
            }
            Err(error) => return Err(error.into()),
        }
        // A device that was pulled out would read as "no bytes" forever. The bench's own pseudo-terminal never hangs
        // up, since its other end is kept open.
        let line = fds.last().filter(|_| self.tty.is_some());
        if line.and_then(PollFd::revents).is_some_and(|events| events.contains(PollFlags::POLLHUP)) {
            return Err(Errno::ENXIO.into());
        }
        // Only the wake-up matters; its reason is in the channel.
        let mut rubbish = [0; 64];
        while matches!((&self.woken).read(&mut rubbish), Ok(count) if count > 0) {}
        Ok(())
    }
}
