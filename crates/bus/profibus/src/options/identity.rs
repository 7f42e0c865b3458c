//! The key `identity` of a station: the nameplate of its device.

use tickbus_base::toml_text::{Key, Shape, Value};

use crate::acyclic::Nameplate;

/// The characters of an order number and of a serial number on the nameplate.
const ORDER: usize = 20;
const SERIAL: usize = 16;

/// The keys of `identity`.
pub(super) const IDENTITY_KEYS: &[Key] = &[
    Key::new(
        "manufacturer",
        Shape::Whole(0, u16::MAX as i128),
        "The number of the maker at PROFIBUS & PROFINET International, such as 42 for Siemens",
    )
    .or("0"),
    Key::new(
        "order",
        Shape::Label(ORDER),
        "The order number; that of the GSD file, or the ident, by default",
    ),
    Key::new(
        "serial",
        Shape::Label(SERIAL),
        "The serial number; \"station\" and the address by default",
    ),
];

/// The parts of the nameplate that the file states.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) struct StatedIdentity {
    manufacturer: u16,
    order: Option<String>,
    serial: Option<String>,
}

impl StatedIdentity {
    /// Completes the nameplate of the device at `address`.
    pub(super) fn complete(&self, address: u8, nameplate: &mut Nameplate) {
        let own = self.clone();
        nameplate.serial = own.serial.unwrap_or_else(|| format!("station {address}"));
        nameplate.manufacturer = own.manufacturer;
        if let Some(order) = own.order {
            nameplate.order = order;
        }
    }
}

/// Reads the table.
pub(super) fn read_identity(value: &Value<'_>) -> Option<StatedIdentity> {
    let mut table = value.table(
        "identity",
        "write a table such as { manufacturer = 42, order = \"6ES7 151-1BA02\" }",
    )?;
    let [manufacturer, order, serial] =
        ["manufacturer", "order", "serial"].map(|key| table.take(key));
    table.finish();
    let text = |value: Option<Value<'_>>, longest| {
        let Some(value) = value else {
            return Some(None);
        };
        let text = value.label(longest, "write the text in quotes")?;
        Some(Some(text.to_owned()))
    };
    let manufacturer = manufacturer.map_or(Some(0), |value| {
        let number = value.whole(0..=u16::MAX.into())?;
        u16::try_from(number).ok()
    });
    let (order, serial) = (text(order, ORDER), text(serial, SERIAL));
    Some(StatedIdentity {
        manufacturer: manufacturer?,
        order: order?,
        serial: serial?,
    })
}
