//! Gyroscopes and accelerometers of a module at rest and level, at nominal scale.

use std::time::Duration;

use gnc_analysis::capture::Timing;
use gnc_analysis::figures;
use gnc_analysis::figures::clock::sample_rate_error;
use gnc_board::stream::Closed;
use gnc_executive::catalogue::sensors::{
    ACCEL, ACCEL_NOISE, ACCEL_NORM, ACCEL_TEMPERATURE, GYRO, GYRO_NOISE, GYRO_TEMPERATURE, SATURATED_CHANNELS,
    STUCK_CHANNELS,
};
use gnc_executive::catalogue::{FAILED_READS, SAMPLE_RATE, SPIKES, STALE_SAMPLES};
use gnc_executive::plan::Params;
use gnc_executive::quantity::Unit;
use gnc_metrology::stats::{mean, mean_sd};
use gnc_protocol::message::StreamStart;
use gnc_protocol::stream::{ACCEL_LSB_PER_G, GYRO_LSB_PER_DPS, ImuSample, SATURATION, StreamId};
use gnc_protocol::wire::{FieldReader, Wire as _};

use super::sampling::{ClockWatch, samples_per_frame};
use super::{ProcedureContext, ProcedureError, Recorder};

pub(super) async fn run(
    bench: &ProcedureContext<'_>,
    params: &Params,
    recorder: &Recorder<'_>,
) -> Result<(), ProcedureError> {
    let wanted = u32::try_from(params.integer("samples")?).unwrap_or(u32::MAX);
    let rate_hz = params.quantity("rate", Unit::Hertz)?.round() as u16;
    let (samples, timing) = capture(bench, rate_hz, wanted).await?;
    let (samples, bad) = figures::sound_at_rest(&samples);

    let channel = |pick: &dyn Fn(&ImuSample) -> i32| samples.iter().map(|sample| f64::from(pick(sample))).collect();
    let mut faults = Faults::default();
    let mut squares = 0.0;
    for (axis, (rate, noise)) in GYRO.iter().zip(&GYRO_NOISE).enumerate() {
        let counts: Vec<f64> = channel(&|sample| sample.gyro[axis]);
        faults.look_at(rate.name, &counts);
        let (mean, sd) = mean_sd(&counts);
        recorder.number(rate, mean / GYRO_LSB_PER_DPS, Unit::DegreePerSecond).await?;
        recorder.number(noise, sd / GYRO_LSB_PER_DPS, Unit::DegreePerSecond).await?;
    }
    for (axis, (force, noise)) in ACCEL.iter().zip(&ACCEL_NOISE).enumerate() {
        let counts: Vec<f64> = channel(&|sample| sample.accel[axis]);
        faults.look_at(force.name, &counts);
        let (mean, sd) = mean_sd(&counts);
        let force_g = mean / ACCEL_LSB_PER_G;
        squares += force_g * force_g;
        recorder.number(force, force_g, Unit::Gravity).await?;
        recorder.number(noise, sd / ACCEL_LSB_PER_G * 1e3, Unit::Milligravity).await?;
    }
    recorder.number(&ACCEL_NORM, squares.sqrt(), Unit::Gravity).await?;
    let gyro_temperature: Vec<f64> = channel(&|sample| sample.gyro_temperature.into());
    let accel_temperature: Vec<f64> = channel(&|sample| sample.accel_temperature.into());
    recorder.number(&GYRO_TEMPERATURE, mean(&gyro_temperature) * 0.01, Unit::DegreeCelsius).await?;
    recorder.number(&ACCEL_TEMPERATURE, mean(&accel_temperature) * 0.01, Unit::DegreeCelsius).await?;
    recorder.text(&STUCK_CHANNELS, &list(&faults.stuck)).await?;
    recorder.text(&SATURATED_CHANNELS, &list(&faults.saturated)).await?;
    let rate_error = sample_rate_error(&bench.earlier, std::iter::once(&timing.host), 0.95);
    recorder.value(&SAMPLE_RATE, &rate_error).await?;
    for (measurement, share) in [&FAILED_READS, &STALE_SAMPLES, &SPIKES].into_iter().zip(bad) {
        recorder.number(measurement, share, Unit::Percent).await?;
    }
    Ok(())
}

/// Captures this many samples without a gap, on the grid of the board's clock.
async fn capture(
    bench: &ProcedureContext<'_>,
    rate_hz: u16,
    wanted: u32,
) -> Result<(Vec<ImuSample>, Timing), ProcedureError> {
    let mut stream = bench.board.listen(StreamId::Imu).await?;
    let samples_per_frame = samples_per_frame(wanted);
    let start = StreamStart { stream: StreamId::Imu as u8, rate_hz, count: wanted, samples_per_frame };
    bench.board.call(&start).await?;
    let mut samples = Vec::with_capacity(wanted as usize);
    let mut clock = ClockWatch::new(rate_hz, bench);
    let mut fault = None;
    while let Some(frame) = stream.next().await? {
        let mut reader = FieldReader::new(&frame.samples);
        for _ in 0..frame.head.count {
            let sample = ImuSample::get(&mut reader)
                .map_err(|error| ProcedureError::Nonsense { what: "the IMU stream", why: error.to_string() })?;
            samples.push(sample);
        }
        // Losses of the line are reported first.
        fault = fault.or(clock.frame(&frame.head, frame.head.count.into()).err());
        bench.board.captured(samples.len() as u32, wanted, rate_hz);
        if frame.head.first.saturating_add(frame.head.count.into()) >= wanted {
            break;
        }
    }
    bench.board.spent(Duration::from_secs_f64(f64::from(wanted) / f64::from(rate_hz.max(1))));
    let Closed { losses, .. } = bench.board.stop_stream(stream).await?;
    if samples.len() as u32 != wanted || losses.any() {
        return Err(ProcedureError::SamplesLost { wanted, losses });
    }
    let timing = match fault {
        Some(fault) => Err(fault),
        None => clock.end(),
    };
    let timing = timing.map_err(|fault| ProcedureError::Clock { what: "the IMU stream".into(), fault })?;
    Ok((samples, timing))
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
