//! The positions of the bottles, and the accidents that must not happen.
//!
//! Only the pocket of wheel 1 under lift 1 is modelled: each index brings a full one from the infeed.

use super::plant::{BIG, Lift, Wheel};

/// How near a cup must be to a pocket or sleeve, in micrometres.
const REACH: i32 = 1_000;

/// How far wheel 2 reaches below its sleeves.
const CLEARANCE: i32 = 5_000;

/// Height of a bottle: a lift with a bottle on it that is this far below a full sleeve hits the sleeve's
/// bottle.
const BOTTLE: i32 = 60_000;

/// The bottles of the cell.
#[derive(Clone, Debug, Default)]
pub(super) struct Bottles {
    /// The first accident.
    pub(super) broken: Option<&'static str>,
    pocket: bool,
    /// The sleeve over lift 1, and that over lift 2.
    sleeves: [bool; 2],
    cups: [bool; 2],
    vacuum: [bool; 2],
    turning: [bool; 2],
    position: i32,
}

impl Bottles {
    /// Switches the vacuum of both cups; before the machine moves.
    pub(super) fn suck(&mut self, lifts: [&Lift; 2], vacuum: [bool; 2]) {
        for (cup, on) in vacuum.into_iter().enumerate() {
            if self.vacuum[cup] && !on && self.cups[cup] {
                self.cups[cup] = false;
                match self.seat(cup, lifts) {
                    Some(seat) if !*seat => *seat = true,
                    _ => self.fail("a bottle falls"),
                }
            }
        }
        self.vacuum = vacuum;
        self.grip(lifts);
    }

    /// Follows one move of the machine.
    pub(super) fn follow(&mut self, lifts: [&Lift; 2], wheels: [&Wheel; 2]) {
        let turning = wheels.map(Wheel::turning);
        let [low_1, low_2] = lifts.map(|lift| lift.position <= REACH);
        let top = lifts[0].position + if self.cups[0] { BOTTLE } else { 0 };
        if turning[0] && (!low_1 || self.cups[0]) {
            self.fail("wheel 1 turns through lift 1 or its bottle");
        }
        if turning[1] && (!low_2 || self.cups[1] || top > BIG - CLEARANCE) {
            self.fail("wheel 2 turns through a lift or its bottle");
        }
        let [stops_1, stops_2] = [0, 1].map(|wheel| self.turning[wheel] && !turning[wheel]);
        self.pocket |= stops_1;
        if stops_2 {
            self.sleeves.reverse();
        }
        self.turning = turning;
        self.lift_1(lifts[0].position);
        self.grip(lifts);
    }

    /// A cup with vacuum takes the bottle that it is under, unless that is moving.
    fn grip(&mut self, lifts: [&Lift; 2]) {
        for cup in 0..2 {
            if self.vacuum[cup]
                && !self.cups[cup]
                && !self.turning[cup]
                && let Some(seat) = self.seat(cup, lifts)
                && *seat
            {
                *seat = false;
                self.cups[cup] = true;
            }
        }
    }

    /// Checks for collisions of lift 1 on its way.
    fn lift_1(&mut self, position: i32) {
        let before = std::mem::replace(&mut self.position, position);
        let contact = BIG - BOTTLE;
        if before <= contact && position > contact && self.cups[0] && self.sleeves[0] {
            self.fail("lift 1 brings a bottle to a full sleeve");
        }
        if before > BOTTLE && position <= BOTTLE && self.cups[0] && self.pocket {
            self.fail("lift 1 brings a bottle to a full pocket");
        }
        if before <= REACH && position > REACH && !self.cups[0] && self.pocket {
            self.fail("lift 1 pushes a bottle up");
        }
    }

    /// The pocket or sleeve at which a cup is.
    fn seat(&mut self, cup: usize, lifts: [&Lift; 2]) -> Option<&mut bool> {
        let low = lifts[cup].position <= REACH;
        let high = lifts[cup].position >= BIG - REACH;
        match cup {
            0 if low => Some(&mut self.pocket),
            0 if high => Some(&mut self.sleeves[0]),
            1 if low => Some(&mut self.sleeves[1]),
            _ => None,
        }
    }

    fn fail(&mut self, what: &'static str) {
        self.broken.get_or_insert(what);
    }
}
