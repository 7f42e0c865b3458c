//! The telegrams: which words a drive receives and sends, in which order.

use tickbus_image::signal::{Area, DataType, Scale};

/// 100 % of the reference speed, and of an override, in 16 bits and in 32.
pub(crate) const WHOLE: f64 = 16_384.0;
const WHOLE_LONG: f64 = 1_073_741_824.0;

/// A word or double word of a telegram, by its name in the profile and in SINAMICS.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[expect(missing_docs, reason = "the profile's own names")]
pub enum Word {
    Stw1,
    NsollA,
    NsollB,
    Stw2,
    G1Stw,
    Xerr,
    Kpc,
    PosStw1,
    PosStw2,
    Override,
    MdiTarpos,
    MdiVelocity,
    MdiAcc,
    MdiDec,
    UserOut,
    Zsw1,
    NistA,
    NistB,
    Zsw2,
    G1Zsw,
    G1Xist1,
    G1Xist2,
    PosZsw1,
    PosZsw2,
    Meldw,
    XistA,
    FaultCode,
    WarnCode,
    UserIn,
}

impl Word {
    /// The number of words.
    pub(crate) const COUNT: usize = Self::UserIn as usize + 1;

    /// The name, which follows that of the drive and a dot in the name of the signal.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Stw1 => "STW1",
            Self::NsollA => "NSOLL_A",
            Self::NsollB => "NSOLL_B",
            Self::Stw2 => "STW2",
            Self::G1Stw => "G1_STW",
            Self::Xerr => "XERR",
            Self::Kpc => "KPC",
            Self::PosStw1 => "POS_STW1",
            Self::PosStw2 => "POS_STW2",
            Self::Override => "OVERRIDE",
            Self::MdiTarpos => "MDI_TARPOS",
            Self::MdiVelocity => "MDI_VELOCITY",
            Self::MdiAcc => "MDI_ACC",
            Self::MdiDec => "MDI_DEC",
            Self::UserOut => "USER_OUT",
            Self::Zsw1 => "ZSW1",
            Self::NistA => "NIST_A",
            Self::NistB => "NIST_B",
            Self::Zsw2 => "ZSW2",
            Self::G1Zsw => "G1_ZSW",
            Self::G1Xist1 => "G1_XIST1",
            Self::G1Xist2 => "G1_XIST2",
            Self::PosZsw1 => "POS_ZSW1",
            Self::PosZsw2 => "POS_ZSW2",
            Self::Meldw => "MELDW",
            Self::XistA => "XIST_A",
            Self::FaultCode => "FAULT_CODE",
            Self::WarnCode => "WARN_CODE",
            Self::UserIn => "USER_IN",
        }
    }

    /// `%Q` for what the drive receives, `%I` for what it sends.
    pub const fn area(self) -> Area {
        if (self as usize) < Self::Zsw1 as usize {
            Area::Output
        } else {
            Area::Input
        }
    }

    /// The type of its signal.
    pub const fn data_type(self) -> DataType {
        match self {
            Self::NsollA | Self::NistA => DataType::Int,
            Self::Xerr | Self::MdiTarpos | Self::XistA | Self::NsollB | Self::NistB => {
                DataType::Dint
            }
            Self::Kpc | Self::MdiVelocity | Self::G1Xist1 | Self::G1Xist2 => DataType::Udint,
            Self::Override | Self::MdiAcc | Self::MdiDec | Self::FaultCode | Self::WarnCode => {
                DataType::Uint
            }
            _ => DataType::Word,
        }
    }

    /// The scale of its signal: speeds are in the unit of the reference speed.
    pub(crate) fn scale(self, reference: f64) -> Option<Scale> {
        let whole = match self {
            Self::NsollA | Self::NistA => WHOLE,
            Self::NsollB | Self::NistB => WHOLE_LONG,
            _ => return None,
        };
        Some(Scale {
            gain: reference / whole,
            offset: 0.0,
        })
    }
}

/// A telegram of the profile (1, 2, 3, 5), or of SINAMICS (111).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Telegram {
    /// Speed in 16 bits.
    Speed = 1,
    /// Speed in 32 bits.
    LongSpeed = 2,
    /// Speed in 32 bits, with an encoder.
    Encoder = 3,
    /// As 3, with the position controller in the drive (DSC).
    Servo = 5,
    /// The drive positions on its own (EPOS, MDI).
    Positioner = 111,
}

impl Telegram {
    /// All telegrams.
    pub const ALL: [Self; 5] = [
        Self::Speed,
        Self::LongSpeed,
        Self::Encoder,
        Self::Servo,
        Self::Positioner,
    ];

    /// The telegram's number.
    pub const fn number(self) -> u32 {
        self as u32
    }

    /// The words that the drive receives and those that it sends, each in the order of the telegram.
    pub const fn words(self) -> [&'static [Word]; 2] {
        use Word::{
            FaultCode, G1Stw, G1Xist1, G1Xist2, G1Zsw, Kpc, MdiAcc, MdiDec, MdiTarpos, MdiVelocity,
            Meldw, NistA, NistB, NsollA, NsollB, Override, PosStw1, PosStw2, PosZsw1, PosZsw2,
            Stw1, Stw2, UserIn, UserOut, WarnCode, Xerr, XistA, Zsw1, Zsw2,
        };
        const ENCODER: &[Word] = &[Zsw1, NistB, Zsw2, G1Zsw, G1Xist1, G1Xist2];
        match self {
            Self::Speed => [&[Stw1, NsollA], &[Zsw1, NistA]],
            Self::LongSpeed => [&[Stw1, NsollB, Stw2], &[Zsw1, NistB, Zsw2]],
            Self::Encoder => [&[Stw1, NsollB, Stw2, G1Stw], ENCODER],
            Self::Servo => [&[Stw1, NsollB, Stw2, G1Stw, Xerr, Kpc], ENCODER],
            Self::Positioner => [
                &[
                    Stw1,
                    PosStw1,
                    PosStw2,
                    Stw2,
                    Override,
                    MdiTarpos,
                    MdiVelocity,
                    MdiAcc,
                    MdiDec,
                    UserOut,
                ],
                &[
                    Zsw1, PosZsw1, PosZsw2, Zsw2, Meldw, XistA, NistB, FaultCode, WarnCode, UserIn,
                ],
            ],
        }
    }

    /// The bytes that the drive receives, and those that it sends.
    pub fn bytes(self) -> [usize; 2] {
        self.words().map(|words| {
            let bytes = words.iter().map(|word| word.data_type().size_bytes());
            bytes.sum()
        })
    }
}

/// The values of the words of a telegram; 0 for those that it does not have.
#[derive(Clone, Debug, PartialEq)]
pub struct Words([f64; Word::COUNT]);

impl Default for Words {
    fn default() -> Self {
        Self([0.0; Word::COUNT])
    }
}

impl Words {
    /// The value of a word.
    pub const fn get(&self, word: Word) -> f64 {
        self.0[word as usize]
    }

    /// Sets the value of a word.
    pub const fn set(&mut self, word: Word, value: f64) {
        self.0[word as usize] = value;
    }

    /// The value of a word of bits.
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "a word has 16 bits; other values saturate"
    )]
    pub(crate) const fn bits(&self, word: Word) -> u16 {
        self.get(word) as u16
    }

    pub(crate) fn set_bits(&mut self, word: Word, bits: u16) {
        self.set(word, bits.into());
    }
}
