//! What the board hears and says: the conversation on both links, and the breaches between it and the wire.

use std::time::Duration;

use gnc_protocol::Call as _;
use gnc_protocol::frame::{Frame, Kind};
use gnc_protocol::message::{HostHello, MAGIC, MakeSafe};
use gnc_protocol::slave::Slave;
use gnc_protocol::wire::Wire;

use super::{FRAMES_WAIT, SAMPLES_AHEAD_S, SimulatedBench};
use crate::board::BoardPort;
use crate::breaches::conversation::TalkFilter;

impl SimulatedBench {
    /// Takes a frame of the conversation from a link.
    pub(super) fn take(&mut self, port: BoardPort, frame: &Frame, now: Duration) {
        let talk = match port {
            BoardPort::Serial => &mut self.talk,
            BoardPort::Can => &mut self.can_talk,
        };
        let Some(frame) = talk.hear(frame, now) else { return };
        self.board.power_off_waits = talk.is_safe_late(&frame);
        if HostHello::from_payload(&frame.payload).is_ok_and(|hello| hello.magic == MAGIC)
            && frame.header.kind == Kind::Hello
        {
            self.session_on = port;
            self.board.set_carrier(port);
            match port {
                BoardPort::Serial => {
                    self.can_slave.leave();
                    self.can_talk.forget();
                    self.can.drop_samples();
                }
                BoardPort::Can => {
                    self.slave.leave();
                    self.talk.forget();
                }
            }
        }
        self.count_link();
        let slave = match port {
            BoardPort::Serial => &mut self.slave,
            BoardPort::Can => &mut self.can_slave,
        };
        let mut answers = Vec::new();
        slave.receive(&frame, now, &mut self.board, &mut |answer| answers.push(answer));
        self.board.power_off_waits = false;
        self.send(port, answers, now);
    }

    /// Sends to the host everything that is due.
    pub(super) fn speak(&mut self, now: Duration) {
        if !self.board.is_booting() {
            let (mut frames, mut can_frames) = (Vec::new(), Vec::new());
            self.count_link();
            self.board.line_room = match self.session_on {
                BoardPort::Serial => self.line_bytes(SAMPLES_AHEAD_S).saturating_sub(self.outgoing.len()),
                // On the bus samples wait in a separate queue, behind everything else.
                BoardPort::Can => usize::MAX,
            };
            frames.extend(self.talk.watch(&mut self.slave, &mut self.board, now));
            can_frames.extend(self.can_talk.watch(&mut self.can_slave, &mut self.board, now));
            self.slave.tick(now, &mut self.board, &mut |frame| frames.push(frame));
            self.can_slave.tick(now, &mut self.board, &mut |frame| can_frames.push(frame));
            self.talk.tick(&self.slave, &self.board, now);
            self.can_talk.tick(&self.can_slave, &self.board, now);
            self.send(BoardPort::Serial, frames, now);
            self.send(BoardPort::Can, can_frames, now);
            if let Some(text) = self.bytes.print(now) {
                self.wire_to_host.push(&text, now);
            }
        }
        self.carry(now);
    }

    /// When the board has something to say by itself.
    pub(super) fn talk_due(&self) -> Duration {
        let filters = [self.talk.next_due(), self.can_talk.next_due(), self.bytes.next_due()];
        filters.into_iter().flatten().fold(self.slave.next_due().min(self.can_slave.next_due()), Duration::min)
    }

    fn count_link(&mut self) {
        let (counters, sent) = match self.session_on {
            BoardPort::Serial => (self.decoder.counters(), sent(&self.slave, &self.talk)),
            BoardPort::Can => (self.can.counters(), self.can.messages()),
        };
        let reply = &mut self.board.link_counters;
        (reply.frames, reply.bad_checksum) = (counters.frames, counters.bad_checksum);
        (reply.malformed, reply.missing) = (counters.malformed, counters.missing);
        reply.sent = sent;
    }

    /// Sends frames as far as the breaches of the board let them go.
    fn send(&mut self, port: BoardPort, frames: Vec<Frame>, now: Duration) {
        let talk = match port {
            BoardPort::Serial => &mut self.talk,
            BoardPort::Can => &mut self.can_talk,
        };
        let frames = if talk.is_active() {
            talk.push(frames, now);
            std::iter::from_fn(|| talk.pop(now)).collect()
        } else {
            frames
        };
        self.put(port, frames, now);
    }

    fn put(&mut self, port: BoardPort, frames: Vec<Frame>, now: Duration) {
        for frame in frames {
            if frame.header.kind == Kind::Result && frame.header.message == MakeSafe::ID {
                self.board.finish_power_off();
            }
            self.said_more |= port == BoardPort::Serial && frame.header.kind != Kind::Stream;
            match port {
                BoardPort::Serial if self.wire_to_host.is_clean() => {
                    if self.outgoing.len() <= FRAMES_WAIT {
                        self.bytes.write(&frame, |bytes| self.outgoing.push(bytes, now));
                    }
                }
                BoardPort::Serial => {
                    if frame.header.kind == Kind::Hello {
                        self.wire_to_host.begin_numbers();
                    }
                    self.bytes.write(&frame, |bytes| self.wire_to_host.push(bytes, now));
                }
                BoardPort::Can if self.has_can => self.can.send(&frame),
                BoardPort::Can => {}
            }
        }
        let echo = self.wire_to_host.take_echo();
        self.incoming.push(&echo, now);
        self.carry(now);
    }
}

/// Frames that left the board.
fn sent(slave: &Slave, talk: &TalkFilter) -> u32 {
    if talk.is_active() { talk.sent() } else { slave.sent() }
}
