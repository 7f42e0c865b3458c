//! A complete driver.cfg.

use std::path::{Path, PathBuf};

use super::driver_table::read_driver;
use super::layout;
use super::observer;
use super::origin::{CommandLineEnd, Origin};
use super::timing::{Line, Timing, TimingKeys};
use crate::loopback;
use crate::{Kinds, Options, PageOptions};
use tickbus_axis as axis;
use tickbus_axis::{Axis, Field};
use tickbus_base::RealTime;
use tickbus_base::toml_text::{Collector, Mistakes, Table, Value, load_text, read_text, shown};
use tickbus_fieldbus::faults::{self, Fault};
use tickbus_fieldbus::{At, Events, LifeSigns, Role, Written};
use tickbus_image::signal::{Addressing, Area, SignalTable, Station};
use tickbus_record as record;
use tickbus_reply::{self as reply, Drive, Reply};

/// The checked contents of a driver.cfg.
#[derive(Clone, Debug, PartialEq)]
pub struct Config {
    /// The file that it was read from.
    pub path: PathBuf,
    /// The driver's id, unique among the drivers of a folder; positive.
    pub id: i32,
    /// The driver's name, for people.
    pub name: String,
    /// The end of the bus that the driver serves.
    pub role: Role,
    /// The real-time settings for the threads of the bus and of a hosted program.
    pub real_time: Option<RealTime>,
    /// The unit that the addresses in the file count in; the addresses in `table` count bytes.
    pub addressing: Addressing,
    /// The driver's stations and signals.
    pub table: SignalTable,
    /// The driver's axes; their signals are in `table` like all others.
    pub axes: Vec<Axis>,
    /// The signals that the driver makes where no model does; none at the PLC's end.
    pub replies: Vec<Reply>,
    /// Cycle times and time-outs.
    pub timing: Timing,
    /// The options of the bus.
    pub bus: Options,
    /// The kinds of bus known when the file was read: [tables that replace the file's own](Self::overlaid) can name
    /// them.
    pub kinds: &'static Kinds,
    /// The events to report.
    pub events: Events,
    /// The signals that show each end that the other one is alive.
    pub life_signs: LifeSigns,
    /// Faults to inject at this end.
    pub faults: Vec<Fault>,
    /// The file with further faults; [`load`](Self::load) reads it.
    pub fault_file: Option<PathBuf>,
    /// The recording to make, if any.
    pub record: Option<record::Options>,
    /// The live page, if the file asks for one.
    pub page: Option<PageOptions>,
    /// The way in which the file was read, for [reading it again](Self::read_again).
    pub origin: Origin,
}

/// The values known before a file is read.
type Given = (Option<CommandLineEnd>, &'static Kinds);

impl Config {
    /// Returns the reply that makes the signal with this index.
    pub fn reply_of(&self, signal: usize) -> Option<&Reply> {
        let mut replies = self.replies.iter();
        replies.find(|reply| reply.outputs.contains(&signal))
    }

    /// Returns the signals of the machine that the driver makes by itself apart from replies (heartbeats, and those of
    /// axes), by index, and what makes them.
    pub fn made_signals(&self) -> Vec<(usize, String)> {
        taken_signals(&self.table, &self.axes, &self.life_signs)
    }

    /// Returns the folder to which paths in the driver.cfg are relative.
    pub fn folder(&self) -> &Path {
        self.path.parent().unwrap_or(Path::new(""))
    }

    /// Reads the driver.cfg at `path`, which can name these `kinds` of bus.
    ///
    /// # Errors
    ///
    /// Returns an error if the file cannot be read or is not UTF-8, or every mistake in it.
    pub fn load(path: &Path, kinds: &'static Kinds) -> Result<Self, Mistakes> {
        Self::load_as(path, None, kinds)
    }

    /// Reads the driver.cfg at `path` for a separate process that serves the end `asked` for on its command line.
    ///
    /// # Errors
    ///
    /// As [`load`](Self::load). Also an error if the file states the other role, or if its bus cannot leave the
    /// process.
    pub fn load_as(
        path: &Path,
        asked: Option<CommandLineEnd>,
        kinds: &'static Kinds,
    ) -> Result<Self, Mistakes> {
        let text = load_text(path)?;
        let shown = path.display().to_string();
        let mut config = Self::parse_at(path, &shown, &text, (asked, kinds))?;
        let collector = Collector::new(&shown, &text);
        config
            .bus
            .check_files(config.folder(), &config.table, &collector);
        if let Some(mistakes) = collector.finish() {
            return Err(mistakes);
        }
        if let Some(file) = config.fault_file.take() {
            config.add_faults(&file)?;
        }
        Ok(config)
    }

    /// Returns the context in which the driver's faults are read.
    pub fn fault_scope(&self) -> faults::Scope<'_> {
        faults::Scope {
            table: &self.table,
            has_diagnosis: self.bus.has_diagnosis(),
            has_answers: self.bus.has_answers(),
            codes: self.bus.answer_codes(),
        }
    }

    /// Adds the faults in the file at `path`.
    ///
    /// # Errors
    ///
    /// Returns an error if the file cannot be read, or every mistake in it.
    pub fn add_faults(&mut self, path: &Path) -> Result<(), Mistakes> {
        let text = load_text(path)?;
        let file = path.display().to_string();
        let allowed = self.role.check_faults();
        allowed.map_err(|mistake| Mistakes::of(&file, mistake))?;
        let more = faults::read_file(&file, &text, self.fault_scope())?;
        if self.faults.len() + more.len() > faults::LIMIT {
            let what = format!("there are {} faults", self.faults.len() + more.len());
            let right = format!("a driver has at most {}", faults::LIMIT);
            return Err(Mistakes::of_file(&file, what, right));
        }
        self.faults.extend(more);
        Ok(())
    }

    /// Reads the text of a driver.cfg; mistakes call it `file_name`.
    ///
    /// # Errors
    ///
    /// Returns every mistake in the text.
    pub fn parse(file_name: &str, text: &str, kinds: &'static Kinds) -> Result<Self, Mistakes> {
        Self::parse_as(file_name, text, None, kinds)
    }

    /// As [`parse`](Self::parse), for the end `asked` for on a command line; see [`load_as`](Self::load_as).
    ///
    /// # Errors
    ///
    /// Returns every mistake in the text.
    pub fn parse_as(
        file_name: &str,
        text: &str,
        asked: Option<CommandLineEnd>,
        kinds: &'static Kinds,
    ) -> Result<Self, Mistakes> {
        Self::parse_at(Path::new(file_name), file_name, text, (asked, kinds))
    }

    /// As [`parse_as`](Self::parse_as), for a file at `path`, which need not be UTF-8. Mistakes call the file `shown`.
    fn parse_at(path: &Path, shown: &str, text: &str, given: Given) -> Result<Self, Mistakes> {
        let mut collector = Collector::new(shown, text);
        let config = read_text(&mut collector, text, |root| read(path, root, given));
        match collector.finish() {
            Some(mistakes) => Err(mistakes),
            None => Ok(config.expect("what is not read has a mistake")),
        }
    }
}

#[expect(
    clippy::too_many_lines,
    reason = "the tables of a file, one after the other"
)]
fn read(path: &Path, mut root: Table<'_>, given: Given) -> Option<Config> {
    let driver = root.require("driver", "write a [driver] table with id and name");
    let fieldbus = root.require("fieldbus", "write a [fieldbus] table with the kind of bus");
    let stations = root.take("station");
    let signals = root.take("signal");
    let axes = root.take("axis");
    let drives = root.take("drive");
    let replies = root.take("reply");
    let faults = root.take("fault");
    let record = root.take("record");
    let page = root.take("page");

    let driver = driver.and_then(|value| value.table("[driver]", "write a [driver] table"));
    let fault_file = driver.as_ref().and_then(|table| {
        let mut faults = table.all().filter(|(key, _)| *key == "faults");
        faults.next().map(|(_, value)| value)
    });
    let driver = driver.map(read_driver);
    let addressing = driver
        .as_ref()
        .map_or(Addressing::Bytes, |driver| driver.addressing);
    let mut fieldbus = fieldbus
        .and_then(|value| value.table("[fieldbus]", "write a [fieldbus] table"))
        .map(|table| read_fieldbus(table, given));
    let role = fieldbus.as_ref().map(|fieldbus| fieldbus.role);
    let observes = role == Some(Role::Observer);
    // A file of both ends may have keys about values that they write. The command that observes ignores them.
    let is_observers = observes && fieldbus.as_ref().is_some_and(|it| !it.is_for_both);
    let replayed = fieldbus.as_ref().and_then(|fieldbus| fieldbus.bus.as_ref());
    let replayed = replayed.and_then(Options::replayed);
    let record = record.map(|value| {
        let table = value.table("[record]", "write a [record] table")?;
        record::Options::read(table, replayed)
    });
    let page = page.map(|value| PageOptions::read(value.table("[page]", "write a [page] table")?));
    let declared = stations.map(|value| value.tables("[[station]]"));
    let signals = signals
        .map(|value| value.tables("[[signal]]"))
        .unwrap_or_default();
    let axes = axes
        .map(|value| value.tables("[[axis]]"))
        .unwrap_or_default();
    let drives = drives
        .map(|value| value.tables("[[drive]]"))
        .unwrap_or_default();
    if is_observers {
        for table in declared.iter().flatten() {
            observer::refuse_keys(table, observer::OF_LINE);
        }
        for table in &signals {
            observer::refuse_keys(table, observer::OF_SIGNAL);
        }
    }
    for (tables, limit, what) in [
        (&signals, layout::SIGNAL_LIMIT, "signals"),
        (&axes, layout::AXIS_LIMIT, "axes"),
        (&drives, layout::DRIVE_LIMIT, "drives"),
    ] {
        if let Some(table) = tables.get(limit) {
            table.wrong(
                format!("there are {} {what}", tables.len()),
                format!("a driver has at most {limit}"),
            );
            root.finish();
            return None;
        }
    }
    layout::check_twins(&signals, "signal");
    layout::check_twins(&axes, "axis");
    layout::check_twins(&drives, "drive");
    let (mut axes, drives, sections) = layout::read_signals(signals, axes, drives, addressing);
    let sizes = fieldbus
        .as_ref()
        .map(|fieldbus| fieldbus.sizes.clone())
        .unwrap_or_default();
    let bus = fieldbus.as_mut().and_then(|fieldbus| fieldbus.bus.as_mut());
    let table = layout::lay_out(sections, &axes, declared, sizes, bus);
    if let Some(fieldbus) = &mut fieldbus
        && let (Some(at), Some(bus), Some(table)) = (&fieldbus.at, &mut fieldbus.bus, &table)
    {
        bus.place_signals(&At::read(at, table), table);
    }
    let bus = fieldbus.as_ref().and_then(|fieldbus| fieldbus.bus.as_ref());
    if let (Some(bus), Some(table)) = (bus, &table) {
        bus.fit(table, root.collector());
    }
    let observed = table.as_ref().filter(|_| observes).cloned();
    let observed = observed.map(SignalTable::observed);
    // An observer reads both areas, and each of its signals can be a life sign.
    let seen = observed.as_ref().filter(|_| is_observers);
    let life_signs = match (&fieldbus, seen.or(table.as_ref())) {
        (Some(fieldbus), Some(table)) => fieldbus.read_life_signs(table),
        _ => LifeSigns::default(),
    };
    let empty = |station: &Station| station.input_bytes + station.output_bytes == 0;
    if table
        .as_ref()
        .is_some_and(|table| table.stations.iter().all(empty))
    {
        root.require_one_of(
            &["signal"],
            "write a [[signal]] section with name and address for each signal",
        );
    }
    root.finish();
    let table = observed.or(table);
    if let Some(table) = &table {
        axis::resolve(&mut axes, table);
    }
    let replies = replies.map(|value| value.tables("[[reply]]"));
    let replies = replies.unwrap_or_default();
    if let (Some(first), Some(fieldbus)) = (replies.first(), &fieldbus)
        && fieldbus.own_role == Role::Controller
    {
        first.wrong(
            "this end is the PLC, and replies are made by the machine",
            "remove [[reply]], or write them into the driver.cfg of the machine",
        );
    }
    if is_observers && let Some(first) = replies.first() {
        observer::refuse_replies(first);
    }
    let replies = match &table {
        // All signals of an observer are received.
        Some(_) if observes => Vec::new(),
        Some(table) => read_replies(replies, &drives, table, &axes, &life_signs),
        None => Vec::new(),
    };
    let bus = fieldbus.as_ref().and_then(|fieldbus| fieldbus.bus.as_ref());
    let scope = table.as_ref().map(|table| faults::Scope {
        table,
        // Mistakes in the bus table have been reported already.
        has_diagnosis: bus.is_none_or(|bus| bus.has_diagnosis()),
        has_answers: bus.is_none_or(|bus| bus.has_answers()),
        codes: bus.map_or(faults::AnswerCodes::ANY, |bus| bus.answer_codes()),
    });
    if is_observers {
        for value in faults.iter().chain(&fault_file) {
            observer::refuse_faults(value);
        }
    }
    let faults = faults
        .filter(|_| !is_observers)
        .map(|value| faults::read_sections(value.tables("[[fault]]"), scope))
        .unwrap_or_default();

    let (driver, fieldbus) = (driver?, fieldbus?);
    // In a file that serves both ends, the faults belong to the machine: injected at both ends, they would happen
    // twice.
    let is_other_end = fieldbus.is_for_both && fieldbus.role != Role::Device;
    let replies = if is_other_end { Vec::new() } else { replies };
    let (faults, fault_file) = if is_other_end {
        (Vec::new(), None)
    } else {
        let beside = path.parent().unwrap_or(Path::new(""));
        (faults, driver.faults.map(|file| beside.join(file)))
    };
    Some(Config {
        path: path.to_owned(),
        id: driver.id?,
        name: driver.name?,
        real_time: driver.real_time,
        role: fieldbus.role,
        addressing,
        table: table?,
        axes,
        replies,
        timing: fieldbus.timing?,
        bus: fieldbus.bus?,
        kinds: given.1,
        origin: Origin::of(given.0),
        events: fieldbus.events,
        life_signs,
        faults,
        fault_file,
        record: match record {
            // That of a file of both ends is the simulation's.
            Some(record) => Some(record?).filter(|_| !observes || is_observers),
            None => None,
        },
        page: match page {
            // As with faults: the two ends cannot share one address.
            Some(page) => Some(page?).filter(|_| !is_other_end),
            None => None,
        },
    })
}

/// Reads the replies of a machine, whose other signals of the driver's own they must not make; its drives are replies,
/// too.
fn read_replies(
    sections: Vec<Table<'_>>,
    drives: &[Drive<'_>],
    table: &SignalTable,
    axes: &[Axis],
    life_signs: &LifeSigns,
) -> Vec<Reply> {
    let mut taken = taken_signals(table, axes, life_signs);
    let scope = reply::Scope {
        table,
        writes: Area::Input,
        tick: None,
        taken: &[],
        earlier: &[],
    };
    let earlier = reply::drives(drives, scope);
    for drive in &earlier {
        let what = format!("the drive \"{}\"", shown(&drive.name));
        taken.extend(drive.outputs.iter().map(|own| (*own, what.clone())));
    }
    let scope = reply::Scope {
        taken: &taken,
        earlier: &earlier,
        ..scope
    };
    reply::read_sections(sections, scope)
}

/// The signals of the machine that the driver makes apart from replies, by index, and what makes them.
fn taken_signals(
    table: &SignalTable,
    axes: &[Axis],
    life_signs: &LifeSigns,
) -> Vec<(usize, String)> {
    let beats = life_signs.beats(table, Role::Device);
    let mut taken: Vec<_> = beats
        .map(|beat| (beat.signal, "\"heartbeat\"".to_owned()))
        .collect();
    for axis in axes {
        let fields = [Field::Acknowledge, Field::CommandDone];
        let switches = axis.switches.iter();
        let switches = switches.filter_map(|switch| table.position(&switch.name));
        let of_axis = fields.into_iter().filter_map(|field| axis.slot(field));
        let of_axis = of_axis.chain(switches);
        taken.extend(of_axis.map(|signal| (signal, format!("the axis \"{}\"", shown(&axis.name)))));
    }
    taken
}

struct FieldbusTable<'a> {
    role: Role,
    /// True if the file states no role and serves both ends.
    is_for_both: bool,
    /// The end that the file describes.
    own_role: Role,
    life_signs: Written<'a>,
    timing: Option<Timing>,
    sizes: layout::Sizes<'a>,
    /// `[fieldbus.at]`, which can only be read after the signals.
    at: Option<Value<'a>>,
    bus: Option<Options>,
    events: Events,
}

impl FieldbusTable<'_> {
    fn read_life_signs(&self, table: &SignalTable) -> LifeSigns {
        let of_bus = self.bus.as_ref().and_then(|bus| bus.cycle());
        let cycle = self.timing.as_ref().and_then(|timing| timing.cycle);
        let mut signs = LifeSigns::default();
        self.life_signs
            .read(table, self.own_role, cycle.or(of_bus), &mut signs);
        signs
    }
}

fn read_fieldbus(mut table: Table<'_>, (asked, kinds): Given) -> FieldbusTable<'_> {
    let kind = table.require("kind", "write the kind of bus, such as kind = \"loopback\"");
    let role = table.take("role");
    let life_signs = Written::take(&mut table);
    let spans = TimingKeys::take(&mut table);
    let sizes = layout::Sizes::take(&mut table);
    let at = table.take("at");
    let roles = Role::ALL.map(|role| (role.name(), role));
    let stated = role
        .as_ref()
        .and_then(|value| value.choice("roles", &roles));
    if let (Some(value), Some(stated), Some(asked)) = (&role, stated, asked)
        && stated != asked.role
    {
        value.wrong(
            format!("this command is the {} of the line", asked.role.name()),
            "remove \"role\", so that the file serves both ends, or give the command a file of its own",
        );
    }
    let role = stated.or(asked.map(|asked| asked.role)).unwrap_or_default();
    if stated == Some(Role::Observer) {
        observer::refuse_keys(&table, observer::OF_LINE);
    }
    let read = if let Some(kind) = kind {
        let moved = asked.is_some_and(|asked| asked.moved);
        // A loopback in a separate process is reported below; a role that only the command gave must cause no other
        // mistake.
        let is_loopback = kind.as_text() == Some(loopback::NAME);
        let as_written = match stated {
            None if is_loopback => Role::default(),
            _ => role,
        };
        let read = kinds.read(&kind, as_written, moved, table);
        if let (Some((bus, _)), Some(_)) = (&read, asked)
            && bus.is_in_process()
        {
            kind.wrong(
                format!(
                    "both ends of the bus \"{}\" live in one process",
                    bus.kind()
                ),
                "use a bus between processes, such as kind = \"socket\"",
            );
        }
        read
    } else {
        // Without the bus kind, the valid keys are unknown.
        table.finish_open();
        None
    };
    let (bus, events) = read.unzip();
    FieldbusTable {
        role,
        is_for_both: stated.is_none(),
        own_role: stated.unwrap_or_default(),
        life_signs,
        timing: spans.read(Line::of(role, bus.as_ref())),
        sizes,
        at,
        bus,
        events: events.unwrap_or_default(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::loopback::{self, Peer};
    use crate::timing::{LEAST_MAX_AGE, RECONNECT};
    use tickbus_base::time::Nanos;
    use tickbus_image::signal::{DataType, Latch, Signal, Slot};

    const HEAD: &str = "[driver]\nid = 1\nname = \"Cell\"\n[fieldbus]\nkind = \"loopback\"\n\
                        link = \"cell\"\n";

    #[test]
    fn an_axis_that_is_not_inverted_needs_no_limits() {
        let text = format!("{HEAD}[[axis]]\nname = \"A\"\ninverted = false\n");
        let config = Config::parse("test.cfg", &text, &crate::KINDS).expect("right");
        assert_eq!(config.axes.len(), 1);
        assert!(!config.table.signals.is_empty());
    }

    /// Reads one signal from the keys of its section.
    #[track_caller]
    fn signal(keys: &str) -> Signal {
        let text = format!("{HEAD}[[signal]]\nname = \"A\"\n{keys}\n");
        match Config::parse("test.cfg", &text, &crate::KINDS) {
            Ok(mut config) => config.table.signals.remove(0),
            Err(mistakes) => panic!("{mistakes}"),
        }
    }

    #[test]
    fn the_type_follows_from_the_address_unless_it_is_stated() {
        for (keys, data_type) in [
            ("address = \"%I0.0\"", DataType::Bool),
            ("address = \"%IB0\"", DataType::Byte),
            ("address = \"%IW0\"", DataType::Word),
            ("address = \"%ID0\"", DataType::Dword),
            ("address = \"%IL0\"", DataType::Lword),
            ("address = \"%ID0\"\ntype = \"real\"", DataType::Real),
        ] {
            assert_eq!(signal(keys).data_type, data_type, "{keys}");
        }
    }

    #[test]
    fn a_comment_and_a_folder_are_kept_and_a_signal_without_them_has_no_notes() {
        let longest = "é".repeat(200);
        let keys = format!("address = \"%QX0.0\"\ncomment = \"{longest}\"\nfolder = \"IO # 1\"");
        let noted = signal(&keys);
        assert_eq!((noted.comment(), noted.folder()), (&*longest, "IO # 1"));
        assert_eq!(signal("address = \"%QX0.0\"").notes, None);
    }

    #[test]
    fn fail_safe_values_are_exact_and_of_the_slot_s_own_kind() {
        for (keys, slot) in [
            (
                "address = \"%QX0.0\"\nfail_safe = true",
                Slot::from_real(1.0),
            ),
            ("address = \"%QX0.0\"\nfail_safe = 1", Slot::from_real(1.0)),
            (
                "address = \"%QW0\"\nfail_safe = 0xFFFF",
                Slot::from_real(65_535.0),
            ),
            ("address = \"%QW0\"\nfail_safe = 7.0", Slot::from_real(7.0)),
            (
                "address = \"%QL0\"\nfail_safe = 18446744073709551615",
                Slot::from_unsigned(u64::MAX),
            ),
            (
                "address = \"%QL0\"\ntype = \"LINT\"\nfail_safe = -9223372036854775807",
                Slot::from_signed(-i64::MAX),
            ),
            (
                "address = \"%QL0\"\ntype = \"LREAL\"\nfail_safe = -0.5",
                Slot::from_real(-0.5),
            ),
            // Without a fail-safe value, all bits are zero: 4 mA, not an impossible 0 mA.
            (
                "address = \"%QW0\"\nscale = { raw = [0, 27648], value = [4, 20] }",
                Slot::from_real(4.0),
            ),
            (
                "address = \"%QL0\"\nscale = { raw = [0, 10], value = [0, 1] }\nfail_safe = 0.5",
                Slot::from_real(0.5),
            ),
        ] {
            assert_eq!(signal(keys).fail_safe, slot, "{keys}");
        }
    }

    #[test]
    fn every_hosted_program_can_be_named_with_its_options() {
        let option = "program_options = { la1_code = \"lsb-first\" }";
        let with_options = tickbus_programs::PROGRAMS
            .names()
            .iter()
            .map(|name| (*name, ""));
        for (name, option) in with_options.chain([("rig", option)]) {
            let head = HEAD.replace(
                "link = \"cell\"",
                &format!("program = \"{name}\"\n{option}"),
            );
            let config = Config::parse(
                "test.cfg",
                &format!("{head}input_bytes = 1\n"),
                &crate::KINDS,
            )
            .unwrap_or_else(|mistakes| panic!("{mistakes}"));
            let options = config.bus.downcast_ref::<loopback::Options>();
            let Some(loopback::Options {
                peer: Peer::Program { name, options, .. },
                ..
            }) = options
            else {
                panic!("a hosted program");
            };
            assert_eq!(
                tickbus_programs::program(name, options)
                    .expect("a program")
                    .name(),
                name
            );
        }
    }

    #[test]
    fn latches_hold() {
        let signal = signal("address = \"%IX0.0\"\nlatch = \"falling\"\nhold = \"20ms\"");
        assert_eq!(
            (signal.latch, signal.hold),
            (Some(Latch::Falling), Nanos::from_millis(20))
        );
    }

    #[test]
    fn times_have_their_defaults() {
        let timing = |keys: &str| {
            let text = format!("{HEAD}{keys}\ninput_bytes = 1\n");
            Config::parse("test.cfg", &text, &crate::KINDS)
                .unwrap_or_else(|m| panic!("{m}"))
                .timing
        };
        assert_eq!(timing("").reconnect, RECONNECT);
        assert_eq!(timing("").max_age, LEAST_MAX_AGE);
        assert_eq!(timing("cycle = \"50ms\"").max_age, Nanos::from_millis(500));
        assert_eq!(timing("cycle = \"1ms\"").max_age, LEAST_MAX_AGE);
        assert_eq!(
            timing("cycle = \"50ms\"\nmax_age = \"60ms\"").max_age,
            Nanos::from_millis(60)
        );
    }

    #[test]
    fn a_thousand_mistakes_are_told_in_no_time() {
        let section = |number: i32| {
            format!("[[signal]]\nname = \"S{number}\"\naddress = \"%QX0.0\"\nhold = x\n")
        };
        let sections = (0..1000).map(section);
        let text: String = std::iter::once(HEAD.to_owned()).chain(sections).collect();
        let mistakes = Config::parse("test.cfg", &text, &crate::KINDS).expect_err("mistakes");
        assert_eq!(mistakes.len(), 1000);
    }
}
