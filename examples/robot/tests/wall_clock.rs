//! The robot really free-wheeling, on the wall clock.

use tickbus_base::time::{Monotonic, Nanos};
use tickbus_robot::experiment::LOCK_STEP_ERROR;
use tickbus_robot::metrics::error;
use tickbus_robot::participants::STEPS;
use tickbus_robot::wall_clock;

/// The size of the difference depends on the computer, so nothing more is asserted.
#[test]
fn on_the_wall_clock_the_robot_is_farther_off_than_in_lock_step() {
    let run = wall_clock::run(&*Monotonic::shared(), Nanos::from_millis(50), STEPS);
    assert_eq!(run.len(), STEPS);
    assert!(error(&run) > LOCK_STEP_ERROR);
}
