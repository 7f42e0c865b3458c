//! The types of code carriers.

/// A type of code carrier.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum CarrierType {
    /// IDC: 32 octets.
    Idc,
    /// IDC-1K: 128 octets, the type that a reader expects after power-on.
    #[default]
    Idc1K,
    /// IMC-40-64K: 8192 octets.
    Imc64K,
    /// IMC-40-256K: 32768 octets.
    Imc256K,
}

impl CarrierType {
    /// All types, by their names in a driver.cfg.
    pub const ALL: [(&'static str, Self); 4] = [
        ("IDC", Self::Idc),
        ("IDC-1K", Self::Idc1K),
        ("IMC-40-64K", Self::Imc64K),
        ("IMC-40-256K", Self::Imc256K),
    ];

    /// The name.
    pub fn name(self) -> &'static str {
        let found = Self::ALL.iter().find(|(_, carrier)| *carrier == self);
        found.map_or("", |(name, _)| name)
    }

    /// The size in octets.
    pub const fn size(self) -> usize {
        match self {
            Self::Idc => 0x20,
            Self::Idc1K => 0x80,
            Self::Imc64K => 0x2000,
            Self::Imc256K => 0x8000,
        }
    }

    /// The most octets that one command reads or writes.
    pub const fn most(self) -> usize {
        match self {
            Self::Idc => 0x20,
            _ => 0x80,
        }
    }

    /// The family, which alone determines the command `d` and the digits of an address.
    pub const fn family(self) -> Family {
        match self {
            Self::Idc => Family::Idc,
            Self::Idc1K => Family::Idc1K,
            Self::Imc64K | Self::Imc256K => Family::Imc40,
        }
    }

    /// True if the carrier has all of these octets, and one command can address them.
    pub const fn has(self, address: u16, length: usize) -> bool {
        length > 0 && length <= self.most() && address as usize + length <= self.size()
    }
}

/// The setting of a reader.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Family {
    /// `1`: IDC.
    Idc,
    /// `3`: IMC-40.
    Imc40,
    /// `4`: IDC-1K.
    #[default]
    Idc1K,
}

impl Family {
    /// The family's character in the command `d`.
    pub const fn digit(self) -> u8 {
        match self {
            Self::Idc => b'1',
            Self::Imc40 => b'3',
            Self::Idc1K => b'4',
        }
    }

    /// The family with this character.
    pub fn of_digit(digit: u8) -> Option<Self> {
        let all = [Self::Idc, Self::Imc40, Self::Idc1K];
        all.into_iter().find(|family| family.digit() == digit)
    }

    /// The number of digits of an address.
    pub const fn address_digits(self) -> usize {
        match self {
            Self::Imc40 => 4,
            _ => 2,
        }
    }
}
