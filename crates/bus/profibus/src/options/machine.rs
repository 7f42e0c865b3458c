//! The GSD file of a user's own machine: of its stations without one.

use tickbus_base::Mistake;
use tickbus_image::signal::SignalTable;

use super::{Device, Options};
use crate::gsd::write::Machine;

impl Options {
    /// The GSD file of the stations with `ident`, or of all without a GSD file, for the machine `name`.
    ///
    /// # Errors
    ///
    /// No station matches, or the stations have several idents, each of which needs a separate file.
    pub fn gsd(
        &self,
        name: &str,
        table: &SignalTable,
        ident: Option<u16>,
    ) -> Result<String, Mistake> {
        let mut stations = Vec::new();
        let mut idents: Vec<u16> = Vec::new();
        for (index, (station, signals)) in self.stations().zip(&table.stations).enumerate() {
            let Device::Plain {
                ident: own,
                configuration,
            } = &station.device
            else {
                continue;
            };
            if !idents.contains(own) {
                idents.push(*own);
            }
            if ident.is_none_or(|asked| asked == *own) {
                let mut identity = super::station::plain(
                    *own,
                    configuration.as_ref(),
                    &self.exchanged(table, index),
                );
                let records = self.add_records(station, table, index, &mut identity);
                records.map_err(|(_, mistake)| mistake)?;
                stations.push((station.address, signals.name.as_str(), identity));
            }
        }
        let texts: Vec<String> = idents.iter().map(|own| format!("0x{own:04X}")).collect();
        let Some((_, first, _)) = stations.first() else {
            return Err(match ident {
                Some(asked) if !idents.is_empty() => Mistake::new(
                    format!("no station has the ident 0x{asked:04X}"),
                    format!("the stations without a GSD file have {}", texts.join(", ")),
                ),
                _ => Mistake::new(
                    "every station has the GSD file of its maker",
                    "give the PLC's project those; a machine of your own has stations with an ident instead",
                ),
            });
        };
        if ident.is_none() && idents.len() > 1 {
            return Err(Mistake::new(
                format!(
                    "the stations have {} idents, {}",
                    idents.len(),
                    texts.join(", ")
                ),
                format!("each has a GSD file of its own: add --ident {}", texts[0]),
            ));
        }
        let is_one_of_several = idents.len() > 1 && !first.is_empty();
        let machine = Machine {
            model: if is_one_of_several { first } else { name },
            baud: self.line.settings.baud,
            max_tsdr: self.line.max_tsdr,
            stations,
        };
        Ok(machine.write())
    }
}
