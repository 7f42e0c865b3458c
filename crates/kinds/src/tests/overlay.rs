//! A driver.cfg whose bus is replaced by one of another kind.

use tickbus_driver_cfg::Config;

use crate::KINDS;

fn plant(fieldbus: &str) -> Config {
    let text = format!(
        "[driver]\nid = 1\nname = \"Cell\"\n[fieldbus]\nmax_age = \"3s\"\ninput_bytes = 8\n{fieldbus}\n\
         [[signal]]\nname = \"A\"\naddress = \"%IX0.0\"\n"
    );
    Config::parse("plant.cfg", &text, &KINDS).unwrap_or_else(|mistakes| panic!("{mistakes}"))
}

#[test]
fn a_controller_on_another_bus_ends_as_one_that_its_file_puts_there() {
    let end = "kind = \"socket\"\nrole = \"controller\"\naddress = \"10.0.0.1:2000\"\n";
    for stated in [
        "",
        "watchdog = \"off\"",
        "at_close = \"hold\"\nwhile_stale = \"hold\"",
    ] {
        let machine = plant(&format!("kind = \"loopback\"\nlink = \"cell\"\n{stated}"));
        let overlaid = machine.overlaid("other tables", &format!("[fieldbus]\n{end}"));
        let right = plant(&format!("{end}{stated}"));
        assert_eq!(overlaid.expect("right").timing, right.timing, "{stated}");
    }
}

const TWO_PLCS: &str = "[driver]\nid = 1\nname = \"Cell\"\n[fieldbus]\nkind = \"loopback\"\nlink = \"x\"\n\
                        [[station]]\nname = \"A\"\n[[station]]\nname = \"B\"\n\
                        [[signal]]\nname = \"a\"\naddress = \"%QX0.0\"\nstation = \"A\"\n\
                        [[signal]]\nname = \"b\"\naddress = \"%QX0.0\"\nstation = \"B\"\n";

fn with_two_plcs(tables: &str) -> Result<Config, String> {
    let plant =
        Config::parse("plant.cfg", TWO_PLCS, &KINDS).unwrap_or_else(|wrong| panic!("{wrong}"));
    let overlaid = plant.overlaid("other tables", tables);
    overlaid.map_err(|mistakes| mistakes.to_string())
}

#[test]
fn another_bus_is_told_of_the_stations_and_what_it_lacks_of_them_is_a_mistake() {
    let told = with_two_plcs("[fieldbus]\nkind = \"modbus-client\"\naddress = \"10.0.0.1:502\"\n");
    let told = told.expect_err("stations have units");
    for name in ["A", "B"] {
        let lacks = format!("other tables:2:8: [[station]] \"{name}\" has no \"unit\"");
        assert!(told.contains(&lacks), "{told}");
    }
    let units = "[[station]]\nname = \"B\"\nunit = 2\n[[station]]\nname = \"A\"\nunit = 1\n";
    let table = "[fieldbus]\nkind = \"modbus-server\"\n";
    let right = with_two_plcs(&format!("{table}{units}")).expect("right");
    let told = format!("{:?}", right.bus);
    let place = |unit: &str| {
        told.find(unit)
            .unwrap_or_else(|| panic!("no {unit} in {told}"))
    };
    assert!(
        place("unit: Some(1)") < place("unit: Some(2)"),
        "A is the first"
    );
    let told = with_two_plcs(&format!("{table}{}", units.replace("\"B\"", "\"C\"")));
    assert!(
        told.expect_err("no C")
            .contains("the driver.cfg has no station \"C\"")
    );
}

#[test]
fn another_bus_has_to_fit_the_signals() {
    let told = with_two_plcs("[fieldbus]\nkind = \"socket\"\nmessage = \"axis\"\n");
    assert!(told.expect_err("no axes").starts_with("other tables:"));
}
