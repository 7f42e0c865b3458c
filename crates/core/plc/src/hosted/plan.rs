//! Maps the variables of a program to the process image.

use super::table::Declared;
use tickbus_base::Mistake;
use tickbus_image::signal::{Address, Addressing, Area, ByteOrder, DataType, SignalTable, Width};

/// The settings for fitting a program to the image.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) struct Settings {
    /// The unit of the numbers in addresses; `None` leaves it to the driver.cfg.
    pub(super) addressing: Option<Addressing>,
    /// The `%I` bit that is TRUE while the machine's data are alive.
    pub(super) alive: Option<String>,
    /// The byte order of values for which the driver.cfg has no signal.
    pub(super) order: ByteOrder,
}

/// One variable and its address.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct LocatedVariable {
    /// Index of the declared variable.
    pub(super) variable: usize,
    pub(super) address: Address,
    pub(super) order: ByteOrder,
    /// The address as written in the program.
    written: String,
}

/// All variables of a program, by direction.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) struct Plan {
    pub(super) inputs: Vec<LocatedVariable>,
    pub(super) outputs: Vec<LocatedVariable>,
    /// The variables that receive `alive`.
    pub(super) alive: Vec<usize>,
}

impl LocatedVariable {
    /// Reads the value from the image; bytes beyond its end read as 0.
    pub(super) fn take(&self, image: &[u8]) -> u64 {
        let byte = |at: usize| image.get(at).copied().unwrap_or(0);
        let Address {
            width, byte: first, ..
        } = self.address;
        if width == Width::Bit {
            return u64::from(byte(first) >> self.address.bit & 1);
        }
        let size = width.bytes();
        (0..size).fold(0, |value, significance| {
            let at = first + self.order.byte_position(size, significance);
            value | u64::from(byte(at)) << (8 * significance)
        })
    }

    /// Writes the value to the image; bytes beyond its end are dropped.
    pub(super) fn put(&self, value: u64, image: &mut [u8]) {
        let Address {
            width, byte: first, ..
        } = self.address;
        if width == Width::Bit {
            if let Some(byte) = image.get_mut(first) {
                let mask = 1 << self.address.bit;
                *byte = if value == 0 {
                    *byte & !mask
                } else {
                    *byte | mask
                };
            }
            return;
        }
        let size = width.bytes();
        for (significance, from) in value.to_le_bytes().into_iter().take(size).enumerate() {
            let at = first + self.order.byte_position(size, significance);
            if let Some(byte) = image.get_mut(at) {
                *byte = from;
            }
        }
    }
}

impl Plan {
    /// Determines the place of each variable. With a signal table, a variable gets the byte order of the
    /// signal at the same address, and all variables must be within the image.
    pub(super) fn new(
        declared: &[Declared],
        settings: &Settings,
        addressing: Addressing,
        table: Option<&SignalTable>,
    ) -> Result<Self, Mistake> {
        let addressing = settings.addressing.unwrap_or(addressing);
        let mut plan = Self::default();
        for (variable, declared) in declared.iter().enumerate() {
            if declared.area == "M" {
                continue;
            }
            let place = place(variable, declared, settings, addressing, table)?;
            let places = match place.address.area {
                Area::Input => &mut plan.inputs,
                Area::Output => &mut plan.outputs,
            };
            // Two programs of a project may declare the same variable; both declarations then share one
            // value.
            if !places.iter().any(|other| other.address == place.address) {
                places.push(place);
            }
        }
        if plan.inputs.is_empty() && plan.outputs.is_empty() {
            return Err(Mistake::new(
                "has no variable in %I or %Q, so that it can do nothing",
                "declare some, such as lamp AT %QX0.0 : BOOL",
            ));
        }
        plan.check_overlaps(addressing)?;
        if let Some(text) = &settings.alive {
            plan.find_alive(text, addressing, table)?;
        }
        if let Some(table) = table {
            plan.check_image(table)?;
        }
        Ok(plan)
    }

    /// Each variable has its own value, so of two outputs on the same bit only one would take effect.
    fn check_overlaps(&self, addressing: Addressing) -> Result<(), Mistake> {
        let keep = "keep one of them, or move one: each is a variable of its own, and only one would count";
        let right = match addressing {
            Addressing::Bytes => {
                format!("{keep}; if the numbers count elements, say addressing = \"iec\"")
            }
            Addressing::Elements => keep.to_owned(),
        };
        let mut sorted: Vec<&LocatedVariable> = self.outputs.iter().collect();
        sorted.sort_by_key(|place| place.address.bits().start);
        let mut last: Option<&LocatedVariable> = None;
        for place in sorted {
            if let Some(last) = last
                && place.address.bits().start < last.address.bits().end
            {
                return Err(Mistake::new(
                    format!(
                        "has two outputs on the same bits, {} and {}",
                        last.written, place.written
                    ),
                    right,
                ));
            }
            last = Some(place);
        }
        Ok(())
    }

    fn find_alive(
        &mut self,
        text: &str,
        addressing: Addressing,
        table: Option<&SignalTable>,
    ) -> Result<(), Mistake> {
        let address = Address::parse(text, addressing)?;
        let on_it = |place: &LocatedVariable| place.address == address;
        let Some(at) = self.inputs.iter().position(on_it) else {
            return Err(Mistake::new(
                format!("has no variable at {text}, which the option \"alive\" names"),
                format!("declare one in it, such as link_alive AT {text} : BOOL"),
            ));
        };
        let mut signals = table.into_iter().flat_map(|table| &table.signals);
        let taken = signals.find(|signal| {
            signal.area == Area::Input && signal.address().bits().contains(&address.bits().start)
        });
        if let Some(signal) = taken {
            return Err(Mistake::new(
                format!(
                    "takes {text} for the option \"alive\", where the signal \"{}\" lies",
                    signal.name
                ),
                "take a bit that no signal has",
            ));
        }
        self.alive.push(self.inputs.remove(at).variable);
        Ok(())
    }

    fn check_image(&self, table: &SignalTable) -> Result<(), Mistake> {
        let Some(station) = table.stations.first() else {
            return Ok(());
        };
        for place in self.inputs.iter().chain(&self.outputs) {
            let area = place.address.area;
            let end = place.address.bits().end.div_ceil(8);
            let has = station.bytes(area);
            if end > has {
                let key = match area {
                    Area::Input => "input_bytes",
                    Area::Output => "output_bytes",
                };
                return Err(Mistake::new(
                    format!(
                        "uses {} (to byte {}), but {area} has {has} bytes in this driver.cfg",
                        place.written,
                        end - 1
                    ),
                    format!(
                        "add the signal, or {key} = {end}; and check \"addressing\", which says whether \
                         addresses count bytes or elements"
                    ),
                ));
            }
        }
        Ok(())
    }

    /// How many bytes of the area the program uses.
    pub(super) fn bytes(&self, area: Area) -> usize {
        let places = match area {
            Area::Input => &self.inputs,
            Area::Output => &self.outputs,
        };
        let ends = places.iter().map(|place| place.address.bits().end);
        ends.max().unwrap_or(0).div_ceil(8)
    }
}

/// The place of one variable.
fn place(
    variable: usize,
    declared: &Declared,
    settings: &Settings,
    addressing: Addressing,
    table: Option<&SignalTable>,
) -> Result<LocatedVariable, Mistake> {
    let numbers: Vec<String> = declared.numbers.iter().map(u32::to_string).collect();
    let written = format!("%{}{}{}", declared.area, declared.size, numbers.join("."));
    let wrong = |what: String, right: String| {
        let name = format!("{written} : {}", declared.data_type);
        Err(Mistake::new(format!("declares {name}, and {what}"), right))
    };
    let Ok(data_type) = declared.data_type.parse::<DataType>() else {
        let types = DataType::ALL.map(DataType::name).join(", ");
        return wrong(
            format!("{} has no place in a process image", declared.data_type),
            format!("types are {types}"),
        );
    };
    if numbers.len() > 2 {
        return wrong(
            "its address has more than two numbers".to_owned(),
            "write %IX1.0 for bit 0 of byte 1, and %IW4 for a word".to_owned(),
        );
    }
    let address = match Address::parse(&written, addressing) {
        Ok(address) => address,
        Err(error) => return wrong(error.what, error.right),
    };
    if data_type.width() != address.width {
        return wrong(
            format!(
                "{data_type} has {} bits, but its address {}",
                data_type.width().bits(),
                address.width.bits()
            ),
            format!(
                "write %{}{} for it",
                declared.area,
                data_type.width().letter()
            ),
        );
    }
    if declared.bytes != data_type.size_bytes() {
        return wrong(
            format!("its value has {} bytes", declared.bytes),
            "build it anew with the plc/glue of this tickbus".to_owned(),
        );
    }
    let mut signals = table.into_iter().flat_map(|table| &table.signals);
    let signal = signals.find(|signal| signal.address() == address);
    let is_real = |data_type| matches!(data_type, DataType::Real | DataType::Lreal);
    if let Some(signal) = signal
        && is_real(signal.data_type) != is_real(data_type)
    {
        return wrong(
            format!(
                "the signal \"{}\" there is a {}",
                signal.name, signal.data_type
            ),
            "give both the same type".to_owned(),
        );
    }
    Ok(LocatedVariable {
        variable,
        address,
        order: signal.map_or(settings.order, |signal| signal.order),
        written,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use tickbus_image::signal::Signal;

    fn variable(data_type: &str, address: &str, bytes: usize) -> Declared {
        let numbers = address[3..].split('.');
        Declared {
            data_type: data_type.to_owned(),
            area: address[1..2].to_owned(),
            size: address[2..3].to_owned(),
            numbers: numbers.map(|number| number.parse().unwrap()).collect(),
            bytes,
        }
    }

    fn plan(declared: &[Declared], settings: &Settings) -> Result<Plan, String> {
        Plan::new(declared, settings, Addressing::Bytes, None)
            .map_err(|mistake| mistake.to_string())
    }

    fn lies(declared: &[Declared], settings: &Settings) -> Vec<String> {
        let plan = plan(declared, settings).expect("a plan");
        let all = plan.inputs.iter().chain(&plan.outputs);
        all.map(|place| format!("{} {}", place.address, place.order))
            .collect()
    }

    fn refusal(declared: &[Declared], settings: &Settings) -> String {
        plan(declared, settings).expect_err("refused")
    }

    #[test]
    fn numbers_count_bytes_or_elements() {
        let declared = [
            variable("INT", "%IW1", 2),
            variable("REAL", "%QD2", 4),
            variable("BOOL", "%QX1.2", 1),
            variable("INT", "%MW7", 2),
        ];
        let mut settings = Settings::default();
        assert_eq!(
            lies(&declared, &settings),
            ["%IW1 ABCD", "%QD2 ABCD", "%QX1.2 ABCD"]
        );
        settings.addressing = Some(Addressing::Elements);
        settings.order = ByteOrder::Dcba;
        assert_eq!(
            lies(&declared, &settings),
            ["%IW2 DCBA", "%QD8 DCBA", "%QX1.2 DCBA"]
        );
    }

    #[test]
    fn values_lie_in_the_image_by_their_order_and_leave_the_rest_alone() {
        let declared = [
            variable("UDINT", "%QD1", 4),
            variable("BOOL", "%QX0.7", 1),
            variable("UDINT", "%ID1", 4),
            variable("BOOL", "%IX0.7", 1),
        ];
        for (order, bytes) in [
            (ByteOrder::Abcd, [0x81, 1, 2, 3, 4, 0xFF]),
            (ByteOrder::Dcba, [0x81, 4, 3, 2, 1, 0xFF]),
            (ByteOrder::Cdab, [0x81, 3, 4, 1, 2, 0xFF]),
        ] {
            let settings = Settings {
                order,
                ..Settings::default()
            };
            let plan = plan(&declared, &settings).expect("a plan");
            let mut image = [0x01, 0, 0, 0, 0, 0xFF];
            plan.outputs[0].put(0x0102_0304, &mut image);
            plan.outputs[1].put(7, &mut image);
            assert_eq!(image, bytes, "{order}: any value but 0 is TRUE");
            assert_eq!(plan.inputs[0].take(&image), 0x0102_0304);
            assert_eq!(plan.inputs[1].take(&image), 1);
            plan.outputs[1].put(0, &mut image);
            assert_eq!((image[0], plan.inputs[1].take(&image)), (0x01, 0));
        }
    }

    #[test]
    fn what_an_image_lacks_reads_as_zero_and_is_dropped() {
        let declared = [variable("WORD", "%QW1", 2), variable("WORD", "%IW1", 2)];
        let plan = plan(&declared, &Settings::default()).expect("a plan");
        let mut image = [0, 0];
        plan.outputs[0].put(0x1234, &mut image);
        assert_eq!(image, [0, 0x12]);
        assert_eq!(plan.inputs[0].take(&image), 0x1200);
        assert_eq!((plan.bytes(Area::Input), plan.bytes(Area::Output)), (3, 3));
    }

    #[test]
    fn a_variable_that_two_programs_declare_is_one() {
        let declared = [
            variable("BOOL", "%IX0.0", 1),
            variable("BOOL", "%QX0.0", 1),
            variable("BOOL", "%IX0.0", 1),
            variable("BOOL", "%QX0.0", 1),
        ];
        assert_eq!(lies(&declared, &Settings::default()).len(), 2);
    }

    #[test]
    fn the_signals_of_the_driver_cfg_say_the_byte_order() {
        let declared = [variable("INT", "%QW0", 2), variable("INT", "%QW2", 2)];
        let (table, settings) = (table(&declared[..1]), Settings::default());
        let plan = Plan::new(&declared, &settings, Addressing::Bytes, Some(&table));
        let orders: Vec<_> = plan
            .expect("a plan")
            .outputs
            .into_iter()
            .map(|place| place.order)
            .collect();
        assert_eq!(orders, [ByteOrder::Dcba, ByteOrder::Abcd]);
    }

    /// One little-endian signal per variable, in an image of 4 bytes in each direction.
    fn table(declared: &[Declared]) -> SignalTable {
        let plan = plan(declared, &Settings::default()).expect("a plan");
        let all = plan.inputs.iter().chain(&plan.outputs);
        let signals = all.map(|place| {
            let data_type = declared[place.variable].data_type.parse().expect("a type");
            let Address {
                area, byte, bit, ..
            } = place.address;
            Signal {
                bit,
                order: ByteOrder::Dcba,
                ..Signal::new(format!("S{}", place.variable), area, byte, data_type)
            }
        });
        SignalTable::of_one_station(4, 4, signals.collect())
    }

    #[test]
    fn refusals_name_the_variable_and_what_would_be_right() {
        let none = Settings::default();
        for (declared, says) in [
            (
                vec![variable("TIME", "%QD0", 16)],
                "declares %QD0 : TIME, and TIME has no place in a process image; types are BOOL, BYTE, SINT, \
                 USINT, WORD, INT, UINT, DWORD, DINT, UDINT, REAL, LWORD, LINT, ULINT, LREAL",
            ),
            (
                vec![variable("INT", "%QX0.0", 2)],
                "declares %QX0.0 : INT, and INT has 16 bits, but its address 1; write %QW for it",
            ),
            (
                vec![variable("BOOL", "%IX1.2.3", 1)],
                "declares %IX1.2.3 : BOOL, and its address has more than two numbers; write %IX1.0 for bit 0 of \
                 byte 1, and %IW4 for a word",
            ),
            (
                vec![variable("BOOL", "%IX5", 1)],
                "declares %IX5 : BOOL, and the bit address \"%IX5\" names no bit; write %IX5.0 to %IX5.7, or \
                 %IB5 for the whole byte",
            ),
            (
                vec![variable("WORD", "%QW0", 2), variable("BOOL", "%QX1.0", 1)],
                "has two outputs on the same bits, %QW0 and %QX1.0; keep one of them, or move one: each is a \
                 variable of its own, and only one would count; if the numbers count elements, say addressing = \
                 \"iec\"",
            ),
            (
                vec![variable("INT", "%MW0", 2)],
                "has no variable in %I or %Q, so that it can do nothing; declare some, such as lamp AT %QX0.0 \
                 : BOOL",
            ),
        ] {
            assert_eq!(refusal(&declared, &none), says);
        }
    }

    #[test]
    fn what_lies_beyond_the_image_is_refused_with_its_address_as_written() {
        let declared = [variable("WORD", "%QW2", 2)];
        let settings = Settings {
            addressing: Some(Addressing::Elements),
            ..Settings::default()
        };
        let table = table(&[variable("WORD", "%QW0", 2)]);
        let plan = Plan::new(&declared, &settings, Addressing::Bytes, Some(&table));
        let Mistake { what, right } = plan.expect_err("refused");
        assert_eq!(
            what,
            "uses %QW2 (to byte 5), but %Q has 4 bytes in this driver.cfg"
        );
        assert!(
            right.starts_with("add the signal, or output_bytes = 6; "),
            "{right}"
        );
    }

    #[test]
    fn a_number_and_a_real_do_not_share_an_address() {
        let table = table(&[variable("DINT", "%QD0", 4)]);
        let declared = [variable("REAL", "%QD0", 4)];
        let settings = Settings::default();
        let plan = Plan::new(&declared, &settings, Addressing::Bytes, Some(&table));
        assert_eq!(
            plan.expect_err("refused").what,
            "declares %QD0 : REAL, and the signal \"S0\" there is a DINT"
        );
    }

    #[test]
    fn whether_the_data_are_alive_goes_to_a_bit_that_no_signal_has() {
        let declared = [variable("BOOL", "%IX9.0", 1), variable("BYTE", "%IB0", 1)];
        let settings = |alive: &str| Settings {
            alive: Some(alive.to_owned()),
            ..Settings::default()
        };
        let table = table(&declared[1..]);
        let fitted = Plan::new(
            &declared,
            &settings("%IX9.0"),
            Addressing::Bytes,
            Some(&table),
        );
        let fitted = fitted.expect("it need not lie within the image");
        assert_eq!((fitted.alive, fitted.inputs.len()), (vec![0], 1));
        assert_eq!(
            refusal(&declared, &settings("%IX9.1")),
            "has no variable at %IX9.1, which the option \"alive\" names; declare one in it, such as \
             link_alive AT %IX9.1 : BOOL"
        );
        let declared = [variable("BOOL", "%IX0.3", 1)];
        let taken = Plan::new(
            &declared,
            &settings("%IX0.3"),
            Addressing::Bytes,
            Some(&table),
        );
        assert_eq!(
            taken.expect_err("refused").what,
            "takes %IX0.3 for the option \"alive\", where the signal \"S0\" lies"
        );
    }
}
