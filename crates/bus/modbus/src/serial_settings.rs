//! The settings of serial lines that devices usually have, to be tried if those of a driver.cfg are wrong.

use tickbus_base::os::{Parity, SerialSettings};

use crate::line::PARITIES;

/// The usual baud rates, the most frequent first.
const BAUDS: [u32; 8] = [9600, 19_200, 38_400, 57_600, 115_200, 4800, 2400, 1200];

/// The usual settings besides `own`, the most frequent first.
pub(crate) fn others(own: SerialSettings) -> impl Iterator<Item = SerialSettings> {
    let usual = [Parity::Even, Parity::None, Parity::Odd];
    let at = move |baud| {
        usual.map(|parity| SerialSettings {
            baud,
            parity,
            // A second stop bit is a pause for those who do not expect it.
            two_stop_bits: own.two_stop_bits && parity == Parity::None,
            ..own
        })
    };
    // At the own baud rate first.
    let bauds = BAUDS.into_iter().filter(move |baud| *baud != own.baud);
    let bauds = std::iter::once(own.baud).chain(bauds);
    bauds.flat_map(at).filter(move |other| *other != own)
}

/// The keys of a driver.cfg for these settings.
pub(crate) fn written(settings: SerialSettings) -> String {
    let parities = PARITIES.iter();
    let name = parities
        .filter(|(_, parity)| *parity == settings.parity)
        .map(|(name, _)| *name);
    let name = name.collect::<String>();
    format!("baud = {} and parity = \"{name}\"", settings.baud)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn other_settings_begin_at_the_same_rate_and_are_none_twice() {
        let own = SerialSettings {
            baud: 19_200,
            parity: Parity::Even,
            two_stop_bits: false,
            seven_bits: false,
            rs485: true,
        };
        let all: Vec<SerialSettings> = others(own).collect();
        assert_eq!(all.len(), 3 * BAUDS.len() - 1);
        assert!(!all.contains(&own));
        assert!(all.iter().all(|other| other.rs485));
        assert_eq!(written(all[0]), "baud = 19200 and parity = \"none\"");
    }
}
