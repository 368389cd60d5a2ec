//! Actions of an operator or a fixture at the bench, and the callers that wait for bench time to pass.

use std::sync::mpsc::Sender;
use std::time::Duration;

use gnc_rig::Along;

use super::SimulatedBench;
use crate::operator::SWITCHES;
use crate::turntable::TableRefusal;
use crate::world::{ModuleAxis, Sign};

/// A caller that waits for bench time to pass.
#[derive(Debug)]
pub(super) enum Sleeper {
    Until(u64, Sender<()>),
    /// Until the module is still.
    Still(Sender<Result<(), TableRefusal>>),
}

impl SimulatedBench {
    /// Flips a DIP switch, 1 to 5.
    pub fn set_switch(&mut self, number: u8, on: bool) {
        self.board.module.ad.set_switch(number, on);
    }

    /// Asks the operator to set one DIP switch (1 to 5) on and all others off, or all off.
    pub fn only_switch(&mut self, on: Option<u8>) {
        if self.operator.sets_switches() {
            (1..=SWITCHES).for_each(|number| self.set_switch(number, Some(number) == on));
        }
    }

    /// Points the module's reference axis.
    pub fn set_heading_deg(&mut self, heading_deg: f64) {
        self.board.take_samples();
        self.board.world.set_heading_deg(heading_deg);
        self.table.laid(self.board.world.up());
    }

    /// Lays the module down with an axis up.
    pub fn set_axis_up(&mut self, axis: ModuleAxis, sign: Sign) {
        self.board.take_samples();
        self.board.world.set_axis_up(axis, sign);
        self.table.laid(axis);
    }

    /// Turns the module steadily about one of its axes.
    pub fn set_turn(&mut self, axis: ModuleAxis, rate_dps: f64) {
        let now_s = self.moment();
        self.board.world.set_turn(axis, rate_dps, now_s);
        self.table.laid(axis);
    }

    /// Begins to point an axis of the module along a direction. All motions of the table take bench time and end
    /// without further calls.
    ///
    /// # Errors
    /// [`TableRefusal`] if the table moves, or the heading is not a number.
    pub fn orient(&mut self, along: Along, axis: ModuleAxis, sign: Sign, heading_deg: f64) -> Result<(), TableRefusal> {
        let now_s = self.moment();
        self.table.orient(&mut self.board.world, along, (axis, sign), heading_deg, now_s)
    }

    /// Begins to lay the module down in any attitude: `up` is a direction in the module's axes.
    ///
    /// # Errors
    /// [`TableRefusal`] if the table moves, or there is no such direction or heading.
    pub fn orient_up(&mut self, up: [f64; 3], heading_deg: f64) -> Result<(), TableRefusal> {
        let now_s = self.moment();
        self.table.orient_up(&mut self.board.world, up, heading_deg, now_s)
    }

    /// Begins a rotation about the table's axis.
    ///
    /// # Errors
    /// [`TableRefusal`] if the table moves, was left between two orientations, or cannot turn so fast.
    pub fn rotate(&mut self, angle_deg: f64, span_s: f64) -> Result<(), TableRefusal> {
        let now_s = self.moment();
        self.table.rotate(&mut self.board.world, angle_deg, span_s, now_s)
    }

    /// Begins to spin about the table's axis.
    ///
    /// # Errors
    /// [`TableRefusal`] while the table is oriented, was left between two orientations, or cannot turn so fast.
    pub fn spin(&mut self, rate_dps: f64) -> Result<(), TableRefusal> {
        let now_s = self.moment();
        self.table.spin(&mut self.board.world, rate_dps, now_s)
    }

    /// Begins to stop the table.
    pub fn stop(&mut self) {
        let now_s = self.moment();
        self.table.stop(&mut self.board.world, now_s);
    }

    /// Whether the module is under power.
    #[must_use]
    pub fn is_powered(&self) -> bool {
        self.board.is_powered()
    }

    /// Whether the module moves.
    #[must_use]
    pub(crate) fn is_moving(&self) -> bool {
        !self.board.world.motion.is_still(self.board.true_s(self.board.now_ns()))
    }

    /// Notifies `done` when bench time has passed `span` more.
    pub fn sleep(&mut self, span: Duration, done: Sender<()>) {
        let span_ns = u64::try_from(span.as_nanos()).unwrap_or(u64::MAX / 2);
        self.sleepers.push(Sleeper::Until(self.board.now_ns().saturating_add(span_ns), done));
        self.wake_sleepers();
    }

    /// Notifies `done` when the module is still, or that it spins without end.
    pub fn wait_still(&mut self, done: Sender<Result<(), TableRefusal>>) {
        self.sleepers.push(Sleeper::Still(done));
        self.wake_sleepers();
    }

    /// The true time of an action on the module. Samples before it are taken first, with the module as it was.
    fn moment(&mut self) -> f64 {
        self.board.take_samples();
        self.board.true_s(self.board.now_ns())
    }

    /// The bench time at which the module is still for certain; `None` if it never is. It includes a microsecond more
    /// than the rounding of a true time to nanoseconds of the board.
    fn still_ns(&self) -> Option<u64> {
        self.board.world.motion.end_s().map(|end_s| self.board.bench_ns(end_s).max(0.0) as u64 + 1000)
    }

    /// The bench time at which the first sleeper is due.
    pub(super) fn sleeper_due_ns(&self) -> Option<u64> {
        let due_ns = |sleeper: &Sleeper| match sleeper {
            Sleeper::Until(until_ns, _) => Some(*until_ns),
            Sleeper::Still(_) => self.still_ns(),
        };
        self.sleepers.iter().filter_map(due_ns).min()
    }

    /// Notifies the sleepers whose time has come.
    pub(super) fn wake_sleepers(&mut self) {
        let (now_ns, still_ns) = (self.board.now_ns(), self.still_ns());
        // A sleeper that gave up waiting is gone and needs no notice.
        self.sleepers.retain(|sleeper| {
            match sleeper {
                Sleeper::Until(until_ns, _) if *until_ns > now_ns => return true,
                Sleeper::Until(_, done) => {
                    let _ = done.send(());
                }
                Sleeper::Still(done) => {
                    let answer = match still_ns {
                        Some(still_ns) if still_ns > now_ns => return true,
                        Some(_) => Ok(()),
                        None => Err(TableRefusal::Spinning),
                    };
                    let _ = done.send(answer);
                }
            }
            false
        });
    }
}
