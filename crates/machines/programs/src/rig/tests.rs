//! The program against a small plant.

mod bottles;
mod cell;
mod plant;
mod random;

use self::cell::{ABORT, Cell, PARKED, READY, RECOVER, RESET, RUN, START, STOP};
use self::plant::WORDS;
use super::La1Code;

const SC1: u16 = 0x0020;
const SUCTION: u16 = 0x1020;
const ACKNOWLEDGE: u16 = 0x8000;

fn words_of(cycles: usize) -> Vec<u16> {
    WORDS.repeat(cycles)
}

#[test]
fn homing_lowers_the_lifts_then_turns_the_wheels_then_is_ready() {
    let mut cell = Cell::new(La1Code::MsbFirst);
    cell.alive = false;
    cell.scans(50);
    assert_eq!(
        (cell.seen.phase, cell.seen.word),
        (0, SUCTION),
        "waits for the machine, and drops nothing"
    );
    cell.alive = true;
    cell.scans(2);
    assert_eq!(cell.seen.word, 0x041C | SUCTION, "LA1 − big, LA2 down");
    cell.until("the switches", |cell| {
        cell.plant.la1.at_bottom() && cell.plant.la2.at_bottom()
    });
    cell.scans(20);
    assert_eq!(
        cell.seen.word,
        0x041C | SUCTION,
        "past the switches, to the stops"
    );
    cell.until("the jog", |cell| cell.seen.word == 0x0102);
    assert!(
        cell.plant.la1.position == 0 && cell.plant.la2.position == 0,
        "down to the stop"
    );
    cell.until("lift 1 up, as in step 2", |cell| cell.seen.word == WORDS[1]);
    cell.until("lift 1 down, with suction", |cell| cell.seen.word == 0x003C);
    cell.until_phase(READY);
    assert_eq!(cell.phases, [0, 1, 2]);
    assert_eq!((cell.plant.im1.angle, cell.plant.im2.angle), (0, 0));
    assert_eq!((cell.seen.word, cell.seen.cycles), (0, 0));
    assert!(!cell.plant.not_ok);
}

#[test]
fn homing_gives_up_on_a_lift_that_does_not_come_to_the_sleeve_or_back() {
    let mut cell = Cell::new(La1Code::MsbFirst);
    cell.plant.mute = true;
    cell.until("the stroke", |cell| cell.seen.word == WORDS[1]);
    cell.scans(500);
    assert_eq!(cell.seen.phase, 1);
    cell.scan();
    assert_eq!((cell.seen.phase, cell.seen.word), (ABORT, SC1));

    cell.plant.mute = false;
    cell.press(RESET);
    cell.until("the stroke", |cell| cell.seen.word == WORDS[1]);
    cell.until("the way down", |cell| cell.seen.word == 0x003C);
    cell.plant.la1.jammed = true;
    cell.plant.sees_jams = false;
    cell.scans(500);
    assert_eq!(cell.seen.phase, RECOVER);
    cell.scan();
    assert_eq!((cell.seen.phase, cell.seen.word), (ABORT, SC1));

    cell.plant.la1.jammed = false;
    cell.press(RESET);
    cell.until("the stroke", |cell| cell.seen.word == WORDS[1]);
    cell.plant.not_ok = true;
    cell.scan();
    assert_eq!((cell.seen.phase, cell.seen.word), (ABORT, SC1));
    cell.press(RESET);
    cell.until_phase(READY);
}

#[test]
fn homing_acknowledges_a_fault_first() {
    let mut cell = Cell::new(La1Code::MsbFirst);
    cell.plant.not_ok = true;
    cell.scan();
    assert_eq!(
        (cell.seen.phase, cell.seen.word),
        (1, ACKNOWLEDGE | SUCTION)
    );
    cell.until_phase(READY);
    assert_eq!(cell.phases, [0, 1, 2]);
}

#[test]
fn a_referenced_lift_in_mid_path_comes_home_by_a_second_acknowledge() {
    let mut cell = Cell::new(La1Code::MsbFirst);
    cell.plant.la1.referenced = true;
    cell.scan();
    assert_eq!(cell.seen.word & ACKNOWLEDGE, 0);
    cell.until("the pulse", |cell| cell.seen.word == ACKNOWLEDGE | SUCTION);
    cell.until_phase(READY);
    assert_eq!(cell.phases, [0, 1, 2]);
}

#[test]
fn a_lift_that_fails_again_after_the_acknowledge_aborts_the_homing() {
    let mut cell = Cell::new(La1Code::MsbFirst);
    cell.plant.not_ok = true;
    cell.until("the lifts", |cell| cell.seen.word & 0x0404 != 0);
    cell.plant.not_ok = true;
    cell.scan();
    assert_eq!((cell.seen.phase, cell.seen.word), (ABORT, SUCTION));
}

#[test]
fn a_homing_that_lost_the_link_begins_with_its_full_time() {
    let mut cell = Cell::new(La1Code::MsbFirst);
    cell.scans(5);
    cell.alive = false;
    cell.scans(950);
    cell.alive = true;
    cell.until_phase(READY);
    assert_eq!(cell.phases, [0, 1, 0, 1, 2]);
}

#[test]
fn three_cycles_command_exactly_the_words_of_the_protocol() {
    let mut cell = Cell::ready();
    cell.press(START);
    for cycle in 1..=3 {
        cell.until("the cycle", |cell| cell.seen.cycles == cycle);
        assert_eq!((cell.seen.phase, cell.seen.step), (RUN, 1));
    }
    assert_eq!(cell.words[..18], words_of(3));
    assert!(!cell.plant.not_ok);
}

#[test]
fn the_other_order_of_the_code_swaps_the_small_moves_alone() {
    let mut cell = Cell::new(La1Code::LsbFirst);
    cell.until_phase(READY);
    cell.press(START);
    cell.until("a cycle", |cell| cell.seen.cycles == 1);
    assert_eq!(
        cell.words[..6],
        [0x0001, 0x0024, 0x0014, 0x0080, 0x3C2C, 0x343C]
    );
    assert!(!cell.plant.not_ok);
}

#[test]
fn stop_ends_the_cycle_then_finalises_and_parks_and_start_begins_anew() {
    let mut cell = Cell::in_step(3);
    cell.press(STOP);
    cell.press(START);
    cell.until_phase(PARKED);
    assert_eq!(cell.phases, [0, 1, 2, 3, 6, 7]);
    assert_eq!(cell.words, words_of(1), "no word of a second cycle");
    assert_eq!(
        (cell.seen.word, cell.seen.cycles, cell.seen.step),
        (0, 1, 0)
    );
    assert_eq!((cell.plant.im1.angle, cell.plant.im2.angle), (0, 0));

    cell.press(STOP);
    cell.press(RESET);
    cell.scans(300);
    assert_eq!(cell.seen.phase, PARKED, "only Start counts");
    cell.press(START);
    cell.until_phase(READY);
    cell.scans(300);
    assert_eq!(cell.seen.phase, READY, "the Stop while parked is forgotten");
    cell.press(START);
    cell.until("the second cycle", |cell| cell.seen.cycles == 2);
    cell.press(STOP);
    cell.until_phase(PARKED);
    assert_eq!(cell.phases, [0, 1, 2, 3, 6, 7, 1, 2, 3, 6, 7]);
    assert_eq!(cell.seen.cycles, 3);
}

#[test]
fn stop_counts_while_homing_and_while_ready() {
    let mut cell = Cell::ready();
    cell.press(RESET);
    assert_eq!(cell.seen.phase, READY);
    cell.press(STOP);
    cell.until_phase(PARKED);
    assert_eq!(cell.phases, [0, 1, 2, 6, 7]);

    let mut cell = Cell::new(La1Code::MsbFirst);
    cell.scans(5);
    cell.press(START);
    cell.press(STOP);
    cell.until_phase(PARKED);
    assert_eq!(cell.phases, [0, 1, 6, 7]);
}

#[test]
fn a_jam_that_the_machine_sees_aborts_at_once_and_recovers_into_the_run() {
    let mut cell = Cell::in_step(5);
    cell.plant.la2.jammed = true;
    cell.until_phase(ABORT);
    assert!(cell.plant.not_ok);
    assert_eq!(
        (cell.seen.word, cell.seen.step),
        (SUCTION, 0),
        "holds the bottles, moves nothing"
    );
    cell.press(START);
    cell.scans(500);
    assert_eq!((cell.seen.phase, cell.seen.word), (ABORT, SUCTION));

    cell.press(RESET);
    cell.until_phase(ABORT);
    assert_eq!(cell.phases, [0, 1, 2, 3, 4, 5, 4], "still jammed");
    assert_eq!(cell.seen.word, SUCTION);

    cell.plant.la2.jammed = false;
    cell.press(RESET);
    assert_eq!(cell.phases.last(), Some(&RECOVER));
    cell.until("the lifts down", |cell| cell.seen.word & SUCTION == 0);
    assert!(
        cell.plant.la1.at_bottom() && cell.plant.la2.at_bottom(),
        "held until down"
    );
    cell.words.clear();
    cell.until("the cycle", |cell| cell.seen.cycles == 1);
    assert_eq!(cell.phases, [0, 1, 2, 3, 4, 5, 4, 5, 3]);
    assert_eq!(cell.words[..6], WORDS);
}

#[test]
fn the_acknowledge_pulse_lasts_its_time() {
    let mut cell = Cell::in_step(5);
    cell.plant.not_ok = true;
    cell.scan();
    assert_eq!(cell.seen.phase, ABORT);
    cell.buttons = RESET;
    let mut pulse = 0;
    for _ in 0..100 {
        cell.scan();
        pulse += i32::from(cell.seen.word & ACKNOWLEDGE != 0);
    }
    assert_eq!(
        pulse, 11,
        "100 ms, from the scan after the one that began it"
    );
}

#[test]
fn a_jam_that_only_the_program_sees_aborts_after_its_time() {
    let mut cell = Cell::in_step(5);
    cell.plant.sees_jams = false;
    cell.plant.la1.jammed = true;
    cell.scans(150);
    assert_eq!(cell.seen.phase, RUN);
    cell.scan();
    assert_eq!((cell.seen.phase, cell.seen.word), (ABORT, SUCTION));
    assert!(!cell.plant.not_ok);
    cell.plant.la1.jammed = false;
    cell.press(RESET);
    cell.until("the cycle", |cell| cell.seen.cycles == 1);
}

#[test]
fn a_step_that_never_completes_aborts_after_its_time() {
    let mut cell = Cell::in_step(2);
    cell.plant.mute = true;
    cell.scans(499);
    assert_eq!(cell.seen.phase, RUN);
    cell.scan();
    assert_eq!((cell.seen.phase, cell.seen.word), (ABORT, SC1));
}

#[test]
fn a_step_whose_complete_is_on_before_it_begins_is_not_commanded() {
    for step in 1..=6 {
        let mut cell = Cell::ready();
        cell.plant.stuck[1] = 1 << (step - 1);
        cell.press(START);
        cell.until_phase(ABORT);
        assert_eq!(cell.words, WORDS[..step - 1], "step {step}");
        assert!(!cell.plant.not_ok, "step {step}");
        cell.plant.stuck[1] = 0;
        cell.press(RESET);
        cell.until("the cycle", |cell| cell.seen.cycles == 1);
    }
}

#[test]
fn a_step_that_is_complete_within_50_ms_aborts_in_that_scan() {
    for after in 0..4 {
        let mut cell = Cell::in_step(4);
        cell.scans(after);
        assert_eq!((cell.seen.phase, cell.seen.step), (RUN, 4));
        cell.plant.stuck[1] = 1 << 3;
        cell.scan();
        assert_eq!((cell.seen.phase, cell.seen.word), (ABORT, 0), "{after}");
    }
    let mut cell = Cell::in_step(4);
    cell.scans(4);
    cell.plant.stuck[1] = 1 << 3;
    cell.scans(2);
    assert_eq!((cell.seen.phase, cell.seen.step), (RUN, 5));
}

#[test]
fn homing_does_not_believe_a_lift_that_is_up_at_once_or_at_its_bottom_too() {
    for stuck in [[0, 1 << 1, 0], [0, 0, 1 << 3]] {
        let mut cell = Cell::new(La1Code::MsbFirst);
        cell.until("the stroke", |cell| cell.seen.word == WORDS[1]);
        cell.plant.stuck = stuck;
        cell.until_phase(ABORT);
        assert_eq!((cell.seen.word, cell.plant.not_ok), (SC1, false));
        cell.plant.stuck = [0; 3];
        cell.press(RESET);
        cell.until_phase(READY);
        assert_eq!(cell.phases, [0, 1, 4, 5, 2]);
    }
}

#[test]
fn stop_in_abort_is_remembered_until_the_rig_is_home() {
    let mut cell = Cell::in_step(4);
    cell.plant.not_ok = true;
    cell.until_phase(ABORT);
    cell.press(STOP);
    cell.scans(300);
    assert_eq!(cell.seen.phase, ABORT);
    cell.press(RESET);
    cell.until_phase(PARKED);
    assert_eq!(cell.phases, [0, 1, 2, 3, 4, 5, 6, 7]);
}

#[test]
fn a_fault_before_any_run_recovers_to_ready() {
    let mut cell = Cell::ready();
    cell.plant.not_ok = true;
    cell.until_phase(ABORT);
    cell.press(RESET);
    cell.until_phase(READY);
    assert_eq!(cell.phases, [0, 1, 2, 4, 5, 2]);
}

#[test]
fn homing_gives_up_on_a_stuck_lift_and_on_a_blind_sensor() {
    let mut cell = Cell::new(La1Code::MsbFirst);
    cell.plant.sees_jams = false;
    cell.plant.la1.jammed = true;
    cell.scans(1001);
    assert_eq!(cell.seen.phase, 1);
    cell.scan();
    assert_eq!((cell.seen.phase, cell.seen.word), (ABORT, SUCTION));

    cell.plant.la1.jammed = false;
    cell.plant.im2.blind = true;
    cell.press(RESET);
    cell.until_phase(ABORT);
    cell.plant.im2.blind = false;
    cell.press(RESET);
    cell.until_phase(READY);
    assert_eq!(cell.phases, [0, 1, 4, 5, 4, 5, 2]);
}

#[test]
fn a_wheel_is_never_turned_through_a_lift() {
    // The switch of lift 1 drops out while wheel 1 is being indexed.
    let mut cell = Cell::in_step(1);
    let image = cell.plant.image();
    cell.scan_inputs([image[0], image[1], image[2] & !8]);
    assert_eq!((cell.seen.phase, cell.seen.word), (ABORT, 0));

    // Lift 2 is off its switch when the drum turns to the step of wheel 2.
    let mut cell = Cell::in_step(3);
    cell.plant.la2.position = 50_000;
    cell.until_phase(ABORT);
    assert_eq!(cell.words, WORDS[..3]);

    // A lift leaves its switch while the wheels are jogged.
    let mut cell = Cell::new(La1Code::MsbFirst);
    cell.until("the jog", |cell| cell.seen.word == 0x0102);
    cell.plant.la1.position = 50_000;
    cell.scan();
    assert_eq!((cell.seen.phase, cell.seen.word), (ABORT, 0));
}

/// Interrupts the link for a second.
#[track_caller]
fn flicker(cell: &mut Cell) {
    let suction = cell.seen.word & SUCTION;
    let cycles = cell.seen.cycles;
    cell.alive = false;
    for _ in 0..100 {
        cell.scan();
        assert_eq!(
            (cell.seen.phase, cell.seen.word, cell.seen.step),
            (0, suction, 0)
        );
        assert_eq!(cell.seen.cycles, cycles);
    }
    cell.alive = true;
    cell.phases.clear();
}

#[test]
fn after_a_lost_link_a_run_goes_on_by_itself() {
    for step in 1..=6 {
        let mut cell = Cell::in_step(step);
        cell.scans(20);
        flicker(&mut cell);
        cell.until("the cycle", |cell| cell.seen.cycles == 1);
        assert_eq!(cell.phases, [1, 3], "step {step}");
    }
}

/// Switches the program off after `ran` scans of its second cycle and on again after `off` scans: the machine
/// continues with the last word until the data are stale, and holds the fail-safe values from then on. Then
/// the operator presses Start, and the cell continues.
#[track_caller]
fn power_cut(ran: usize, off: usize) {
    let mut cell = Cell::ready();
    cell.press(START);
    cell.until("the second cycle", |cell| cell.seen.cycles == 1);
    cell.scans(ran);
    assert!(!cell.plant.not_ok);
    cell.power_cut(off);
    cell.until_phase(READY);
    cell.press(START);
    cell.until("two more cycles", |cell| cell.seen.cycles == 2);
    assert_eq!(cell.phases, [0, 1, 2, 3], "after {ran} scans, {off} off");
    assert_eq!(
        cell.plant.bottles.broken, None,
        "after {ran} scans, {off} off"
    );
    cell.press(STOP);
    cell.until_phase(PARKED);
    assert_eq!(
        cell.plant.bottles.broken, None,
        "after {ran} scans, {off} off"
    );
}

#[test]
fn a_power_cut_at_any_moment_drops_nothing_and_leaves_no_sleeve_full() {
    let mut cell = Cell::ready();
    cell.press(START);
    cell.until("the second cycle", |cell| cell.seen.cycles == 1);
    let mut scans = 0;
    cell.until("the third cycle", |cell| cell.seen.cycles == 2);
    while cell.seen.cycles == 2 {
        cell.scan();
        scans += 1;
    }
    assert!(scans > 200, "a cycle takes {scans} scans");
    for ran in (0..scans).step_by(3) {
        // Back before the data are stale, just when they become stale, and long after.
        for off in [5, 25, 150] {
            power_cut(ran, off);
        }
    }
}

#[test]
fn a_second_power_cut_in_the_homing_drops_nothing_either() {
    for ran in (0..700).step_by(10) {
        let mut cell = Cell::in_step(4);
        cell.scans(20);
        cell.power_cut(100);
        cell.scans(ran);
        cell.power_cut(100);
        cell.until_phase(READY);
        cell.press(START);
        cell.until("a cycle", |cell| cell.seen.cycles == 1);
        assert_eq!(cell.plant.bottles.broken, None, "after {ran} scans");
    }
}

#[test]
fn after_a_lost_link_no_sleeve_is_full_either() {
    for ran in (0..1_300).step_by(7) {
        let mut cell = Cell::ready();
        cell.press(START);
        cell.scans(ran);
        flicker(&mut cell);
        let cycles = cell.seen.cycles + 1;
        cell.until("the cycle", |cell| cell.seen.cycles == cycles);
        assert_eq!(cell.plant.bottles.broken, None, "after {ran} scans");
    }
}

#[test]
fn after_a_lost_link_the_other_phases_home_or_wait_for_reset() {
    let mut cell = Cell::new(La1Code::MsbFirst);
    cell.scans(40);
    flicker(&mut cell);
    cell.until_phase(READY);
    assert_eq!(cell.phases, [1, 2]);

    flicker(&mut cell);
    cell.until_phase(READY);
    assert_eq!(cell.phases, [1, 2]);

    cell.press(START);
    cell.until("step 5", |cell| cell.seen.step == 5);
    cell.plant.not_ok = true;
    cell.until_phase(ABORT);
    flicker(&mut cell);
    cell.scans(300);
    assert_eq!(cell.phases, [4], "a fault outlives the link");

    cell.press(RESET);
    flicker(&mut cell);
    cell.until_phase(RUN);
    assert_eq!(cell.phases, [1, 3], "what was reset is reset");

    cell.press(STOP);
    cell.until_phase(6);
    flicker(&mut cell);
    cell.until_phase(PARKED);
    assert_eq!(cell.phases, [1, 6, 7]);

    flicker(&mut cell);
    cell.until_phase(READY);
    assert_eq!(cell.phases, [1, 2]);
}
