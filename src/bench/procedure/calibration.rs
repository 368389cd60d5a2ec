//! Items of calibration and performance. They capture samples, and their results come from the captures alone.

use gnc_analysis::capture::Capture;
use gnc_analysis::figures::{self, AnalysisInput, Findings};
use gnc_analysis::motion;
use gnc_executive::catalogue::ItemId;
use gnc_executive::plan::Params;

use super::{ProcedureContext, ProcedureError, Recorder, capturing};

pub(super) async fn run(
    item: ItemId,
    bench: &ProcedureContext<'_>,
    params: &Params,
    recorder: &Recorder<'_>,
) -> Result<(), ProcedureError> {
    let captures = captures(item, bench, params, recorder).await?;
    let findings = analyse(item, bench, params, captures, recorder).await?;
    Ok(recorder.found(findings).await?)
}

/// Works out the figures on a separate thread. The conversation with the board goes on meanwhile, since the board's
/// watchdog waits only two seconds. If the figures are refused, the shares of bad samples are filed first: a module
/// whose chip gives bad samples fails by its limit, and the refusal stands beside it.
pub(super) async fn analyse(
    item: ItemId,
    bench: &ProcedureContext<'_>,
    params: &Params,
    captures: Vec<Capture>,
    recorder: &Recorder<'_>,
) -> Result<Findings, ProcedureError> {
    let (params, site, earlier) = (params.clone(), bench.site.cloned(), bench.earlier.clone());
    let worked_out = tokio::task::spawn_blocking(move || {
        let question = AnalysisInput { params: &params, site: site.as_ref(), captures: &captures, earlier: &earlier };
        figures::analyse(item, &question).map_err(|refused| (figures::integrity(item, &question), refused))
    });
    match worked_out.await {
        Ok(Ok(found)) => Ok(found),
        Ok(Err((integrity, refused))) => {
            recorder.values(&integrity).await?;
            Err(refused.into())
        }
        Err(_) => Err(ProcedureError::Analysis {
            why: "the analysis stopped unexpectedly, by a fault of this program".into(),
        }),
    }
}

/// The captures of the item itself, or those of the item that its parameters name.
async fn captures(
    item: ItemId,
    bench: &ProcedureContext<'_>,
    params: &Params,
    recorder: &Recorder<'_>,
) -> Result<Vec<Capture>, ProcedureError> {
    match motion::program(item, params)? {
        Some(program) => {
            recorder.note(&program.to_string()).await?;
            capturing::run(&program, bench, recorder).await
        }
        None => match params.source("of")? {
            Some(other) => Ok(recorder.captures_of(other).await?),
            None => Err(ProcedureError::CannotRun { item, why: "this version has no procedure for it" }),
        },
    }
}
