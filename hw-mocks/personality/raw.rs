//! The file as written, before anything is checked.

use std::collections::BTreeMap;

use serde::Deserialize;
use toml::Spanned;

use super::Expectation;

#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(super) struct Personality {
    pub(super) description: String,
    pub(super) expect: BTreeMap<String, Expectation>,
    pub(super) module: Module,
    pub(super) board: Board,
    pub(super) sampling: Sampling,
    pub(super) supply: Supply,
    pub(super) start: Start,
    pub(super) rails: Rails,
    pub(super) cpu: Cpu,
    pub(super) timers: Timers,
    pub(super) internal_ram: Memory,
    pub(super) sdram: Memory,
    pub(super) spi_flash: Flash,
    pub(super) internal_flash: Flash,
    pub(super) gyro: Triad,
    pub(super) accel: Triad,
    pub(super) mag: Triad,
    pub(super) imu: Imu,
    pub(super) vibration: Vec<Vibration>,
    pub(super) calibration: Calibration,
    pub(super) gnss: Gnss,
    pub(super) ad: Ad,
    pub(super) io: Io,
    pub(super) spi: Spi,
    pub(super) sci: Sci,
    pub(super) can: Can,
    pub(super) wire: Wire,
    pub(super) can_wire: CanWire,
    pub(super) turntable: Turntable,
    pub(super) reboot: Option<Reboot>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(super) struct Module {
    pub(super) serial_number: Option<Spanned<String>>,
    pub(super) part: Option<Spanned<String>>,
    pub(super) hardware: Option<Spanned<String>>,
    pub(super) firmware: Option<Spanned<String>>,
    pub(super) protocol: Option<Spanned<u32>>,
    pub(super) swapped_after: Option<Spanned<u32>>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(super) struct Board {
    pub(super) serial: Option<Spanned<String>>,
    pub(super) firmware: Option<Spanned<String>>,
    pub(super) clock_error_ppm: Option<Spanned<f64>>,
    pub(super) clock_drift_ppm_per_h: Option<Spanned<f64>>,
    pub(super) caches_identity: bool,
}

#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(super) struct Sampling {
    pub(super) rate_error_ppm: Option<Spanned<f64>>,
    pub(super) counted_times: bool,
    pub(super) time_step: Option<TimeStep>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct TimeStep {
    pub(super) at_s: Spanned<f64>,
    pub(super) for_s: Spanned<f64>,
    pub(super) step_us: Spanned<f64>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(super) struct Supply {
    pub(super) voltage_v: Option<Spanned<f64>>,
    pub(super) current_a: Option<Spanned<f64>>,
    pub(super) off_voltage_v: Option<Spanned<f64>>,
    pub(super) off_current_a: Option<Spanned<f64>>,
    pub(super) meter_holds: bool,
}

#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(super) struct Start {
    pub(super) late_every: Option<Spanned<u32>>,
    pub(super) late_ms: Option<Spanned<f64>>,
    pub(super) hangs_every: Option<Spanned<u32>>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(super) struct Rails {
    pub(super) v5_v: Option<Spanned<f64>>,
    pub(super) v3v3_v: Option<Spanned<f64>>,
    pub(super) v1v2_v: Option<Spanned<f64>>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(super) struct Cpu {
    pub(super) dead_cores: Vec<Spanned<u32>>,
    pub(super) multiplier_bit_of_core_2: Option<Spanned<u32>>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(super) struct Timers {
    pub(super) rate_error_ppm: Option<Spanned<f64>>,
    pub(super) jitter_ns: Option<Spanned<f64>>,
    pub(super) miss_every: Option<Spanned<u32>>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(super) struct Memory {
    pub(super) stuck_data_line: Option<StuckLine>,
    pub(super) stuck_address_line: Option<StuckLine>,
    pub(super) shorted_address_lines: Option<[Spanned<u32>; 2]>,
    pub(super) stuck_cells: Vec<Cell>,
    pub(super) coupled_cells: Vec<Coupling>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct StuckLine {
    pub(super) line: Spanned<u32>,
    pub(super) level: Spanned<u32>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Cell {
    pub(super) index: Spanned<u32>,
    pub(super) bit: Spanned<u32>,
    pub(super) level: Spanned<u32>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Coupling {
    pub(super) aggressor: Spanned<u32>,
    pub(super) victim: Spanned<u32>,
    pub(super) bit: Spanned<u32>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(super) struct Flash {
    pub(super) bad_bits: Vec<BadBit>,
    pub(super) erase_factor: Option<Spanned<f64>>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct BadBit {
    pub(super) sector: Spanned<u32>,
    pub(super) word: Spanned<u32>,
    pub(super) bit: Spanned<u32>,
    pub(super) level: Spanned<u32>,
}

/// A number for all three axes, or one for each.
#[derive(Debug, Clone, Copy)]
pub(super) struct PerAxis(pub(super) [f64; 3]);

impl<'de> Deserialize<'de> for PerAxis {
    fn deserialize<D: serde::Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        // By hand, since an untagged enum loses the place in the file.
        struct Numbers;
        impl<'de> serde::de::Visitor<'de> for Numbers {
            type Value = PerAxis;
            fn expecting(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                f.write_str("a number, or three for X, Y and Z")
            }
            fn visit_f64<E>(self, value: f64) -> Result<PerAxis, E> {
                Ok(PerAxis([value; 3]))
            }
            fn visit_i64<E>(self, value: i64) -> Result<PerAxis, E> {
                Ok(PerAxis([value as f64; 3]))
            }
            fn visit_seq<A: serde::de::SeqAccess<'de>>(self, sequence: A) -> Result<PerAxis, A::Error> {
                <[f64; 3]>::deserialize(serde::de::value::SeqAccessDeserializer::new(sequence)).map(PerAxis)
            }
        }
        deserializer.deserialize_any(Numbers)
    }
}

/// Three sensors. Units: gyro deg/s with what belongs to the bias in deg/h; accel g with that in mg; mag gauss.
#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(super) struct Triad {
    #[serde(alias = "bias_stability_dph", alias = "bias_stability_mg")]
    pub(super) bias_stability: Option<Spanned<PerAxis>>,
    #[serde(alias = "bias_repeatability_dph", alias = "bias_repeatability_mg")]
    pub(super) bias_repeatability: Option<Spanned<PerAxis>>,
    #[serde(alias = "turn_on_dph", alias = "turn_on_mg")]
    pub(super) turn_on: Option<Spanned<PerAxis>>,
    #[serde(alias = "flicker_dph", alias = "flicker_mg")]
    pub(super) flicker: Option<Spanned<PerAxis>>,
    #[serde(alias = "drift_dph_per_h", alias = "drift_mg_per_h")]
    pub(super) drift: Option<Spanned<PerAxis>>,
    #[serde(alias = "wander_dph", alias = "wander_mg")]
    pub(super) wander: Option<Spanned<PerAxis>>,
    pub(super) wander_s: Option<Spanned<f64>>,
    pub(super) scale_turn_on: Option<Spanned<PerAxis>>,
    pub(super) coupling_turn_on: Option<Spanned<f64>>,
    #[serde(alias = "deadband_dps", alias = "deadband_g", alias = "deadband_gauss")]
    pub(super) deadband: Option<Spanned<PerAxis>>,
    #[serde(alias = "step_dps", alias = "step_g", alias = "step_gauss")]
    pub(super) step: Option<Spanned<PerAxis>>,
    #[serde(alias = "range_dps", alias = "range_g", alias = "range_gauss")]
    pub(super) range: Option<Spanned<PerAxis>>,
    pub(super) response: Option<[[Spanned<f64>; 3]; 3]>,
    pub(super) y_skew_us: Option<Spanned<f64>>,
    pub(super) stuck_axes: Vec<Spanned<String>>,
    pub(super) dead_axes: Vec<Spanned<String>>,
    pub(super) swapped_axes: Option<[Spanned<String>; 2]>,
    pub(super) noise_factor: Option<Spanned<f64>>,
    #[serde(alias = "offset_dps", alias = "offset_g", alias = "offset_gauss")]
    pub(super) offset: Option<[Spanned<f64>; 3]>,
    pub(super) bandwidth_hz: Option<Spanned<f64>>,
    pub(super) bandwidth_order: Option<Spanned<u32>>,
    pub(super) update_rate_hz: Option<Spanned<f64>>,
    pub(super) noise_per_k: Option<Spanned<PerAxis>>,
    #[serde(alias = "clip_low_dps", alias = "clip_low_g", alias = "clip_low_gauss")]
    pub(super) clip_low: Option<Spanned<PerAxis>>,
    #[serde(alias = "clip_high_dps", alias = "clip_high_g", alias = "clip_high_gauss")]
    pub(super) clip_high: Option<Spanned<PerAxis>>,
    pub(super) spikes: Option<Spikes>,
    pub(super) failed_reads: Option<FailedReads>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Spikes {
    pub(super) share: Spanned<f64>,
    #[serde(alias = "size_dps", alias = "size_g", alias = "size_gauss")]
    pub(super) size: Spanned<f64>,
    pub(super) axis: Option<Spanned<String>>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct FailedReads {
    pub(super) share: Spanned<f64>,
    pub(super) code: Spanned<i32>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(super) struct Imu {
    pub(super) failed_reads: Option<FailedReads>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Vibration {
    pub(super) frequency_hz: Spanned<f64>,
    pub(super) rate_dps: Option<[Spanned<f64>; 3]>,
    pub(super) force_g: Option<[Spanned<f64>; 3]>,
    pub(super) field_gauss: Option<[Spanned<f64>; 3]>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(super) struct Calibration {
    pub(super) lost_bit: Option<LostBit>,
    pub(super) transposed: bool,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct LostBit {
    pub(super) byte: Spanned<u32>,
    pub(super) bit: Spanned<u32>,
    #[serde(default)]
    pub(super) after_power_cycle: bool,
}

#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(super) struct Gnss {
    pub(super) no_sky: bool,
    pub(super) repeater_north_m: Option<Spanned<f64>>,
    pub(super) repeater_east_m: Option<Spanned<f64>>,
    pub(super) covered_after_fix_s: Option<Spanned<f64>>,
    pub(super) pps_open: bool,
    pub(super) pps_jitter_ns: Option<Spanned<f64>>,
    pub(super) playback: Option<Spanned<String>>,
    pub(super) playback_hz: Option<Spanned<f64>>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(super) struct Ad {
    pub(super) unwired_switches: Vec<Spanned<u32>>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(super) struct Io {
    pub(super) shorted: Vec<[Spanned<u32>; 2]>,
    pub(super) open: Vec<Spanned<u32>>,
    pub(super) stuck: Vec<StuckLine>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(super) struct Spi {
    pub(super) flip_every_bits: Option<Spanned<u32>>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(super) struct Sci {
    pub(super) lose_every: Option<Spanned<u32>>,
    pub(super) flip_every: Option<Spanned<u32>>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(super) struct Can {
    pub(super) flip_every: Option<Spanned<u32>>,
    pub(super) swap_every: Option<Spanned<u32>>,
    pub(super) tx_error_every: Option<Spanned<u32>>,
    pub(super) bus_off_after: Option<Spanned<u32>>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(super) struct Turntable {
    pub(super) axis_error_arcsec: Option<[Spanned<f64>; 2]>,
    pub(super) heading_error_arcsec: Option<Spanned<f64>>,
    pub(super) mounting_deg: Option<[Spanned<f64>; 3]>,
    pub(super) attitude_error_arcsec: Option<Spanned<f64>>,
    pub(super) repeatability_arcsec: Option<Spanned<f64>>,
    pub(super) angle_error_ppm: Option<Spanned<f64>>,
    pub(super) angle_error_arcsec: Option<Spanned<f64>>,
    pub(super) rate_error_ppm: Option<Spanned<f64>>,
    pub(super) wobble_arcsec: Option<Spanned<f64>>,
    pub(super) field_mgauss: Option<[Spanned<f64>; 3]>,
    pub(super) field_swing_ppm: Option<Spanned<f64>>,
    pub(super) lever_arm_mm: Option<[Spanned<f64>; 3]>,
    pub(super) slew_s: Option<Spanned<f64>>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(super) struct Wire {
    pub(super) both: Along,
    pub(super) to_host: Option<Along>,
    pub(super) to_board: Option<Along>,
    pub(super) can_lose_every: Option<Spanned<u32>>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(super) struct Along {
    pub(super) lost_bytes_per_million: Option<Spanned<f64>>,
    pub(super) lost_byte_at: Option<Spanned<u32>>,
    pub(super) flipped_bits_per_million: Option<Spanned<f64>>,
    pub(super) lost_frames_per_million: Option<Spanned<f64>>,
    pub(super) cut_frames_per_million: Option<Spanned<f64>>,
    pub(super) doubled_frames_per_million: Option<Spanned<f64>>,
    pub(super) overtaken_frames_per_million: Option<Spanned<f64>>,
    pub(super) delayed_frames_per_million: Option<Spanned<f64>>,
    pub(super) delay_ms: Option<Spanned<f64>>,
    pub(super) stalled_frames_per_million: Option<Spanned<f64>>,
    pub(super) stall_ms: Option<Spanned<f64>>,
    pub(super) babbled_frames_per_million: Option<Spanned<f64>>,
    pub(super) echoed_frames_per_million: Option<Spanned<f64>>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(super) struct CanWire {
    pub(super) both: CanDirection,
    pub(super) to_host: Option<CanDirection>,
    pub(super) to_board: Option<CanDirection>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(super) struct CanDirection {
    pub(super) lost_frames_per_million: Option<Spanned<f64>>,
    pub(super) lost_bursts_per_million: Option<Spanned<f64>>,
    pub(super) flipped_frames_per_million: Option<Spanned<f64>>,
    pub(super) doubled_frames_per_million: Option<Spanned<f64>>,
    pub(super) overtaken_frames_per_million: Option<Spanned<f64>>,
    pub(super) delayed_frames_per_million: Option<Spanned<f64>>,
    pub(super) delay_ms: Option<Spanned<f64>>,
    pub(super) stalled_frames_per_million: Option<Spanned<f64>>,
    pub(super) stall_ms: Option<Spanned<f64>>,
    pub(super) babbled_frames_per_million: Option<Spanned<f64>>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(super) struct Reboot {
    pub(super) on: Option<Spanned<String>>,
    pub(super) nth: Option<Spanned<u32>>,
    pub(super) after_ms: Option<Spanned<f64>>,
    pub(super) at_board_time_s: Option<Spanned<f64>>,
}
