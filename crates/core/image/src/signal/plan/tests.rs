//! Numbers against a model: one signal at a time, rounded by the definition, and cut.

use super::*;
use number::half_away_from_zero;

/// The bounds of an integer type as doubles, and its bytes, the most significant one first.
struct Whole {
    data_type: DataType,
    bounds: [f64; 2],
    bytes: fn(f64) -> Vec<u8>,
}

macro_rules! whole {
    ($data_type:ident, $int:ident) => {
        Whole {
            data_type: DataType::$data_type,
            bounds: [f64::from($int::MIN), f64::from($int::MAX)],
            #[allow(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "it was rounded and clamped before"
            )]
            bytes: |value| (value as $int).to_be_bytes().into(),
        }
    };
}

fn wholes() -> [Whole; 6] {
    [
        whole!(Sint, i8),
        whole!(Usint, u8),
        whole!(Int, i16),
        whole!(Uint, u16),
        whole!(Dint, i32),
        whole!(Udint, u32),
    ]
}

/// Values around every bound, and at every distance from it that could be rounded to it.
fn values([low, high]: [f64; 2]) -> Vec<f64> {
    let mut values = vec![0.0, 1.0, -1.0, 0.5, -0.5, 1.5, 1e300, -1e300];
    values.extend([f64::INFINITY, f64::NEG_INFINITY]);
    for bound in [low, high] {
        for by in [0.0, 0.25, 0.5, 0.75, 1.0] {
            values.extend([bound - by, bound + by]);
            values.extend([(bound + by).next_down(), (bound - by).next_up()]);
        }
    }
    values
}

/// One signal of this type per value, and this many unused bytes after every third one.
fn table(data_type: DataType, scale: Option<Scale>, count: usize, gap: usize) -> SignalTable {
    let size = data_type.size_bytes();
    let signals = (0..count).map(|at| Signal {
        scale,
        ..Signal::new(
            format!("{at}"),
            Area::Input,
            at * size + at / 3 * gap,
            data_type,
        )
    });
    SignalTable::of_one_station(count * (size + gap), 0, signals.collect())
}

/// Encodes `values`; returns the bytes of each signal, and the conversions.
fn encoded(table: &SignalTable, values: &[f64]) -> (Vec<Vec<u8>>, Conversions) {
    let slots: Vec<_> = values.iter().map(|value| Slot::from_real(*value)).collect();
    let mut frame = vec![0xAA; table.stations[0].input_bytes];
    let conversions = Plan::new(table, 0, Area::Input).encode(&slots, &mut frame);
    let bytes = table.signals.iter().map(|signal| {
        let size = signal.data_type.size_bytes();
        frame[signal.byte..][..size].to_vec()
    });
    (bytes.collect(), conversions)
}

#[test]
fn integers_are_rounded_half_away_from_zero_and_cut_at_their_bounds_wherever_they_stand() {
    for Whole {
        data_type,
        bounds,
        bytes,
    } in wholes()
    {
        let values = values(bounds);
        let (expected, saturated): (Vec<_>, Vec<_>) = values
            .iter()
            .map(|value| {
                let rounded = half_away_from_zero(*value);
                let cut = rounded.clamp(bounds[0], bounds[1]);
                (bytes(cut), (cut - rounded).abs() > 0.0)
            })
            .unzip();
        let saturated = saturated.into_iter().filter(|is_cut| *is_cut).count();
        for gap in [0, 1, 4] {
            let table = table(data_type, None, values.len(), gap);
            let (found, conversions) = encoded(&table, &values);
            assert_eq!(found, expected, "{data_type:?} {gap}");
            assert_eq!(conversions.saturated as usize, saturated, "{data_type:?}");
        }
    }
}

#[test]
fn signals_in_turn_with_unused_bytes_between_them_keep_their_places() {
    for gap in 0..4 {
        let signals = (0..8_usize)
            .map(|at| Signal::new(format!("{at}"), Area::Input, at * (2 + gap), DataType::Uint));
        let table = SignalTable::of_one_station(8 * (2 + gap), 0, signals.collect());
        let values = [1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0];
        let (found, _) = encoded(&table, &values);
        let expected: Vec<_> = (1..=8).map(|value| vec![0, value]).collect();
        assert_eq!(found, expected, "{gap}");
    }
}

#[test]
fn a_real_is_infinite_only_if_its_value_is() {
    let tiny = Scale {
        gain: 1e-300,
        offset: 0.0,
    };
    let (infinity, most) = (f32::INFINITY, f32::MAX);
    for (scale, value, expected, saturated) in [
        (None, f64::INFINITY, infinity, 0),
        (None, f64::NEG_INFINITY, -infinity, 0),
        (None, 1e300, most, 1),
        (Some(tiny), f64::INFINITY, infinity, 0),
        // Exceeds the doubles only once it is scaled.
        (Some(tiny), 1e300, most, 1),
        (Some(tiny), -1e300, -most, 1),
    ] {
        let (found, conversions) = encoded(&table(DataType::Real, scale, 1, 0), &[value]);
        assert_eq!(found, [expected.to_be_bytes()], "{value:e}");
        assert_eq!(conversions.saturated, saturated, "{value:e}");
    }
}
