use super::*;

const TICK: f64 = 0.01;

/// 1500 turns per minute in 1 s up and 2 s down, 0.5 s at a quick stop, 4 s coasting.
fn setup(telegram: Telegram) -> Setup {
    Setup {
        telegram,
        reference_speed: 1500.0,
        ramp_up: 1.0,
        ramp_down: 2.0,
        quick_stop: 0.5,
        coast: 4.0,
        increments: 1000.0,
        codes: [7860, 7850],
        mechanics: Mechanics {
            velocity: 10_000.0,
            rates: [20_000.0, 20_000.0],
            limits: Some([-5_000.0, 50_000.0]),
            units_per_turn: 1_000.0,
        },
    }
}

struct Rig {
    drive: Profidrive,
    words: Words,
    measured: Measured,
    told: Words,
    /// The words and the measurements of the last step.
    seen: Option<(Words, Measured)>,
}

impl Rig {
    fn new(telegram: Telegram) -> Self {
        Self {
            drive: Profidrive::new(setup(telegram)),
            words: Words::default(),
            measured: Measured::default(),
            told: Words::default(),
            seen: None,
        }
    }

    /// A drive in operation.
    fn running(telegram: Telegram, stw1: u16) -> Self {
        let mut rig = Self::new(telegram);
        for stw1 in [0x047E, stw1, stw1] {
            rig.write(stw1);
        }
        assert_eq!(rig.drive.state(), State::Operation);
        rig
    }

    /// One step with this STW1.
    fn write(&mut self, stw1: u16) -> u16 {
        self.words.set_bits(Word::Stw1, stw1);
        self.for_seconds(TICK)
    }

    fn for_seconds(&mut self, seconds: f64) -> u16 {
        let mut left = seconds;
        while left > TICK / 2.0 {
            left -= TICK;
            // A drive that does not move is not stepped without news.
            let now = Some((self.words.clone(), self.measured));
            if !self.drive.moves() && self.seen == now {
                continue;
            }
            self.seen = now;
            self.told = self.drive.step(TICK, &self.words, &self.measured);
        }
        self.told.bits(Word::Zsw1)
    }

    fn speed(&self) -> f64 {
        self.told.get(Word::NistB)
    }

    fn set(&mut self, word: Word, value: f64) {
        self.words.set(word, value);
    }
}

/// A value within a hundredth.
#[track_caller]
fn near(value: f64, expected: f64) {
    let limit = 0.01 * expected.abs().max(1.0);
    assert!(
        (value - expected).abs() <= limit,
        "{value}, expected {expected}"
    );
}

#[test]
fn a_drive_runs_up_with_047e_and_047f_and_follows_its_ramps() {
    let mut rig = Rig::new(Telegram::Speed);
    rig.set(Word::NsollA, 750.0);
    // Switching on inhibited, both stops active, control requested.
    assert_eq!(rig.write(0) & 0x027F, 0x0240);
    assert_eq!(rig.write(0x047E) & 0x027F, 0x0231, "ready for switching on");
    assert_eq!(rig.write(0x047F) & 0x027F, 0x0233, "switched on");
    assert_eq!(
        rig.write(0x047F) & 0x037F,
        0x0237,
        "operation, not at speed"
    );
    let zsw1 = rig.for_seconds(0.5);
    near(rig.told.get(Word::NistA), 750.0);
    assert_eq!(
        zsw1 & 0x0700,
        0x0300,
        "at its setpoint, below the reference"
    );
    rig.set(Word::NsollA, 1500.0);
    assert_eq!(rig.for_seconds(0.6) & 0x0700, 0x0700);
    // OFF1: 2 s from the reference speed to standstill, and back to S2.
    assert_eq!(rig.write(0x047E) & 0x7F, 0x33);
    rig.for_seconds(1.0);
    near(rig.speed(), 1500.0 * (1.0 - 1.01 / 2.0));
    assert_eq!(rig.for_seconds(1.1) & 0x7F, 0x31);
    near(rig.speed(), 0.0);
}

#[test]
fn the_ramp_generator_obeys_bits_4_to_6_and_11() {
    let mut rig = Rig::running(Telegram::LongSpeed, 0x047F);
    rig.set(Word::NsollB, 1500.0);
    rig.for_seconds(0.5);
    rig.write(0x045F);
    let held = rig.speed();
    rig.for_seconds(0.5);
    near(rig.speed(), held);
    // Without the setpoint the speed goes down by the ramp.
    rig.write(0x043F);
    rig.for_seconds(0.5);
    near(rig.speed(), held - 1500.0 / 2.0 * 0.51);
    rig.write(0x0C7F);
    rig.for_seconds(3.0);
    near(rig.speed(), -1500.0);
    assert_eq!(rig.told.bits(Word::Zsw1) & 0x4000, 0, "backwards");
    // The output of the ramp generator is 0: the drive brakes as fast as it can.
    rig.write(0x046F);
    rig.for_seconds(0.5);
    near(rig.speed(), 0.0);
    assert_eq!(rig.drive.state(), State::Operation);
}

#[test]
fn quick_stop_and_coasting_lead_to_s1_and_only_off1_leads_out_of_it() {
    for (stw1, zsw1, seconds) in [(0x047B, 0x13, 0.5), (0x047D, 0x60, 4.0)] {
        let mut rig = Rig::running(Telegram::LongSpeed, 0x047F);
        rig.set(Word::NsollB, 1500.0);
        rig.for_seconds(1.1);
        assert_eq!(rig.write(stw1) & 0x7F, zsw1, "{stw1:04X}");
        rig.for_seconds(seconds / 2.0);
        near(rig.speed(), 1500.0 * (0.5 - TICK / seconds));
        rig.for_seconds(seconds / 2.0 + TICK);
        near(rig.speed(), 0.0);
        assert_eq!(rig.write(0x047F) & 0x4F, 0x40, "{stw1:04X}");
        assert_eq!(rig.write(0x047E) & 0x4F, 0x01);
    }
}

#[test]
fn a_fault_stays_until_the_edge_of_its_acknowledgement_after_its_cause() {
    let mut rig = Rig::running(Telegram::Positioner, 0x047F);
    rig.measured.warning = true;
    assert_eq!(rig.for_seconds(TICK) & 0x80, 0x80);
    assert_eq!(rig.told.bits(Word::WarnCode), 7850);
    rig.measured = Measured {
        fault: true,
        ..Measured::default()
    };
    assert_eq!(rig.for_seconds(TICK) & 0xCF, 0x48);
    assert_eq!(rig.told.bits(Word::FaultCode), 7860);
    // The cause is still there.
    assert_eq!(rig.write(0x04FE) & 0x4F, 0x48);
    rig.measured.fault = false;
    assert_eq!(rig.for_seconds(TICK) & 0x4F, 0x48, "no edge");
    rig.write(0x047E);
    assert_eq!(
        rig.write(0x04FF) & 0x4F,
        0x40,
        "acknowledged, ON is no way out"
    );
    assert_eq!(rig.told.bits(Word::FaultCode), 0);
    assert_eq!(rig.write(0x047E) & 0x4F, 0x01);
}

#[test]
fn words_count_only_with_control_by_plc_and_a_plc_that_is_gone_is_a_fault() {
    let mut rig = Rig::running(Telegram::LongSpeed, 0x047F);
    rig.set(Word::NsollB, 1500.0);
    rig.for_seconds(1.1);
    rig.set(Word::NsollB, 0.0);
    assert_eq!(rig.write(0x007E) & 0x7F, 0x37, "not its PLC");
    rig.for_seconds(0.5);
    near(rig.speed(), 1500.0);
    // All zeros: the PLC has stopped.
    assert_eq!(rig.write(0) & 0x0F, 0x0B);
    assert_eq!(rig.told.bits(Word::FaultCode), NO_SETPOINTS);
    assert_eq!(rig.for_seconds(0.6) & 0x4F, 0x48);
    near(rig.speed(), 0.0);
    assert_eq!(rig.write(0x047E) & 0x4F, 0x48, "to be acknowledged");
    assert_eq!(rig.write(0x04FE) & 0x4F, 0x01);
}

#[test]
fn the_speed_of_a_simulation_counts_and_a_stop_waits_for_its_standstill() {
    let mut rig = Rig::running(Telegram::LongSpeed, 0x047F);
    rig.set(Word::NsollB, 1500.0);
    rig.measured.speed = Some(1200.0);
    assert_eq!(rig.for_seconds(1.5) & 0x0100, 0, "not at its setpoint");
    near(rig.speed(), 1200.0);
    rig.write(0x047E);
    assert_eq!(rig.for_seconds(3.0) & 0x7F, 0x33, "it still turns");
    rig.measured.speed = Some(10.0);
    assert_eq!(rig.for_seconds(TICK) & 0x7F, 0x31);
}

#[test]
fn the_encoder_counts_the_turns_of_a_motor_that_only_the_simulation_turns() {
    let mut rig = Rig::new(Telegram::Encoder);
    rig.measured.speed = Some(600.0);
    rig.for_seconds(2.0);
    near(rig.told.get(Word::G1Xist1), 20_000.0);
    rig.measured.speed = Some(0.0);
    rig.for_seconds(TICK);
    assert!(!rig.drive.moves());
}

#[test]
fn a_simulation_that_fails_for_a_tick_does_not_spoil_the_encoder_and_the_position() {
    let mut rig = Rig::running(Telegram::Encoder, 0x047F);
    for wrong in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 1e300] {
        rig.measured.speed = Some(wrong);
        rig.for_seconds(TICK);
    }
    // At most twice the reference speed counts, for a tick each, and NaN not at all.
    let wrong_turns = 50.0 * TICK * 2.0;
    rig.measured.speed = Some(600.0);
    rig.for_seconds(2.0);
    let turns = rig.told.get(Word::G1Xist1) / 1000.0;
    assert!((turns - 20.0).abs() < wrong_turns, "{turns}");

    let mut rig = Rig::new(Telegram::Positioner);
    rig.measured.position = Some(f64::NAN);
    rig.write(0x047E);
    rig.measured.position = Some(400.0);
    rig.for_seconds(TICK);
    rig.measured.position = None;
    rig.for_seconds(TICK);
    near(rig.told.get(Word::XistA), 400.0);
}

#[test]
fn the_life_sign_counts_while_the_plc_sends_one() {
    let mut rig = Rig::running(Telegram::LongSpeed, 0x047F);
    assert_eq!(rig.told.bits(Word::Zsw2), 0x0400, "pulses enabled");
    rig.set(Word::Stw2, f64::from(0x1000));
    let signs = [0; 17].map(|_: u8| {
        rig.for_seconds(TICK);
        rig.told.bits(Word::Zsw2) >> 12
    });
    let expected = [1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 1, 2];
    assert_eq!(signs, expected);
    rig.set(Word::Stw2, 0.0);
    rig.for_seconds(TICK);
    assert_eq!(rig.told.bits(Word::Zsw2) >> 12, 0);
}

#[test]
fn the_encoder_counts_sends_its_absolute_value_on_request_and_can_be_parked() {
    let mut rig = Rig::running(Telegram::Encoder, 0x047F);
    rig.set(Word::NsollB, 600.0);
    rig.for_seconds(2.4);
    // 10 turns per second, after a ramp of 0.4 s.
    near(
        rig.told.get(Word::G1Xist1),
        1000.0 * (2.0 * 10.0 + 0.4 * 5.0),
    );
    assert_eq!(rig.told.get(Word::G1Xist2).to_bits(), 0);
    rig.set(Word::G1Stw, f64::from(0xA000_u16));
    rig.for_seconds(TICK);
    assert_eq!(rig.told.bits(Word::G1Zsw), 0x2800);
    near(rig.told.get(Word::G1Xist2), rig.told.get(Word::G1Xist1));
    rig.set(Word::G1Stw, f64::from(0x6000_u16));
    rig.for_seconds(TICK);
    assert_eq!(rig.told.bits(Word::G1Zsw), 0x4000);
    assert_eq!(rig.told.get(Word::G1Xist1).to_bits(), 0);
    // Backwards past 0 the count wraps at 32 bits.
    rig.set(Word::G1Stw, 0.0);
    rig.set(Word::NsollB, -600.0);
    rig.for_seconds(5.0);
    assert!(rig.told.get(Word::G1Xist1) > 4e9, "{:?}", rig.told);
}

#[test]
fn the_position_controller_in_the_drive_takes_a_deviation_away() {
    let mut rig = Rig::running(Telegram::Servo, 0x047F);
    // 5 turns of 1000 increments, with a gain of 20 per second.
    rig.set(Word::Xerr, 5_000.0);
    rig.set(Word::Kpc, 20_000.0);
    rig.for_seconds(1.0);
    near(rig.told.get(Word::G1Xist1), 5_000.0);
    near(rig.speed(), 0.0);
    // The setpoint of the speed is fed forward.
    rig.set(Word::Xerr, 0.0);
    rig.set(Word::NsollB, 60.0);
    rig.for_seconds(TICK);
    near(rig.speed(), 60.0);
}

/// MDI, absolute, with all enables.
const MDI: f64 = 33_024.0;

fn positioner() -> Rig {
    let mut rig = Rig::running(Telegram::Positioner, 0x043F);
    rig.set(Word::PosStw1, MDI);
    rig.set(Word::Override, 16_384.0);
    rig.set(Word::MdiVelocity, 60.0 * 5.0);
    rig.set(Word::MdiAcc, 16_384.0);
    rig.set(Word::MdiDec, 16_384.0);
    rig
}

#[test]
fn mdi_positions_with_the_edge_of_its_command_and_tells_the_target() {
    let mut rig = positioner();
    assert_eq!(
        rig.for_seconds(TICK) & 0x3C00,
        0x2C00,
        "there, referenced, stands"
    );
    assert_eq!(rig.told.bits(Word::PosZsw1), 0x8000);
    rig.set(Word::MdiTarpos, 10_000.0);
    rig.for_seconds(0.1);
    near(rig.told.get(Word::XistA), 0.0);
    // The edge: acknowledged, under way, accelerates.
    assert_eq!(rig.write(0x047F) & 0xF400, 0x5000);
    rig.for_seconds(0.5);
    near(rig.speed(), 60.0 * 5.0);
    assert_eq!(rig.told.bits(Word::PosZsw2) & 0x8030, 0x8010, "forwards");
    // Half of the override.
    rig.set(Word::Override, 8_192.0);
    rig.for_seconds(0.2);
    near(rig.speed(), 60.0 * 2.5);
    // An intermediate stop keeps the task.
    rig.write(0x045F);
    assert_eq!(rig.for_seconds(0.5) & 0x2400, 0x2000);
    rig.write(0x047F);
    assert_eq!(rig.for_seconds(5.0) & 0xE400, 0x2400, "there, and stands");
    near(rig.told.get(Word::XistA), 10_000.0);
    // Relative, without another edge: nothing; with one: on by 500.
    rig.set(Word::PosStw1, MDI - 256.0);
    rig.set(Word::MdiTarpos, 500.0);
    rig.for_seconds(1.0);
    near(rig.told.get(Word::XistA), 10_000.0);
    rig.write(0x043F);
    rig.write(0x047F);
    rig.for_seconds(2.0);
    near(rig.told.get(Word::XistA), 10_500.0);
    // A rejected task is gone.
    rig.write(0x043F);
    rig.set(Word::MdiTarpos, 10_000.0);
    rig.write(0x047F);
    rig.for_seconds(0.3);
    rig.write(0x046F);
    rig.for_seconds(1.0);
    let stopped = rig.told.get(Word::XistA);
    rig.write(0x047F);
    assert_eq!(rig.for_seconds(2.0) & 0x2400, 0x2000);
    near(rig.told.get(Word::XistA), stopped);
}

#[test]
fn continuous_transfer_set_up_and_the_software_limits() {
    let mut rig = positioner();
    rig.set(Word::PosStw1, MDI + 4096.0);
    rig.set(Word::MdiTarpos, 3_000.0);
    assert_eq!(rig.for_seconds(2.0) & 0x0400, 0x0400, "without an edge");
    near(rig.told.get(Word::XistA), 3_000.0);
    // Set-up backwards, up to the limit if the limits are on.
    rig.set(Word::PosStw2, 16_384.0);
    rig.set(Word::PosStw1, f64::from(0xD400_u16));
    rig.for_seconds(3.0);
    near(rig.told.get(Word::XistA), -5_000.0);
    assert_eq!(rig.told.bits(Word::PosZsw1), 0xC000);
    assert_eq!(rig.told.bits(Word::PosZsw2) & 0x00C4, 0x0044);
    rig.set(Word::PosStw2, 0.0);
    rig.for_seconds(2.0);
    assert!(rig.told.get(Word::XistA) < -10_000.0);
    // The velocity of the axis is the limit.
    rig.set(Word::MdiVelocity, 60_000.0);
    rig.for_seconds(1.0);
    near(rig.speed(), -600.0);
    assert_eq!(rig.told.bits(Word::PosZsw2) & 0x0022, 0x0022);
}

#[test]
fn jogging_homing_and_setting_the_reference_point() {
    let mut rig = positioner();
    rig.set(Word::PosStw1, 0.0);
    rig.write(0x063F);
    rig.for_seconds(1.0);
    near(rig.speed(), 60.0 * 5.0);
    assert_eq!(rig.told.bits(Word::PosZsw1), 0x0400);
    rig.write(0x053F);
    rig.for_seconds(1.0);
    near(rig.speed(), -60.0 * 5.0);
    rig.write(0x043F);
    rig.for_seconds(1.0);
    near(rig.speed(), 0.0);
    // Incremental: 1000 LU.
    rig.set(Word::PosStw2, 32.0);
    let before = rig.told.get(Word::XistA);
    rig.write(0x063F);
    rig.for_seconds(1.0);
    near(rig.told.get(Word::XistA), before + 1_000.0);
    rig.write(0x043F);
    // Homing.
    assert_eq!(rig.write(0x0C3F) & 0x0800, 0, "not referenced on the way");
    assert_eq!(rig.told.bits(Word::PosZsw1), 0x0800);
    assert_eq!(rig.for_seconds(3.0) & 0x0800, 0x0800);
    near(rig.told.get(Word::XistA), 0.0);
    rig.write(0x063F);
    rig.for_seconds(1.0);
    rig.write(0x043F);
    rig.for_seconds(1.0);
    assert!(rig.told.get(Word::XistA) > 500.0);
    rig.set(Word::PosStw2, 2.0);
    rig.for_seconds(TICK);
    near(rig.told.get(Word::XistA), 0.0);
}

#[test]
fn the_telegrams_have_the_lengths_of_the_profile_in_words() {
    let lengths = Telegram::ALL.map(|telegram| telegram.bytes().map(|bytes| bytes / 2));
    assert_eq!(lengths, [[2, 2], [4, 4], [5, 9], [9, 9], [12, 12]]);
}
