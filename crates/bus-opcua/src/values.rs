//! Converts between frames of the image and OPC UA values.

use opcua::types::{DataTypeId, Variant, VariantScalarTypeId};

use tickbus_image::signal::{Area, DataType, Plan, Signal, SignalTable, Slot, Width};

/// The signals of one area of all stations, as OPC UA values.
///
/// The value on the wire is the raw one in the frame, without its scale.
#[derive(Debug)]
pub(super) struct Values {
    /// One plan per station.
    plans: Vec<Plan>,
    /// The bits of each signal of the table, as unsigned numbers.
    bits: Vec<Slot>,
    /// The indices of the area's signals in the table, by station.
    signals: Vec<Vec<usize>>,
}

impl Values {
    /// The values of `area`.
    pub(super) fn new(table: &SignalTable, area: Area) -> Self {
        let table = bits_of(table);
        let stations = 0..table.stations.len();
        let here = |station| {
            let signals = table.signals.iter().enumerate();
            let here =
                signals.filter(move |(_, signal)| signal.station == station && signal.area == area);
            here.map(|(index, _)| index).collect()
        };
        Self {
            plans: stations
                .clone()
                .map(|station| Plan::new(&table, station, area))
                .collect(),
            bits: vec![Slot::default(); table.signals.len()],
            signals: stations.map(here).collect(),
        }
    }

    /// The area's signals of a station, as indices in the table.
    pub(super) fn signals(&self, station: usize) -> &[usize] {
        &self.signals[station]
    }

    /// Reads the values of a frame.
    pub(super) fn take(&mut self, station: usize, frame: &[u8]) {
        self.plans[station].decode(frame, &mut self.bits);
    }

    /// Writes the values to a frame; bits that no signal covers become zero.
    pub(super) fn give(&self, station: usize, frame: &mut [u8]) {
        self.plans[station].encode(&self.bits, frame);
    }

    /// The bits of a signal.
    pub(super) fn bits(&self, signal: usize) -> Slot {
        self.bits[signal]
    }

    /// Sets the bits of a signal.
    pub(super) fn set(&mut self, signal: usize, bits: Slot) {
        self.bits[signal] = bits;
    }
}

/// The table with every signal as an unsigned integer of the same size: so a plan preserves the bits of all
/// types, NaN included.
fn bits_of(table: &SignalTable) -> SignalTable {
    let signals = table.signals.iter().map(|signal| Signal {
        data_type: match signal.data_type.width() {
            Width::Bit => DataType::Bool,
            Width::Byte => DataType::Usint,
            Width::Word => DataType::Uint,
            Width::Double => DataType::Udint,
            Width::Long => DataType::Ulint,
        },
        scale: None,
        fail_safe: Slot::default(),
        ..signal.clone()
    });
    SignalTable {
        stations: table.stations.clone(),
        signals: signals.collect(),
    }
}

/// The OPC UA type of a data type.
pub(super) fn scalar(data_type: DataType) -> VariantScalarTypeId {
    match data_type {
        DataType::Bool => VariantScalarTypeId::Boolean,
        DataType::Sint => VariantScalarTypeId::SByte,
        DataType::Byte | DataType::Usint => VariantScalarTypeId::Byte,
        DataType::Int => VariantScalarTypeId::Int16,
        DataType::Word | DataType::Uint => VariantScalarTypeId::UInt16,
        DataType::Dint => VariantScalarTypeId::Int32,
        DataType::Dword | DataType::Udint => VariantScalarTypeId::UInt32,
        DataType::Real => VariantScalarTypeId::Float,
        DataType::Lint => VariantScalarTypeId::Int64,
        DataType::Lword | DataType::Ulint => VariantScalarTypeId::UInt64,
        DataType::Lreal => VariantScalarTypeId::Double,
    }
}

/// The node that describes a type.
pub(super) fn data_type_id(data_type: DataType) -> DataTypeId {
    match scalar(data_type) {
        VariantScalarTypeId::Boolean => DataTypeId::Boolean,
        VariantScalarTypeId::SByte => DataTypeId::SByte,
        VariantScalarTypeId::Byte => DataTypeId::Byte,
        VariantScalarTypeId::Int16 => DataTypeId::Int16,
        VariantScalarTypeId::UInt16 => DataTypeId::UInt16,
        VariantScalarTypeId::Int32 => DataTypeId::Int32,
        VariantScalarTypeId::UInt32 => DataTypeId::UInt32,
        VariantScalarTypeId::Float => DataTypeId::Float,
        VariantScalarTypeId::Int64 => DataTypeId::Int64,
        VariantScalarTypeId::UInt64 => DataTypeId::UInt64,
        _ => DataTypeId::Double,
    }
}

/// A signal's bits as an OPC UA value.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    clippy::cast_possible_wrap,
    reason = "the bits of a width, taken as what they are"
)]
pub(super) fn variant(data_type: DataType, bits: Slot) -> Variant {
    let wide = match data_type.width() {
        Width::Long => bits.unsigned(),
        _ => bits.real() as u64,
    };
    match scalar(data_type) {
        VariantScalarTypeId::Boolean => Variant::Boolean(wide != 0),
        VariantScalarTypeId::SByte => Variant::SByte(wide as i8),
        VariantScalarTypeId::Byte => Variant::Byte(wide as u8),
        VariantScalarTypeId::Int16 => Variant::Int16(wide as i16),
        VariantScalarTypeId::UInt16 => Variant::UInt16(wide as u16),
        VariantScalarTypeId::Int32 => Variant::Int32(wide as i32),
        VariantScalarTypeId::UInt32 => Variant::UInt32(wide as u32),
        VariantScalarTypeId::Float => Variant::Float(f32::from_bits(wide as u32)),
        VariantScalarTypeId::Int64 => Variant::Int64(wide as i64),
        VariantScalarTypeId::UInt64 => Variant::UInt64(wide),
        _ => Variant::Double(f64::from_bits(wide)),
    }
}

/// The bits of a value, for a signal of this type; `None` when the value has another type.
pub(super) fn bits(data_type: DataType, value: &Variant) -> Option<Slot> {
    if value.scalar_type_id() != Some(scalar(data_type)) {
        return None;
    }
    Some(match *value {
        Variant::Boolean(value) => Slot::from_real(f64::from(u8::from(value))),
        Variant::SByte(value) => Slot::from_real(f64::from(value.cast_unsigned())),
        Variant::Byte(value) => Slot::from_real(f64::from(value)),
        Variant::Int16(value) => Slot::from_real(f64::from(value.cast_unsigned())),
        Variant::UInt16(value) => Slot::from_real(f64::from(value)),
        Variant::Int32(value) => Slot::from_real(f64::from(value.cast_unsigned())),
        Variant::UInt32(value) => Slot::from_real(f64::from(value)),
        Variant::Float(value) => Slot::from_real(f64::from(value.to_bits())),
        Variant::Int64(value) => Slot::from_signed(value),
        Variant::UInt64(value) => Slot::from_unsigned(value),
        Variant::Double(value) => Slot::from_unsigned(value.to_bits()),
        _ => return None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use tickbus_image::signal::ByteOrder;

    fn table(data_type: DataType, order: ByteOrder) -> SignalTable {
        let signal = Signal {
            order,
            scale: tickbus_image::signal::Scale::through([0.0, 1.0], [5.0, 7.0]),
            ..Signal::new("a", Area::Output, 0, data_type)
        };
        SignalTable::of_one_station(0, 8, vec![signal])
    }

    #[test]
    fn every_type_goes_both_ways_with_every_bit() {
        for (data_type, values) in [
            (
                DataType::Bool,
                vec![Variant::Boolean(true), Variant::Boolean(false)],
            ),
            (
                DataType::Sint,
                vec![Variant::SByte(-128), Variant::SByte(127)],
            ),
            (DataType::Byte, vec![Variant::Byte(255)]),
            (
                DataType::Int,
                vec![Variant::Int16(-2), Variant::Int16(i16::MAX)],
            ),
            (DataType::Word, vec![Variant::UInt16(0xFF01)]),
            (
                DataType::Dint,
                vec![Variant::Int32(i32::MIN), Variant::Int32(-3)],
            ),
            (DataType::Udint, vec![Variant::UInt32(u32::MAX - 1)]),
            (
                DataType::Real,
                vec![Variant::Float(-0.0), Variant::Float(f32::INFINITY)],
            ),
            (DataType::Lint, vec![Variant::Int64(i64::MIN + 1)]),
            (DataType::Ulint, vec![Variant::UInt64(u64::MAX - 1)]),
            (DataType::Lreal, vec![Variant::Double(-1e300)]),
        ] {
            for order in [ByteOrder::Abcd, ByteOrder::Dcba] {
                let table = table(data_type, order);
                let mut values_of = Values::new(&table, Area::Output);
                for value in &values {
                    values_of.set(0, bits(data_type, value).expect("its own type"));
                    let mut frame = [0; 8];
                    values_of.give(0, &mut frame);
                    values_of.set(0, Slot::default());
                    values_of.take(0, &frame);
                    assert_eq!(&variant(data_type, values_of.bits(0)), value);
                }
            }
        }
    }

    #[test]
    fn nan_stays_the_nan_that_it_is() {
        let odd = f32::from_bits(0x7FC0_1234);
        let table = table(DataType::Real, ByteOrder::Abcd);
        let mut values = Values::new(&table, Area::Output);
        values.set(
            0,
            bits(DataType::Real, &Variant::Float(odd)).expect("it is one"),
        );
        let mut frame = [0; 8];
        values.give(0, &mut frame);
        assert_eq!(frame[..4], [0x7F, 0xC0, 0x12, 0x34]);
    }

    #[test]
    fn a_value_of_another_type_is_none() {
        assert_eq!(bits(DataType::Int, &Variant::Int32(1)), None);
        assert_eq!(bits(DataType::Bool, &Variant::Byte(1)), None);
        assert_eq!(bits(DataType::Real, &Variant::Double(1.0)), None);
        let list = Variant::from(vec![1_i16, 2]);
        assert_eq!(bits(DataType::Int, &list), None);
    }
}
