//! Captures the bytes of the satellite receiver and its pulses.

use gnc_analysis::capture::{Capture, CaptureHead, HostView, ReceiverCapture, Said, Timing};
use gnc_board::stream::{SampleFrame, Stream};
use gnc_nmea::Sentences;
use gnc_protocol::message::StreamStart;
use gnc_protocol::stream::{Losses, PpsCapture, StreamId};
use gnc_protocol::wire::{FieldReader, Wire as _};
use gnc_records::raw::Piece;

use super::{ProcedureError, ProgramCapture};

/// Listens until this board time has passed since the first fix, or the time limit for a fix is over. The analysis
/// works out what the bytes mean.
pub(super) async fn capture(
    capture: &mut ProgramCapture<'_>,
    about: &CaptureHead,
    timeout_s: f64,
    span_s: f64,
) -> Result<(), ProcedureError> {
    let board = capture.bench.board;
    let mut pulses = board.listen(StreamId::Pps).await?;
    let mut bytes = board.listen(StreamId::Gnss).await?;
    let begin_us = bytes.board_time_us();
    capture.raw.write(Piece::Begin { about: about.clone(), board_time_us: begin_us }).await?;
    let [start_pulses, start_bytes] =
        [StreamId::Pps, StreamId::Gnss].map(|stream| StreamStart { stream: stream as u8, ..StreamStart::default() });
    tokio::try_join!(board.call(&start_pulses), board.call(&start_bytes))?;
    let mut ear =
        Ear { heard: ReceiverCapture::default(), sentences: Sentences::default(), began_us: None, fixed_us: None };
    ear.listen(capture, &mut bytes, &mut pulses, timeout_s, span_s).await?;
    // All bytes and pulses of the window are here, or their loss is reported.
    let losses = sum(bytes.losses(), pulses.losses());
    let end_us = bytes.board_time_us();
    tokio::try_join!(board.stop_stream(bytes), board.stop_stream(pulses))?;
    capture.raw.write(Piece::End { losses, host: HostView::default(), board_time_us: end_us }).await?;
    board.spent(std::time::Duration::from_micros(end_us.saturating_sub(begin_us)));
    if losses.any() {
        let at_s = end_us.saturating_sub(begin_us) as f64 * 1e-6;
        return Err(ProcedureError::CaptureLost { label: about.label.clone(), after: losses.received, at_s, losses });
    }
    capture.is_complete().await?;
    let (about, receiver, timing) = (about.clone(), ear.heard, Timing::new(about.rate_hz));
    capture.captures.push(Capture {
        about,
        first_us: begin_us,
        samples: Vec::new(),
        compensated: Vec::new(),
        losses,
        receiver,
        timing,
    });
    Ok(())
}

/// Losses of bytes and edges together: one missing byte or edge spoils the figure.
fn sum(bytes: Losses, pulses: Losses) -> Losses {
    Losses {
        received: bytes.received.saturating_add(pulses.received),
        on_board: bytes.on_board.saturating_add(pulses.on_board),
        on_line: bytes.on_line.saturating_add(pulses.on_line),
    }
}

struct Ear {
    heard: ReceiverCapture,
    sentences: Sentences,
    began_us: Option<u64>,
    fixed_us: Option<u64>,
}

impl Ear {
    async fn listen(
        &mut self,
        capture: &mut ProgramCapture<'_>,
        bytes: &mut Stream,
        pulses: &mut Stream,
        timeout_s: f64,
        span_s: f64,
    ) -> Result<(), ProcedureError> {
        loop {
            let now_us = tokio::select! {
                frame = bytes.next() => match frame? {
                    Some(frame) => self.said(capture, frame).await?,
                    // The receiver is mute while the board's clock goes on.
                    None => {
                        let now_us = bytes.board_time_us();
                        self.began_us.get_or_insert(bytes.began_us().unwrap_or(now_us));
                        now_us
                    }
                },
                frame = pulses.next() => {
                    if let Some(frame) = frame? {
                        self.pulsed(capture, &frame).await?;
                    }
                    continue;
                }
            };
            let began_us = *self.began_us.get_or_insert(now_us);
            let since_s = |us: u64| now_us.saturating_sub(us) as f64 * 1e-6;
            match self.fixed_us {
                Some(fixed_us) => {
                    capture.course.captured(since_s(fixed_us));
                    if since_s(fixed_us) > span_s {
                        return Ok(());
                    }
                }
                None if since_s(began_us) > timeout_s => return Ok(()),
                None => {}
            }
        }
    }

    async fn said(&mut self, capture: &mut ProgramCapture<'_>, frame: SampleFrame) -> Result<u64, ProcedureError> {
        let (board_time_us, bytes) = (frame.head.board_time_us, frame.samples.into_vec());
        if self.sentences.push(&bytes).iter().any(gnc_nmea::Epoch::has_fix) {
            self.fixed_us.get_or_insert(board_time_us);
        }
        capture.raw.write(Piece::Gnss { board_time_us, bytes: bytes.clone() }).await?;
        self.heard.said.push(Said { board_time_us, bytes });
        Ok(board_time_us)
    }

    async fn pulsed(&mut self, capture: &mut ProgramCapture<'_>, frame: &SampleFrame) -> Result<(), ProcedureError> {
        let mut reader = FieldReader::new(&frame.samples);
        let edges_ns = (0..frame.head.count)
            .map(|_| PpsCapture::get(&mut reader).map(|capture| capture.board_time_ns))
            .collect::<Result<Vec<u64>, _>>()
            .map_err(|error| ProcedureError::Nonsense { what: "the PPS stream", why: error.to_string() })?;
        capture.raw.write(Piece::Pps(edges_ns.clone())).await?;
        self.heard.pulses_ns.extend(edges_ns);
        Ok(())
    }
}
