//! A servo robot with two axes and its PLC: an experiment that measures the benefit of virtual time.
//!
//! The robot moves its tool along a path in the plane of x and z. The PLC closes the position loops, so the path
//! depends on when each side sees what the other has done. The same machine and the same program run
//!
//! * in lock-step, as two [participants](tickbus_virtual_time::Participant) of a common virtual time ([`lock_step`]),
//! * free-wheeling, in a model of a PLC on wall time that is linked to a simulation by OPC ([`free_wheeling`]),
//! * really free-wheeling, on threads that sleep ([`wall_clock`]).
//!
//! [`page`] shows the paths side by side. `docs/virtual-time.md` explains the experiment.
//!
//! [`shear`] is a second one: a shear whose sensors are on for too short a time for a slow link.

#![cfg_attr(
    test,
    allow(clippy::float_cmp, reason = "what is exact is compared exactly")
)]

pub mod controller;
pub mod experiment;
pub mod free_wheeling;
pub mod load;
pub mod lock_step;
pub mod metrics;
pub mod page;
pub mod participants;
pub mod path;
pub mod plant;
pub mod random;
pub mod shear;
pub mod wall_clock;

/// The programs in the guide are compiled with the tests.
#[cfg(doctest)]
#[doc = include_str!("../../../docs/virtual-time.md")]
struct Guide;
