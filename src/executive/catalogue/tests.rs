use std::collections::BTreeSet;

use super::*;

#[test]
fn the_table_is_consistent() {
    for item in ItemId::ALL {
        let spec = item.spec();
        assert_eq!(ItemId::from_id(item.as_str()), Some(item));
        assert_eq!(serde_json::to_string(&item).unwrap(), format!("\"{item}\""));
        assert!(spec.timeout_s > 0.0);
        assert!(spec.devices.contains(&Device::Slave), "{item}");
        let names: BTreeSet<&str> = spec.measurements.iter().map(|measurement| measurement.name).collect();
        assert_eq!(names.len(), spec.measurements.len(), "{item} has a measurement twice");
        for measurement in spec.measurements {
            let name = measurement.name;
            assert!(name.bytes().all(|b| b.is_ascii_lowercase() || b.is_ascii_digit() || b == b'_'), "{name}");
            assert!(measurement.look_at.ends_with('.'), "{item} {name}: not a sentence");
            match measurement.kind {
                MeasurementKind::Number(dimension) => {
                    assert_eq!(measurement.unit.dimension(), dimension, "{item} {name}");
                }
                MeasurementKind::Text => assert_eq!(measurement.unit, Unit::Count),
            }
            match measurement.when {
                None => {}
                Some(When::HasInteger { param, element }) => match &spec.param(param).unwrap().kind {
                    ParamKind::Integers { min, max, .. } => assert!((*min..=*max).contains(&element)),
                    other => panic!("{item} {name}: {param} is {other:?}"),
                },
                Some(When::HasText { param, element }) => match &spec.param(param).unwrap().kind {
                    ParamKind::Choices { of, .. } => assert!(of.contains(&element)),
                    other => panic!("{item} {name}: {param} is {other:?}"),
                },
            }
        }
        for param in spec.params {
            match param.kind {
                ParamKind::Integer { min, max, default } => assert!((min..=max).contains(&default)),
                ParamKind::Integers { min, max, default } => {
                    assert!(!default.is_empty() && default.iter().all(|value| (min..=max).contains(value)));
                }
                ParamKind::Quantity { min, max, default, .. } => assert!((min..=max).contains(&default)),
                ParamKind::Choice { of, default } => assert!(of.contains(&default)),
                ParamKind::Choices { of, default } => {
                    assert!(!default.is_empty() && default.iter().all(|text| of.contains(text)));
                }
                ParamKind::Source { of } => assert!(!of.is_empty()),
            }
        }
    }
}

/// Items use results of items before them in the table, so they can run in the order of the table.
#[test]
fn needs_stand_before() {
    let position = |item: ItemId| ItemId::ALL.iter().position(|other| *other == item);
    for item in ItemId::ALL {
        for (need, when) in item.spec().needs {
            assert!(position(*need) < position(item), "{item} needs {need}");
            if let Some(When::HasText { param, element }) = when {
                let Some(ParamKind::Choices { of, .. }) = item.spec().param(param).map(|param| &param.kind) else {
                    panic!("{item} has no choices {param}");
                };
                assert!(of.contains(element));
            }
        }
    }
}

#[test]
fn power_cycles_exclude_everything() {
    for item in ItemId::ALL {
        for switches in [ItemId::BiasRepeatability, ItemId::Identity, ItemId::PowerCycle] {
            assert!(switches.excludes(item) && item.excludes(switches), "{item}");
        }
    }
    assert!(!ItemId::GyroBias.excludes(ItemId::Gnss));
}

#[test]
fn shared_pins_and_motion_exclude() {
    assert!(ItemId::Io.excludes(ItemId::Spi));
    assert!(ItemId::Ad.excludes(ItemId::Imu));
    assert!(ItemId::Imu.excludes(ItemId::Ad));
    assert!(!ItemId::Gnss.excludes(ItemId::Sdram));
    assert!(!Resource::Still.excludes(Resource::Still));
}

/// Programs find a figure of a matrix by the indices of its row and column.
#[test]
fn indices_and_names_of_a_figure_agree() {
    use calibration::{COUPLINGS, G_SENSITIVITY, NONORTHOGONALITY};
    use repeated::{COUPLINGS_LEFT, NONORTHOGONALITY_LEFT};
    let axes = ["x", "y", "z"];
    let agree = |measurement: &MeasurementSpec, kind: &str, (i, j): (usize, usize)| {
        assert_eq!(measurement.name, format!("{kind}_{}{}", axes[i], axes[j]));
    };
    for (k, pair) in COUPLED_PAIRS.into_iter().enumerate() {
        agree(&COUPLINGS[k], "coupling", pair);
        agree(&COUPLINGS_LEFT.gyro[k], "coupling_gyro", pair);
        agree(&COUPLINGS_LEFT.accel[k], "coupling_accel", pair);
    }
    for (k, pair) in SENSOR_PAIRS.into_iter().enumerate() {
        agree(&NONORTHOGONALITY[k], "nonorthogonality", pair);
        agree(&NONORTHOGONALITY_LEFT.gyro[k], "nonorthogonality_gyro", pair);
        agree(&NONORTHOGONALITY_LEFT.accel[k], "nonorthogonality_accel", pair);
    }
    for (i, row) in G_SENSITIVITY.iter().enumerate() {
        for (j, measurement) in row.iter().enumerate() {
            agree(measurement, "g_sensitivity", (i, j));
        }
    }
}

#[test]
fn the_stored_page_is_the_generated_one() {
    let stored = include_str!("../../../docs/items.md");
    assert!(stored == page(), "run: cargo run -q -p gnc-executive --example items > docs/items.md");
}

#[test]
fn counts_of_measurements_are_those_of_the_specification() {
    let of_specification = [
        (ItemId::Identity, 7),
        (ItemId::Cpu, 2 * 4),
        (ItemId::Timers, 3 * (4 * 3 + 1)),
        // Five patterns, two other measurements, and what the mismatches have in common.
        (ItemId::InternalRam, 5 + 2 + 1),
        (ItemId::Sdram, 5 + 2 + 1),
        (ItemId::SpiFlash, 5),
        (ItemId::InternalFlash, 4),
        (ItemId::Imu, 17 + OF_SAMPLES),
        (ItemId::Gnss, 21),
        (ItemId::Ad, 5 * 2 + 1 + 3),
        (ItemId::Io, 3),
        (ItemId::Spi, 3),
        (ItemId::Sci, 6),
        // Seven measurements of the item, and one of the host's adapter.
        (ItemId::Can, 7 + 1),
        // Biases, scales, couplings, angles.
        (ItemId::SixPosition, 3 + 3 + 6 + 3 + 3 + OF_SAMPLES),
        (ItemId::GyroStill, 3 + 9 + 3 + OF_SAMPLES),
        (ItemId::Rotation, 3 + 6 + 3 + 3 + 3 + 2 + OF_SAMPLES),
        (ItemId::GyroBias, 5 + OF_SAMPLES),
        (ItemId::AccelBias, 4 + OF_SAMPLES),
        (ItemId::BiasStability, 6 + 2 + OF_SAMPLES),
        (ItemId::BiasRepeatability, 6 + 2 + OF_SAMPLES),
        (ItemId::ScaleFactorRepeatability, 6 + 2 + OF_SAMPLES),
        (ItemId::CrossCoupling, 2 * (6 + 3) + OF_SAMPLES),
        (ItemId::Resolution, 6 + 3 + OF_SAMPLES),
        (ItemId::Allan, 18 + OF_SAMPLES),
        (ItemId::Psd, 12 + OF_SAMPLES),
        (ItemId::MagnetometerEllipse, 13 + OF_SAMPLES),
        (ItemId::MagnetometerEllipsoid, 14 + OF_SAMPLES),
        // The error of the board's clock is one of them.
        (ItemId::GnssAccuracy, 9),
        (ItemId::CalibrationDownload, 4),
        (ItemId::CalibrationCheck, 8 + OF_SAMPLES),
    ];
    for (item, count) in of_specification {
        assert_eq!(item.spec().measurements.len(), count, "{item}");
    }
}

/// Measurements of every item that captures samples: the error of their rate, and three kinds of bad samples.
const OF_SAMPLES: usize = 4;
