//! A station's diagnosis in words.

use crate::configuration::hex;

/// The octets of the standard's part.
const STANDARD: usize = 6;

/// The flags that say what is wrong, by octet and bit, with the standard's names.
const FLAGS: [(usize, u8, &str); 12] = [
    (0, 0, "Station_Non_Existent"),
    (0, 1, "Station_Not_Ready"),
    (0, 2, "Cfg_Fault"),
    (0, 3, "Ext_Diag"),
    (0, 4, "Not_Supported"),
    (0, 5, "Invalid_Slave_Response"),
    (0, 6, "Prm_Fault"),
    (0, 7, "Master_Lock"),
    (1, 0, "Prm_Req"),
    (1, 1, "Stat_Diag"),
    (1, 7, "Deactivated"),
    (2, 7, "Ext_Diag_Overflow"),
];

/// True for data that are long enough to be a diagnosis.
pub(super) fn is_one(data: &[u8]) -> bool {
    data.len() >= STANDARD
}

/// The ident number in a diagnosis.
pub(super) fn ident(data: &[u8]) -> u16 {
    u16::from_be_bytes([data[4], data[5]])
}

/// The flags and the octets: `Ext_Diag: 08 0C 00 02 80 E0 43 01`; empty for no diagnosis.
pub(super) fn in_words(data: &[u8]) -> String {
    if !is_one(data) {
        return String::new();
    }
    let set = FLAGS
        .iter()
        .filter(|(octet, bit, _)| data[*octet] & (1 << bit) != 0);
    let names: Vec<&str> = set.map(|(_, _, name)| *name).collect();
    let names = match &names[..] {
        [] => "nothing wrong".to_owned(),
        names => names.join(", "),
    };
    format!("{names}: {}", hex(data))
}
