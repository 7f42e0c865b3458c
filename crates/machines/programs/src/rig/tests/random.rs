//! Under any trouble, the program stays within its bounds, and an operator can bring it home again.
//!
//! [`Seen::check`](super::cell::Seen::check) holds in every scan of these tests.

use proptest::prelude::*;

use super::cell::{ABORT, Cell, PARKED, RESET, START, STOP};
use crate::rig::La1Code;

/// A kind of trouble in a running cell.
#[derive(Clone, Copy, Debug)]
enum Trouble {
    Press(u8),
    Link(bool),
    Jam(bool, bool),
    NotOk,
    Mute(bool),
    Blind(bool),
    /// The sensors' bits are flipped for one scan.
    Noise([u8; 3]),
}

impl Trouble {
    fn befalls(self, cell: &mut Cell) {
        match self {
            Self::Press(button) => cell.press(button),
            Self::Link(alive) => cell.alive = alive,
            Self::Jam(la1, la2) => {
                cell.plant.la1.jammed = la1;
                cell.plant.la2.jammed = la2;
            }
            Self::NotOk => cell.plant.not_ok = true,
            Self::Mute(mute) => cell.plant.mute = mute,
            Self::Blind(blind) => cell.plant.im1.blind = blind,
            Self::Noise(flips) => {
                let image = cell.plant.image();
                cell.scan_inputs(std::array::from_fn(|byte| image[byte] ^ flips[byte]));
            }
        }
    }
}

fn trouble() -> impl Strategy<Value = Trouble> {
    prop_oneof![
        4 => prop_oneof![Just(START), Just(STOP), Just(RESET)].prop_map(Trouble::Press),
        2 => any::<bool>().prop_map(Trouble::Link),
        1 => any::<(bool, bool)>().prop_map(|(la1, la2)| Trouble::Jam(la1, la2)),
        1 => Just(Trouble::NotOk),
        1 => any::<bool>().prop_map(Trouble::Mute),
        1 => any::<bool>().prop_map(Trouble::Blind),
        2 => any::<[u8; 3]>().prop_map(Trouble::Noise),
    ]
}

/// Ends every trouble; then the operator presses Stop, and Reset after a fault, until the rig is parked.
fn park(cell: &mut Cell) {
    cell.alive = true;
    cell.plant.la1.jammed = false;
    cell.plant.la2.jammed = false;
    cell.plant.mute = false;
    cell.plant.im1.blind = false;
    cell.scans(2);
    for _ in 0..4 {
        if cell.seen.phase != PARKED {
            cell.press(STOP);
        }
        cell.until("a rest", |cell| [ABORT, PARKED].contains(&cell.seen.phase));
        if cell.seen.phase == PARKED {
            break;
        }
        cell.press(RESET);
    }
}

/// The reference run of lift 1 reaches the bottom switch half a millimetre above the stop, and at that moment
/// the program is made to drop the run command.
#[test]
fn a_reference_run_that_ends_on_the_switch_parks_lift_1_on_its_stop() {
    let not_ok = Trouble::Noise([128, 0, 0]);
    for broken_off_by in [not_ok, Trouble::NotOk, Trouble::Link(false)] {
        for acknowledged in [true, false] {
            let mut cell = Cell::new(La1Code::MsbFirst);
            cell.plant.not_ok = acknowledged;
            cell.until("the switch", |cell| cell.plant.la1.at_bottom());
            assert_eq!(
                (cell.plant.la1.position, cell.seen.word & 0x001C),
                (500, 0x001C)
            );
            broken_off_by.befalls(&mut cell);
            cell.scans(1);
            assert_eq!(cell.seen.word & 0x001C, 0, "{broken_off_by:?}");
            park(&mut cell);
            assert_eq!(
                (cell.seen.phase, cell.plant.la1.position),
                (PARKED, 0),
                "{broken_off_by:?}, acknowledged before: {acknowledged}"
            );
        }
    }
}

/// A case that the test below has found.
#[test]
fn noise_in_the_scan_in_which_lift_1_meets_its_switch_parks_it_on_its_stop() {
    let not_ok = Trouble::Noise([128, 0, 0]);
    let mut cell = Cell::ready();
    for (trouble, scans) in [
        (Trouble::Mute(false), 105),
        (Trouble::Jam(false, false), 75),
        (Trouble::Press(START), 104),
        (not_ok, 0),
        (Trouble::Press(RESET), 72),
        (Trouble::Press(START), 132),
        (Trouble::Press(START), 117),
        (not_ok, 0),
    ] {
        trouble.befalls(&mut cell);
        cell.scans(scans);
    }
    assert_eq!((cell.seen.phase, cell.plant.la1.position), (ABORT, 500));
    park(&mut cell);
    assert_eq!((cell.seen.phase, cell.plant.la1.position), (PARKED, 0));
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 48, ..ProptestConfig::default() })]

    #[test]
    fn random_inputs_never_make_it_unsafe(
        scans in prop::collection::vec((any::<[u8; 3]>(), 1_usize..40, 0_u8..20), 200),
    ) {
        let mut cell = Cell::new(La1Code::MsbFirst);
        for (inputs, times, luck) in scans {
            cell.alive = luck > 0;
            for _ in 0..times {
                cell.scan_inputs(inputs);
            }
        }
    }

    #[test]
    fn after_any_trouble_an_operator_can_park_the_rig(
        troubles in prop::collection::vec((trouble(), 0_usize..300), 1..60),
        started: bool,
    ) {
        let mut cell = Cell::ready();
        if started {
            cell.press(START);
        }
        for (trouble, scans) in troubles {
            trouble.befalls(&mut cell);
            cell.scans(scans);
        }
        park(&mut cell);
        prop_assert_eq!(cell.seen.phase, PARKED);
        prop_assert_eq!(cell.plant.la1.position, 0);
    }
}
