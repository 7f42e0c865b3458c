//! Device addresses, as in the tag lists of PLC4X, KEPServer and other clients.

use tickbus_base::Mistake;
use tickbus_bus_modbus::TagAddress;
use tickbus_bus_s7::Variable;
use tickbus_bus_s7::item::Object;
use tickbus_image::signal::{Area, DataType, Width};

/// The bus that the addresses of a list belong to.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Client {
    /// `holding-register:21`, `400021`.
    Modbus,
    /// `%DB10.DBX0.3`, `DB10,REAL4`.
    S7,
}

impl Client {
    /// The bus kind's name in a driver.cfg.
    pub const fn kind(self) -> &'static str {
        match self {
            Self::Modbus => "modbus-client",
            Self::S7 => "s7-client",
        }
    }
}

/// The place of a tag in the device.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Spots {
    /// The type stated in the address.
    pub(super) data_type: Option<DataType>,
    /// The size according to the address, if it states no type.
    pub(super) width: Width,
    /// The tag is the lower or the upper half of a register, or that half's first bit.
    pub(super) is_half: bool,
    /// The direction that the place implies; most places can be both read and written.
    pub(super) area: Option<Area>,
}

/// True if `text` is a device address and cannot be anything else that tables contain.
pub(super) fn is_address(text: &str) -> bool {
    only(text).is_some()
}

/// The bus of an address that only one bus has. `%MW20` may belong to either, and `%IW4` may also be in the process
/// image.
pub(super) fn only(text: &str) -> Option<Client> {
    let upper = text.to_ascii_uppercase();
    let bare = upper.strip_prefix('%').unwrap_or(&upper);
    let is_numbered = bare.len() >= 5 && bare.starts_with(|c: char| c.is_ascii_digit());
    let is_table = [
        "COIL",
        "DISCRETE-INPUT",
        "INPUT-REGISTER",
        "HOLDING-REGISTER",
    ]
    .iter()
    .any(|table| bare.starts_with(table));
    if (is_numbered || is_table) && text.parse::<TagAddress>().is_ok() {
        return Some(Client::Modbus);
    }
    let in_block = bare
        .strip_prefix("DB")
        .is_some_and(|rest| rest.starts_with(|c: char| c.is_ascii_digit()));
    let is_typed = bare.contains(':') && !bare.ends_with(":P");
    (in_block || is_typed)
        .then(|| text.parse::<Variable>().ok())
        .flatten()
        .map(|_| Client::S7)
}

/// Reads an address of `client`.
///
/// # Errors
///
/// The address is invalid; the message has the remedy.
pub(super) fn spots(text: &str, client: Client) -> Result<Spots, Mistake> {
    match client {
        Client::Modbus => {
            let spot: TagAddress = text.parse()?;
            let table = spot.place.table;
            let is_bit = table.is_bits() || spot.bit.is_some();
            Ok(Spots {
                data_type: spot.data_type,
                is_half: matches!(spot.bit, Some(0 | 8)),
                width: if is_bit { Width::Bit } else { Width::Word },
                area: (!table.is_writable()).then_some(Area::Output),
            })
        }
        Client::S7 => {
            let variable: Variable = text.parse().map_err(|what: String| {
                Mistake::new(
                    what,
                    "write \"%DB10.DBX0.3\", \"%DB10.DBD4:REAL\", \"DB10,REAL4\" or \"%MW20\"",
                )
            })?;
            Ok(Spots {
                data_type: variable.data_type,
                width: variable.width,
                is_half: false,
                area: match variable.object {
                    Object::Inputs => Some(Area::Input),
                    Object::Outputs => Some(Area::Output),
                    _ => None,
                },
            })
        }
    }
}

/// The direction of a module point in a Logix controller (`Local:1:I.Data.0`, `Rack:2:O1[3]`); `None` for
/// anything else.
pub(super) fn module_side(target: &str) -> Option<Area> {
    let (_, rest) = target.rsplit_once(':')?;
    let side = rest.split(['.', '[']).next()?;
    let area = match side.chars().next()? {
        'I' | 'i' => Area::Input,
        'O' | 'o' => Area::Output,
        _ => return None,
    };
    let is_numbered = side[1..].bytes().all(|byte| byte.is_ascii_digit());
    is_numbered.then_some(area)
}

/// KEPServer's type of this name.
pub(super) fn kepserver_type(text: &str) -> Option<DataType> {
    Some(match text.to_ascii_lowercase().as_str() {
        "boolean" => DataType::Bool,
        "char" => DataType::Sint,
        "byte" => DataType::Usint,
        "short" => DataType::Int,
        "word" => DataType::Uint,
        "long" => DataType::Dint,
        "dword" => DataType::Udint,
        "float" => DataType::Real,
        "llong" => DataType::Lint,
        "qword" => DataType::Ulint,
        "double" => DataType::Lreal,
        _ => return None,
    })
}
