//! The bus `hilscher-cifx`: cifX and netX cards.

mod errors;
mod information;
mod library;

pub use errors::ERRORS;

use std::path::Path;
use std::sync::Arc;

use tickbus_base::Mistake;
use tickbus_base::time::Nanos;
use tickbus_base::toml_text::{Key, Shape, Table};
use tickbus_fieldbus::{
    Bus, BusError, BusKind, BusOptions, BusSetup, CYCLE, Card, CardBus, CardOptions, Failing,
    Moved, NamedFile, OpenError, Port, Role, Vendor, Verdict,
};
use tickbus_image::signal::SignalTable;

use crate::answer::Answer;
use crate::timeout::{millis, read};
use errors::{failing, moved};
use library::{Channel, Driver, Library, NAME, OFF, ON};

/// The time for the card to register that this program is ready or not, and to switch its bus off.
const STATE: Nanos = Nanos::from_secs(1);

/// The longest name of a board in the driver.
const BOARD_LIMIT: usize = 15;

/// The keys of the bus, for the schema of a driver.cfg.
const KEYS: &[Key] = &[
    Key::new(
        "board",
        Shape::Label(BOARD_LIMIT),
        "The board, by the name or alias that the vendor's tools show",
    )
    .or("\"cifX0\""),
    Key::new("channel", Shape::Whole(0, 5), "The channel of the board").or("0"),
    Key::new(
        "io_timeout",
        Shape::Duration,
        "How long the card may take to hand over the process data",
    )
    .or("\"10ms\""),
    Key::new(
        "bus_on_timeout",
        Shape::Duration,
        "How long opening waits for the bus to communicate",
    )
    .or("\"10s\""),
    CardOptions::library_key(Some(NAME)),
];

/// The options of the bus `hilscher-cifx`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Options {
    /// Library, places and watchdog.
    pub card: CardOptions,
    /// The board's name or alias.
    pub board: String,
    /// The channel.
    pub channel: u32,
    /// The time for the card to pass the process data on.
    pub io_timeout: Nanos,
    /// How long opening waits for the bus to communicate.
    pub bus_on_timeout: Nanos,
}

impl BusKind for Options {
    const NAME: &'static str = "hilscher-cifx";
    const KEYS: &'static [&'static [Key]] = &[KEYS, CardOptions::KEYS];

    fn read(_role: Role, _moved: bool, table: &mut Table<'_>) -> Option<Self> {
        let board = table.take("board");
        let channel = table.take("channel");
        let io_timeout = table.take("io_timeout");
        let bus_on_timeout = table.take("bus_on_timeout");
        let card = CardOptions::read(table, Some(NAME));
        let board = board.map_or(Some("cifX0"), |value| {
            value.label(
                BOARD_LIMIT,
                "name the board as the vendor's tools do, such as \"cifX0\"",
            )
        });
        let channel = channel.map_or(Some(0), |value| value.whole(0..=5));
        let io_timeout = read(io_timeout, Nanos::from_millis(10));
        let bus_on_timeout = read(bus_on_timeout, Nanos::from_secs(10));
        Some(Self {
            card: card?,
            board: board?.to_owned(),
            channel: u32::try_from(channel?).ok()?,
            io_timeout: io_timeout?,
            bus_on_timeout: bus_on_timeout?,
        })
    }
}

impl BusOptions for Options {
    fn summary(&self, _role: Role, _table: &SignalTable) -> Vec<String> {
        let mut parts = vec![format!("board {} channel {}", self.board, self.channel)];
        parts.extend(self.card.summary());
        parts
    }

    fn files(&self) -> Vec<NamedFile> {
        Vec::new()
    }

    fn open(&self, setup: &BusSetup<'_>) -> Result<Bus, OpenError> {
        let path = self.card.library(NAME, setup.folder)?;
        let driver = Cifx(self.clone());
        Ok(Bus::Free(Box::new(CardBus::new(driver, path, setup))))
    }

    fn cycle(&self) -> Option<Nanos> {
        Some(CYCLE)
    }
}

/// The way to the card in the options.
struct Cifx(Options);

impl Vendor for Cifx {
    const COUNTERS: [&'static str; 3] = [
        "hilscher-cifx.slow_calls",
        "hilscher-cifx.no_com",
        "hilscher-cifx.again",
    ];

    type Library = Arc<Library>;

    fn load(&self, path: &Path) -> Result<Self::Library, Mistake> {
        Library::load(path)
    }

    fn open<'l>(
        &self,
        library: &'l Self::Library,
        port: &Port,
        _sizes: [usize; 2],
    ) -> Result<Box<dyn Card + 'l>, BusError> {
        let driver = Driver::open(library).map_err(Failing::error)?;
        let channel = Channel::open(driver, &self.0.board, self.0.channel);
        let mut card = OpenCard {
            channel: channel.map_err(Failing::error)?,
            is_ready: false,
            is_on: false,
            is_watched: false,
            options: self.0.clone(),
        };
        // Only for people: continue if a driver does not provide this.
        if let Ok(information) = card.channel.information() {
            port.tell("card", &information.to_string());
            port.tell("card.state", &information.state());
        }
        card.start().map_err(Failing::error)?;
        Ok(Box::new(card))
    }

    fn limits(&self) -> [Nanos; 2] {
        // The driver for Linux searches for its cards when it starts.
        let start = Nanos::from_secs(10);
        [
            start + STATE + self.0.bus_on_timeout,
            STATE.times(2) + Nanos::from_secs(2),
        ]
    }

    fn timeout(&self) -> Nanos {
        self.0.io_timeout.times(2)
    }
}

/// An open channel that was started to some extent; dropping it reverses the steps.
struct OpenCard<'l> {
    channel: Channel<'l>,
    is_ready: bool,
    is_on: bool,
    is_watched: bool,
    options: Options,
}

impl OpenCard<'_> {
    fn start(&mut self) -> Result<(), Failing> {
        self.is_ready = true;
        self.channel.host_state(ON, millis(STATE))?;
        self.is_on = true;
        let timeout = millis(self.options.bus_on_timeout);
        match self.channel.bus_state(ON, timeout) {
            // The card's bus may come up later.
            Err(failing) if failing.verdict == Verdict::NoPeer => {}
            other => other?,
        }
        self.is_watched = self.options.card.watchdog;
        self.trigger()
    }

    /// Triggers the card's watchdog, if there is one.
    fn trigger(&self) -> Result<(), Failing> {
        if !self.is_watched {
            return Ok(());
        }
        match self.channel.watchdog(ON) {
            0 => Ok(()),
            code => Err(failing("xChannelWatchdog", code)),
        }
    }
}

impl Card for OpenCard<'_> {
    fn exchange(
        &mut self,
        _now: Nanos,
        output: &[u8],
        input: &mut [u8],
    ) -> Result<Moved, BusError> {
        let Options {
            card, io_timeout, ..
        } = &self.options;
        let timeout = millis(*io_timeout);
        match self.trigger() {
            // The exchange reports that, too, and the next cycle triggers the watchdog again.
            Err(Failing {
                verdict: Verdict::Again | Verdict::NoPeer,
                ..
            }) => {}
            other => other.map_err(Failing::error)?,
        }
        let (mut out, mut back, mut again) = (false, false, None);
        let mut no_peer = None;
        let mut note = |answer: Answer, moved: &mut bool| match answer {
            Answer::Moved => *moved = true,
            Answer::Again(meaning) => again = Some(meaning),
            Answer::NoPeer(words) => no_peer = Some(words),
        };
        if !output.is_empty() {
            let code = self.channel.write(card.write_offset, output, timeout);
            note(moved("xChannelIOWrite", code)?, &mut out);
        }
        if !input.is_empty() {
            let code = self.channel.read(card.read_offset, input, timeout);
            note(moved("xChannelIORead", code)?, &mut back);
        }
        Ok(match no_peer {
            Some(words) => Moved::NoPeer(words),
            None => Moved::Data { out, back, again },
        })
    }
}

impl Drop for OpenCard<'_> {
    fn drop(&mut self) {
        // A failure here was reported before, or the card is gone: continue closing in any case.
        if self.is_watched {
            self.channel.watchdog(OFF);
        }
        if self.is_on {
            let _ = self.channel.bus_state(OFF, millis(STATE));
        }
        if self.is_ready {
            let _ = self.channel.host_state(OFF, millis(STATE));
        }
    }
}
