//! S7 communication: `PUT` and `GET` if the simulation is the server, nothing if it connects.

use std::ops::Range;

use super::body::{Body, by_hand};
use super::{Image, Plan};
use crate::record::PlacedSignal;
use tickbus_bus_s7::item::Object;
use tickbus_bus_s7::{ClientOptions, ServerOptions, Start, Variable};
use tickbus_image::signal::Area;

/// The simulation is a CPU: the areas I and Q of that CPU are the images.
pub(super) fn puts_and_gets(
    plan: &Plan<'_>,
    options: &ServerOptions,
    notes: &mut Vec<String>,
) -> Body {
    if plan.config.table.stations.len() > 1 {
        return by_hand("s7-server with several stations", notes);
    }
    if options.address.port != 102 {
        notes.push(format!(
            "PUT and GET of a CPU dial port 102 and no other; driver.cfg listens on {}: docs/s7.md tells how to get port 102",
            options.address
        ));
    }
    let (get_most, put_most) = plan.cpu.get_and_put();
    let get = Jobs::new("GET", 'I', &plan.inputs, get_most);
    let put = Jobs::new("PUT", 'Q', &plan.outputs, put_most);
    for jobs in [&get, &put] {
        if jobs.parts.len() > 1 {
            notes.push(format!(
                "the {} bytes of %{} go in {} calls of {}, as one carries at most {}: the bytes of one call belong \
                 together, those of two may be of two moments",
                jobs.bytes,
                jobs.area,
                jobs.parts.len(),
                jobs.block,
                jobs.most
            ));
        }
    }
    let mut variables = Vec::new();
    let mut code =
        vec!["// The S7 connection of the hardware configuration has this ID.".to_owned()];
    get.write(plan, &mut variables, &mut code);
    put.write(plan, &mut variables, &mut code);
    let heard = if get.parts.is_empty() { &put } else { &get };
    Body {
        what: format!(
            "S7 communication: GET brings {} bytes from the simulation, PUT takes {} bytes to it.",
            get.bytes, put.bytes
        ),
        variables,
        code,
        receives: get.bytes > 0,
        sends: put.bytes > 0,
        heard: heard.any(heard.done()),
        ..Body::default()
    }
}

/// The calls that transfer one image, one after another.
struct Jobs<'a> {
    /// `GET` or `PUT`.
    block: &'static str,
    /// The simulation's area.
    area: char,
    image: &'a Image<'a>,
    bytes: usize,
    most: usize,
    parts: Vec<Range<usize>>,
}

impl<'a> Jobs<'a> {
    fn new(block: &'static str, area: char, image: &'a Image<'a>, most: usize) -> Self {
        let bytes = image.record.bytes;
        Self {
            block,
            area,
            image,
            bytes,
            most,
            parts: (0..bytes)
                .step_by(most)
                .map(|first| first..bytes.min(first + most))
                .collect(),
        }
    }

    /// The output of a call that reports completion.
    fn done(&self) -> &'static str {
        if self.block == "GET" { "NDR" } else { "DONE" }
    }

    /// `#Get_1.NDR OR #Get_2.NDR`.
    fn any(&self, member: &str) -> String {
        let all: Vec<String> = (1..=self.parts.len())
            .map(|number| format!("#{}.{member}", self.name(number)))
            .collect();
        all.join(" OR ")
    }

    fn name(&self, number: usize) -> String {
        let block = if self.block == "GET" { "Get" } else { "Put" };
        format!("{block}_{number}")
    }

    /// Writes the declarations and the calls. The data of the calls are declared as bytes over the image: PUT and GET
    /// require the same length and type at both ends.
    fn write(&self, plan: &Plan<'_>, variables: &mut Vec<String>, code: &mut Vec<String>) {
        if self.parts.is_empty() {
            return;
        }
        let prefix = &plan.prefix;
        let gets = self.block == "GET";
        let (copy, is_asking, job) = if gets {
            ("Incoming", "Is_getting", "Get_job")
        } else {
            ("Outgoing", "Is_putting", "Put_job")
        };
        let parts = self.parts.iter().enumerate();
        variables.extend(
            parts
                .clone()
                .map(|(n, _)| format!("{} : {};", self.name(n + 1), self.block)),
        );
        variables.push(format!("{copy} : \"{}\";", self.image.type_name));
        variables.push(format!("{copy}_parts AT {copy} : Struct"));
        variables.extend(
            parts.clone().map(|(n, part)| {
                format!("   Part_{} : Array[0..{}] of Byte;", n + 1, part.len() - 1)
            }),
        );
        variables.push("END_STRUCT;".to_owned());
        variables.extend([format!("{is_asking} : Bool;"), format!("{job} : Int;")]);

        let mut add = |lines: &[&str]| code.extend(lines.iter().map(|line| (*line).to_owned()));
        add(&[
            "",
            "// One job after another; REQ rests for one call between two of them.",
        ]);
        if !gets {
            add(&[
                &format!("IF #{job} = 0 AND NOT #{is_asking} THEN"),
                &format!("   #Outgoing := \"{}\".Image;", self.image.block),
                "END_IF;",
            ]);
        }
        for (n, part) in parts {
            add(&[
                &format!(
                    "#{}(REQ := #{is_asking} AND #{job} = {n} AND \"{prefix}\".Simulated,",
                    self.name(n + 1)
                ),
                "       ID := W#16#100,",
                &format!(
                    "       ADDR_1 := P#{}{}.0 BYTE {},",
                    self.area,
                    part.start,
                    part.len()
                ),
                &format!(
                    "       {} := #{copy}_parts.Part_{});",
                    if gets { "RD_1" } else { "SD_1" },
                    n + 1
                ),
            ]);
        }
        add(&[
            &format!("IF NOT #{is_asking} THEN"),
            &format!("   #{is_asking} := TRUE;"),
            &format!("ELSIF {} THEN", self.any(self.done())),
            &format!("   #{is_asking} := FALSE;"),
            &format!("   #{job} := #{job} + 1;"),
            &format!("   IF #{job} >= {} THEN", self.parts.len()),
            &format!("      #{job} := 0;"),
        ]);
        if gets {
            add(&[
                &format!("      \"{}\".Image := #Incoming;", self.image.block),
                &format!("      \"{prefix}\".Received := \"{prefix}\".Received + 1;"),
            ]);
        } else {
            add(&[&format!(
                "      \"{prefix}\".Sent := \"{prefix}\".Sent + 1;"
            )]);
        }
        add(&["   END_IF;"]);
        for n in 1..=self.parts.len() {
            let name = self.name(n);
            add(&[
                &format!("ELSIF #{name}.ERROR THEN"),
                &format!("   #{is_asking} := FALSE;"),
                &format!("   #{job} := 0;"),
                &format!("   \"{prefix}\".Errors := \"{prefix}\".Errors + 1;"),
                &format!("   \"{prefix}\".Last_error := #{name}.STATUS;"),
            ]);
        }
        add(&["END_IF;"]);
    }
}

/// The CPU variable that the simulation itself reads or writes for a signal: named in `[fieldbus.at]`, or
/// part of the process image. Copying would overwrite it.
pub(super) fn direct(plan: &Plan<'_>, place: &PlacedSignal<'_>) -> Option<Variable> {
    let options: &ClientOptions = plan.config.bus.downcast_ref()?;
    let variable = options.variable(place.signal)?;
    let has_line = options.variables.contains_key(&place.signal.name);
    (has_line || !matches!(variable.object, Object::Block(_))).then_some(variable)
}

/// Each image with its place according to the driver.cfg.
fn places<'p>(
    plan: &'p Plan<'_>,
    options: &ClientOptions,
) -> impl Iterator<Item = (Area, &'p Image<'p>, Start)> {
    let images = [(Area::Output, &plan.outputs), (Area::Input, &plan.inputs)];
    let places = images.map(|(area, image)| Some((area, image, options.place(0, area)?)));
    places.into_iter().flatten().filter(|(_, image, _)| {
        let mut signals = image.record.places.iter().map(|place| place.signal);
        signals.any(|signal| !options.variables.contains_key(&signal.name))
    })
}

/// The simulation connects, and reads and writes the data blocks itself.
pub(super) fn nothing(plan: &Plan<'_>, options: &ClientOptions) -> Body {
    let mut code =
        vec![";   // The simulation reads and writes by itself, as driver.cfg says:".to_owned()];
    for (area, image, start) in places(plan, options) {
        code.push(match start.object {
            Object::Block(number) => format!(
                "    // {area} at {start}; \"{}\".Image is for that, as DB{number}",
                image.block
            ),
            _ => format!(
                "    // {area} at {start}, in the CPU's own memory: \"{}\" is not needed",
                image.block
            ),
        });
    }
    for image in [&plan.outputs, &plan.inputs] {
        for place in &image.record.places {
            if let Some(variable) = options.variable(place.signal)
                && options.variables.contains_key(&place.signal.name)
            {
                let name = &place.signal.name;
                code.push(format!("    // \"{name}\" at {variable}, where the program has it: nothing is to be copied"));
            }
        }
    }
    Body {
        what: "The simulation reads and writes the data blocks by S7 communication; no call is needed here.".to_owned(),
        code,
        ..Body::default()
    }
}

/// The settings to be made in the project.
pub(super) fn steps_for_puts_and_gets() -> Vec<String> {
    vec![
        "Devices & networks > Connections > S7 connection: partner unspecified, the IP address of the simulator's computer, \
         partner TSAP 03.01 (rack 0, slot 1); its ID is W#16#100 in the link source."
            .to_owned(),
    ]
}

/// The settings to be made in the project.
pub(super) fn steps_for_nothing(plan: &Plan<'_>, options: &ClientOptions) -> Vec<String> {
    let mut steps = vec![
        "CPU properties > Protection & Security > Connection mechanisms: permit access with PUT/GET communication."
            .to_owned(),
        "With local user management (TIA Portal V19 and later, S7-1500 from firmware 3.1, S7-1200 of generation 2) that is not \
         enough: Security settings > Users and roles, give the user \"Anonymous\" a role with the CPU's right to full \
         access; or choose the legacy access control by access levels, and there full access."
            .to_owned(),
    ];
    for (_, image, start) in places(plan, options) {
        if let Object::Block(number) = start.object {
            steps.push(format!(
                "A block from a source gets whatever number is free. Properties of \"{}\" > General > Number: manual, \
                 {number}. Change it before the blocks are compiled and loaded.",
                image.block
            ));
        }
        if start.byte > 0 {
            steps.push(format!(
                "driver.cfg has this image at {start}, not at the beginning: put {} bytes before Image in \"{}\".",
                start.byte, image.block
            ));
        }
    }
    steps
}
