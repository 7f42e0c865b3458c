package tickbus.machines.rig;

import tickbus.machines.motion.Legs;

/** Trapezoidal motion of one drive: constant acceleration, constant speed, constant deceleration. */
final class Ramp {
    private final Legs legs;

    Ramp(double position) {
        legs = new Legs(position);
    }

    double position() {
        return legs.position();
    }

    double velocity() {
        return legs.velocity();
    }

    boolean moving() {
        return legs.moving();
    }

    /** Shifts the scale of a resting or endlessly turning drive; a wheel uses this to stay within one turn. */
    void shift(double by) {
        legs.shift(by);
    }

    /**
     * Moves to a target and stops there. A moving drive first brakes to rest.
     *
     * @param target where to stop
     * @param speed greatest speed, above 0
     * @param steepness acceleration and deceleration, above 0
     * @param brake deceleration from the current speed, above 0
     */
    void moveTo(double target, double speed, double steepness, double brake) {
        legs.begin();
        legs.leg(Math.abs(legs.velocity()) / brake, -legs.velocity());
        double distance = Math.abs(target - legs.plannedPosition());
        double sign = Math.signum(target - legs.plannedPosition());
        double rise = Math.min(speed / steepness, Math.sqrt(distance / steepness));
        double cruise = Math.max(0, (distance - steepness * rise * rise) / speed);
        legs.leg(rise, sign * steepness * rise);
        legs.leg(cruise, 0);
        legs.leg(rise, -sign * steepness * rise);
        legs.endsAt(target);
    }

    /**
     * Changes to a speed and keeps it; speed 0 stops.
     *
     * @param speed signed speed to reach
     * @param steepness acceleration or deceleration, above 0
     */
    void runAt(double speed, double steepness) {
        legs.begin();
        double change = speed - legs.velocity();
        legs.leg(Math.abs(change) / steepness, change);
        if (speed == 0) {
            legs.endsAt(legs.plannedPosition());
        } else {
            legs.goesOn();
        }
    }

    /** Stops instantly. */
    void halt() {
        legs.halt();
    }

    /** Stops instantly at a given position, where there is an obstacle. */
    void haltAt(double place) {
        legs.haltAt(place);
    }

    void advance(long nanos) {
        legs.advance(nanos);
    }
}
