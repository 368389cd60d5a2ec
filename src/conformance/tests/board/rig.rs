//! A simulated board and the checks in one task, on one clock that moves when both wait.

use std::time::Duration;

use gnc_conformance::{CheckOptions, Ended, run};
use gnc_link::can::{CanLink, MemoryEnd};
use gnc_link::memory::MemoryPort;
use gnc_link::{Link, Target};
use hw_mocks::{BenchOptions, Personality, SimulatedBench, Speed};
use tokio::io::{AsyncReadExt as _, AsyncWriteExt as _, DuplexStream};
use tokio::sync::watch;
use tokio::time::{Instant, sleep_until};

/// Least step of the clock between two looks of the bench.
const LOOK: Duration = Duration::from_micros(100);

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Wire {
    Rs422,
    Can,
}

pub(crate) struct Rig {
    options: BenchOptions,
}

impl Rig {
    pub(crate) fn new(personality: &str) -> Self {
        let personality = Personality::from_toml("test", personality).unwrap();
        let options = BenchOptions { personality, speed: Speed::Times(1.0), seed: 13, ..BenchOptions::default() };
        println!("seed {}", options.seed);
        Self { options }
    }

    pub(crate) fn check(&self, wire: Wire, only: Option<&str>) -> Ended {
        let runtime = tokio::runtime::Builder::new_current_thread().enable_all().start_paused(true).build().unwrap();
        runtime.block_on(async {
            let began = Instant::now();
            let (_stop, stopped) = watch::channel(false);
            let mut bench = SimulatedBench::new(&self.options);
            let rate_bps = if wire == Wire::Can { 500_000 } else { self.options.rate_baud };
            let options = CheckOptions { rate_bps, nonce: 77, only: only.map(str::to_owned) };
            let mut tell = |_: gnc_conformance::CheckEvent<'_>| {};
            let ended = match wire {
                Wire::Rs422 => {
                    let port = MemoryPort::new("port", self.options.rate_baud);
                    let end = port.plug_in();
                    let link = Link::open(&Target::Memory(port)).unwrap();
                    tokio::select! {
                        biased;
                        ended = run(link, &options, stopped, &mut tell) => ended,
                        () = serve(&mut bench, end) => unreachable!(),
                    }
                }
                Wire::Can => {
                    let (link, end) = CanLink::in_memory();
                    tokio::select! {
                        biased;
                        ended = run(Link::Can(Box::new(link)), &options, stopped, &mut tell) => ended,
                        () = serve_can(&mut bench, end) => unreachable!(),
                    }
                }
            };
            println!("{:.1} s of link time", began.elapsed().as_secs_f64());
            ended.unwrap()
        })
    }
}

async fn serve(bench: &mut SimulatedBench, mut end: DuplexStream) {
    let began = Instant::now();
    let mut buffer = [0; 4096];
    loop {
        let now = began.elapsed();
        bench.advance(now);
        let bytes = bench.output(now).to_vec();
        if !bytes.is_empty() {
            end.write_all(&bytes).await.unwrap();
            bench.consume(bytes.len());
        }
        let due = began + bench.next_due(now).max(now + LOOK);
        tokio::select! {
            biased;
            count = end.read(&mut buffer) => {
                bench.receive(&buffer[..count.unwrap()], began.elapsed());
            }
            () = sleep_until(due) => {}
        }
    }
}

async fn serve_can(bench: &mut SimulatedBench, mut end: MemoryEnd) {
    let began = Instant::now();
    loop {
        let now = began.elapsed();
        bench.advance(now);
        while let Some(frame) = bench.output_can() {
            end.to_host.send(frame).await.unwrap();
        }
        let due = began + bench.next_due(now).max(now + LOOK);
        tokio::select! {
            biased;
            Some(frame) = end.from_host.recv() => bench.receive_can(frame, began.elapsed()),
            () = sleep_until(due) => {}
        }
    }
}
