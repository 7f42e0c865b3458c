//! Signals of every type, with byte orders and scales, and the conversions of docs/driver-cfg.md. Their values follow
//! from the stamp beside them.

use std::iter::Take;
use std::ops::Deref;

use crate::random::{Random, scramble};

/// The meaning of a type's bits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Shape {
    /// True or false.
    Bool,
    /// A number without a sign.
    Unsigned,
    /// A number in two's complement.
    Signed,
    /// A floating-point number.
    Float,
}

/// The types of signals, with their shapes and their widths in bits.
const TYPES: [(&str, Shape, u32); 15] = [
    ("BOOL", Shape::Bool, 1),
    ("BYTE", Shape::Unsigned, 8),
    ("SINT", Shape::Signed, 8),
    ("USINT", Shape::Unsigned, 8),
    ("WORD", Shape::Unsigned, 16),
    ("INT", Shape::Signed, 16),
    ("UINT", Shape::Unsigned, 16),
    ("DWORD", Shape::Unsigned, 32),
    ("DINT", Shape::Signed, 32),
    ("UDINT", Shape::Unsigned, 32),
    ("REAL", Shape::Float, 32),
    ("LWORD", Shape::Unsigned, 64),
    ("LINT", Shape::Signed, 64),
    ("ULINT", Shape::Unsigned, 64),
    ("LREAL", Shape::Float, 64),
];

/// Two points of a scale: raw values, and the values that they represent.
type Points = [f64; 4];

/// A signal beside the stamp.
#[derive(Clone, Debug, PartialEq)]
pub struct Typed {
    /// The number of the signal, which is in its name.
    pub number: usize,
    /// The type of the signal.
    pub kind: &'static str,
    /// The meaning of the type's bits.
    pub shape: Shape,
    /// The width of the type, in bits.
    pub bits: u32,
    /// The key `order`.
    pub order: &'static str,
    /// The key `scale`.
    pub scale: Option<Points>,
    /// The first byte of the signal.
    pub place: usize,
    /// The raw fail-safe value of the signal.
    pub fail_safe: i64,
    /// True if the reading end has a USINT in place of each byte of the signal.
    pub is_split: bool,
}

impl Typed {
    /// Draws some signals from byte `first` on, with gaps between them if `has_gaps`.
    pub(crate) fn draw(random: &mut Random, first: usize, has_gaps: bool) -> Vec<Self> {
        let mut place = first;
        let count = usize::try_from(random.within(1, 5)).expect("small");
        let typed = (0..count).map(|number| {
            let (kind, shape, bits) = random.of(&TYPES);
            let order = random.of(&["ABCD", "DCBA", "CDAB", "BADC"]);
            // Powers of two, so that only raw values are rounded.
            let (raw, value) = (random.of(&[0.0, 8.0, 32.0]), random.of(&[0.0, 8.0, -3.5]));
            let gain = random.of(&[0.25, 2.0, -0.5, 64.0]);
            let has_scale = random.once_in(2) && bits > 1 && (bits < 64 || shape == Shape::Float);
            let size = usize::try_from(bits.div_ceil(8)).expect("small");
            let typed = Self {
                number,
                kind,
                shape,
                bits,
                order: if bits > 8 { order } else { "ABCD" },
                scale: has_scale.then_some([raw, raw + 64.0, value, value + 64.0 * gain]),
                place,
                fail_safe: random.within(0, if bits == 1 { 1 } else { 100 }),
                is_split: random.once_in(3) && bits > 1,
            };
            place +=
                size + usize::try_from(random.below(2)).expect("small") * usize::from(has_gaps);
            typed
        });
        typed.collect()
    }

    /// Returns true if the slot holds an integer, false if it holds a double.
    fn is_integer(&self) -> bool {
        self.bits == 64 && self.shape != Shape::Float
    }

    fn size(&self) -> usize {
        usize::try_from(self.bits.div_ceil(8)).expect("small")
    }

    /// The name of the signal, which tells the readers of recordings how the values are written.
    fn name(&self, area: char, station: usize) -> String {
        let how = match self.kind {
            "LINT" => "i64",
            _ if self.is_integer() => "u64",
            _ => "f64",
        };
        format!("{how}x{}{area}{station}", self.number)
    }

    fn is_split_at(&self, reads: bool) -> bool {
        self.is_split && reads
    }

    /// The names of the signal at an end.
    pub(crate) fn names(&self, area: char, station: usize, reads: bool) -> Vec<String> {
        if !self.is_split_at(reads) {
            return vec![self.name(area, station)];
        }
        let bytes = 0..self.size();
        let names = bytes.map(|byte| format!("byte{byte}x{}{area}{station}", self.number));
        names.collect()
    }

    /// The sections of the signal in the driver.cfg of an end, without the keys for the station.
    pub(crate) fn sections(&self, area: char, station: usize, reads: bool) -> Vec<String> {
        let place = self.place;
        if self.is_split_at(reads) {
            let names = self.names(area, station, reads).into_iter();
            let bytes = self.laid_out(self.safe_bits());
            let sections = names.zip(bytes).enumerate().map(|(index, (name, byte))| {
                let place = place + index;
                format!(
                    "[[signal]]\nname = \"{name}\"\naddress = \"%{area}B{place}\"\ntype = \"USINT\"\nfail_safe = {byte}"
                )
            });
            return sections.collect();
        }
        let address = match self.bits {
            1 => format!("X{place}.0"),
            8 => format!("B{place}"),
            16 => format!("W{place}"),
            32 => format!("D{place}"),
            _ => format!("L{place}"),
        };
        let name = self.name(area, station);
        let section = format!(
            "[[signal]]\nname = \"{name}\"\naddress = \"%{area}{address}\"\ntype = \"{}\"\n",
            self.kind
        );
        let order = if self.bits > 8 {
            format!("order = \"{}\"\n", self.order)
        } else {
            String::new()
        };
        let scale = self
            .scale
            .map_or_else(String::new, |[raw, other, value, behind]| {
                format!("scale = {{ raw = [{raw}, {other}], value = [{value:?}, {behind:?}] }}\n")
            });
        let fail_safe = f64::from_bits(self.read(self.safe_bits()));
        let fail_safe = match self.kind {
            "BOOL" => format!("fail_safe = {}", self.fail_safe == 1),
            _ if self.is_integer() => format!("fail_safe = {}", self.fail_safe),
            _ => format!("fail_safe = {fail_safe:?}"),
        };
        vec![[section, order, scale, fail_safe].concat()]
    }

    /// The bits of the fail-safe value.
    fn safe_bits(&self) -> u64 {
        #[expect(clippy::cast_precision_loss, reason = "a small number")]
        let half = self.fail_safe as f64 / 2.0;
        // A zero takes the sign of the gain that it is divided by.
        let is_negative_zero = half == 0.0 && self.line().0 < 0.0;
        let half = if is_negative_zero { -0.0 } else { half };
        match (self.shape, self.bits) {
            #[expect(clippy::cast_possible_truncation, reason = "a small number")]
            (Shape::Float, 32) => u64::from((half as f32).to_bits()),
            (Shape::Float, _) => half.to_bits(),
            _ => self.fail_safe.cast_unsigned(),
        }
    }

    /// The gain and the offset of the scale.
    fn line(&self) -> (f64, f64) {
        let [raw, other, value, behind] = self.scale.unwrap_or([0.0, 1.0, 0.0, 1.0]);
        let gain = (behind - value) / (other - raw);
        (gain, value - raw * gain)
    }

    /// The slot that a simulation writes in the tick with this stamp.
    #[expect(
        clippy::cast_precision_loss,
        clippy::cast_possible_truncation,
        reason = "numbers of all kinds are wanted"
    )]
    pub(crate) fn written(&self, stamp: u64) -> u64 {
        let chance = scramble(stamp ^ (self.number as u64 + 1) << 56);
        let (gain, offset) = self.line();
        let wide = chance.cast_signed();
        let value = match (self.shape, self.bits) {
            (Shape::Bool, _) => (chance & 1) as f64,
            _ if self.is_integer() => return chance,
            _ if chance >> 60 == 0 => f64::NAN,
            // Quarters of whole numbers pass the scale and the type exactly; some floating-point numbers do not.
            (Shape::Float, 32) => f64::from(wide as i16) / 4.0 * gain + offset,
            (Shape::Float, _) => f64::from(wide as i32) / 4.0 * gain + offset,
            _ => {
                // Slightly beyond both limits, and with halves.
                let span = 1_u64 << (self.bits + 1);
                let raw =
                    (chance % span) as f64 - (span / 2) as f64 + (chance >> 59 & 1) as f64 / 2.0;
                raw * gain + offset
            }
        };
        value.to_bits()
    }

    /// The bits of a slot on the line.
    #[expect(
        clippy::cast_possible_truncation,
        reason = "what is clamped fits, and a REAL is what it is"
    )]
    fn on_line(&self, slot: u64) -> u64 {
        if self.is_integer() {
            return slot;
        }
        let value = f64::from_bits(slot);
        if value.is_nan() {
            return self.safe_bits();
        }
        let (gain, offset) = self.line();
        let raw = (value - offset) / gain;
        match (self.shape, self.bits) {
            (Shape::Bool, _) => u64::from(value != 0.0),
            (Shape::Float, 32) => u64::from((raw as f32).to_bits()),
            (Shape::Float, _) => raw.to_bits(),
            _ => {
                let half = if raw < 0.0 { -0.5 } else { 0.5 };
                let whole = (raw + half).trunc() as i64;
                let (least, most) = if self.shape == Shape::Signed {
                    (-(1_i64 << (self.bits - 1)), (1_i64 << (self.bits - 1)) - 1)
                } else {
                    (0, (1_i64 << self.bits) - 1)
                };
                whole.clamp(least, most).cast_unsigned() & (u64::MAX >> (64 - self.bits))
            }
        }
    }

    /// The slot that results from bits on the line.
    #[expect(
        clippy::cast_precision_loss,
        clippy::cast_possible_truncation,
        reason = "32 bits at most"
    )]
    fn read(&self, bits: u64) -> u64 {
        if self.is_integer() {
            return bits;
        }
        let unused = 64 - self.bits;
        let raw = match (self.shape, self.bits) {
            (Shape::Float, 32) => f64::from(f32::from_bits(bits as u32)),
            (Shape::Float, _) => f64::from_bits(bits),
            (Shape::Signed, _) => ((bits << unused).cast_signed() >> unused) as f64,
            _ => bits as f64,
        };
        let (gain, offset) = self.line();
        (raw * gain + offset).to_bits()
    }

    /// The bytes of bits on the line, in the order of the signal.
    fn laid_out(&self, bits: u64) -> Few<u8> {
        let size = self.size();
        let mut bytes = Few::default();
        for byte in &bits.to_be_bytes()[8 - size..] {
            bytes.push(*byte);
        }
        self.reorder(&mut bytes.items[..size]);
        bytes
    }

    /// Puts bytes, most significant first, into the order of the signal; the reverse is the same operation.
    fn reorder(&self, bytes: &mut [u8]) {
        if matches!(self.order, "DCBA" | "CDAB") {
            bytes.reverse();
        }
        if matches!(self.order, "BADC" | "CDAB") {
            bytes.chunks_mut(2).for_each(<[u8]>::reverse);
        }
    }

    /// The bytes of the signal in the tick with this stamp.
    pub(crate) fn bytes(&self, stamp: u64) -> Few<u8> {
        self.laid_out(self.on_line(self.written(stamp)))
    }

    /// The slots that an end reads from bytes that begin with those of the signal; see [`shown`](Self::shown).
    pub(crate) fn taken(&self, bytes: &[u8], reads: bool) -> Few<u64> {
        let mut big = [0; 8];
        let big = &mut big[..self.size()];
        big.copy_from_slice(&bytes[..self.size()]);
        if self.is_split_at(reads) {
            return Few::of_bytes(big);
        }
        self.reorder(big);
        Few::one(
            self.read(
                big.iter()
                    .fold(0, |bits, byte| bits << 8 | u64::from(*byte)),
            ),
        )
    }

    /// The slots that an end shows for the tick with this stamp, or for fail-safe values.
    pub(crate) fn shown(&self, stamp: Option<u64>, reads: bool) -> Few<u64> {
        let bits = stamp.map_or(self.safe_bits(), |stamp| self.on_line(self.written(stamp)));
        if self.is_split_at(reads) {
            return Few::of_bytes(&self.laid_out(bits));
        }
        Few::one(self.read(bits))
    }
}

/// Up to eight items without heap memory: the judge makes one for each signal in each tick.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Few<T> {
    items: [T; 8],
    count: usize,
}

impl<T: Copy + Default> Few<T> {
    fn one(item: T) -> Self {
        let mut few = Self::default();
        few.push(item);
        few
    }

    fn push(&mut self, item: T) {
        self.items[self.count] = item;
        self.count += 1;
    }
}

impl Few<u64> {
    /// The slots of USINTs.
    fn of_bytes(bytes: &[u8]) -> Self {
        let mut few = Self::default();
        for byte in bytes {
            few.push(f64::from(*byte).to_bits());
        }
        few
    }
}

impl<T> Deref for Few<T> {
    type Target = [T];

    fn deref(&self) -> &[T] {
        &self.items[..self.count]
    }
}

impl<T> IntoIterator for Few<T> {
    type Item = T;
    type IntoIter = Take<std::array::IntoIter<T, 8>>;

    fn into_iter(self) -> Self::IntoIter {
        self.items.into_iter().take(self.count)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn orders_are_as_the_docs_have_them() {
        let mut typed = Typed {
            number: 0,
            kind: "DWORD",
            shape: Shape::Unsigned,
            bits: 32,
            order: "ABCD",
            scale: None,
            place: 16,
            fail_safe: 0,
            is_split: true,
        };
        for (order, bytes) in [
            ("ABCD", [1, 2, 3, 4]),
            ("DCBA", [4, 3, 2, 1]),
            ("CDAB", [3, 4, 1, 2]),
            ("BADC", [2, 1, 4, 3]),
        ] {
            typed.order = order;
            assert_eq!(*typed.laid_out(0x0102_0304), bytes);
        }
    }
}
