//! The handle on the board.

use std::cell::{Cell, RefCell};

use gnc_link::Link;
use gnc_link::can::Tap;
use gnc_protocol::message::BoardHello;
use gnc_protocol::stream::StreamId;
use tokio::sync::{mpsc, oneshot, watch};
use tokio::task::JoinHandle;

use crate::breach::{Breaches, Case, NEWS};
use crate::error::{BoardError, gone};
use crate::latest::{Follower, Latest};
use crate::readings::Readings;
use crate::rule::{Breach, Rule};
use crate::session::{LinkReport, Session, SessionCommand};
use crate::status::{BoardTime, LinkAbsence};

/// Commands that may wait for the conversation. Every item awaits its answer, so more than a few mean a fault.
const COMMANDS: usize = 16;
/// Absences of the port that may wait to be read. A port that goes away more often between two looks has a loose plug,
/// and sixteen lines say so.
const ABSENCES: usize = 16;

/// A handle on the board. Dropping it ends the conversation.
#[derive(Debug)]
pub struct BoardClient {
    commands: mpsc::Sender<SessionCommand>,
    board_time: Follower<BoardTime>,
    hello: RefCell<BoardHello>,
    next_request: Cell<u16>,
    task: JoinHandle<LinkReport>,
    pub(crate) tap: Option<Tap>,
    absences: tokio::sync::Mutex<mpsc::Receiver<LinkAbsence>>,
    pub(crate) breaches: Breaches,
    breach_news: tokio::sync::Mutex<mpsc::Receiver<Breach>>,
}

impl BoardClient {
    /// Says HELLO over a link and keeps the conversation going. `readings` shows the values that pass by.
    ///
    /// # Errors
    /// [`BoardError::NoAnswer`] or [`BoardError::Version`].
    pub async fn connect(mut link: Link, nonce: u32, readings: watch::Sender<Readings>) -> Result<Self, BoardError> {
        let (commands, receiver) = mpsc::channel(COMMANDS);
        let beat = Latest::new(BoardTime::default());
        let board_time = beat.follower();
        let tap = match &mut link {
            Link::Serial(_) => None,
            Link::Can(link) => link.tap(),
        };
        let (absent, absences) = mpsc::channel(ABSENCES);
        let (news, breach_news) = mpsc::channel(NEWS);
        let breaches = Breaches::new(news);
        let conversation = Session::new(link, receiver, beat, readings, absent, breaches.clone());
        let task = tokio::spawn(conversation.run());
        let hello = RefCell::new(BoardHello::default());
        let absences = tokio::sync::Mutex::new(absences);
        let breach_news = tokio::sync::Mutex::new(breach_news);
        let next_request = Cell::new(1);
        let board = Self { commands, board_time, hello, next_request, task, tap, absences, breaches, breach_news };
        board.reopen(nonce).await?;
        Ok(board)
    }

    /// Opens a new session on the same link, after a restart of the board. Returns the board's boot id.
    ///
    /// # Errors
    /// As [`BoardClient::connect`].
    pub async fn reopen(&self, nonce: u32) -> Result<u32, BoardError> {
        let (answer, answered) = oneshot::channel();
        self.send(SessionCommand::Hello { nonce, answer }).await?;
        let hello = answered.await.map_err(|_| gone())??;
        let boot_id = hello.boot_id;
        self.hello.replace(hello);
        Ok(boot_id)
    }

    /// What the board said of itself in its HELLO.
    #[must_use]
    pub fn hello(&self) -> BoardHello {
        self.hello.borrow().clone()
    }

    /// Follows the board's clock, from the next heartbeat on.
    #[must_use]
    pub fn board_time(&self) -> Follower<BoardTime> {
        self.board_time.another()
    }

    /// The next absence of the port or interface, once it is over; `None` after the end of the conversation.
    pub async fn absence(&self) -> Option<LinkAbsence> {
        self.absences.lock().await.recv().await
    }

    /// Waits for the next rule of the interface document that the board breaks for the first time.
    pub async fn breach(&self) -> Breach {
        match self.breach_news.lock().await.recv().await {
            Some(breach) => breach,
            // This handle keeps the sender, so this never happens.
            None => std::future::pending().await,
        }
    }

    /// All that the board did against the interface document so far.
    #[must_use]
    pub fn breaches(&self) -> Vec<Breach> {
        self.breaches.all()
    }

    /// The newest breach that touches the values of one of these streams, after a number of refused values.
    #[must_use]
    pub fn broken_stream(&self, refusals: u64, streams: &[StreamId]) -> Option<BoardError> {
        self.breaches.touched_since(refusals, streams)
    }

    /// Keeps a breach that only the user of the board can see.
    pub fn broke(&self, rule: &'static Rule) {
        self.breaches.see(rule, Case::Plain);
    }

    /// Ends the conversation and says what the line was like.
    pub async fn close(self) -> LinkReport {
        let Self { commands, task, .. } = self;
        drop(commands);
        task.await.unwrap_or_default()
    }

    /// A number for the next request. Frames without a request have number 0.
    pub(crate) fn number(&self) -> u16 {
        let number = self.next_request.get();
        self.next_request.set(number.checked_add(1).unwrap_or(1));
        number
    }

    pub(crate) async fn send(&self, command: SessionCommand) -> Result<(), BoardError> {
        self.commands.send(command).await.map_err(|_| gone())
    }
}
