//! The codec plan against an oracle that works bit by bit, and against hand-written vectors.

#![allow(clippy::float_cmp)] // decoded values are exact

mod codec_oracle;

use codec_oracle::Oracle;
use proptest::prelude::*;
use tickbus::signal::{
    Area, ByteOrder, Conversions, DataType, Plan, Scale, Signal, SignalTable, Slot, Station,
};

const ORDERS: [ByteOrder; 4] = [
    ByteOrder::Abcd,
    ByteOrder::Cdab,
    ByteOrder::Badc,
    ByteOrder::Dcba,
];

const TYPES: [DataType; 15] = [
    DataType::Bool,
    DataType::Byte,
    DataType::Sint,
    DataType::Usint,
    DataType::Word,
    DataType::Int,
    DataType::Uint,
    DataType::Dword,
    DataType::Dint,
    DataType::Udint,
    DataType::Real,
    DataType::Lword,
    DataType::Lint,
    DataType::Ulint,
    DataType::Lreal,
];

fn signal(data_type: DataType, area: Area, byte: usize, bit: u8) -> Signal {
    Signal {
        bit,
        ..Signal::new(format!("{area:?} {byte}.{bit}"), area, byte, data_type)
    }
}

fn table(signals: Vec<Signal>, bytes: usize) -> SignalTable {
    let station = Station {
        name: String::new(),
        input_bytes: bytes,
        output_bytes: bytes,
        observed_bytes: 0,
    };
    SignalTable {
        stations: vec![station; 2],
        signals,
        structures: Vec::new(),
    }
}

/// Encodes one value of one signal that lies at byte 0.
fn encode_one(signal: Signal, slot: Slot) -> (Vec<u8>, Conversions) {
    let mut frame = vec![0xEE; codec_oracle::bits(signal.data_type).div_ceil(8)];
    let plan = Plan::new(&table(vec![signal], frame.len()), 0, Area::Input);
    let conversions = plan.encode(&[slot], &mut frame);
    (frame, conversions)
}

fn encoded(data_type: DataType, value: f64) -> (Vec<u8>, Conversions) {
    encode_one(signal(data_type, Area::Input, 0, 0), Slot::from_real(value))
}

fn decode_one(signal: Signal, frame: &[u8]) -> Slot {
    let area = signal.area;
    let plan = Plan::new(&table(vec![signal], frame.len()), 0, area);
    let mut slots = [Slot::default()];
    plan.decode(frame, &mut slots);
    slots[0]
}

const CLEAN: Conversions = Conversions {
    saturated: 0,
    not_a_number: 0,
};
const SATURATED: Conversions = Conversions {
    saturated: 1,
    not_a_number: 0,
};
const NOT_A_NUMBER: Conversions = Conversions {
    saturated: 0,
    not_a_number: 1,
};

/// The two bytes of a rig word with only bit n set, for n = 0 to 15, big-endian.
const WORD_BITS: [[u8; 2]; 16] = [
    [0x00, 0x01],
    [0x00, 0x02],
    [0x00, 0x04],
    [0x00, 0x08],
    [0x00, 0x10],
    [0x00, 0x20],
    [0x00, 0x40],
    [0x00, 0x80],
    [0x01, 0x00],
    [0x02, 0x00],
    [0x04, 0x00],
    [0x08, 0x00],
    [0x10, 0x00],
    [0x20, 0x00],
    [0x40, 0x00],
    [0x80, 0x00],
];

/// The used bits of the rig's command word (%QW0) and status word (%IW0).
const COMMAND_BITS: [u8; 13] = [0, 1, 2, 3, 4, 5, 7, 8, 10, 11, 12, 13, 15];
const STATUS_BITS: [u8; 11] = [0, 1, 2, 3, 4, 5, 11, 12, 13, 14, 15];

/// BOOL signals for the given bits of a WORD at byte 0.
fn word_bits(area: Area, bits: &[u8], big_endian: bool) -> SignalTable {
    let signals = bits.iter().map(|n| {
        let byte = if big_endian { 1 - n / 8 } else { n / 8 };
        signal(DataType::Bool, area, usize::from(byte), n % 8)
    });
    table(signals.collect(), 2)
}

#[test]
fn both_rig_words_bit_by_bit_in_both_orders() {
    let all: Vec<u8> = (0..16).collect();
    for (area, bits) in [
        (Area::Output, &COMMAND_BITS[..]),
        (Area::Input, &STATUS_BITS[..]),
        (Area::Output, &all[..]),
        (Area::Input, &all[..]),
    ] {
        for big_endian in [true, false] {
            let plan = Plan::new(&word_bits(area, bits, big_endian), 0, area);
            let order = if big_endian {
                ByteOrder::Abcd
            } else {
                ByteOrder::Dcba
            };
            let word = Signal {
                order,
                ..signal(DataType::Word, area, 0, 0)
            };
            for (position, bit) in bits.iter().enumerate() {
                let mut golden = WORD_BITS[usize::from(*bit)];
                if !big_endian {
                    golden.reverse();
                }
                let mut slots = vec![Slot::from_real(0.0); bits.len()];
                slots[position] = Slot::from_real(1.0);
                let mut frame = [0xFF; 2];
                assert_eq!(plan.encode(&slots, &mut frame), CLEAN);
                assert_eq!(frame, golden, "bit {bit}");

                let mut decoded = vec![Slot::from_real(7.0); bits.len()];
                plan.decode(&golden, &mut decoded);
                assert_eq!(decoded, slots, "bit {bit}");

                let value = decode_one(word.clone(), &golden).real();
                assert_eq!(value, f64::from(1_u32 << bit));
            }
        }
    }
}

#[test]
fn the_six_steps_of_the_rig() {
    let plan = Plan::new(
        &word_bits(Area::Output, &COMMAND_BITS, true),
        0,
        Area::Output,
    );
    for word in [0x0001_u16, 0x0024, 0x000C, 0x0080, 0x3C34, 0x343C] {
        let mut slots = [Slot::default(); 13];
        plan.decode(&word.to_be_bytes(), &mut slots);
        for (slot, bit) in slots.iter().zip(COMMAND_BITS) {
            assert_eq!(
                slot.real(),
                f64::from(word >> bit & 1),
                "{word:04X} bit {bit}"
            );
        }
        let mut frame = [0; 2];
        plan.encode(&slots, &mut frame);
        assert_eq!(frame, word.to_be_bytes());
    }
}

#[test]
fn byte_orders_by_letter() {
    for (order, four, eight) in [
        (ByteOrder::Abcd, [1, 2, 3, 4], [1, 2, 3, 4, 5, 6, 7, 8]),
        (ByteOrder::Cdab, [3, 4, 1, 2], [7, 8, 5, 6, 3, 4, 1, 2]),
        (ByteOrder::Badc, [2, 1, 4, 3], [2, 1, 4, 3, 6, 5, 8, 7]),
        (ByteOrder::Dcba, [4, 3, 2, 1], [8, 7, 6, 5, 4, 3, 2, 1]),
    ] {
        let dword = Signal {
            order,
            ..signal(DataType::Dword, Area::Input, 0, 0)
        };
        let value = Slot::from_real(f64::from(0x0102_0304));
        assert_eq!(encode_one(dword.clone(), value), (four.to_vec(), CLEAN));
        assert_eq!(decode_one(dword, &four), value);

        let lword = Signal {
            order,
            ..signal(DataType::Lword, Area::Input, 0, 0)
        };
        let value = Slot(0x0102_0304_0506_0708);
        assert_eq!(encode_one(lword.clone(), value), (eight.to_vec(), CLEAN));
        assert_eq!(decode_one(lword, &eight), value);
    }
    for (order, two) in [
        (ByteOrder::Abcd, [1, 2]),
        (ByteOrder::Cdab, [1, 2]),
        (ByteOrder::Badc, [2, 1]),
        (ByteOrder::Dcba, [2, 1]),
    ] {
        let int = Signal {
            order,
            ..signal(DataType::Int, Area::Input, 0, 0)
        };
        let value = Slot::from_real(258.0);
        assert_eq!(encode_one(int.clone(), value), (two.to_vec(), CLEAN));
        assert_eq!(decode_one(int, &two), value);
    }
}

#[test]
fn sixty_four_bit_integers_are_exact_at_their_ends() {
    for bits in [
        0,
        1,
        (1 << 53) + 1,
        i64::MAX.cast_unsigned(),
        i64::MIN.cast_unsigned(),
        i64::MIN.cast_unsigned() + 1,
        u64::MAX - 1,
        u64::MAX,
        f64::NAN.to_bits(),
    ] {
        for data_type in [DataType::Lword, DataType::Lint, DataType::Ulint] {
            let signal = signal(data_type, Area::Input, 0, 0);
            let (frame, conversions) = encode_one(signal.clone(), Slot(bits));
            assert_eq!((&frame[..], conversions), (&bits.to_be_bytes()[..], CLEAN));
            assert_eq!(decode_one(signal, &frame), Slot(bits));
        }
    }
}

#[test]
fn scaled_64_bit_integers_saturate_at_their_ends() {
    let scale = Some(Scale {
        gain: 1.0,
        offset: 0.0,
    });
    let encode = |data_type, value| {
        let signal = Signal {
            scale,
            ..signal(data_type, Area::Input, 0, 0)
        };
        let (frame, conversions) = encode_one(signal, Slot::from_real(value));
        let array: [u8; 8] = frame.try_into().expect("eight bytes");
        (i128::from(i64::from_be_bytes(array)), conversions)
    };
    let two_63 = 9_223_372_036_854_775_808.0;
    assert_eq!(
        encode(DataType::Lint, -two_63),
        (i128::from(i64::MIN), CLEAN)
    );
    assert_eq!(
        encode(DataType::Lint, -two_63 - 2048.0),
        (i128::from(i64::MIN), SATURATED)
    );
    assert_eq!(
        encode(DataType::Lint, two_63 - 1024.0),
        (i128::from(i64::MAX) - 1023, CLEAN)
    );
    assert_eq!(
        encode(DataType::Lint, two_63),
        (i128::from(i64::MAX), SATURATED)
    );
    assert_eq!(encode(DataType::Ulint, 2.0 * two_63), (-1, SATURATED));
    assert_eq!(
        encode(DataType::Ulint, 2.0 * two_63 - 2048.0),
        (-2048, CLEAN)
    );
    assert_eq!(encode(DataType::Ulint, -0.5), (0, SATURATED));
    assert_eq!(encode(DataType::Ulint, -0.25), (0, CLEAN));
}

#[test]
fn integers_round_half_away_from_zero_and_then_saturate() {
    for (value, word, conversions) in [
        (0.5, 1, CLEAN),
        (-0.5, -1, CLEAN),
        (0.499_999_999_999_999_94, 0, CLEAN),
        (-0.499_999_999_999_999_94, 0, CLEAN),
        (1.5, 2, CLEAN),
        (2.5, 3, CLEAN),
        (-2.5, -3, CLEAN),
        (32_767.499_999, 32_767, CLEAN),
        (32_767.5, 32_767, SATURATED),
        (-32_768.499_999, -32_768, CLEAN),
        (-32_768.5, -32_768, SATURATED),
        (1e300, 32_767, SATURATED),
        (f64::INFINITY, 32_767, SATURATED),
        (f64::NEG_INFINITY, -32_768, SATURATED),
        (f64::NAN, 0, NOT_A_NUMBER),
    ] {
        let expected = (i16::to_be_bytes(word).to_vec(), conversions);
        assert_eq!(encoded(DataType::Int, value), expected, "{value}");
    }
}

#[test]
fn reals_saturate_but_infinities_pass() {
    let real = |value: f32| value.to_be_bytes().to_vec();
    let max = f64::from(f32::MAX);
    for (value, bytes, conversions) in [
        (max, real(f32::MAX), CLEAN),
        (max.next_up(), real(f32::MAX), SATURATED),
        (-1e300, real(f32::MIN), SATURATED),
        (f64::INFINITY, real(f32::INFINITY), CLEAN),
        (f64::NEG_INFINITY, real(f32::NEG_INFINITY), CLEAN),
        (1e-300, real(0.0), CLEAN),
        (-0.0, real(-0.0), CLEAN),
        (f64::NAN, real(0.0), NOT_A_NUMBER),
    ] {
        assert_eq!(
            encoded(DataType::Real, value),
            (bytes, conversions),
            "{value}"
        );
    }
    let lreal = Signal {
        scale: Some(Scale {
            gain: 0.5,
            offset: 0.0,
        }),
        ..signal(DataType::Lreal, Area::Input, 0, 0)
    };
    for (value, number, conversions) in [
        (f64::MAX, f64::MAX, SATURATED),
        (f64::MIN, f64::MIN, SATURATED),
        (f64::NEG_INFINITY, f64::NEG_INFINITY, CLEAN),
        (3.0, 6.0, CLEAN),
    ] {
        let expected = (number.to_be_bytes().to_vec(), conversions);
        assert_eq!(encode_one(lreal.clone(), Slot::from_real(value)), expected);
    }
}

#[test]
fn nan_becomes_the_fail_safe_value() {
    let nan = Slot::from_real(f64::NAN);
    let int = Signal {
        scale: Some(Scale {
            gain: 0.01,
            offset: 5.0,
        }),
        fail_safe: Slot::from_real(7.5),
        ..signal(DataType::Int, Area::Input, 0, 0)
    };
    assert_eq!(encode_one(int, nan), (vec![0, 250], NOT_A_NUMBER));
    let high = Signal {
        fail_safe: Slot::from_real(1.0),
        ..signal(DataType::Bool, Area::Input, 0, 0)
    };
    assert_eq!(encode_one(high, nan), (vec![1], NOT_A_NUMBER));
    let real = Signal {
        fail_safe: nan,
        ..signal(DataType::Real, Area::Input, 0, 0)
    };
    assert_eq!(encode_one(real, nan), (vec![0; 4], NOT_A_NUMBER));
}

#[test]
fn any_number_but_zero_is_a_high_bool() {
    // Eight consecutive slots are encoded as a byte in one way, a single slot in another.
    let values = [-0.0, 1.0, 0.5, -1.0, f64::INFINITY, 5e-324, 2.0, f64::NAN];
    let signals = (0..8).map(|bit| Signal {
        fail_safe: Slot::from_real(1.0),
        ..signal(DataType::Bool, Area::Input, 0, bit)
    });
    let slots = values.map(Slot::from_real);
    let mut frame = [0];
    let plan = Plan::new(&table(signals.collect(), 1), 0, Area::Input);
    assert_eq!(plan.encode(&slots, &mut frame), NOT_A_NUMBER);
    assert_eq!(frame, [0b1111_1110]);
    for place in 0..8 {
        for value in [0.5, 0.25, 2_f64.powi(-1022), 1.5, 2.0, -1.0, 5e-324] {
            let mut slots = [Slot::from_real(0.0); 8];
            slots[place] = Slot::from_real(value);
            assert_eq!(plan.encode(&slots, &mut frame), CLEAN);
            assert_eq!(frame, [1 << place], "{value:e} at bit {place}");
        }
    }
    for (value, slot) in values.iter().zip(slots) {
        let (frame, _) = encode_one(signal(DataType::Bool, Area::Input, 0, 0), slot);
        assert_eq!(frame, [u8::from(!value.is_nan() && *value != 0.0)]);
    }
}

#[test]
fn raw_values_of_usual_scales_come_back() {
    for (data_type, raws, low, high) in [
        (DataType::Int, (0.0, 27_648.0), 0.0, 250.0),
        (DataType::Int, (0.0, 27_648.0), 4.0, 20.0),
        (DataType::Int, (0.0, 27_648.0), -273.15, 1_600.0),
        (DataType::Int, (-27_648.0, 27_648.0), -10.0, 10.0),
        (DataType::Int, (0.0, 10.0), 0.0, 1.0),
        (DataType::Int, (0.0, 27_648.0), 100.0, 0.0),
        (DataType::Uint, (0.0, 65_535.0), 0.0, 1.0),
        (DataType::Uint, (0.0, 27_648.0), 0.0, 1e-6),
        (DataType::Uint, (0.0, 27_648.0), 1e9, 1e9 + 1.0),
    ] {
        let gain = (high - low) / (raws.1 - raws.0);
        let signals = (0..65_536).map(|number| Signal {
            scale: Some(Scale {
                gain,
                offset: low - raws.0 * gain,
            }),
            ..signal(data_type, Area::Input, 2 * number, 0)
        });
        let plan = Plan::new(&table(signals.collect(), 131_072), 0, Area::Input);
        let frame: Vec<u8> = (0..=u16::MAX).flat_map(u16::to_be_bytes).collect();
        let mut slots = vec![Slot::default(); 65_536];
        plan.decode(&frame, &mut slots);
        let mut again = vec![0; frame.len()];
        assert_eq!(plan.encode(&slots, &mut again), CLEAN);
        assert!(again == frame, "{data_type:?} {raws:?} {low} {high}");
    }
}

#[test]
fn fail_safe_writes_only_the_slots_of_its_area_and_station() {
    let fail_safe = |area, station, byte, value| Signal {
        station,
        fail_safe: Slot::from_real(value),
        ..signal(DataType::Real, area, byte, 0)
    };
    let table = table(
        vec![
            fail_safe(Area::Input, 0, 0, 1.0),
            fail_safe(Area::Output, 0, 0, 2.0),
            fail_safe(Area::Output, 1, 0, 3.0),
            fail_safe(Area::Output, 0, 4, 4.0),
        ],
        8,
    );
    let mut slots = [Slot::from_real(9.0); 4];
    Plan::new(&table, 0, Area::Output).fail_safe(&mut slots);
    assert_eq!(slots.map(Slot::real), [9.0, 2.0, 9.0, 4.0]);
}

#[test]
fn bytes_beyond_the_station_stay_untouched() {
    let table = table(vec![signal(DataType::Byte, Area::Input, 1, 0)], 3);
    let mut frame = [0xEE; 5];
    Plan::new(&table, 0, Area::Input).encode(&[Slot::from_real(255.0)], &mut frame);
    assert_eq!(frame, [0, 0xFF, 0, 0xEE, 0xEE]);
}

#[test]
#[should_panic(expected = "the plan needs 1 slots and 3 frame bytes, but was given 1 and 2")]
fn a_short_frame_panics_before_anything_is_written() {
    let table = table(vec![signal(DataType::Byte, Area::Input, 1, 0)], 3);
    Plan::new(&table, 0, Area::Input).encode(&[Slot::default()], &mut [0; 2]);
}

/// Signals that are adjacent in the frame.
#[derive(Clone, Debug)]
struct Stretch {
    data_type: DataType,
    order: ByteOrder,
    area: Area,
    station: usize,
    scaled: bool,
    count: usize,
    /// Bytes, or bits of a BOOL stretch, left free before it.
    gap: usize,
}

fn stretch() -> impl Strategy<Value = Stretch> {
    let which = (
        prop::sample::select(&TYPES[..]),
        prop::sample::select(&ORDERS[..]),
        prop::sample::select(&[Area::Input, Area::Output][..]),
        prop::sample::select(&[0, 0, 0, 1][..]),
        any::<bool>(),
    );
    let size = (prop_oneof![3 => 1..6_usize, 1 => 1..80_usize], 0..4_usize);
    (which, size).prop_map(
        |((data_type, order, area, station, scaled), (count, gap))| Stretch {
            data_type,
            order,
            area,
            station,
            scaled: scaled && data_type != DataType::Bool,
            count,
            gap,
        },
    )
}

/// How the table orders the signals.
#[derive(Clone, Copy, Debug)]
enum Files {
    AsPlaced,
    Reversed,
    /// The first of each stretch, then the second of each, and so on.
    Interleaved,
    Shuffled,
}

fn scale() -> impl Strategy<Value = Scale> {
    prop_oneof![
        Just((250.0 / 27_648.0, 0.0)),
        Just((-0.1, 100.0)),
        Just((1.0, 0.0)),
        Just((1e-300, 0.0)),
        (-1e3..-1e-3, -1e4..1e4),
        (1e-3..1e3, -1e4..1e4),
    ]
    .prop_map(|(gain, offset)| Scale { gain, offset })
}

/// Values near all thresholds.
fn value() -> impl Strategy<Value = f64> {
    let powers = prop::sample::select(&[0, 7, 8, 15, 16, 31, 32, 52, 53, 63, 64, 127, 128][..]);
    let near_powers = (powers, -2..=2_i8, any::<bool>()).prop_map(|(power, halves, negative)| {
        let value = 2_f64.powi(power) + f64::from(halves) / 2.0;
        if negative { -value } else { value }
    });
    prop_oneof![
        4 => prop::sample::select(&[0.0, 1.0][..]),
        2 => -200.0..200.0_f64,
        2 => (-70_000..70_000_i32).prop_map(|halves| f64::from(halves) / 2.0),
        2 => near_powers,
        1 => any::<u64>().prop_map(f64::from_bits),
        1 => any::<u32>().prop_map(|bits| f64::from(f32::from_bits(bits))),
        1 => prop::sample::select(
            vec![f64::NAN, f64::INFINITY, f64::NEG_INFINITY, -0.0, f64::MAX, f64::from(f32::MAX).next_up()]
        ),
    ]
}

/// A slot for a signal of either kind.
fn slot(signal: &Signal) -> BoxedStrategy<Slot> {
    if codec_oracle::is_integer_slot(signal) {
        prop_oneof![
            any::<u64>(),
            prop::sample::select(&[0, u64::MAX, 1 << 63, (1 << 63) - 1][..])
        ]
        .prop_map(Slot)
        .boxed()
    } else {
        value().prop_map(Slot::from_real).boxed()
    }
}

/// Places the stretches one after another in the frames of their area and station.
fn placed(stretches: &[Stretch], scales: &[Scale]) -> SignalTable {
    let mut bit_positions = [[0_usize; 2]; 2];
    let mut scales = scales.iter().cycle();
    let mut signals = Vec::new();
    for stretch in stretches {
        let area = usize::from(stretch.area == Area::Output);
        let position = &mut bit_positions[stretch.station][area];
        let bits = codec_oracle::bits(stretch.data_type);
        *position = if bits == 1 {
            *position + stretch.gap
        } else {
            (position.div_ceil(8) + stretch.gap) * 8
        };
        for _ in 0..stretch.count {
            let bit = u8::try_from(*position % 8).expect("below 8");
            signals.push(Signal {
                station: stretch.station,
                order: stretch.order,
                scale: scales.next().filter(|_| stretch.scaled).copied(),
                ..signal(stretch.data_type, stretch.area, *position / 8, bit)
            });
            *position += bits;
        }
    }
    let bytes = |station: usize, area: usize| bit_positions[station][area].div_ceil(8) + station;
    let station = |station| Station {
        name: format!("station {station}"),
        input_bytes: bytes(station, 0),
        output_bytes: bytes(station, 1),
        observed_bytes: 0,
    };
    SignalTable {
        stations: vec![station(0), station(1)],
        signals,
        structures: Vec::new(),
    }
}

/// A table, a slot for each of its signals, and a seed for frame bytes.
fn device() -> impl Strategy<Value = (SignalTable, Vec<Slot>, u64)> {
    let stretches = prop::collection::vec(stretch(), 1..8);
    let scales = prop::collection::vec(scale(), 1..8);
    let files = prop::sample::select(
        &[
            Files::AsPlaced,
            Files::AsPlaced,
            Files::Reversed,
            Files::Interleaved,
            Files::Shuffled,
        ][..],
    );
    (stretches, scales, files)
        .prop_flat_map(|(stretches, scales, files)| {
            let mut table = placed(&stretches, &scales);
            match files {
                Files::AsPlaced | Files::Shuffled => {}
                Files::Reversed => table.signals.reverse(),
                Files::Interleaved => {
                    let ranks = stretches.iter().flat_map(|stretch| 0..stretch.count);
                    let mut ranked: Vec<_> = ranks.zip(table.signals).collect();
                    ranked.sort_by_key(|(rank, _)| *rank);
                    table.signals = ranked.into_iter().map(|(_, signal)| signal).collect();
                }
            }
            let signals = Just(table.signals.clone());
            let signals = match files {
                Files::Shuffled => signals.prop_shuffle().boxed(),
                _ => signals.boxed(),
            };
            (Just(table), signals)
        })
        .prop_flat_map(|(table, signals)| {
            let slots: Vec<_> = signals.iter().map(slot).collect();
            let fail_safes = slots.clone();
            (Just((table, signals)), fail_safes, slots, any::<u64>())
        })
        .prop_map(|((mut table, signals), fail_safes, slots, seed)| {
            table.signals = signals;
            for (signal, fail_safe) in table.signals.iter_mut().zip(fail_safes) {
                signal.fail_safe = fail_safe;
            }
            (table, slots, seed)
        })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(192))]

    #[test]
    fn encodes_and_decodes_like_the_oracle((table, slots, seed) in device()) {
        for station in 0..2 {
            for area in [Area::Input, Area::Output] {
                let plan = Plan::new(&table, station, area);
                let oracle = Oracle::new(&table, station, area);
                let mut frame: Vec<u8> = codec_oracle::noise(seed).take(oracle.bytes()).collect();

                let mut decoded = slots.clone();
                plan.decode(&frame, &mut decoded);
                let mut expected = slots.clone();
                oracle.decode(&frame, &mut expected);
                prop_assert_eq!(&decoded, &expected);

                let conversions = plan.encode(&slots, &mut frame);
                let (expected_frame, expected_conversions) = oracle.encode(&slots);
                prop_assert_eq!(&frame, &expected_frame);
                prop_assert_eq!(conversions, expected_conversions);

                let mut fail_safe = slots.clone();
                plan.fail_safe(&mut fail_safe);
                for (number, signal) in table.signals.iter().enumerate() {
                    let ours = signal.station == station && signal.area == area;
                    let expected = if ours { signal.fail_safe } else { slots[number] };
                    prop_assert_eq!(fail_safe[number], expected);
                }
            }
        }
    }
}
