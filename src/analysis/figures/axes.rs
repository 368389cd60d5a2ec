//! Couplings and angles of a triad in three frames: the axes of the table, of the module's seat, and the module's own.
//!
//! A calibration uses attitudes of the table. The seat (the socket's reference faces) is mounted on the table with a
//! small rotation `C`, so that `M_table = M_seat C`. A coupling is relative to one of these frames. The angles between
//! the sensors' own axes do not depend on the frame.

use gnc_executive::bench::BenchImperfections;
use gnc_executive::catalogue::calibration::{COUPLINGS, NONORTHOGONALITY};
use gnc_executive::catalogue::{COUPLED_PAIRS, SENSOR_PAIRS};
use gnc_executive::quantity::Unit;
use gnc_metrology::triad::{coupling, nonorthogonality_rad};
use nalgebra::{Matrix3, Rotation3, Vector3};

use super::Findings;
use super::budget::Budget;
use super::json::rows;
use crate::details::{self, FRAMES};

/// A triad's response relative to the axes of the table, and the mounting of the seat.
pub(super) struct TriadFrames<'r> {
    /// Rows are sensors, columns axes of the table.
    pub(super) response: &'r Matrix3<f64>,
    pub(super) fixture: BenchImperfections,
}

impl TriadFrames<'_> {
    /// The response relative to the axes of the seat. Without a measured mounting it equals the response relative to
    /// the table.
    fn in_seat(&self) -> Matrix3<f64> {
        let mounting = Vector3::from(self.fixture.mounting_rad.unwrap_or_default());
        self.response * Rotation3::from_scaled_axis(mounting).inverse()
    }

    /// Adds the couplings relative to the seat, the angles between the sensors' axes (both in ppm), and a detail that
    /// names the frames. `budget` is that of `M_ij / M_ii` relative to the table.
    pub(super) fn report(&self, findings: &mut Findings, budget: impl Fn(usize, usize) -> Budget, probability: f64) {
        let seated = coupling(&self.in_seat());
        for ((i, j), measurement) in COUPLED_PAIRS.into_iter().zip(&COUPLINGS) {
            let of_seat = budget(i, j).b("mounting of the seat", self.fixture.mounting_u_rad, "rad", 1e6);
            findings.figure(measurement, seated[(i, j)] * 1e6, &of_seat, probability);
        }
        let angles_rad = nonorthogonality_rad(self.response);
        for (k, (i, j)) in SENSOR_PAIRS.into_iter().enumerate() {
            findings.figure(
                &NONORTHOGONALITY[k],
                angles_rad[k] * 1e6,
                &of_angle(&budget(i, j), &budget(j, i)),
                probability,
            );
        }
        let measured = self.fixture.mounting_rad;
        let label = if measured.is_some() {
            "the mounting of the seat is that of the bench file; coefficients are relative to the table"
        } else {
            "the mounting of the seat was not measured and counts as zero; coefficients are relative to the table"
        };
        let frames = details::AxesDetails {
            coupling_to_table: rows(&coupling(self.response)),
            coupling_to_seat: rows(&seated),
            nonorthogonality_rad: angles_rad.into(),
            mounting_deg: measured.map(|mounting| mounting.map(f64::to_degrees)),
            mounting_u_deg: self.fixture.mounting_u_rad.to_degrees(),
            label: label.to_owned(),
        };
        findings.part(&FRAMES, frames);
    }
}

/// The budget of an angle. To first order the angle between two sensors' axes is the sum of both couplings; the
/// mounting cancels.
pub(super) fn of_angle(one: &Budget, other: &Budget) -> Budget {
    let [(one, one_dof), (other, other_dof)] = [one.combined(), other.combined()];
    Budget::new(Unit::PartsPerMillion).a("coupling of one", one, one_dof).a("of the other", other, other_dof)
}
