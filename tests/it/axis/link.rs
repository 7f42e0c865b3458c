//! The driver's work for axes: acknowledges, commands by number, end switches.

use crate::axis::machine::Pair;

#[test]
fn the_machine_acknowledges_so_that_the_edge_may_fall_at_once() {
    let mut pair = Pair::new("[[axis]]\nname = \"A\"\nacknowledge = true\n");
    for _ in 0..20 {
        pair.outputs[0] = 0x11;
        pair.until("an acknowledge", |pair| pair.inputs[0] & 4 != 0);
        // The acknowledge tells the PLC that a tick has seen the command.
        pair.outputs[0] = 0x10;
        pair.until("its fall", |pair| pair.inputs[0] & 4 == 0);
    }
    pair.until("a tick without", |pair| pair.get("A.Execute") == 0.0);
}

#[test]
fn a_command_number_stands_for_what_the_table_of_the_machine_says() {
    let mut pair = Pair::new(
        "[[axis]]\nname = \"A\"\nkind = \"tracking\"\ndiagnostics = true\nlimits = [0.0, 400.0]\n\
         [[axis.command]]\nnumber = 258\nmode = \"position\"\nposition = 300.0\nspeed = 80.0\nacceleration = 150.0\n\
         [[axis.command]]\nnumber = 2\ntorque = 1.5\n",
    );
    assert_eq!((pair.outputs.len(), pair.inputs.len()), (30, 16));
    // Values missing in the table come from the PLC: here the deceleration.
    pair.outputs[0] = 0x11;
    pair.outputs[2..6].copy_from_slice(&7.0_f32.to_be_bytes());
    pair.outputs[14..18].copy_from_slice(&99.0_f32.to_be_bytes());
    pair.outputs[22..24].copy_from_slice(&[1, 2]);
    pair.set("A.InPosition", 0.0);
    pair.until("the command", |pair| pair.get("A.Execute") == 1.0);
    let told = ["TargetPosition", "Speed", "Acceleration", "Deceleration"];
    let told = told.map(|field| pair.get(&format!("A.{field}")));
    assert_eq!(told, [300.0, 80.0, 150.0, 99.0]);
    assert_eq!(pair.inputs[14..16], [0, 0], "not done yet");
    pair.set("A.InPosition", 1.0);
    pair.until("done", |pair| pair.inputs[14..16] == [1, 2]);

    pair.outputs[0] = 0x10;
    pair.outputs[22..24].copy_from_slice(&[0, 2]);
    pair.until("the next", |pair| pair.get("A.Torque") == 1.5);
    assert_eq!(pair.get("A.Tracking"), 1.0, "the mode of the table");
    assert_eq!(
        pair.get("A.TargetPosition"),
        7.0,
        "and the offset of the PLC"
    );

    pair.outputs[0] = 0x11;
    pair.outputs[22..24].copy_from_slice(&[0, 3]);
    pair.until("an error", |pair| pair.inputs[12..14] == [0, 3]);
    for _ in 0..5 {
        assert_eq!(pair.get("A.Execute"), 0.0, "no command for the simulation");
        pair.turn();
    }
    pair.outputs[22..24].copy_from_slice(&[0, 0]);
    assert_eq!(
        pair.get("A.Error"),
        0.0,
        "the simulation's own is as it was"
    );
    pair.until("no error", |pair| pair.inputs[12..14] == [0, 0]);
    pair.until("a command of the PLC's own", |pair| {
        pair.get("A.TargetPosition") == 7.0 && pair.get("A.Execute") == 1.0
    });
}

#[test]
fn end_switches_trip_at_their_positions_and_let_go_behind_their_hysteresis() {
    let mut pair = Pair::new(
        "[[axis]]\nname = \"A\"\nlimits = [0.0, 400.0]\n\
         [[axis.switch]]\nname = \"up\"\nabove = 395.0\nhysteresis = 2.0\naddress = \"%IX10.3\"\n\
         [[axis.switch]]\nname = \"down\"\nbelow = 0.5\naddress = \"%IX10.4\"\n",
    );
    assert_eq!(pair.inputs.len(), 11);
    for (position, switches) in [
        (200.0, 0),
        (394.9, 0),
        (395.0, 8),
        (393.1, 8),
        (392.9, 0),
        (394.0, 0),
        (400.0, 8),
        (0.6, 0),
        (0.5, 16),
        (0.0, 16),
        (0.51, 0),
    ] {
        pair.set("A.ActualPosition", position);
        let raw = f32::to_be_bytes(
            #[expect(clippy::cast_possible_truncation, reason = "as the codec does")]
            {
                position as f32
            },
        );
        pair.until("the position", |pair| pair.inputs[2..6] == raw);
        assert_eq!(pair.inputs[10], switches, "{position}");
    }
}
