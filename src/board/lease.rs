//! One item's dealings with the board: its requests, its streams, the board time they took.

use std::cell::{Cell, RefCell};
use std::time::Duration;

use gnc_link::can::Tap;
use gnc_protocol::message::{Abort, Call, StreamStop};
use gnc_protocol::stream::StreamId;
use gnc_protocol::wire::Wire as _;
use tokio::sync::{mpsc, oneshot, watch};

use crate::client::BoardClient;
use crate::error::{BoardError, gone};
use crate::rule;
use crate::session::{Answer, SessionCommand};
use crate::status::Advance;
use crate::stream::{AHEAD, Closed, Stream, WAITING};

/// What one attempt of an item asks of the board. Several items may do so at once.
#[derive(Debug)]
pub struct BoardLease<'a> {
    board: &'a BoardClient,
    advance: watch::Sender<Advance>,
    requests: RefCell<Vec<u16>>,
    streams: RefCell<Vec<StreamId>>,
    /// All streams that were listened to, and the refusals of values before.
    heard: RefCell<Vec<StreamId>>,
    refusals: u64,
    busy: Cell<Duration>,
}

impl<'a> BoardLease<'a> {
    /// A lease for one attempt; `advance` tells people how far it is.
    #[must_use]
    pub fn new(board: &'a BoardClient, advance: watch::Sender<Advance>) -> Self {
        let (requests, streams) = (RefCell::new(Vec::new()), RefCell::new(Vec::new()));
        let refusals = board.breaches.refusals();
        Self { board, advance, requests, streams, heard: RefCell::default(), refusals, busy: Cell::new(Duration::ZERO) }
    }

    /// Asks and waits for the result.
    ///
    /// # Errors
    /// [`BoardError`].
    pub async fn call<C: Call>(&self, call: &C) -> Result<C::Reply, BoardError> {
        self.ask(call).await.map(|(reply, _)| reply)
    }

    /// Asks and waits for the result. Also returns what the call took.
    ///
    /// # Errors
    /// [`BoardError`].
    pub async fn ask<C: Call>(&self, call: &C) -> Result<(C::Reply, Answer), BoardError> {
        let payload = Box::new(call.to_payload().map_err(|_| BoardError::TooLong { what: C::NAME })?);
        let (answer, answered) = oneshot::channel();
        let request = self.board.number();
        self.requests.borrow_mut().push(request);
        let (message, what, advance) = (C::ID, C::NAME, self.advance.clone());
        self.board.send(SessionCommand::Ask { request, message, what, payload, answer, advance }).await?;
        let answer = answered.await.map_err(|_| gone())??;
        self.spent(answer.elapsed);
        let reply =
            C::Reply::from_payload(&answer.body).map_err(|source| BoardError::BadAnswer { what: C::NAME, source })?;
        Ok((reply, answer))
    }

    /// Whether the board switches and measures the module's supply, by its HELLO.
    #[must_use]
    pub fn switches_supply(&self) -> bool {
        self.board.hello().capabilities & gnc_protocol::message::capability::POWER != 0
    }

    /// Why the samples that were listened to cannot be trusted, if the board broke a rule that touches them. A listener that
    /// had ended, or was behind, has not heard of it.
    #[must_use]
    pub fn broken_stream(&self) -> Option<BoardError> {
        self.board.broken_stream(self.refusals, &self.heard.borrow())
    }

    /// All streams that were listened to, and the number of values that were refused before.
    #[must_use]
    pub fn listened(&self) -> (Vec<StreamId>, u64) {
        (self.heard.borrow().clone(), self.refusals)
    }

    /// The error of an answer that cannot be, by what other answers say; the run's record names it.
    #[must_use]
    pub fn impossible(&self, of: &'static str, why: String) -> BoardError {
        self.board.breaches.refuse(&rule::IMPOSSIBLE, of, why)
    }

    /// Test frames of the CAN bus that carries this conversation; `None` on another link.
    #[must_use]
    pub fn tap(&self) -> Option<&'a Tap> {
        self.board.tap.as_ref()
    }

    /// Listens to a stream from now on. Start the stream after that.
    ///
    /// # Errors
    /// [`BoardError::Gone`].
    pub async fn listen(&self, stream: StreamId) -> Result<Stream, BoardError> {
        let (sender, frames) = mpsc::channel(WAITING + AHEAD);
        self.streams.borrow_mut().push(stream);
        self.heard.borrow_mut().push(stream);
        self.board.send(SessionCommand::Listen { stream, sender }).await?;
        Ok(Stream::new(stream, frames, self.board.board_time()))
    }

    /// Ends a stream and says where its samples are. This includes samples that come while it ends.
    ///
    /// # Errors
    /// [`BoardError`].
    pub async fn stop_stream(&self, stream: Stream) -> Result<Closed, BoardError> {
        let id = stream.id();
        let stop = StreamStop { stream: id as u8 };
        let closed = stream.close(self.call(&stop)).await?;
        self.streams.borrow_mut().retain(|open| *open != id);
        Ok(closed)
    }

    /// Ends a stream to which nobody listens any more. On CAN samples may still come behind the board's answer, and a new
    /// run of the stream must not take them for its own.
    async fn end_stream(&self, id: StreamId) -> Result<(), BoardError> {
        if self.tap().is_some() {
            let stream = self.listen(id).await?;
            return self.stop_stream(stream).await.map(drop);
        }
        self.call(&StreamStop { stream: id as u8 }).await.map(drop)
    }

    /// Tells people how far a capture is.
    pub fn captured(&self, samples: u32, wanted: u32, rate_hz: u16) {
        let ms = |samples: u32| u64::from(samples) * 1000 / u64::from(rate_hz.max(1));
        self.advance.send_replace(Advance {
            done_permille: (u64::from(samples) * 1000 / u64::from(wanted.max(1))).min(1000) as u16,
            elapsed_ms: u32::try_from(ms(samples)).unwrap_or(u32::MAX),
            expected_ms: u32::try_from(ms(wanted)).unwrap_or(u32::MAX),
        });
    }

    /// Tells people how far a whole program of captures is.
    pub fn advanced(&self, done_s: f64, whole_s: f64) {
        let ms = |span_s: f64| (span_s * 1e3) as u32;
        self.advance.send_replace(Advance {
            done_permille: (done_s / whole_s.max(1e-3) * 1e3).clamp(0.0, 1e3) as u16,
            elapsed_ms: ms(done_s),
            expected_ms: ms(whole_s),
        });
    }

    /// Adds board time that was needed: requests by their results, streams by the code that listened.
    pub fn spent(&self, board_time: Duration) {
        self.busy.set(self.busy.get() + board_time);
    }

    /// Board time needed so far.
    #[must_use]
    pub fn busy(&self) -> Duration {
        self.busy.get()
    }

    /// Numbers of the requests made here.
    #[must_use]
    pub fn requests(&self) -> Vec<u16> {
        self.requests.borrow().clone()
    }

    /// Ends all that may still go on at the board after an attempt that was cut off. If something cannot be ended, the
    /// next item that needs the board finds it.
    pub async fn clear(&self) {
        let last =
            self.requests.borrow().iter().rev().take(gnc_protocol::slave::MAX_RUNNING).copied().collect::<Vec<_>>();
        for request in last {
            if self.call(&Abort { request }).await.is_err_and(|error| !error.is_answered()) {
                return;
            }
        }
        let open = std::mem::take(&mut *self.streams.borrow_mut());
        for stream in open {
            if self.end_stream(stream).await.is_err_and(|error| !error.is_answered()) {
                return;
            }
        }
    }
}
