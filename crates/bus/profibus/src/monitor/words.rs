//! Telegrams in words.

use crate::configuration::hex;
use crate::station::sap;
use crate::telegram::{BROADCAST, Control, Frame, Telegram};

/// The purpose of a request.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Service {
    Status,
    DataExchange,
    SetPrm,
    ChkCfg,
    Other(&'static str),
}

impl Service {
    fn name(self) -> &'static str {
        match self {
            Self::Status => "FDL_Status",
            Self::DataExchange => "Data_Exchange",
            Self::SetPrm => "Set_Prm",
            Self::ChkCfg => "Chk_Cfg",
            Self::Other(name) => name,
        }
    }
}

pub(crate) fn service(frame: &Frame<'_>) -> Service {
    if frame.control.function() == Control::FDL_STATUS {
        return Service::Status;
    }
    service_at(frame.dsap)
}

fn service_at(slaves: Option<u8>) -> Service {
    match slaves {
        None => Service::DataExchange,
        Some(sap::SET_PRM) => Service::SetPrm,
        Some(sap::CHK_CFG) => Service::ChkCfg,
        Some(sap::SLAVE_DIAG) => Service::Other("Slave_Diag"),
        Some(sap::GET_CFG) => Service::Other("Get_Cfg"),
        Some(sap::GLOBAL_CONTROL) => Service::Other("Global_Control"),
        Some(sap::RD_INP) => Service::Other("RD_Inp"),
        Some(sap::RD_OUTP) => Service::Other("RD_Outp"),
        Some(55) => Service::Other("Set_Slave_Add"),
        Some(53) => Service::Other("Set_Ext_Prm"),
        Some(0..=51) => Service::Other("DP-V1"),
        Some(_) => Service::Other("another service"),
    }
}

/// A telegram in words: `2 -> 8 Data_Exchange 12 34`.
pub fn words(telegram: &Telegram<'_>) -> String {
    let frame = match telegram {
        Telegram::Token {
            destination,
            source,
        } => return format!("{source} -> {destination} token"),
        Telegram::ShortAck => return "short acknowledgement".to_owned(),
        Telegram::Frame(frame) => frame,
    };
    let destination = match frame.destination {
        BROADCAST => "all".to_owned(),
        address => address.to_string(),
    };
    let what = if frame.control.is_request() {
        service(frame).name().to_owned()
    } else {
        let answer = match frame.control.0 & 0x0F {
            0x00 => "ok",
            0x02 => "no resource",
            0x03 => "not active",
            0x08 => "data",
            0x09 => "no data",
            0x0A => "data, diagnosis waits",
            _ => "another answer",
        };
        match frame.ssap.map(|ssap| service_at(Some(ssap)).name()) {
            Some(service) => format!("{service}: {answer}"),
            None => answer.to_owned(),
        }
    };
    let text = format!(
        "{} -> {destination} {what} {}",
        frame.source,
        hex(frame.data)
    );
    text.trim_end().to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn telegrams_are_told_in_words() {
        for (bytes, told) in [
            (&[0xDC, 3, 2][..], "2 -> 3 token"),
            (&[0xE5], "short acknowledgement"),
            (&[0x10, 8, 2, 0x49, 0x53, 0x16], "2 -> 8 FDL_Status"),
            (&[0x10, 2, 8, 0, 0x0A, 0x16], "8 -> 2 ok"),
            (
                &[0x68, 5, 5, 0x68, 8, 2, 0x5D, 0x12, 0x34, 0xAD, 0x16],
                "2 -> 8 Data_Exchange 12 34",
            ),
            (
                &[
                    0x68, 7, 7, 0x68, 0xFF, 0x81, 0x46, 0x3A, 0x3E, 0, 0, 0x3E, 0x16,
                ],
                "1 -> all Global_Control 00 00",
            ),
            (
                &[
                    0x68, 0x0B, 0x0B, 0x68, 0x82, 0x88, 8, 0x3E, 0x3C, 2, 5, 0, 0xFF, 0x47, 0x11,
                    0xEA, 0x16,
                ],
                "8 -> 2 Slave_Diag: data 02 05 00 FF 47 11",
            ),
        ] {
            let (telegram, _) = Telegram::parse(bytes).expect("right").expect("whole");
            assert_eq!(words(&telegram), told);
        }
    }
}
