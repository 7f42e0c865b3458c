//! A small peeling line: ideal drives, and blocks that stay in place. Panics when a block falls, or on a collision.

use std::f64::consts::{SQRT_2, TAU};

use tickbus::axis::{Demand, Drive, Feedback, Field};
use tickbus::driver_cfg::Config;
use tickbus::signal::Slot;

const TICK: f64 = 0.01;
/// Half the length of a block: the position of everything that holds a block at its ends.
const HALF: f64 = 650.0;
const CORE: f64 = 41.0;

/// A block, by the radius of its two ends.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Block {
    ends: [f64; 2],
}

impl Block {
    fn radius(self) -> f64 {
        self.ends[0].max(self.ends[1])
    }
}

/// The axes of one PLC.
#[derive(Debug)]
pub(crate) struct Side {
    pub(crate) drives: Vec<Drive>,
    told: Vec<Feedback>,
}

/// The signals other than axes, by their indices in the two tables.
#[derive(Debug)]
struct Places {
    blocks: [usize; 8],
    distances: [usize; 2],
    time: usize,
    /// The source and the destination side, and the indices on both sides.
    wires: [(usize, usize, [usize; 2]); 4],
}

impl Places {
    fn new(configs: [&Config; 2]) -> Self {
        let place = |side: usize, name: &str| {
            let table = &configs[side].table;
            table.position(name).unwrap_or_else(|| panic!("{name}"))
        };
        let wire =
            |from: usize, to: usize, name: &str| (from, to, [place(from, name), place(to, name)]);
        Self {
            blocks: std::array::from_fn(|n| place(0, &format!("block at feeder step {}", n + 1))),
            distances: std::array::from_fn(|n| {
                place(0, &format!("pre-centring distance {}", n + 1))
            }),
            time: place(0, "simulation time"),
            wires: [
                wire(0, 1, "block presented"),
                wire(0, 1, "transfer clear"),
                wire(1, 0, "lathe ready"),
                wire(1, 0, "lathe holds block"),
            ],
        }
    }
}

#[derive(Debug)]
#[expect(clippy::struct_excessive_bools, reason = "each is a fact of its own")]
pub(crate) struct Plant {
    pub(crate) sides: [Side; 2],
    places: Places,
    time: f64,
    made: u32,
    gate_used: bool,
    was_up: bool,
    steps: [Option<Block>; 4],
    on_feeder: Option<Block>,
    in_spindles: Option<Block>,
    in_clamps: Option<Block>,
    /// Between the spindles of the lathe.
    pub(crate) held: Option<Block>,
    /// The clamps and the centring spindles hold the same block.
    grabbed: bool,
    /// The clamps and the lathe hold the same block.
    shared: bool,
    pub(crate) cores: u32,
    /// Veneer, in mm.
    pub(crate) veneer: f64,
}

/// The positions of the axes when the machine is switched on.
const BEGINNINGS: [&[f64]; 2] = [
    &[
        30.0, 500.0, 690.0, 700.0, 280.0, 10.0, 300.0, 0.0, 850.0, 800.0, 800.0, 0.0,
    ],
    &[
        800.0, 790.0, 0.0, 280.0, 0.0, 10.0, 300.0, 300.0, 300.0, 0.0, 0.0, 0.0, 50.0,
    ],
];

impl Plant {
    pub(crate) fn new(configs: [&Config; 2]) -> Self {
        let mut number = 0;
        let sides = configs.map(|config| {
            let begins = BEGINNINGS[number];
            number += 1;
            let drives = config.axes.iter().zip(begins);
            let drives: Vec<Drive> = drives
                .map(|(axis, position)| Drive::new(axis.kind, *position, axis.limits))
                .collect();
            Side {
                told: vec![Feedback::default(); drives.len()],
                drives,
            }
        });
        Self {
            sides,
            places: Places::new(configs),
            time: 0.0,
            made: 0,
            gate_used: false,
            was_up: false,
            steps: [None; 4],
            on_feeder: None,
            in_spindles: None,
            in_clamps: None,
            held: None,
            grabbed: false,
            shared: false,
            cores: 0,
            veneer: 0.0,
        }
    }

    /// True if charger and lathe hold the same block.
    pub(crate) fn is_shared(&self) -> bool {
        self.shared
    }

    fn at(&self, side: usize, axis: usize) -> f64 {
        self.sides[side].told[axis].position
    }

    fn near(&self, axis: usize, position: f64) -> bool {
        (self.at(0, axis) - position).abs() < 1.0
    }

    /// One tick: moves the axes as commanded in the slots, moves the blocks with them, and fills the slots
    /// with the sensors' values.
    pub(crate) fn step(&mut self, mut slots: [&mut [Slot]; 2], configs: [&Config; 2]) {
        self.time += TICK;
        for side in 0..2 {
            for (number, axis) in configs[side].axes.iter().enumerate() {
                let demand = axis.demand(slots[side]);
                let (follows, stop) = self.surroundings(side, number, &demand);
                let drive = &mut self.sides[side].drives[number];
                let mut told = drive.step(TICK, &demand, follows, stop);
                if side == 0 && (number == 2 || number == 3) {
                    // The tips press against the block, and stop there.
                    told.position = told.position.max(stop);
                }
                self.sides[side].told[number] = told;
            }
        }
        self.charge();
        self.hand_over();
        self.peel(configs[1], slots[1]);
        for side in 0..2 {
            self.tell(configs[side], slots[side], side);
        }
        self.wires(&mut slots);
    }

    /// The position that an axis follows, and the one that stops it from closing.
    fn surroundings(&self, side: usize, axis: usize, demand: &Demand) -> (f64, f64) {
        let knife = self.at(1, 3);
        let offset = demand.motion.position;
        let turns = self.sides[1].told[2].speed * TICK;
        let follows = match (side, axis) {
            (1, 3) => knife - demand.motion.torque * turns,
            (1, 4) => offset,
            (1, 6..=8) => knife + offset,
            _ => self.at(side, axis),
        };
        let lies = self.near(1, 0.0) && self.on_feeder.is_some();
        let raised = self.in_spindles.is_some();
        let there = match (side, axis) {
            (0, 2 | 3) => (lies || raised) && self.at(0, 5) > 100.0,
            (0, 9 | 10) => raised || self.in_clamps.is_some(),
            (1, 0 | 1) => self.held.is_some() || (self.in_clamps.is_some() && self.near(8, 0.0)),
            _ => false,
        };
        (follows, if there { HALF } else { 0.0 })
    }

    /// Steps, linear feeder and centring.
    fn charge(&mut self) {
        let open = self.at(0, 11) > 50.0;
        if open && !self.gate_used && self.steps[0].is_none() {
            self.made += 1;
            let radius = 130.0 + f64::from(self.made * 7 % 20);
            self.steps[0] = Some(Block {
                ends: [radius, radius - f64::from(self.made % 3) * 4.0],
            });
            self.gate_used = true;
        }
        self.gate_used &= open;
        let up = self.at(0, 0) > 399.0;
        if up && !self.was_up {
            if let Some(block) = self.steps[3].take() {
                assert!(
                    self.on_feeder.is_none() && self.near(1, 650.0),
                    "onto what? {self:#?}"
                );
                self.on_feeder = Some(block);
            }
            self.steps.rotate_right(1);
        }
        self.was_up = up;
        let tips = [self.at(0, 2), self.at(0, 3)];
        if let Some(block) = self.on_feeder
            && self.near(1, 0.0)
            && tips.iter().all(|tip| *tip <= HALF)
        {
            for (radius, axis) in block.ends.into_iter().zip([5, 7]) {
                let off = self.at(0, axis) - SQRT_2 * radius;
                assert!(off.abs() < 1.0, "gripped {off} mm off its axis");
                assert!(self.near(axis - 1, 300.0), "gripped beside the feeder");
            }
            self.in_spindles = self.on_feeder.take();
        }
        if self.in_spindles.is_some() && tips.iter().any(|tip| *tip > HALF + 10.0) {
            assert!(self.grabbed, "the block falls from the spindles");
            self.in_spindles = None;
            self.grabbed = false;
        }
    }

    /// Transfer arm and the lathe's spindles.
    fn hand_over(&mut self) {
        let clamps = [self.at(0, 9), self.at(0, 10)];
        let closed = clamps.iter().all(|clamp| *clamp <= HALF);
        if self.in_spindles.is_some() && self.in_clamps.is_none() && closed {
            for (axis, position) in [(4, 0.0), (6, 0.0), (5, 280.0), (7, 280.0), (8, 900.0)] {
                assert!(
                    self.near(axis, position),
                    "clamped in the wrong place: {self:#?}"
                );
            }
            self.in_clamps = self.in_spindles;
            self.grabbed = true;
        }
        let brought = self.in_spindles.is_some() && self.at(0, 4) < 100.0;
        assert!(
            !brought || self.grabbed || self.in_clamps.is_none(),
            "one block runs into another: {self:#?}"
        );
        let spindles = [self.at(1, 0), self.at(1, 1)];
        if let Some(block) = self.in_clamps {
            if self.near(8, 0.0) && spindles.iter().all(|tip| *tip <= HALF) && self.held.is_none() {
                assert!(self.at(1, 3) > block.radius(), "the knife is in the way");
                self.held = Some(block);
                self.shared = true;
            }
            if clamps.iter().any(|clamp| *clamp > HALF + 10.0) {
                assert!(
                    self.shared && self.near(8, 0.0),
                    "the block falls from the clamps: {self:#?}"
                );
                self.in_clamps = None;
                self.shared = false;
            }
            assert!(
                !self.shared || self.near(8, 0.0),
                "two who hold a block go different ways"
            );
        }
    }

    fn peel(&mut self, config: &Config, slots: &[Slot]) {
        let turns = self.sides[1].told[2].speed * TICK;
        let knife = self.at(1, 3);
        let Some(block) = &mut self.held else {
            return;
        };
        let radius = block.ends[0].max(block.ends[1]);
        if knife < radius {
            assert!(turns > 0.0, "the knife runs into a block that stands");
            assert!(radius - knife < 1.0, "the knife runs into the block");
            assert!(!self.shared, "the charger still holds the block");
            block.ends = block.ends.map(|end| end.min(knife));
            let gate = config.axes[10]
                .slot(Field::ActualPosition)
                .expect("it has one");
            if slots[gate].real() > 50.0 {
                self.veneer += turns * TAU * knife;
            }
        }
        let spindles = [self.at(1, 0), self.at(1, 1)];
        if spindles.iter().any(|tip| *tip > HALF + 10.0) {
            let block = self.held.take().expect("it is there");
            if std::mem::take(&mut self.shared) {
                // The clamps still hold the block.
                return;
            }
            assert!(
                self.at(1, 12) > 90.0,
                "the core falls onto a closed core drop"
            );
            assert!(turns.abs() < 1e-6, "the core is thrown");
            // A block abandoned half-way is also dropped with the cores.
            assert!(block.radius() < CORE || self.sides[1].told[3].position > 100.0);
            self.cores += 1;
        }
    }

    fn tell(&self, config: &Config, slots: &mut [Slot], side: usize) {
        let level = |on: bool| Slot::from_real(f64::from(u8::from(on)));
        for (axis, told) in config.axes.iter().zip(&self.sides[side].told) {
            axis.tell(told, slots);
        }
        if side == 1 {
            return;
        }
        let blocks = [
            self.steps[0].is_some(),
            self.steps[1].is_some(),
            self.steps[2].is_some(),
            self.steps[3].is_some(),
            self.on_feeder.is_some(),
            self.in_spindles.is_some(),
            self.in_clamps.is_some(),
            true,
        ];
        for (place, on) in self.places.blocks.into_iter().zip(blocks) {
            slots[place] = level(on);
        }
        let lies = self.on_feeder.filter(|_| self.near(1, 0.0));
        for (end, place) in self.places.distances.into_iter().enumerate() {
            let top = lies.map_or(0.0, |block| (1.0 + SQRT_2) * block.ends[end]);
            slots[place] = Slot::from_real(800.0 - top);
        }
        slots[self.places.time] = Slot::from_real(self.time);
    }

    /// The wires from one PLC to the other.
    fn wires(&self, slots: &mut [&mut [Slot]; 2]) {
        for (from, to, [source, target]) in self.places.wires {
            slots[to][target] = slots[from][source];
        }
    }
}
