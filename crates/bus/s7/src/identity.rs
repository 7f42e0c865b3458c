//! `[fieldbus.identity]`: how the CPU names itself.

use crate::szl::{Identity, LONG_NAME, NAME, ORDER};
use tickbus_base::toml_text::{Key, Shape, Value};

/// The longest copyright notice, in characters.
const COPYRIGHT: usize = 26;

/// The longest text of a firmware version.
const FIRMWARE: usize = 12;

/// The keys of the table.
pub(crate) const IDENTITY_KEYS: &[Key] = &[
    Key::new(
        "order",
        Shape::Label(ORDER),
        "The order number, such as \"6ES7 315-2EH14-0AB0\"; \"tickbus\" by default",
    ),
    Key::new(
        "firmware",
        Shape::Label(FIRMWARE),
        "The version of the firmware, such as \"V3.2.6\"; that of tickbus by default",
    ),
    Key::new(
        "name",
        Shape::Label(NAME),
        "The name of the module; the driver's name by default",
    ),
    Key::new(
        "system",
        Shape::Label(NAME),
        "The name of the automation system; the module's name by default",
    ),
    Key::new("plant", Shape::Label(LONG_NAME), "The plant identification"),
    Key::new(
        "serial",
        Shape::Label(NAME),
        "The serial number of the module",
    ),
    Key::new(
        "module",
        Shape::Label(LONG_NAME),
        "The type of the module, such as \"CPU 315-2 PN/DP\"",
    ),
    Key::new(
        "copyright",
        Shape::Label(COPYRIGHT),
        "The copyright notice, such as \"Original Siemens Equipment\"",
    ),
];

/// The stated parts of an identity; each that is `None` has its default.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct StatedIdentity {
    texts: [Option<String>; 7],
    firmware: Option<[u8; 3]>,
}

impl StatedIdentity {
    /// The identity of a server whose driver has this name.
    pub(crate) fn complete(&self, driver: &str) -> Identity {
        let [order, name, system, plant, serial, module, copyright] = self.texts.clone();
        let usual = Identity::of_driver(driver);
        let name = name.unwrap_or(usual.name);
        Identity {
            order: order.unwrap_or(usual.order),
            firmware: self.firmware.unwrap_or(usual.firmware),
            system: system.unwrap_or_else(|| name.clone()),
            name,
            plant: plant.unwrap_or_default(),
            serial: serial.unwrap_or_default(),
            module: module.unwrap_or(usual.module),
            copyright: copyright.unwrap_or(usual.copyright),
        }
    }
}

/// Reads the table.
pub(crate) fn read_identity(value: &Value<'_>) -> Option<StatedIdentity> {
    let mut table = value.table(
        "[fieldbus.identity]",
        "write a table such as { order = \"6ES7 315-2EH14-0AB0\", name = \"PLC_1\" }",
    )?;
    let mut text = |name: &'static str, longest: usize| {
        let Some(value) = table.take(name) else {
            return Some(None);
        };
        read_text(&value, longest).map(Some)
    };
    let texts = [
        ("order", ORDER),
        ("name", NAME),
        ("system", NAME),
        ("plant", LONG_NAME),
        ("serial", NAME),
        ("module", LONG_NAME),
        ("copyright", COPYRIGHT),
    ]
    .map(|(name, longest)| text(name, longest));
    let firmware = table.take("firmware");
    let firmware = match &firmware {
        None => Some(None),
        Some(value) => read_firmware(value).map(Some),
    };
    table.finish();
    if texts.contains(&None) {
        return None;
    }
    Some(StatedIdentity {
        texts: texts.map(Option::flatten),
        firmware: firmware?,
    })
}

fn read_text(value: &Value<'_>, longest: usize) -> Option<String> {
    let text = value.label(longest, "write the text in quotes, in ASCII")?;
    if let Some(other) = text.chars().find(|c| !matches!(c, ' '..='~')) {
        value.wrong(
            format!("it has {other:?}"),
            "a CPU has ASCII here, so write it without accents",
        );
        return None;
    }
    Some(text.to_owned())
}

fn read_firmware(value: &Value<'_>) -> Option<[u8; 3]> {
    const RIGHT: &str = "write three numbers from 0 to 255, such as \"V3.2.6\"";
    let text = value.label(FIRMWARE, RIGHT)?;
    let bare = text.strip_prefix(['V', 'v']).unwrap_or(text);
    let numbers = bare.split('.').map(|number| {
        let plain = number.bytes().all(|byte| byte.is_ascii_digit());
        number.parse().ok().filter(|_| plain)
    });
    let numbers: Option<Vec<u8>> = numbers.collect();
    let version = numbers.and_then(|numbers| <[u8; 3]>::try_from(numbers).ok());
    if version.is_none() {
        value.wrong(format!("\"{text}\" is no version of a firmware"), RIGHT);
    }
    version
}
