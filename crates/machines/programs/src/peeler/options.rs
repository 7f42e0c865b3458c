//! The options of the two programs.

use tickbus_base::time::Nanos;
use tickbus_plc::ProgramError;

/// The options that a user may give to either program.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Options {
    /// How long `Execute` stays on; `None` waits for the machine's acknowledge.
    pub(super) hold: Option<Nanos>,
    /// The program is done after this many blocks; `None` for never.
    pub(super) blocks: Option<u64>,
    /// Speed of the veneer, in mm/s.
    pub(super) peeling_speed: f64,
    /// Thickness of the veneer, in mm.
    pub(super) thickness: f64,
}

impl Options {
    /// The options of both programs.
    pub(super) const CHARGER: [&'static str; 2] = ["hold", "blocks"];
    /// The options of the lathe.
    pub(super) const LATHE: [&'static str; 4] = ["hold", "blocks", "peeling_speed", "thickness"];

    /// Reads the options for the program that has the options `known`.
    pub(super) fn read(
        program: &'static str,
        known: &'static [&'static str],
        options: &[(String, String)],
    ) -> Result<Self, ProgramError> {
        let mut read = Self {
            hold: None,
            blocks: None,
            peeling_speed: 3_000.0,
            thickness: 1.5,
        };
        for (key, value) in options {
            let wrong = |option: &'static str, right: &str| ProgramError::BadValue {
                program,
                option,
                value: value.clone(),
                right: right.to_owned(),
            };
            let above_zero = |option, most: f64, right: &str| {
                let number = value.parse().ok();
                number
                    .filter(|number: &f64| *number > 0.0 && *number <= most)
                    .ok_or_else(|| wrong(option, right))
            };
            match key.as_str() {
                name if !known.contains(&name) => {
                    return Err(ProgramError::UnknownOption {
                        program,
                        option: key.clone(),
                        known,
                    });
                }
                "hold" => {
                    const RIGHT: &str =
                        "write a duration, such as 500ms, or leave it out to await acknowledges";
                    let hold = value.parse().ok().filter(|hold| *hold > Nanos::ZERO);
                    read.hold = Some(hold.ok_or_else(|| wrong("hold", RIGHT))?);
                }
                "blocks" => {
                    let blocks = value.parse().ok().filter(|blocks| *blocks > 0);
                    let right = "write after how many blocks the program is done, such as 3";
                    read.blocks = Some(blocks.ok_or_else(|| wrong("blocks", right))?);
                }
                "peeling_speed" => {
                    let right = "write the speed of the veneer in mm/s, such as 3000";
                    read.peeling_speed = above_zero("peeling_speed", 20_000.0, right)?;
                }
                _ => {
                    let right = "write the thickness of the veneer in mm, such as 1.5";
                    read.thickness = above_zero("thickness", 10.0, right)?;
                }
            }
        }
        Ok(read)
    }
}
