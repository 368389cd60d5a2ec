//! Running streams: samples of the sensors and bytes of the receiver, at their moments of the board's clock.

use gnc_protocol::Payload;
use gnc_protocol::error::FaultCode;
use gnc_protocol::message::{StreamStart, StreamStartReply, StreamStopReply};
use gnc_protocol::slave::{BoardOutput, RequestFault, RequestRefusal};
use gnc_protocol::stream::{PpsCapture, StreamFrame, StreamId};

use super::finish::body;
use super::{BoardPort, CAPTURE_NS, SimulatedBoard};
use crate::breaches::is_nth;
use crate::devices::gnss::{EPOCHS_HZ, LATENCY_S};
use crate::devices::inertial::noise::STEP_S;
use crate::requests::{self, samples_per_frame};
use crate::streams::{RunningStream, format_of, stream_bytes};
use crate::world::{Influence, World};

impl SimulatedBoard {
    pub(super) fn start_stream(&mut self, start: &StreamStart) -> Result<Payload, RequestFault> {
        let refused = |refusal: RequestRefusal| RequestFault { code: FaultCode::DeviceFault, text: refusal.text };
        let load_permille = self.check_stream(start).map_err(refused)?;
        let id = requests::stream_of(start.stream).map_err(refused)?;
        let utc_s = self.world.utc_s(self.true_s(self.now_ns));
        let tick = match id {
            StreamId::Imu | StreamId::Compensated => 0,
            StreamId::Gnss => (utc_s * EPOCHS_HZ).floor().max(0.0) as u64 + 1,
            StreamId::Pps => utc_s.floor().max(0.0) as u64 + 1,
        };
        self.ended.retain(|(ended, _)| *ended != id);
        let breaches = self.breaches.streams;
        let mut asked = start.clone();
        if asked.count != 0 {
            asked.count = asked.count.saturating_add(breaches.extra_samples);
        }
        if let Some((_, most)) = requests::samples_of(start.stream)
            && breaches.samples_a_frame != 0
            && self.carrier == BoardPort::Serial
        {
            asked.samples_per_frame = breaches.samples_a_frame.min(most as u8);
        }
        let mut stream = RunningStream::new(&asked, id, load_permille, self.now_ns, tick);
        stream.sampling = self.sampling;
        if id == StreamId::Compensated {
            stream.compensation = self.module.calibration.compensation();
        }
        self.streams.push(stream);
        body(&StreamStartReply {
            format: format_of(id) as u8,
            samples_per_frame: match id {
                StreamId::Imu | StreamId::Compensated => samples_per_frame(start),
                StreamId::Gnss => 0,
                StreamId::Pps => 1,
            },
            load_permille: u16::try_from(load_permille).unwrap_or(u16::MAX),
        })
    }

    pub(super) fn stop_stream(&mut self, number: u8) -> Result<Payload, RequestFault> {
        if let Some(index) = self.streams.iter().position(|stream| stream.id as u8 == number) {
            if self.breaches.streams.go_on {
                let stream = &self.streams[index];
                self.ended.push((stream.id, stream.stopped()));
            } else {
                self.close_stream(index);
            }
        }
        let ended = self.ended.iter().find(|(id, _)| *id as u8 == number);
        let account = ended.map_or_else(StreamStopReply::default, |(_, reply)| reply.clone());
        body(&self.breaches.streams.account(&account))
    }

    /// Ends a stream. Samples that wait for a full frame are sent first.
    fn close_stream(&mut self, index: usize) {
        let mut stream = self.streams.swap_remove(index);
        if let Some(frame) = stream.take_frame() {
            self.send(&mut stream, frame);
        }
        self.ended.push((stream.id, stream.stopped()));
    }

    /// Ends all streams in good order before the module is switched off: no sample is lost.
    pub(super) fn close_streams(&mut self) {
        while !self.streams.is_empty() {
            self.close_stream(0);
        }
    }

    /// Ends all streams at once: samples that have not left yet are dropped and counted.
    pub(super) fn drop_streams(&mut self) {
        self.run_streams();
        while let Some(mut stream) = self.streams.pop() {
            if let Some(frame) = stream.take_frame() {
                stream.drop_frame(&frame);
            }
            self.ended.push((stream.id, stream.stopped()));
        }
        for output in std::mem::take(&mut self.samples) {
            if let BoardOutput::Stream(stream, frame) = output
                && let Some((_, reply)) = self.ended.iter_mut().find(|(id, _)| *id == stream)
            {
                reply.dropped = reply.dropped.wrapping_add(u32::from(frame.head.count));
            }
        }
    }

    /// Bytes of samples that wait for the line.
    pub(crate) fn samples_waiting(&self) -> usize {
        let bytes = |output: &BoardOutput| match output {
            BoardOutput::Stream(_, frame) => stream_bytes(frame),
            BoardOutput::Done(_) => 0,
        };
        self.samples.iter().map(bytes).sum()
    }

    fn end_complete_streams(&mut self) {
        while let Some(index) = self.streams.iter().position(RunningStream::is_complete) {
            let stream = self.streams.swap_remove(index);
            self.ended.push((stream.id, stream.stopped()));
        }
    }

    /// The bench time at which a stream has work to do.
    pub(super) fn stream_due_ns(&self, stream: &RunningStream) -> u64 {
        match stream.id {
            StreamId::Imu | StreamId::Compensated => stream.frame_full_ns(),
            StreamId::Gnss => {
                self.bench_ns(stream.tick as f64 / EPOCHS_HZ + LATENCY_S - self.world.utc_start_s).ceil() as u64
            }
            // A little after the second, so that the scatter of the edge cannot move it into the future.
            StreamId::Pps => self.bench_ns(stream.tick as f64 + 1e-6 - self.world.utc_start_s).ceil() as u64,
        }
    }

    /// Takes the samples of all streams up to now.
    pub(super) fn run_streams(&mut self) {
        for index in 0..self.streams.len() {
            self.run_stream(index);
        }
        self.end_complete_streams();
    }

    /// Takes the samples up to now before the world changes. Those of a frame that is not full yet wait for it.
    pub(crate) fn take_samples(&mut self) {
        self.run_streams();
        self.still = None;
    }

    fn run_stream(&mut self, index: usize) {
        // The stream is removed from the list while it runs, since its samples need the rest of the board.
        let mut stream = self.streams.swap_remove(index);
        match stream.id {
            StreamId::Imu | StreamId::Compensated => self.run_imu(&mut stream),
            StreamId::Gnss => self.run_gnss(&mut stream),
            StreamId::Pps => self.run_pps(&mut stream),
        }
        self.streams.push(stream);
        let last = self.streams.len() - 1;
        self.streams.swap(index, last);
    }

    fn run_imu(&mut self, stream: &mut RunningStream) {
        let rate_hz = stream.rate_hz() as f64;
        while !stream.is_complete() && stream.next_imu_ns() <= self.now_ns {
            let time_ns = stream.next_imu_ns();
            let now_s = self.true_s(time_ns);
            let sensors = &mut self.module.sensors;
            let reader = stream.reader.get_or_insert_with(|| sensors.reader(rate_hz));
            let (world, still) = (&self.world, &mut self.still);
            let mut sample = sensors.read(reader, |moment_s| influence(world, still, moment_s), now_s);
            if let Some(repeats) = self.breaches.streams.repeats {
                if repeats.hits(stream.produced()) {
                    sample = stream.last.clone().unwrap_or(sample);
                }
                stream.last = Some(sample.clone());
            }
            let time_us = self.board_us(stream.next_told_ns());
            let full = match &stream.compensation {
                Some(compensation) => {
                    let compensated = compensation.apply(&sample);
                    stream.add_sample(&compensated, time_us)
                }
                None => stream.add_sample(&self.breaches.values.sample(sample), time_us),
            };
            if let Some(frame) = full {
                self.send(stream, frame);
            }
        }
    }

    fn run_gnss(&mut self, stream: &mut RunningStream) {
        while !stream.is_complete() && self.stream_due_ns(stream) <= self.now_ns {
            let epoch_s = stream.tick as f64 / EPOCHS_HZ - self.world.utc_start_s;
            let time_us = self.board_us(self.stream_due_ns(stream));
            stream.tick += 1;
            let said = self.module.gnss.say(&self.world, epoch_s);
            for frame in stream.add_bytes(&said, time_us) {
                self.send(stream, frame);
            }
        }
    }

    fn run_pps(&mut self, stream: &mut RunningStream) {
        while !stream.is_complete() && self.stream_due_ns(stream) <= self.now_ns {
            let second_s = stream.tick as f64 - self.world.utc_start_s;
            stream.tick += 1;
            let Some(scatter_s) = self.module.gnss.pps_scatter_s(second_s) else { continue };
            let edge_ns = self.bench_ns(second_s + scatter_s).max(0.0) as u64;
            let captured_ns = self.board_ns(edge_ns) / CAPTURE_NS * CAPTURE_NS;
            let capture = PpsCapture { board_time_ns: self.breaches.values.capture_ns(captured_ns) };
            if let Some(frame) = stream.add_pps(&capture, captured_ns / 1000) {
                self.send(stream, frame);
            }
        }
    }

    fn send(&mut self, stream: &mut RunningStream, mut frame: StreamFrame) {
        self.frames_made = self.frames_made.wrapping_add(1);
        if is_nth(self.frames_made, self.breaches.streams.drops_frame_every) {
            return;
        }
        self.breaches.streams.number(&mut frame);
        if self.line_full {
            stream.drop_frame(&frame);
        } else {
            self.samples.push_back(BoardOutput::Stream(stream.id, frame));
        }
    }
}

/// What acts on the module. While the module is still, only its temperature changes, as slowly as the sensors' own
/// noise: both are computed once in a step.
fn influence(world: &World, still: &mut Option<(i64, Influence)>, now_s: f64) -> Influence {
    let step = (now_s / STEP_S) as i64;
    match still {
        Some((known, influence)) if *known == step => *influence,
        _ => {
            let influence = world.influence(now_s);
            *still = world.motion.is_still(now_s).then_some((step, influence));
            influence
        }
    }
}
