//! The bus `hilscher-cif`: the cards before cifX, through the vendor's driver for Windows.
//!
//! The old driver for Linux has functions with the same names but different parameters, and is not supported.

mod errors;
mod library;

pub use errors::{ERRORS, meaning};

use std::path::Path;

use tickbus_base::Mistake;
use tickbus_base::time::Nanos;
use tickbus_base::toml_text::{Key, Shape, Table, names};
use tickbus_fieldbus::{
    Bus, BusError, BusKind, BusOptions, BusSetup, CYCLE, Card, CardBus, CardOptions, Failing,
    Moved, NamedFile, OpenError, Port, Role, Vendor, Verdict,
};
use tickbus_image::signal::SignalTable;

use crate::answer::Answer;
use crate::timeout::{millis, read};
use errors::moved;
use library::{Area, Board, Driver, Library};

/// The vendor's library.
const NAME: &str = "CIF32DLL.DLL";

/// The time limit of a reset.
const RESET: Nanos = Nanos::from_secs(5);

/// The time for the card to register that this program is ready or not.
const STATE: Nanos = Nanos::from_millis(200);

/// The keys of the bus, for the schema of a driver.cfg.
const KEYS: &[Key] = &[
    Key::new(
        "device",
        Shape::Whole(0, 3),
        "The card's number in the driver's set-up",
    )
    .or("0"),
    Key::new(
        "reset",
        Shape::Choice(&names(&RESETS)),
        "How the card is reset when it is opened",
    )
    .or("\"warmstart\""),
    Key::new(
        "io_timeout",
        Shape::Duration,
        "How long the card may take to hand over the process data",
    )
    .or("\"100ms\""),
    CardOptions::library_key(Some(NAME)),
];

/// The kinds of reset: the modes of the driver's call.
const RESETS: [(&str, u16); 2] = [("coldstart", 2), ("warmstart", 3)];

/// The options of the bus `hilscher-cif`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Options {
    /// Library, places and watchdog.
    pub card: CardOptions,
    /// The card's number.
    pub device: u16,
    /// How the card is reset when it is opened: the mode of the driver's call.
    pub reset: u16,
    /// The time for the card to exchange the process data.
    pub io_timeout: Nanos,
}

impl BusKind for Options {
    const NAME: &'static str = "hilscher-cif";
    const KEYS: &'static [&'static [Key]] = &[KEYS, CardOptions::KEYS];

    fn read(_role: Role, _moved: bool, table: &mut Table<'_>) -> Option<Self> {
        let device = table.take("device");
        let reset = table.take("reset");
        let io_timeout = table.take("io_timeout");
        let card = CardOptions::read(table, Some(NAME));
        let device = device.map_or(Some(0), |value| value.whole(0..=3));
        let reset = reset.map_or(Some(3), |value| value.choice("kinds of reset", &RESETS));
        let io_timeout = read(io_timeout, Nanos::from_millis(100));
        Some(Self {
            card: card?,
            device: u16::try_from(device?).ok()?,
            reset: reset?,
            io_timeout: io_timeout?,
        })
    }
}

impl BusOptions for Options {
    fn summary(&self, _role: Role, _table: &SignalTable) -> Vec<String> {
        let mut parts = vec![format!("device {}", self.device)];
        parts.extend(self.card.summary());
        parts
    }

    fn files(&self) -> Vec<NamedFile> {
        Vec::new()
    }

    fn open(&self, setup: &BusSetup<'_>) -> Result<Bus, OpenError> {
        if cfg!(not(windows)) && self.card.library.is_none() {
            return Err(OpenError::Unsupported(
                "the driver behind \"hilscher-cif\" is for Windows alone; for a cifX card use \"hilscher-cifx\"".to_owned(),
            ));
        }
        let path = self.card.library(NAME, setup.folder)?;
        let driver = Cif(self.clone());
        Ok(Bus::Free(Box::new(CardBus::new(driver, path, setup))))
    }

    fn cycle(&self) -> Option<Nanos> {
        Some(CYCLE)
    }
}

/// The way to the card in the options.
struct Cif(Options);

impl Vendor for Cif {
    const COUNTERS: [&'static str; 3] = [
        "hilscher-cif.slow_calls",
        "hilscher-cif.no_com",
        "hilscher-cif.again",
    ];

    type Library = Library;

    fn load(&self, path: &Path) -> Result<Self::Library, Mistake> {
        Library::load(path)
    }

    fn open<'l>(
        &self,
        library: &'l Library,
        port: &Port,
        sizes: [usize; 2],
    ) -> Result<Box<dyn Card + 'l>, BusError> {
        let driver = Driver::open(library, self.0.device).map_err(Failing::error)?;
        let board = Board::init(driver).map_err(Failing::error)?;
        if let Some(firmware) = board.information::<32>(Area::Firmware) {
            let texts = [&firmware[..16], &firmware[16..]];
            let texts = texts.map(|part| String::from_utf8_lossy(part).replace('\0', " "));
            port.tell(
                "card",
                &format!("device {}, firmware {}", self.0.device, texts.join(" ")),
            );
        }
        if let Some([kib, ..]) = board.information::<6>(Area::Device) {
            self.check_sizes(kib, sizes)?;
        }
        let mut card = OpenCard {
            board,
            is_ready: false,
            is_watched: false,
            options: self.0.clone(),
        };
        card.start().map_err(Failing::error)?;
        Ok(Box::new(card))
    }

    fn limits(&self) -> [Nanos; 2] {
        [
            RESET + STATE + Nanos::from_secs(2),
            STATE + Nanos::from_secs(2),
        ]
    }

    fn timeout(&self) -> Nanos {
        self.0.io_timeout
    }
}

impl Cif {
    /// Checks that the signals fit into a card with this many KiB of memory: the card itself uses the last KiB, the
    /// rest holds the two images.
    fn check_sizes(&self, kib: u8, [writes, reads]: [usize; 2]) -> Result<(), BusError> {
        let image = usize::from(kib).saturating_sub(1) * 1024 / 2;
        let card = &self.0.card;
        for (does, offset, bytes) in [
            ("writes", card.write_offset, writes),
            ("reads", card.read_offset, reads),
        ] {
            let end = usize::from(offset) + bytes;
            if end > image {
                return Err(BusError::Refused(format!(
                    "this end {does} up to byte {end}, and the card has {image} bytes in each direction; check the \
                     addresses of the signals, `write_offset` and `read_offset`"
                )));
            }
        }
        Ok(())
    }
}

/// A card that was started to some extent; dropping it reverses the steps.
struct OpenCard<'l> {
    board: Board<'l>,
    is_ready: bool,
    is_watched: bool,
    options: Options,
}

impl OpenCard<'_> {
    fn start(&mut self) -> Result<(), Failing> {
        let is_up = |result: Result<(), Failing>| match result {
            // The card's bus may come up later.
            Err(failing) if failing.verdict == Verdict::NoPeer => Ok(()),
            other => other,
        };
        is_up(self.board.reset(self.options.reset, millis(RESET)))?;
        self.is_ready = true;
        is_up(self.board.host_state(true, millis(STATE)))?;
        self.is_watched = self.options.card.watchdog;
        self.trigger()
    }

    /// Triggers the card's watchdog, if there is one.
    fn trigger(&self) -> Result<(), Failing> {
        if self.is_watched {
            self.board.watchdog(true)?;
        }
        Ok(())
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
        match self.trigger() {
            // The exchange reports that, too, and the next cycle triggers the watchdog again.
            Err(Failing {
                verdict: Verdict::Again | Verdict::NoPeer,
                ..
            }) => {}
            other => other.map_err(Failing::error)?,
        }
        let offsets = [card.write_offset, card.read_offset];
        let code = self
            .board
            .exchange(offsets, output, input, millis(*io_timeout));
        Ok(match moved(code)? {
            Answer::Moved => Moved::Data {
                out: true,
                back: true,
                again: None,
            },
            Answer::Again(meaning) => Moved::Data {
                out: false,
                back: false,
                again: Some(meaning),
            },
            Answer::NoPeer(words) => Moved::NoPeer(words),
        })
    }
}

impl Drop for OpenCard<'_> {
    fn drop(&mut self) {
        // A failure here was reported before, or the card is gone: continue closing in any case.
        if self.is_watched {
            let _ = self.board.watchdog(false);
        }
        if self.is_ready {
            let _ = self.board.host_state(false, millis(STATE));
        }
    }
}
