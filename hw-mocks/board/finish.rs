//! Makes the result of a request when its time has passed.

use gnc_protocol::calibration::CalibrationCommitReply;
use gnc_protocol::error::FaultCode;
use gnc_protocol::message::{
    AdReadReply, CpuFloatsReply, CpuIntegersReply, CpuWordsReply, DurationReply, ErrorKind, Flash, FlashIdReply,
    GnssStart, IoTestReply, MismatchReply, ModulePower, Request, SpiDirection, SpiTransferReply, StreamStart,
    StreamStop,
};
use gnc_protocol::slave::{BoardOutput, RequestDone, RequestFault};
use gnc_protocol::wire::{Wire, text};
use gnc_protocol::{Call, Payload};

use super::{Job, SUPPLY_UV, SimulatedBoard};
use crate::devices::calibration::DamagedSlot;
use crate::devices::flash::FlashMemory;
use crate::records::{ErrorFinding, Finder};
use crate::requests::Task;

impl SimulatedBoard {
    pub(super) fn finish(&mut self, job: Job) {
        let Job { request, message, started_ns, task, .. } = job;
        let finder = Finder { request: request.unwrap_or(0), message, board_time_us: self.board_us(self.now_ns) };
        let outcome = match task {
            Task::AtEnd(what) => self.carry_out(what, finder),
            Task::Flash { request, duration_us } => self.finish_flash(&request, duration_us, finder),
            Task::Timers { request, reply } => {
                if reply.interrupts != request.count {
                    let (expected, got) = (u32::from(request.count), u32::from(reply.interrupts));
                    let place = u32::from(request.timer);
                    self.log.note(finder, [ErrorFinding { kind: ErrorKind::TimerInterrupts, place, expected, got }]);
                }
                body(&self.breaches.values.timers(reply))
            }
            Task::Unanswered => Err(fault(FaultCode::DeviceTimeout, "the module does not answer")),
            Task::Pattern { run, .. } => {
                self.note_mismatch(ErrorKind::MemoryMismatch, run.reply(), finder);
                body(run.reply())
            }
        };
        let Some(request) = request else { return };
        let elapsed_us = u32::try_from((self.now_ns - started_ns) / 1000).unwrap_or(u32::MAX);
        let done = BoardOutput::Done(RequestDone { request, elapsed_us, outcome });
        // Results that begin or end streams keep their place among the samples.
        match message {
            StreamStart::ID | StreamStop::ID | ModulePower::ID => self.samples.push_back(done),
            _ => self.outputs.push_back(done),
        }
    }

    fn carry_out(&mut self, what: Request, finder: Finder) -> Result<Payload, RequestFault> {
        match what {
            // The conversation itself answers these two.
            Request::MakeSafe(_) | Request::Abort(_) => body(&()),
            Request::ErrorRecords(request) => body(&self.log.from(request.from)),
            Request::LinkCounters(_) => body(&self.link_counters),
            Request::ModulePower(power) => {
                if power.on == 0 {
                    self.close_streams();
                }
                if power.on == 1 && self.breaches.state.over_current_at_power_on {
                    return Err(self.over_current(finder));
                }
                self.set_power(power.on == 1);
                let reply = self.module.supply(self.powered);
                if self.powered && !SUPPLY_UV.contains(&reply.supply_uv) {
                    let got = reply.supply_uv;
                    let finding = ErrorFinding { kind: ErrorKind::Supply, place: 0, expected: 5_000_000, got };
                    self.log.note(finder, [finding]);
                }
                body(&self.breaches.values.supply(&reply))
            }
            Request::Identity(_) => {
                let said = self.identity_cache.take().unwrap_or_else(|| self.module.identity.clone());
                self.identity_cache = self.caches_identity.then(|| said.clone());
                body(&said)
            }
            Request::CanCounters(_) => body(&self.module.can.counters()),
            Request::CpuWords(request) => {
                self.core_answers(request.core)?;
                let reply = CpuWordsReply { words: self.module.cpu.words(&request) };
                body(&self.breaches.values.words(reply))
            }
            Request::CpuIntegers(request) => {
                self.core_answers(request.core)?;
                body(&CpuIntegersReply { results: self.module.cpu.integers(&request) })
            }
            Request::CpuFloats(request) => {
                self.core_answers(request.core)?;
                body(&CpuFloatsReply { results: self.module.cpu.floats(&request) })
            }
            Request::FlashId(request) => {
                let part = self.flash(request.flash)?.part;
                body(&FlashIdReply {
                    jedec: part.jedec,
                    sector_bytes: part.sector_bytes,
                    scratch_sectors: part.scratch_sectors,
                })
            }
            Request::FlashBlankCheck(request) => {
                let reply = self.flash(request.flash)?.blank_check(request.sector);
                self.note_mismatch(ErrorKind::FlashNotBlank, &reply, finder);
                body(&reply)
            }
            Request::FlashVerify(request) => {
                let reply = self.flash(request.flash)?.verify(request.sector, request.seed);
                self.note_mismatch(ErrorKind::FlashMismatch, &reply, finder);
                body(&reply)
            }
            Request::AdRead(request) => {
                let influence = self.world.influence(self.true_s(self.now_ns));
                let gauss = self.module.sensors.analogue_gauss(&influence);
                let reply = AdReadReply { channels: self.module.ad.read(request.channels, request.samples, &gauss) };
                body(&self.breaches.values.channels(reply))
            }
            Request::IoTest(request) => {
                let levels = self.module.lines.io_test(&request);
                let pair = 1 << request.driver | 1 << request.reader;
                let expected = if request.level == 1 { pair } else { 0b1111 & !pair };
                if levels != expected {
                    let place = u32::from(request.driver) * 16 + u32::from(request.reader);
                    let (expected, got) = (u32::from(expected), u32::from(levels));
                    self.log.note(finder, [ErrorFinding { kind: ErrorKind::IoMismatch, place, expected, got }]);
                }
                body(&IoTestReply { levels })
            }
            Request::SpiTransfer(request) => {
                let direction = SpiDirection::from_number(request.direction).unwrap_or(SpiDirection::FromModule);
                let data = self.module.lines.spi(direction, &request.data);
                self.note_bytes(ErrorKind::SpiMismatch, &request.data, &data, finder);
                body(&SpiTransferReply { data })
            }
            Request::SciEcho(request) => {
                let reply = self.module.sci.echo(&request);
                self.note_bytes(ErrorKind::SciMismatch, &request.data, &reply.data, finder);
                body(&reply)
            }
            Request::GnssRestart(request) => {
                let start = GnssStart::from_number(request.start).unwrap_or(GnssStart::Hot);
                let now_s = self.true_s(self.now_ns);
                self.module.gnss.restart(start, now_s);
                body(&())
            }
            Request::StreamStart(start) => self.start_stream(&start),
            Request::StreamStop(stop) => self.stop_stream(stop.stream),
            Request::CalibrationWrite(write) => {
                self.module.calibration.write(write.calibration);
                body(&())
            }
            Request::CalibrationRead(_) => {
                let finding = |slot: DamagedSlot| ErrorFinding {
                    kind: ErrorKind::CalibrationDamaged,
                    place: slot.slot,
                    expected: slot.expected,
                    got: slot.got,
                };
                self.log.note(finder, self.module.calibration.damaged().into_iter().map(finding));
                body(&self.module.calibration.read())
            }
            // These requests have their own tasks and never come here.
            Request::TimerMeasure(_)
            | Request::RamTest(_)
            | Request::FlashErase(_)
            | Request::FlashWrite(_)
            | Request::CalibrationCommit(_) => {
                Err(fault(FaultCode::DeviceFault, "the board lost track of the request"))
            }
        }
    }

    /// The supply comes on and goes off again at once.
    fn over_current(&mut self, finder: Finder) -> RequestFault {
        self.set_power(true);
        self.set_power(false);
        let got = self.module.supply(false).supply_uv;
        self.log.note(finder, [ErrorFinding { kind: ErrorKind::Supply, place: 0, expected: 5_000_000, got }]);
        fault(FaultCode::DeviceFault, "over current: 2.1 A, switched off")
    }

    fn core_answers(&self, core: u8) -> Result<(), RequestFault> {
        let dead = || fault(FaultCode::DeviceTimeout, &format!("core {core} did not answer"));
        self.module.cpu.answers(core).then_some(()).ok_or_else(dead)
    }

    fn flash(&mut self, number: u8) -> Result<&mut FlashMemory, RequestFault> {
        let flash = Flash::from_number(number).ok_or_else(|| fault(FaultCode::DeviceFault, "no such flash"))?;
        Ok(self.module.flash(flash))
    }

    fn finish_flash(&mut self, what: &Request, duration_us: u32, finder: Finder) -> Result<Payload, RequestFault> {
        let limit_ms = match what {
            Request::CalibrationCommit(_) => {
                let counter = self.module.calibration.commit();
                let duration_us = self.breaches.values.flash_us(duration_us);
                return body(&CalibrationCommitReply { counter, duration_us });
            }
            Request::FlashErase(erase) => {
                let flash = self.flash(erase.flash)?;
                flash.erase(erase.sector);
                flash.part.erase_limit_ms
            }
            Request::FlashWrite(write) => {
                let flash = self.flash(write.flash)?;
                flash.write(write.sector, write.seed);
                flash.part.write_limit_ms
            }
            _ => f64::INFINITY,
        };
        if f64::from(duration_us) > limit_ms * 1000.0 {
            let expected = (limit_ms * 1000.0) as u32;
            let finding = ErrorFinding { kind: ErrorKind::FlashSlow, place: 0, expected, got: duration_us };
            self.log.note(finder, [finding]);
        }
        body(&DurationReply { duration_us: self.breaches.values.flash_us(duration_us) })
    }

    fn note_mismatch(&mut self, kind: ErrorKind, reply: &MismatchReply, finder: Finder) {
        let finding = ErrorFinding { kind, place: reply.first_place, expected: reply.expected, got: reply.got };
        self.log.note(finder, (reply.mismatches > 0).then_some(finding));
    }

    fn note_bytes(&mut self, kind: ErrorKind, sent: &[u8], got: &[u8], finder: Finder) {
        let compare = |(place, &expected): (usize, &u8)| {
            let got = got.get(place).map_or(0x100, |byte| u32::from(*byte));
            let finding = ErrorFinding { kind, place: place as u32, expected: u32::from(expected), got };
            (got != u32::from(expected)).then_some(finding)
        };
        self.log.note(finder, sent.iter().enumerate().filter_map(compare));
    }
}

pub(super) fn body(reply: &impl Wire) -> Result<Payload, RequestFault> {
    reply.to_payload().map_err(|overflow| fault(FaultCode::DeviceFault, &overflow.to_string()))
}

pub(super) fn fault(code: FaultCode, why: &str) -> RequestFault {
    RequestFault { code, text: text(why) }
}
