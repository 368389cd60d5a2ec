//! Gyroscopes and accelerometers of a module at rest and level, at nominal scale.

use std::time::Duration;

use gnc_executive::plan::Params;
use gnc_executive::quantity::Unit;
use gnc_protocol::message::StreamStart;
use gnc_protocol::stream::{ACCEL_LSB_PER_G, GYRO_LSB_PER_DPS, ImuSample, SATURATION, StreamId};
use gnc_protocol::wire::{Reader, Wire as _};

use super::{Bench, Report, Trouble};
use crate::board::stream::Closed;
use crate::figures;
use crate::statistics::{mean, standard_deviation};

const AXES: [&str; 3] = ["x", "y", "z"];

pub(super) async fn run(bench: &Bench<'_>, params: &Params, report: &Report<'_>) -> Result<(), Trouble> {
    let wanted = u32::try_from(params.integer("samples")?).unwrap_or(u32::MAX);
    let rate_hz = params.quantity("rate", Unit::Hertz)?.round() as u16;
    let (samples, bad) = figures::sound_at_rest(&capture(bench, rate_hz, wanted).await?);

    let gyro = AXES.map(|axis| format!("gyro_{axis}"));
    let accel = AXES.map(|axis| format!("accel_{axis}"));
    let channel = |pick: &dyn Fn(&ImuSample) -> i32| samples.iter().map(|sample| f64::from(pick(sample))).collect();
    let mut faults = Faults::default();
    let mut squares = 0.0;
    for (axis, name) in gyro.iter().enumerate() {
        let counts: Vec<f64> = channel(&|sample| sample.gyro[axis]);
        faults.look_at(name, &counts);
        report.number(name, mean(&counts) / GYRO_LSB_PER_DPS, Unit::DegreePerSecond).await?;
        let noise_dps = standard_deviation(&counts) / GYRO_LSB_PER_DPS;
        report.number(&format!("{name}_noise"), noise_dps, Unit::DegreePerSecond).await?;
    }
    for (axis, name) in accel.iter().enumerate() {
        let counts: Vec<f64> = channel(&|sample| sample.accel[axis]);
        faults.look_at(name, &counts);
        let force_g = mean(&counts) / ACCEL_LSB_PER_G;
        squares += force_g * force_g;
        report.number(name, force_g, Unit::Gravity).await?;
        let noise_mg = standard_deviation(&counts) / ACCEL_LSB_PER_G * 1e3;
        report.number(&format!("{name}_noise"), noise_mg, Unit::Milligravity).await?;
    }
    report.number("accel_norm", squares.sqrt(), Unit::Gravity).await?;
    let gyro_temperature: Vec<f64> = channel(&|sample| sample.gyro_temperature.into());
    let accel_temperature: Vec<f64> = channel(&|sample| sample.accel_temperature.into());
    report.number("gyro_temperature", mean(&gyro_temperature) * 0.01, Unit::DegreeCelsius).await?;
    report.number("accel_temperature", mean(&accel_temperature) * 0.01, Unit::DegreeCelsius).await?;
    report.text("stuck_channels", &list(&faults.stuck)).await?;
    report.text("saturated_channels", &list(&faults.saturated)).await?;
    for (name, share) in figures::INTEGRITY.into_iter().zip(bad) {
        report.number(name, share, Unit::Percent).await?;
    }
    Ok(())
}

/// Captures so many samples without a gap.
async fn capture(bench: &Bench<'_>, rate_hz: u16, wanted: u32) -> Result<Vec<ImuSample>, Trouble> {
    let mut stream = bench.board.listen(StreamId::Imu).await?;
    let start = StreamStart { stream: StreamId::Imu as u8, rate_hz, count: wanted, samples_per_frame: 0 };
    bench.board.call(&start).await?;
    let mut samples = Vec::with_capacity(wanted as usize);
    while let Some(frame) = stream.next().await? {
        let mut reader = Reader::new(&frame.samples);
        for _ in 0..frame.head.count {
            let sample = ImuSample::get(&mut reader)
                .map_err(|error| Trouble::Nonsense { what: "the IMU stream", why: error.to_string() })?;
            samples.push(sample);
        }
        bench.board.captured(samples.len() as u32, wanted, rate_hz);
        if frame.head.first.saturating_add(frame.head.count.into()) >= wanted {
            break;
        }
    }
    bench.board.spent(Duration::from_secs_f64(f64::from(wanted) / f64::from(rate_hz.max(1))));
    let Closed { losses, .. } = bench.board.stop_stream(stream).await?;
    if samples.len() as u32 == wanted && !losses.any() {
        return Ok(samples);
    }
    Err(Trouble::SamplesLost { wanted, losses })
}

/// Channels that no longer measure.
#[derive(Debug, Default)]
struct Faults {
    stuck: Vec<String>,
    saturated: Vec<String>,
}

impl Faults {
    fn look_at(&mut self, name: &str, counts: &[f64]) {
        let rail = f64::from(SATURATION);
        if counts.iter().any(|count| count.abs() >= rail) {
            self.saturated.push(name.to_owned());
        } else if counts.windows(2).all(|pair| pair[0] == pair[1]) {
            // At 20,000 counts for one deg/s the noise of a live channel moves every sample.
            self.stuck.push(name.to_owned());
        }
    }
}

fn list(names: &[String]) -> String {
    if names.is_empty() { "none".to_owned() } else { names.join(" ") }
}
