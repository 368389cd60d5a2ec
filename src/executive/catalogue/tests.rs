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
                Kind::Number(dimension) => assert_eq!(measurement.unit.dimension(), dimension, "{item} {name}"),
                Kind::Text => assert_eq!(measurement.unit, Unit::Count),
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

/// Items work with what others find before them in the table, so that its order is one in which they can run.
#[test]
fn needs_stand_before() {
    let position = |item: ItemId| ItemId::ALL.iter().position(|other| *other == item);
    for item in ItemId::ALL {
        for (need, when) in item.needs() {
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
        for switches in [ItemId::BiasRepeatability, ItemId::Identity] {
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

#[test]
fn counts_of_measurements_are_those_of_the_specification() {
    let counts: Vec<usize> = ItemId::ALL.iter().map(|item| item.spec().measurements.len()).collect();
    // identity 7, cpu 2 x 4, timers 3 x (4 x 3 + 1), memories 5 + 2, flashes 5 and 4, imu 17, the rate and three kinds of
    // bad samples, gnss 21, ad 5 x 2 + 1 + 3, io 3, spi 3, sci 6, can 8: its seven and what the host's adapter saw.
    assert_eq!(counts[..14], [7, 8, 39, 7, 7, 5, 4, 17 + 4, 21, 14, 3, 3, 6, 8]);
    // six-position 3 biases, 3 scales, 6 couplings, 3 angles, 3; gyro-still 3 + 9 + 3; rotation 3 + 6 + 3 + 3 + 3 + 2;
    // biases 5 and 4; stability and repeatability 6 + 2 each; coupling 2 x (6 + 3); resolution 6 + 3; allan 18; psd 12;
    // and of each that captures samples how far their rate is off true time and three kinds of bad ones.
    let of_figures = [18, 15, 20, 5, 4, 8, 8, 8, 18, 9, 18, 12, 13, 14];
    assert_eq!(counts[14..28], of_figures.map(|figures| figures + 4));
    // The receiver's accuracy with the board's clock; the download; the check.
    assert_eq!(counts[28..], [9, 4, 8 + 4]);
}
