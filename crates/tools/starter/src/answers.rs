//! The questions, and what can be answered.

use tickbus_export::Target;
use tickbus_net::Address;

/// The PLCs to choose from: each with the bus that suits it best, by docs/which-bus.md.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Plc {
    /// An S7-1500, by records over TCP.
    S71500,
    /// An S7-1200, by records over TCP.
    S71200,
    /// An S7 that calls PUT and GET.
    S7,
    /// CODESYS V3, as a Modbus client.
    Codesys,
    /// `TwinCAT` 3, by records over TCP.
    TwinCat,
    /// `OpenPLC`, as a Modbus client.
    OpenPlc,
    /// Any Modbus client.
    Modbus,
    /// Any OPC UA client.
    OpcUa,
    /// No PLC yet: a program in this process.
    None,
}

impl Plc {
    /// All of them, in the order of the question.
    pub const ALL: [Self; 9] = [
        Self::S71500,
        Self::S71200,
        Self::S7,
        Self::Codesys,
        Self::TwinCat,
        Self::OpenPlc,
        Self::Modbus,
        Self::OpcUa,
        Self::None,
    ];

    /// The name on the command line.
    pub const fn name(self) -> &'static str {
        match self {
            Self::S71500 => "s7-1500",
            Self::S71200 => "s7-1200",
            Self::S7 => "s7",
            Self::Codesys => "codesys",
            Self::TwinCat => "twincat",
            Self::OpenPlc => "openplc",
            Self::Modbus => "modbus",
            Self::OpcUa => "opcua",
            Self::None => "none",
        }
    }

    /// The description, for the question.
    pub const fn about(self) -> &'static str {
        match self {
            Self::S71500 => "S7-1500: TSEND_C and TRCV_C",
            Self::S71200 => "S7-1200: TSEND_C and TRCV_C",
            Self::S7 => "an S7 that calls PUT and GET",
            Self::Codesys => "CODESYS V3: Modbus TCP client",
            Self::TwinCat => "TwinCAT 3: TF6310",
            Self::OpenPlc => "OpenPLC: Modbus TCP client",
            Self::Modbus => "any PLC that polls over Modbus TCP",
            Self::OpcUa => "any OPC UA client",
            Self::None => "none yet: a small program in its place",
        }
    }

    /// The bus of the machine's end.
    pub const fn kind(self) -> &'static str {
        match self {
            Self::S71500 | Self::S71200 | Self::TwinCat => "socket",
            Self::S7 => "s7-server",
            Self::Codesys | Self::OpenPlc | Self::Modbus => "modbus-server",
            Self::OpcUa => "opcua-server",
            Self::None => "loopback",
        }
    }

    /// The port on which the machine listens; `None` without a PLC.
    pub const fn port(self) -> Option<u16> {
        match self {
            Self::S71500 | Self::S71200 | Self::TwinCat => Some(20030),
            Self::S7 => Some(1102),
            Self::Codesys | Self::OpenPlc | Self::Modbus => Some(1502),
            Self::OpcUa => Some(4840),
            Self::None => None,
        }
    }

    /// The editor for which the PLC's half is exported.
    pub const fn target(self) -> Option<Target> {
        match self {
            Self::S71500 => Some(Target::S71500),
            Self::S71200 => Some(Target::S71200),
            Self::Codesys => Some(Target::Codesys),
            Self::TwinCat => Some(Target::TwinCat),
            Self::OpenPlc => Some(Target::OpenPlc),
            Self::S7 | Self::Modbus | Self::OpcUa | Self::None => None,
        }
    }
}

/// The language of the simulator.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Language {
    /// Java 17.
    Java,
    /// Python.
    Python,
    /// C.
    C,
    /// None: replies in driver.cfg, and `tickbus mirror --replies`.
    Replies,
}

impl Language {
    /// All of them, in the order of the question.
    pub const ALL: [Self; 4] = [Self::Java, Self::Python, Self::C, Self::Replies];

    /// The name on the command line.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Java => "java",
            Self::Python => "python",
            Self::C => "c",
            Self::Replies => "replies",
        }
    }

    /// The description, for the question.
    pub const fn about(self) -> &'static str {
        match self {
            Self::Java => "Java 17 or newer",
            Self::Python => "Python 3.9 or newer",
            Self::C => "C or C++",
            Self::Replies => "none: replies in driver.cfg",
        }
    }
}

/// The answers to the questions.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Answers {
    /// The machine's name.
    pub name: String,
    /// The PLC.
    pub plc: Plc,
    /// Where the machine listens; not used without a PLC.
    pub address: Option<Address>,
    /// The language of the simulator.
    pub language: Language,
    /// The text of a driver.cfg with the signals of an imported list; `None` for those of a tank.
    pub signals: Option<String>,
    /// True if the numbers in the addresses of `signals` count elements, as IEC 61131-3 has it, and not bytes.
    pub counts_elements: bool,
    /// How this command is called, for the README.
    pub command: String,
    /// How the interpreter is called that has the Python package.
    pub python: String,
    /// The jar for Java, as far as it was found.
    pub jar: Option<String>,
    /// The folders of tickbus.h and of the library for C, as far as they were found.
    pub c: Option<(String, String)>,
}
