//! The kinds of bus that a driver.cfg can name. The program passes them in: this crate knows only the loopback, and a
//! third-party bus is one more line in the list of the program that contains it.

use std::fmt;

use tickbus_base::toml_text::{Table, Value, did_you_mean, shown};
use tickbus_fieldbus::examine::Search;
use tickbus_fieldbus::{BusKind, BusOptions, Events, Role};
use tickbus_plc::Programs;

use crate::kind_keys::KindKeys;
use crate::{Options, loopback};

/// Reads the keys of one kind in `[fieldbus]`; see [`BusKind::read`].
type ReadOptions = fn(Role, bool, &mut Table<'_>) -> Option<Box<dyn BusOptions>>;

/// A kind of bus, as an entry in a list of kinds.
#[derive(Clone, Copy)]
pub struct Kind {
    keys: KindKeys,
    search: Option<Search>,
    read: ReadOptions,
}

impl Kind {
    /// Returns the kind whose options are of type `K`.
    pub const fn of<K: BusKind>() -> Self {
        Self {
            keys: KindKeys {
                name: K::NAME,
                learns_of_writes: K::LEARNS_OF_WRITES,
                can_observe: K::CAN_OBSERVE,
                browses: K::BROWSES,
                keys: K::KEYS,
                one_of: K::ONE_OF,
                station_keys: K::STATION_KEYS,
            },
            search: K::SEARCH,
            read: |role, moved, table| {
                let options = K::read(role, moved, table)?;
                Some(Box::new(options))
            },
        }
    }
}

impl fmt::Debug for Kind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.keys.name.fmt(f)
    }
}

/// The kinds of bus that a program supports: the loopback and the kinds in its list. Also the PLC programs that a
/// loopback can host.
///
/// A program declares one `static` of this type, and passes it to every function that reads a driver.cfg:
///
/// ```ignore
/// static KINDS: Kinds = Kinds::new(&[Kind::of::<modbus::ServerOptions>()]);
/// static WITH_MINE: Kinds = KINDS.and(&[Kind::of::<my_bus::Options>()]);
/// ```
pub struct Kinds {
    /// The list that this one extends.
    others: Option<&'static Self>,
    buses: &'static [Kind],
    programs: Programs,
    advice: &'static [(&'static str, &'static str)],
}

impl Kinds {
    /// Contains only the loopback.
    pub const LOOPBACK: Self = Self::new(&[]);

    /// Returns the loopback and these buses.
    pub const fn new(buses: &'static [Kind]) -> Self {
        Self {
            others: None,
            buses,
            programs: Programs::NONE,
            advice: &[],
        }
    }

    /// Adds built-in PLC programs that a driver.cfg can name.
    #[must_use]
    pub const fn with_programs(self, programs: Programs) -> Self {
        Self { programs, ..self }
    }

    /// Returns the PLC programs that a driver.cfg can name.
    pub const fn programs(&self) -> &Programs {
        &self.programs
    }

    /// Adds advice for names that users try but that are not a kind: pairs of a name in lower case and the advice.
    #[must_use]
    pub const fn with_advice(self, advice: &'static [(&'static str, &'static str)]) -> Self {
        Self { advice, ..self }
    }

    /// Adds further buses. A kind that is already in the list keeps its name.
    #[must_use]
    pub const fn and(&'static self, buses: &'static [Kind]) -> Self {
        Self {
            others: Some(self),
            buses,
            programs: self.programs,
            advice: self.advice,
        }
    }

    /// Returns the names of all kinds.
    pub fn names(&self) -> Vec<&'static str> {
        self.keys().iter().map(|kind| kind.name).collect()
    }

    /// Returns the keys of all kinds.
    pub fn keys(&self) -> Vec<KindKeys> {
        let mut all = match self.others {
            Some(others) => others.keys(),
            None => vec![loopback::KIND_KEYS],
        };
        for Kind { keys, .. } in self.buses {
            // A further kind of the same name is never used.
            if all.iter().all(|other| other.name != keys.name) {
                all.push(*keys);
            }
        }
        all
    }

    /// Returns how the servers of the buses are found, for each bus whose servers can be.
    pub fn searches(&self) -> Vec<Search> {
        let mut all = self.others.map(Self::searches).unwrap_or_default();
        all.extend(self.buses.iter().filter_map(|kind| kind.search));
        all
    }

    fn find(&self, name: &str) -> Option<&Kind> {
        let others = self.others.and_then(|others| others.find(name));
        others.or_else(|| self.buses.iter().find(|kind| kind.keys.name == name))
    }

    /// Reads `events` and the keys of the bus kind `kind`, and reports their mistakes. `moved` says that another
    /// address will replace the one in the file.
    ///
    /// This finishes the table: keys left in it are unknown, unless the bus kind itself is unknown.
    pub(super) fn read(
        &self,
        kind: &Value<'_>,
        role: Role,
        moved: bool,
        mut table: Table<'_>,
    ) -> Option<(Options, Events)> {
        let name = kind.text(&format!(
            "write the kind of bus in quotes, such as \"{}\"",
            loopback::NAME
        ));
        let (options, learns_of_writes) = match name.map(|name| (name, self.find(name))) {
            Some((loopback::NAME, _)) => {
                let options = loopback::Options::read(role, &mut table, &self.programs);
                (options.map(Options::from), false)
            }
            Some((_, Some(kind))) => {
                let options = (kind.read)(role, moved, &mut table);
                let options = options.map(|options| Options::named(kind.keys.name, options));
                (options, kind.keys.learns_of_writes)
            }
            other => {
                table.finish_open();
                self.report(kind, other?.0);
                return None;
            }
        };
        let keys = self.keys();
        if role == Role::Observer
            && let Some(name) = name
            && !keys
                .iter()
                .any(|kind| kind.name == name && kind.can_observe)
        {
            let can: Vec<&str> = (keys.iter().filter(|kind| kind.can_observe))
                .map(|kind| kind.name)
                .collect();
            kind.wrong(
                format!("nobody can observe on the bus \"{}\"", shown(name)),
                format!("observe with one of {}", can.join(", ")),
            );
        }
        let events = table.take("events");
        table.finish();
        let events = events.map_or(Some(Events::None), |value| {
            read_events(&value, learns_of_writes)
        });
        Some((options?, events?))
    }

    /// Reports that no kind is called `name`.
    fn report(&self, kind: &Value<'_>, name: &str) {
        let lower = name.to_ascii_lowercase();
        let names = self.names();
        let is_kind = names.iter().any(|known| known.eq_ignore_ascii_case(name));
        let advice = self.advice.iter().find(|(known, _)| *known == lower);
        let advice = advice.filter(|_| !is_kind);
        let right = match advice {
            Some((_, right)) => (*right).to_owned(),
            None => did_you_mean(name, "bus kinds", &names),
        };
        kind.wrong(format!("bus kind \"{}\" is unknown", shown(name)), right);
    }
}

impl fmt::Debug for Kinds {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Kinds")
            .field("names", &self.names())
            .field("programs", &self.programs)
            .finish_non_exhaustive()
    }
}

/// Two lists are equal if they have the same kinds and programs.
impl PartialEq for Kinds {
    fn eq(&self, other: &Self) -> bool {
        self.names() == other.names() && self.programs.names() == other.programs.names()
    }
}

fn read_events(value: &Value<'_>, has_writes: bool) -> Option<Events> {
    if value.is_boolean() || !has_writes {
        let changes = value.boolean()?;
        return Some(if changes {
            Events::Changes
        } else {
            Events::None
        });
    }
    let right = "write true for every change, \"writes\" for every write, changed or not, or false";
    let text = value.text(right)?;
    if text != "writes" {
        value.wrong(format!("\"{}\" is no kind of events", shown(text)), right);
        return None;
    }
    Some(Events::Writes)
}
