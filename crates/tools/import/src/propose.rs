//! Proposes replies for the inputs of a PLC that nobody writes: by their names and comments, in English and German, with
//! the outputs of similar names as partners.
//!
//! A proposal is a guess that an engineer reads before it is used. An input whose words have no
//! known meaning gets no proposal.

use std::collections::BTreeMap;
use std::fmt::Write as _;

use super::write::text;

/// A tag or signal, as far as a proposal depends on it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Point<'a> {
    /// The name.
    pub name: &'a str,
    /// The comment; may be empty.
    pub comment: &'a str,
    /// True for `%I`.
    pub is_input: bool,
    /// True for a BOOL.
    pub is_bool: bool,
    /// True if something writes it already.
    pub is_written: bool,
}

/// A proposed `[[reply]]`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Proposal {
    /// The points that it makes, by index.
    pub makes: Vec<usize>,
    /// The section, as a driver.cfg has it.
    pub section: String,
}

/// The meaning of an input.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Role {
    /// An operator's: nothing replies.
    Operator,
    /// A motor runs.
    Running,
    /// Something is wrong: off is right.
    Fault,
    /// The far end of a way: extended, opened.
    Far,
    /// The near end: retracted, closed.
    Near,
    /// All is well, or allowed: on is right.
    Healthy,
}

/// The words of an input that is on while all is well.
const HEALTHY: &str = "ok healthy motorschutz schutzschalter estop emergency notaus nothalt safety sicherheit guard door \
    tuer schutztuer air luft druckluft ready bereit enabled freigabe fuse sicherung breaker power netz \
    supply versorgung";

/// The words for each role; the first role of which a name has a word is its own.
const WORDS: [(Role, &str); 7] = [
    // A contact that is normally closed is on while nothing is wrong and nobody presses.
    (Role::Healthy, "nc"),
    (
        Role::Operator,
        "button pushbutton pb taster schalter key select selector wahl reset ack quittieren quit start stop \
        joystick manual hand auto req request anforderung",
    ),
    (
        Role::Running,
        "running runs run laeuft betrieb betriebsmeldung rueckmeldung rm feedback fb fbk",
    ),
    (
        Role::Fault,
        "fault error alarm trip tripped overload ueberlast stoerung stoer fehler thermal bimetall jam stau \
        failure",
    ),
    (
        Role::Far,
        "extended ext out ausgefahren vorne vorn open opened offen auf geoeffnet up top oben plus",
    ),
    (
        Role::Near,
        "retracted ret in eingefahren hinten closed geschlossen zu down bottom unten home grundstellung \
        minus",
    ),
    (Role::Healthy, HEALTHY),
];

/// The words of a command forth, and of one back.
const FORTH: &str =
    "extend ext out ausfahren vor open oeffnen auf up heben forward fwd advance plus";
const BACK: &str = "retract ret in einfahren zurueck close schliessen zu down senken back backward return rev reverse \
    minus";

/// The words of an output that moves nothing.
const NO_COMMAND: &str = "reset ack quittieren stop fault alarm stoerung lamp light led lampe leuchte horn buzzer siren hupe \
    sirene spare reserve red green amber yellow";

/// Words of a valve rather than a cylinder.
const VALVE: &str = "valve ventil open opened offen auf geoeffnet gate klappe";

/// Words of devices that hold a part: they work closed, so that is their far end.
const HOLDING: &str = "clamp gripper grip jaw jaws chuck vice greifer zange spanner spannfutter";

/// The words of an end or a command that mean the opposite for such a device.
const SHUT_OR_OPEN: &str =
    "closed close geschlossen schliessen zu open opened oeffnen offen auf geoeffnet";

/// Words of an input that is off when somebody stops the machine, in most of them.
const STOPS: &str = "estop emergency notaus nothalt";

/// The value of such an input, with a remark: some programs read it the other way round.
const RELEASED: &str =
    "true   # released; leave this reply out if true means pressed in the program";

/// Words that say nothing about which device a point belongs to.
const FILLERS: &str = "is ist di ai ix input eingang sensor switch limit ls end endlage endschalter ini signal pos \
    position do ao qx output ausgang cmd command befehl on ein coil sol solenoid contactor schuetz \
    ansteuerung activate actuate energize energise to move go set \
    the of at enable rel release actual setpoint sp pv soll istwert sollwert";

/// The words of a name in small letters, without umlauts: `Pumpe1_Läuft` has `pumpe`, `1`, `laeuft`.
fn words(text: &str) -> Vec<String> {
    let mut words: Vec<String> = Vec::new();
    let mut before = ' ';
    for c in text.chars() {
        let begins = !before.is_alphanumeric()
            || before.is_ascii_digit() != c.is_ascii_digit()
            || (before.is_lowercase() && c.is_uppercase());
        if c.is_alphanumeric() {
            if begins {
                words.push(String::new());
            }
            let word = words.last_mut().expect("one has begun");
            for small in c.to_lowercase() {
                match small {
                    'ä' => word.push_str("ae"),
                    'ö' => word.push_str("oe"),
                    'ü' => word.push_str("ue"),
                    'ß' => word.push_str("ss"),
                    other => word.push(other),
                }
            }
        }
        before = c;
    }
    // Two words that make one.
    for (pair, one) in [
        (["e", "stop"], "estop"),
        (["emergency", "stop"], "emergency"),
        (["not", "aus"], "notaus"),
        (["not", "halt"], "nothalt"),
        (["not", "ok"], "fault"),
        (["limit", "switch"], "limit"),
    ] {
        if let Some(at) = words.windows(2).position(|two| two == pair) {
            drop(words.splice(at..at + 2, [one.to_owned()]));
        }
    }
    words
}

fn has(words: &[String], of: &str) -> bool {
    words.iter().any(|word| is_one(word, of))
}

/// True for a word of a list.
fn is_one(word: &str, of: &str) -> bool {
    of.split(' ').any(|one| one == word)
}

fn role(words: &[String]) -> Option<Role> {
    let (role, _) = WORDS.iter().find(|(_, of)| has(words, of))?;
    Some(match role {
        Role::Far if closes(words) => Role::Near,
        Role::Near if closes(words) => Role::Far,
        role => *role,
    })
}

/// True for an end or command of what holds a part: closing it is the way forth.
fn closes(words: &[String]) -> bool {
    has(words, HOLDING) && has(words, SHUT_OR_OPEN)
}

/// The words that name a device, sorted, each with the number or letter behind it: `Pump 1 on` has `pump` with `1`.
type Device = Vec<(String, String)>;

fn device(words: &[String]) -> Device {
    let is_number = |word: &str| word.starts_with(|c: char| c.is_ascii_digit());
    let is_dull = |word: &str| {
        let mut lists = WORDS
            .iter()
            .map(|(_, of)| *of)
            .chain([FORTH, BACK, FILLERS]);
        lists.any(|of| is_one(word, of))
    };
    let mut device = Device::new();
    // True if the word before is the last one of the device.
    let mut follows = false;
    for (place, word) in words.iter().enumerate() {
        let is_letter = word.chars().count() == 1 && !is_number(word);
        let is_numbered = words.get(place + 1).is_some_and(|next| is_number(next));
        match device.last_mut() {
            Some(last) if follows && (is_number(word) || is_letter) => {
                last.1.push_str(word);
                continue;
            }
            _ if is_number(word) => device.push((String::new(), word.clone())),
            // A letter alone says where the tag comes from, such as the x of a BOOL; M1 is a motor.
            _ if is_dull(word) || (is_letter && !is_numbered) => {
                follows = false;
                continue;
            }
            _ => device.push((word.clone(), String::new())),
        }
        follows = true;
    }
    device.sort();
    device.dedup();
    device
}

/// How well two devices fit: the part of their words that both have; 0 where a word has another number.
fn fit(one: &Device, other: &Device) -> usize {
    let differs = |(word, number): &(String, String)| {
        let twin = other.iter().find(|(twin, _)| twin == word);
        twin.is_some_and(|(_, of_twin)| of_twin != number)
    };
    let shared = one.iter().filter(|word| other.contains(word)).count();
    if shared == 0 || one.iter().any(differs) {
        return 0;
    }
    1 + 200 * shared / (one.len() + other.len())
}

/// The effect of an output.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Way {
    On,
    Forth,
    Back,
}

/// An output that commands a device.
struct Command {
    index: usize,
    way: Way,
    /// The device by the output's name, and by its comment.
    devices: [Device; 2],
}

/// The command that fits a device best, by name or else by comment; none where two fit alike.
fn command(device: &Device, way: Way, commands: &[Command]) -> Option<usize> {
    let best = |by: usize| {
        let commands = commands.iter().filter(|command| command.way == way);
        let fits = commands.map(|command| (fit(device, &command.devices[by]), command.index));
        let mut fits: Vec<(usize, usize)> = fits.filter(|(fit, _)| *fit > 0).collect();
        fits.sort_by_key(|(fit, _)| std::cmp::Reverse(*fit));
        match fits[..] {
            [(best, _), (second, _), ..] if best == second => None,
            [(_, best), ..] => Some(best),
            [] => None,
        }
    };
    best(0).or_else(|| best(1))
}

/// True if the name or the comment of an output has no word that the device lacks, except for codes of parts (`Y12`).
fn says_no_more(command: &Command, device: &Device) -> bool {
    let is_known =
        |word: &(String, String)| device.contains(word) || !word.0.is_empty() && !word.1.is_empty();
    let mut devices = command.devices.iter().filter(|of| !of.is_empty());
    devices.any(|of| of.iter().all(is_known))
}

/// Proposes replies for those of the `points` that are inputs and that nothing writes.
pub fn propose(points: &[Point<'_>]) -> Vec<Proposal> {
    let mut commands = Vec::new();
    let mut numbers: BTreeMap<Device, usize> = BTreeMap::new();
    let mut inputs: BTreeMap<Device, Vec<(usize, Role)>> = BTreeMap::new();
    let mut measured = Vec::new();
    for (index, point) in points.iter().enumerate() {
        let (name, comment) = (words(point.name), words(point.comment));
        match (point.is_input, point.is_bool) {
            (false, true) if [&name, &comment].iter().any(|of| has(of, NO_COMMAND)) => {}
            (false, true) => {
                let way = |words: &[String]| {
                    let is_forth = has(words, FORTH);
                    match (is_forth || has(words, BACK), is_forth != closes(words)) {
                        (false, _) => None,
                        (true, true) => Some(Way::Forth),
                        (true, false) => Some(Way::Back),
                    }
                };
                let way = way(&name).or_else(|| way(&comment)).unwrap_or(Way::On);
                let devices = [device(&name), device(&comment)];
                commands.push(Command {
                    index,
                    way,
                    devices,
                });
            }
            (false, false) => {
                numbers.entry(device(&name)).or_insert(index);
            }
            (true, _) if point.is_written => {}
            (true, true) => {
                let named = role(&name).map(|role| (role, &name));
                if let Some((role, words)) =
                    named.or_else(|| role(&comment).map(|role| (role, &comment)))
                {
                    inputs.entry(device(words)).or_default().push((index, role));
                }
            }
            (true, false) => measured.push((index, device(&name))),
        }
    }
    let mut proposals: Vec<Proposal> = inputs
        .iter()
        .flat_map(|(device, inputs)| of_device(points, (device, inputs.as_slice()), &commands))
        .collect();
    for (index, device) in measured {
        if let Some(output) = numbers.get(&device).filter(|_| !device.is_empty()) {
            let keys = [
                ("signal", text(points[index].name)),
                ("input", text(points[*output].name)),
                ("time", text("1s")),
            ];
            proposals.push(proposal("lag", vec![index], &keys));
        }
    }
    proposals.sort_by_key(|proposal| proposal.makes[0]);
    proposals
}

/// Proposes replies for the inputs of one device.
fn of_device(
    points: &[Point<'_>],
    (device, inputs): (&Device, &[(usize, Role)]),
    commands: &[Command],
) -> Vec<Proposal> {
    let name = |index: usize| text(points[index].name);
    let first = |role: Role| {
        inputs
            .iter()
            .find(|(_, of)| *of == role)
            .map(|(index, _)| *index)
    };
    let [on, forth, back] =
        [Way::On, Way::Forth, Way::Back].map(|way| command(device, way, commands));
    let mut proposals = Vec::new();
    let mut made = Vec::new();
    let mut add =
        |kind: &str, pairs: &[(&'static str, Option<usize>)], makes: &[Option<usize>], time| {
            let named = pairs
                .iter()
                .filter_map(|(key, index)| Some((*key, name((*index)?))));
            let keys: Vec<_> = named.chain([time]).collect();
            let makes: Vec<usize> = makes.iter().copied().flatten().collect();
            made.extend(&makes);
            proposals.push(proposal(kind, makes, &keys));
        };
    // Two commands are two directions, of which either lets the motor run: no condition says that.
    let contactor = on.or(forth.filter(|_| back.is_none()));
    if let (running @ Some(_), Some(_)) = (first(Role::Running), contactor) {
        let (overload, healthy) = (first(Role::Fault), first(Role::Healthy));
        let pairs = [
            ("contactor", contactor),
            ("running", running),
            ("overload", overload),
            ("healthy", healthy),
        ];
        add(
            "motor",
            &pairs,
            &[running, overload, healthy],
            ("on_after", text("100ms")),
        );
    }
    let (far, near) = (first(Role::Far), first(Role::Near));
    // An output that names no direction may be any output of a larger device, such as the lamp of a station.
    let plain = on.filter(|index| {
        let mut of_index = commands.iter().filter(|command| command.index == *index);
        of_index.any(|command| says_no_more(command, device))
    });
    let forth = forth.or(plain);
    if far.or(near).is_some() && forth.is_some() {
        let mut ends = [far, near].into_iter().flatten();
        let is_valve = |words: &[String]| has(words, VALVE) && !has(words, HOLDING);
        let (kind, keys, time) = if ends.any(|index| is_valve(&words(points[index].name))) {
            ("valve", ["open", "close", "opened", "closed"], "open_time")
        } else {
            (
                "cylinder",
                ["extend", "retract", "extended", "retracted"],
                "extend_time",
            )
        };
        let [a, b, c, d] = keys;
        let pairs = [(a, forth), (b, back), (c, far), (d, near)];
        add(kind, &pairs, &[far, near], (time, text("1s")));
    }
    for (index, role) in inputs {
        let is_way =
            [Role::Far, Role::Near].contains(role) && has(&words(points[*index].name), HEALTHY);
        if (*role == Role::Healthy || is_way) && !made.contains(index) {
            let is_stop = has(&words(points[*index].name), STOPS);
            let value = if is_stop { RELEASED } else { "true" };
            let keys = [("signal", name(*index)), ("value", value.to_owned())];
            proposals.push(proposal("constant", vec![*index], &keys));
        }
    }
    proposals
}

fn proposal(kind: &str, makes: Vec<usize>, keys: &[(&str, String)]) -> Proposal {
    let mut section = format!("[[reply]]\nkind = \"{kind}\"\n");
    for (key, value) in keys {
        // Writing to a string cannot fail.
        let _ = writeln!(section, "{key} = {value}");
    }
    Proposal { makes, section }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn proposed(inputs: &[&'static str], outputs: &[&'static str]) -> String {
        let point = |is_input| {
            move |name: &&'static str| Point {
                name,
                comment: "",
                is_input,
                is_bool: !name.starts_with('%'),
                is_written: false,
            }
        };
        let points: Vec<Point<'_>> = (inputs.iter().map(point(true)))
            .chain(outputs.iter().map(point(false)))
            .collect();
        let proposals = propose(&points).into_iter();
        let lines = proposals.map(|proposal| {
            let lines = proposal.section.lines().skip(1).collect::<Vec<_>>();
            lines.join(", ").replace('"', "") + "\n"
        });
        lines.collect()
    }

    #[test]
    fn motors_cylinders_and_valves_find_the_outputs_of_their_names_in_two_languages() {
        for (inputs, outputs, expected) in [
            (
                &["Pump 1 running", "Pump 1 overload", "Pump 2 running"][..],
                &["Pump 1 on", "Pump 2 on"][..],
                "kind = motor, contactor = Pump 1 on, running = Pump 1 running, overload = Pump 1 overload, on_after = 100ms\n\
                 kind = motor, contactor = Pump 2 on, running = Pump 2 running, on_after = 100ms\n",
            ),
            (
                &["Pumpe1_Läuft"],
                &["Pumpe1_Ein", "Pumpe2_Ein"],
                "kind = motor, contactor = Pumpe1_Ein, running = Pumpe1_Läuft, on_after = 100ms\n",
            ),
            (
                &["I_Clamp_Extended", "I_Clamp_Retracted"],
                &["Q_Clamp_Extend", "Q_Clamp_Retract"],
                "kind = cylinder, extend = Q_Clamp_Extend, retract = Q_Clamp_Retract, extended = I_Clamp_Extended, \
                 retracted = I_Clamp_Retracted, extend_time = 1s\n",
            ),
            (
                &["xVentil3Offen", "xVentil3Zu"],
                &["xVentil3Auf"],
                "kind = valve, open = xVentil3Auf, opened = xVentil3Offen, closed = xVentil3Zu, open_time = 1s\n",
            ),
            (
                &["iZyl2minus", "iZyl2plus"],
                &["qZyl1toMinus", "qZyl1toPlus", "qZyl2toMinus", "qZyl2toPlus"],
                "kind = cylinder, extend = qZyl2toPlus, retract = qZyl2toMinus, extended = iZyl2plus, \
                 retracted = iZyl2minus, extend_time = 1s\n",
            ),
            (
                &["GateB_ExtLS", "GateB_RetLS", "HaltPB_NC"],
                &["GateA_Sol", "GateB_Sol"],
                "kind = valve, open = GateB_Sol, opened = GateB_ExtLS, closed = GateB_RetLS, open_time = 1s\n\
                 kind = constant, signal = HaltPB_NC, value = true\n",
            ),
            (
                &["M7_Fan_Running", "Cyl1_Extended", "Oven_running"],
                &[
                    "M7_Contactor",
                    "YV1_Cyl1_Extend",
                    "YV2_Cyl1_Retract",
                    "Oven_heater_enable_Q",
                    "Oven_FaultReset_Q",
                ],
                "kind = motor, contactor = M7_Contactor, running = M7_Fan_Running, on_after = 100ms\n\
                 kind = cylinder, extend = YV1_Cyl1_Extend, retract = YV2_Cyl1_Retract, extended = Cyl1_Extended, \
                 extend_time = 1s\n\
                 kind = motor, contactor = Oven_heater_enable_Q, running = Oven_running, on_after = 100ms\n",
            ),
            (
                &["Not-Aus", "Door closed", "Air OK"],
                &[],
                "kind = constant, signal = Not-Aus, value = true   # released; leave this reply out if true means pressed \
                 in the program\n\
                 kind = constant, signal = Door closed, value = true\n\
                 kind = constant, signal = Air OK, value = true\n",
            ),
            // What holds a part does its work closed.
            (
                &["Clamp2Closed", "Clamp2Open", "xGreifer_zu", "Jaw opened"],
                &[
                    "Clamp2Activate",
                    "xGreifer_auf",
                    "xGreifer_schliessen",
                    "Jaw close",
                ],
                "kind = cylinder, extend = Clamp2Activate, extended = Clamp2Closed, retracted = Clamp2Open, extend_time = 1s\n\
                 kind = cylinder, extend = xGreifer_schliessen, retract = xGreifer_auf, extended = xGreifer_zu, \
                 extend_time = 1s\n\
                 kind = cylinder, extend = Jaw close, retracted = Jaw opened, extend_time = 1s\n",
            ),
            (
                &["Stopper_out"],
                &["Y12_Stopper", "Belt_lubrication"],
                "kind = cylinder, extend = Y12_Stopper, extended = Stopper_out, extend_time = 1s\n",
            ),
            (
                &["%Speed actual"],
                &["%Speed actual set"],
                "kind = lag, signal = %Speed actual, input = %Speed actual set, time = 1s\n",
            ),
        ] {
            assert_eq!(proposed(inputs, outputs), expected, "{inputs:?}");
        }
    }

    #[test]
    fn buttons_alarms_and_names_that_say_nothing_get_no_proposal() {
        let inputs = [
            "Start button",
            "Reset",
            "Jam",
            "Not OK",
            "Alarm 3",
            "B12",
            "Pump 3 running",
            "Saw_out_req",
            "Mill_opened",
            "Cell4_home",
        ];
        let outputs = [
            "Pump 1 on",
            "Pump 2 on",
            "Saw_out_allowed",
            "Mill_make_lids",
            "Cell4_part_clamp",
        ];
        assert_eq!(proposed(&inputs, &outputs), "");
    }

    #[test]
    fn comments_say_what_names_do_not() {
        let point = |name, comment, is_input| Point {
            name,
            comment,
            is_input,
            is_bool: true,
            is_written: false,
        };
        let points = [
            point("B1", "Greifer ausgefahren", true),
            point("B2", "Greifer eingefahren", true),
            point("Y1", "Greifer ausfahren", false),
            point("Y2", "Greifer einfahren", false),
            point("Y3", "Schieber ausfahren", false),
        ];
        let proposals = propose(&points);
        assert_eq!(proposals.len(), 1);
        assert_eq!(proposals[0].makes, [0, 1]);
        assert!(
            proposals[0]
                .section
                .contains("extend = \"Y1\"\nretract = \"Y2\"\n")
        );
    }

    #[test]
    fn an_output_that_fits_no_better_than_another_is_no_partner() {
        let outputs = ["Left pump on", "Right pump on"];
        assert_eq!(proposed(&["Pump running"], &outputs), "");
    }
}
