//! Observes stations: takes the data that a master exchanges with them off the line, and sends nothing.
//!
//! The core, [`Observer`], is a function of the bytes on the line. The bus beside it has the port and the image.

mod bus;
mod diagnosis;

use std::collections::BTreeMap;

use tickbus_base::os::Characters;
use tickbus_base::time::Nanos;
use tickbus_fieldbus::Cause;

pub(crate) use bus::ProfibusObserver;

use crate::monitor::{Monitor, Service, service};
use crate::parameters::Parameters;
use crate::station::{Identity, sap};
use crate::telegram::{BROADCAST, Control, Frame, Telegram};

/// So many short acknowledgements in a row are believed where inputs are expected: one alone can be noise, since it is
/// a single character without a checksum.
const BELIEVED: u32 = 3;

/// The stations that are observed, and their masters' requests.
#[derive(Debug)]
pub(crate) struct Observer {
    monitor: Monitor,
    stations: Vec<Observed>,
    /// When the last telegram with a checksum passed, and how often damaged bytes had been heard by then.
    framed: Option<Nanos>,
    damaged: u64,
}

/// One station, as the line shows it.
#[derive(Debug)]
struct Observed {
    address: u8,
    identity: Identity,
    /// The master that has exchanged data with it.
    master: Option<u8>,
    /// The words of each master to it: the station acknowledges the parameters of masters that it does not obey, too.
    told: BTreeMap<u8, Told>,
    /// Why it is another device than expected, by its ident, and by its modules.
    other_device: Option<String>,
    other_modules: Option<String>,
    /// Why the last exchange cannot be read.
    wrong: Option<String>,
    /// How often in a row it has acknowledged an exchange for which it has inputs.
    acknowledged: u32,
    /// The last diagnosis.
    diagnosis: Vec<u8>,
    /// The outputs of CLEAR.
    zeros: Vec<u8>,
}

/// The words of one master to a station. They count once the two exchange data.
#[derive(Debug, Default)]
struct Told {
    /// The groups of the station, from its parameters.
    group: u8,
    /// A master in CLEAR sends it telegrams without outputs, by the parameters.
    fail_safe: bool,
    /// The ident in the parameters, until it is compared.
    ident: Option<u16>,
    /// The master is in CLEAR, by `Global_Control`.
    is_cleared: bool,
}

/// News of an observed station.
#[derive(Debug, PartialEq, Eq)]
pub(crate) enum News<'a> {
    /// The master has sent these outputs, and the station has answered with these inputs.
    Exchange {
        master: u8,
        outputs: &'a [u8],
        inputs: &'a [u8],
        is_cleared: bool,
    },
    /// The master is in CLEAR from now on, or no longer.
    Cleared(bool),
    /// Data are exchanged that cannot be read: why.
    Unreadable(&'a str),
    /// The station has another diagnosis than before, in words.
    Diagnosis(String),
}

impl Observer {
    /// Observes stations with these addresses and devices on a line of `baud` bits per second.
    pub(crate) fn new(baud: u32, stations: impl IntoIterator<Item = (u8, Identity)>) -> Self {
        let observed = |(address, identity): (u8, Identity)| Observed {
            address,
            master: None,
            told: BTreeMap::new(),
            other_device: None,
            other_modules: None,
            wrong: None,
            acknowledged: 0,
            diagnosis: Vec::new(),
            zeros: vec![0; identity.configuration.outputs()],
            identity,
        };
        Self {
            monitor: Monitor::new(baud),
            stations: stations.into_iter().map(observed).collect(),
            framed: None,
            damaged: 0,
        }
    }

    /// Takes characters off the line, and passes on the news of each station, by its index. Returns the number of
    /// telegrams.
    pub(crate) fn hear<'a>(
        &mut self,
        now: Nanos,
        characters: impl Into<Characters<'a>>,
        mut each: impl FnMut(usize, News<'_>),
    ) -> u64 {
        let mut telegrams = 0;
        let before = self.framed;
        let Self {
            monitor,
            stations,
            framed,
            ..
        } = self;
        monitor.hear(now, characters, |heard| {
            let Some(telegram) = heard.telegram else {
                return;
            };
            telegrams += 1;
            let (answer, frame) = match telegram {
                Telegram::Token { .. } => return,
                Telegram::ShortAck => ((Control::OK, &[][..]), None),
                Telegram::Frame(frame) => {
                    *framed = Some(now);
                    ((frame.control, frame.data), Some(frame))
                }
            };
            if let Some(frame) = frame.filter(|frame| frame.control.is_request()) {
                for (index, station) in stations.iter_mut().enumerate() {
                    station.control(&frame, |news| each(index, news));
                }
                return;
            }
            let request = heard.request.map(Telegram::parse);
            let Some(Ok(Some((Telegram::Frame(request), _)))) = request else {
                return;
            };
            // An answer to another master.
            if frame.is_some_and(|frame| frame.destination != request.source) {
                return;
            }
            let asked = stations.iter_mut().enumerate();
            let mut asked = asked.filter(|(_, station)| station.address == request.destination);
            if let Some((index, station)) = asked.next() {
                station.answered(&request, answer, |news| each(index, news));
            }
        });
        if self.framed != before {
            self.damaged = self.monitor.damaged();
        }
        telegrams
    }

    /// How often bytes were heard that are no telegram.
    pub(crate) fn damaged(&self) -> u64 {
        self.monitor.damaged()
    }

    /// When the last telegram passed that has a checksum: other bytes can look like one of the others.
    pub(crate) fn framed(&self) -> Option<Nanos> {
        self.framed
    }

    /// True if damaged bytes were heard since.
    pub(crate) fn is_garbled(&self) -> bool {
        self.monitor.damaged() > self.damaged
    }

    /// Says why no data of a station are observed, and what the cause is. `exchanges`: data that cannot be read are still
    /// exchanged.
    pub(crate) fn trouble(&self, station: usize, exchanges: bool) -> (String, Cause) {
        let station = &self.stations[station];
        match &station.wrong {
            Some(wrong) if exchanges => (wrong.clone(), Cause::Refused),
            _ => (self.silence(station), Cause::Link),
        }
    }

    /// Says why nothing is exchanged with a station.
    fn silence(&self, station: &Observed) -> String {
        let address = station.address;
        let Some(progress) = self.monitor.progress(address) else {
            let others: Vec<String> =
                (self.monitor.answering().map(|other| other.to_string())).collect();
            let others = match &others[..] {
                [] => "no station answers".to_owned(),
                all => format!("the stations that answer are {}", all.join(", ")),
            };
            return format!(
                "no master asks station {address}, and {others}; correct \"address\", or see whether the master's \
                 program has the station"
            );
        };
        let master = progress.master;
        let words = diagnosis::in_words(&station.diagnosis);
        match progress.state {
            _ if !progress.answers => format!(
                "station {address} does not answer master {master}; see whether it is on, and connected"
            ),
            "silent" => format!(
                "station {address} no longer answers master {master}; see whether it is on, and connected"
            ),
            "exchanges data" => format!("master {master} no longer asks station {address}"),
            state => {
                let told = if words.is_empty() {
                    String::new()
                } else {
                    format!("; its diagnosis: {words}")
                };
                format!(
                    "master {master} and station {address} exchange no data, the station {state}{told}"
                )
            }
        }
    }
}

impl Observed {
    /// A request, as far as it is `Global_Control` for this station.
    fn control(&mut self, request: &Frame<'_>, mut tell: impl FnMut(News<'_>)) {
        let is_mine = [BROADCAST, self.address].contains(&request.destination)
            && request.dsap == Some(sap::GLOBAL_CONTROL)
            && !request.control.is_answered();
        let &[command, groups] = request.data else {
            return;
        };
        if !is_mine {
            return;
        }
        let told = self.told.entry(request.source).or_default();
        if groups != 0 && groups & told.group == 0 {
            return;
        }
        let is_cleared = command & 0x02 != 0;
        let is_news = std::mem::replace(&mut told.is_cleared, is_cleared) != is_cleared;
        if is_news && self.master == Some(request.source) {
            tell(News::Cleared(is_cleared));
        }
    }

    /// The station has answered this request.
    fn answered(
        &mut self,
        request: &Frame<'_>,
        (control, data): (Control, &[u8]),
        mut tell: impl FnMut(News<'_>),
    ) {
        match (service(request), request.dsap) {
            (Service::DataExchange, _) => self.exchange(request, control, data, tell),
            (Service::SetPrm | Service::ChkCfg, _) if control != Control::OK => {}
            (Service::SetPrm, _) => self.parameters(request),
            (Service::ChkCfg, _) => {
                let configuration = &self.identity.configuration;
                let difference = configuration.difference(request.data);
                // Signals alone do not say how many bytes there are beside them.
                let difference = difference.filter(|_| !configuration.has_sizes_only());
                self.other_modules = difference.map(|difference| {
                    let (address, master) = (self.address, request.source);
                    format!(
                        "master {master} starts up station {address} with other modules: {difference}; write the \
                         modules of the PLC's project"
                    )
                });
            }
            (_, Some(sap::SLAVE_DIAG)) if diagnosis::is_one(data) && self.diagnosis != data => {
                self.diagnosis.clear();
                self.diagnosis.extend_from_slice(data);
                let ident = diagnosis::ident(data);
                self.compare(ident);
                tell(News::Diagnosis(diagnosis::in_words(data)));
            }
            _ => {}
        }
    }

    /// `Set_Prm`.
    fn parameters(&mut self, request: &Frame<'_>) {
        let Some(parameters) = Parameters::read(request.data) else {
            return;
        };
        if !parameters.lock {
            return;
        }
        let told = Told {
            group: parameters.group,
            fail_safe: parameters.fail_safe(self.identity.dpv1),
            ident: Some(parameters.ident),
            // A station that starts up waits for the next command.
            is_cleared: false,
        };
        self.told.insert(request.source, told);
    }

    /// Compares the device's ident with the expected one.
    fn compare(&mut self, ident: u16) {
        let (address, expected) = (self.address, self.identity.ident);
        self.other_device = (ident != expected).then(|| {
            format!(
                "station {address} is a device with the ident {ident:04X}, expected {expected:04X}; name that \
                 device's GSD file, or correct \"address\" or \"ident\""
            )
        });
    }

    /// `Data_Exchange`.
    fn exchange(
        &mut self,
        request: &Frame<'_>,
        control: Control,
        inputs: &[u8],
        mut tell: impl FnMut(News<'_>),
    ) {
        let is_acknowledged = control == Control::OK && inputs.is_empty();
        let has_data = [Control::DATA_LOW, Control::DATA_HIGH].contains(&control);
        if !is_acknowledged && !has_data {
            return;
        }
        let is_odd = is_acknowledged && self.identity.configuration.inputs() > 0;
        self.acknowledged = if is_odd {
            self.acknowledged.saturating_add(1)
        } else {
            0
        };
        if is_odd && self.acknowledged < BELIEVED {
            return;
        }
        let master = request.source;
        self.master = Some(master);
        let told = self.told.entry(master).or_default();
        let (mut outputs, mut is_cleared) = (request.data, told.is_cleared);
        // Who joined later has not heard the parameters, but sees that the master is in CLEAR.
        let is_fail_safe = self.identity.fail_safe || told.fail_safe || is_cleared;
        if let Some(ident) = told.ident.take() {
            self.compare(ident);
        }
        let modules = &self.identity.configuration;
        if outputs.is_empty() && is_fail_safe && !self.zeros.is_empty() {
            (outputs, is_cleared) = (&self.zeros, true);
        }
        let fits = |received: &[u8], expected: usize| {
            received.len() == expected || modules.has_sizes_only() && received.len() > expected
        };
        let other_length = || !fits(outputs, modules.outputs()) || !fits(inputs, modules.inputs());
        self.wrong = if let Some(known) = self.other_device.as_ref().or(self.other_modules.as_ref())
        {
            Some(known.clone())
        } else if other_length() {
            let at_least = if modules.has_sizes_only() {
                "at least "
            } else {
                ""
            };
            Some(format!(
                "master {master} and station {} exchange {} bytes of outputs and {} bytes of inputs, expected \
                 {at_least}{} and {}; write the modules of the PLC's project",
                self.address,
                request.data.len(),
                inputs.len(),
                modules.outputs(),
                modules.inputs(),
            ))
        } else {
            None
        };
        match &self.wrong {
            Some(why) => tell(News::Unreadable(why)),
            None => tell(News::Exchange {
                master,
                outputs,
                inputs,
                is_cleared,
            }),
        }
    }
}

#[cfg(test)]
mod tests;
