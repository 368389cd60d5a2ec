//! AD channels 4-8 through their DIP switches, and the magnetometer on channels 1-3.

mod switches;

use gnc_executive::catalogue::sensors::{MAG_SPAN, MAG_Z};
use gnc_executive::plan::Params;
use gnc_executive::quantity::Unit;
use gnc_protocol::message::AdRead;

use super::{ProcedureContext, ProcedureError, Recorder};

/// Output of the analogue magnetometer without a field, and its change for each gauss.
const MAG_ZERO_V: f64 = gnc_protocol::analogue::MAG_ZERO_V;
const MAG_V_PER_GAUSS: f64 = gnc_protocol::analogue::MAG_V_PER_GAUSS;

pub(super) async fn run(
    bench: &ProcedureContext<'_>,
    params: &Params,
    recorder: &Recorder<'_>,
) -> Result<(), ProcedureError> {
    let samples = u16::try_from(params.integer("samples")?).unwrap_or(u16::MAX);
    switches::run(bench, samples, recorder).await?;
    magnetometer(bench, samples, params.integer("headings")?, recorder).await
}

/// The horizontal field turns once round the module, so that X and Y sweep twice its strength and Z stays.
async fn magnetometer(
    bench: &ProcedureContext<'_>,
    samples: u16,
    headings: i64,
    recorder: &Recorder<'_>,
) -> Result<(), ProcedureError> {
    let mut fields_gauss = Vec::new();
    for step in 0..headings {
        bench.fixture.turn_to(360.0 * step as f64 / headings as f64, recorder).await?;
        let volts = read(bench, samples).await?;
        fields_gauss.push([0, 1, 2].map(|axis| (volts[axis] - MAG_ZERO_V) / MAG_V_PER_GAUSS));
    }
    bench.fixture.turn_to(0.0, recorder).await?;
    let span = |axis: usize| {
        let values = fields_gauss.iter().map(|field| field[axis]);
        values.clone().fold(f64::NEG_INFINITY, f64::max) - values.fold(f64::INFINITY, f64::min)
    };
    recorder.number(&MAG_SPAN[0], span(0), Unit::Gauss).await?;
    recorder.number(&MAG_SPAN[1], span(1), Unit::Gauss).await?;
    let z: Vec<f64> = fields_gauss.iter().map(|field| field[2]).collect();
    Ok(recorder.number(&MAG_Z, gnc_metrology::stats::mean(&z), Unit::Gauss).await?)
}

/// All eight channels, in volts.
async fn read(bench: &ProcedureContext<'_>, samples: u16) -> Result<[f64; 8], ProcedureError> {
    let reply = bench.board.call(&AdRead { channels: 0xff, samples }).await?;
    let mut volts = [f64::NAN; 8];
    for channel in &reply.channels {
        let index = usize::from(channel.channel).wrapping_sub(1);
        let Some(volt) = volts.get_mut(index) else {
            return Err(ProcedureError::Nonsense {
                what: "AdRead",
                why: format!("there is no channel {}", channel.channel),
            });
        };
        *volt = f64::from(channel.mean_uv) * 1e-6;
    }
    if let Some(missing) = volts.iter().position(|volt| volt.is_nan()) {
        return Err(ProcedureError::Nonsense { what: "AdRead", why: format!("channel {} is missing", missing + 1) });
    }
    Ok(volts)
}
