//! The codec plan on the tick path: the rig's 16 bits, 1,000 REALs against a hand-written loop, the
//! slope per signal, and layouts that the dense loops do not fit.
//!
//! Pin it to one core: `taskset -c 1 cargo bench --bench codec`.

use std::hint::black_box;

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use tickbus::signal::{Area, DataType, Plan, Scale, Signal, SignalTable, Slot};

/// How the signals of the two areas are ordered in the table.
#[derive(Clone, Copy)]
enum Files {
    /// All `%I`, then all `%Q`.
    AreaByArea,
    /// %I and %Q alternate.
    Interleaved,
}

/// Plans for both directions, and the data that they move.
struct Device {
    inputs: Plan,
    outputs: Plan,
    slots: Vec<Slot>,
    input_frame: Vec<u8>,
    output_frame: Vec<u8>,
}

impl Device {
    /// `count` signals in each direction, with types by position.
    fn new(
        count: usize,
        files: Files,
        scale: Option<Scale>,
        data_type: impl Fn(usize) -> DataType,
    ) -> Self {
        let mut byte = 0;
        let mut bit = 0;
        let mut places = Vec::new();
        for number in 0..count {
            let data_type = data_type(number);
            places.push((byte, bit, data_type));
            match data_type {
                DataType::Bool if bit < 7 => bit += 1,
                DataType::Bool => (byte, bit) = (byte + 1, 0),
                DataType::Int => byte += 2,
                DataType::Real => byte += 4,
                other => unreachable!("no bench uses {other:?}"),
            }
        }
        let bytes = byte + usize::from(bit > 0);
        let signal = |area, (byte, bit, data_type)| Signal {
            bit,
            scale: scale.filter(|_| data_type != DataType::Bool),
            ..Signal::new(format!("{area:?} {byte}.{bit}"), area, byte, data_type)
        };
        let signals: Vec<Signal> = match files {
            Files::AreaByArea => [Area::Input, Area::Output]
                .iter()
                .flat_map(|area| places.iter().map(|place| signal(*area, *place)))
                .collect(),
            Files::Interleaved => (places.iter())
                .flat_map(|place| [Area::Input, Area::Output].map(|area| signal(area, *place)))
                .collect(),
        };
        let values = [0.0, 1.0, 1.0, 0.0, 1.0];
        let slots = (values.iter().cycle().take(signals.len()))
            .map(|value| Slot::from_real(*value))
            .collect();
        let table = SignalTable::of_one_station(bytes, bytes, signals);
        Self {
            inputs: Plan::new(&table, 0, Area::Input),
            outputs: Plan::new(&table, 0, Area::Output),
            slots,
            input_frame: vec![0; bytes],
            output_frame: (0..bytes)
                .map(|byte| [0x3F, 0x9D, 0x70, 0xA4][byte % 4])
                .collect(),
        }
    }

    /// One tick's conversions: encode all `%I`, decode all `%Q`.
    fn exchange(&mut self) {
        let slots = black_box(&mut self.slots[..]);
        black_box(self.inputs.encode(slots, black_box(&mut self.input_frame)));
        self.outputs.decode(black_box(&self.output_frame), slots);
        black_box(slots);
    }
}

/// Hand-written code for `count` consecutive REALs in each direction and nothing else.
fn exchange_by_hand(slots: &mut [Slot], input_frame: &mut [u8], output_frame: &[u8]) {
    let (inputs, outputs) = slots.split_at_mut(input_frame.len() / 4);
    for (slot, bytes) in inputs.iter().zip(input_frame.chunks_exact_mut(4)) {
        #[allow(clippy::cast_possible_truncation)]
        bytes.copy_from_slice(&(slot.real() as f32).to_be_bytes());
    }
    for (slot, bytes) in outputs.iter_mut().zip(output_frame.chunks_exact(4)) {
        let bytes = [bytes[0], bytes[1], bytes[2], bytes[3]];
        *slot = Slot::from_real(f64::from(f32::from_be_bytes(bytes)));
    }
}

fn rig(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("rig");
    for (name, files) in [
        ("16+16 BOOL", Files::AreaByArea),
        ("16+16 BOOL, interleaved", Files::Interleaved),
    ] {
        let mut device = Device::new(16, files, None, |_| DataType::Bool);
        group.bench_function(name, |bencher| bencher.iter(|| device.exchange()));
    }
    group.finish();
}

fn reals(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("1000 REAL each way");
    let real = |_| DataType::Real;
    let mut device = Device::new(1000, Files::AreaByArea, None, real);
    group.bench_function("hand-written", |bencher| {
        bencher.iter(|| {
            let slots = black_box(&mut device.slots[..]);
            let input_frame = black_box(&mut device.input_frame[..]);
            exchange_by_hand(slots, input_frame, black_box(&device.output_frame));
        });
    });
    group.bench_function("plan", |bencher| bencher.iter(|| device.exchange()));
    let mut device = Device::new(1000, Files::Interleaved, None, real);
    group.bench_function("plan, interleaved", |bencher| {
        bencher.iter(|| device.exchange());
    });
    let mut device = Device::new(1000, Files::AreaByArea, None, real);
    device.slots[500] = Slot::from_real(f64::NAN);
    group.bench_function("plan, one NaN", |bencher| {
        bencher.iter(|| device.exchange());
    });
    group.finish();
}

fn mixed(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("1000 each way");
    let scale = Scale {
        gain: 250.0 / 27648.0,
        offset: 0.0,
    };
    let scaled_ints = |files| Device::new(1000, files, Some(scale), |_| DataType::Int);
    let by_turns = |number| [DataType::Int, DataType::Real][number % 2];
    for (name, mut device) in [
        ("scaled INT", scaled_ints(Files::AreaByArea)),
        ("scaled INT, interleaved", scaled_ints(Files::Interleaved)),
        (
            "INT and REAL by turns",
            Device::new(1000, Files::AreaByArea, None, by_turns),
        ),
        (
            "BOOL",
            Device::new(1000, Files::AreaByArea, None, |_| DataType::Bool),
        ),
        (
            "BOOL, interleaved",
            Device::new(1000, Files::Interleaved, None, |_| DataType::Bool),
        ),
    ] {
        group.bench_function(name, |bencher| bencher.iter(|| device.exchange()));
    }
    group.finish();
}

fn slope(criterion: &mut Criterion) {
    for (name, files) in [
        ("slope, REAL", Files::AreaByArea),
        ("slope, REAL interleaved", Files::Interleaved),
    ] {
        let mut group = criterion.benchmark_group(name);
        for count in [10, 100, 1_000, 10_000] {
            let mut device = Device::new(count, files, None, |_| DataType::Real);
            group.throughput(Throughput::Elements(2 * count as u64));
            group.bench_function(BenchmarkId::from_parameter(count), |bencher| {
                bencher.iter(|| device.exchange());
            });
        }
        group.finish();
    }
}

criterion_group!(benches, rig, reals, mixed, slope);
criterion_main!(benches);
