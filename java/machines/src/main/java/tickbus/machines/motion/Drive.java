package tickbus.machines.motion;

/**
 * Plans the motion of a drive from a command's speed, acceleration and deceleration: the speed over time is a
 * trapezoid, or a triangle if the distance is too short to reach the speed.
 *
 * <p>From rest, a distance d with speed v, acceleration a and deceleration b takes v/a + (d − v²/2a − v²/2b)/v + v/b
 * if d is at least v²/2a + v²/2b, else w/a + w/b with the peak w = √(2dab/(a+b)).
 *
 * <p>With a jerk above 0 each change of speed is an S-curve: the acceleration rises and falls at that rate. The change takes
 * longer, by acceleration / jerk if the acceleration is reached.
 */
public final class Drive {
    /** Bisection steps in the search for the peak of a short S-curve; more would change nothing. */
    private static final int HALVINGS = 60;

    private final Legs legs;
    /** Of the current motion; 0 for none. */
    private double jerk;

    /**
     * A drive at rest.
     *
     * @param position the drive's position
     */
    public Drive(double position) {
        this.legs = new Legs(position);
    }

    /**
     * The position of the drive.
     *
     * @return in the drive's unit
     */
    public double position() {
        return legs.position();
    }

    /**
     * The speed of the drive, with its direction as sign.
     *
     * @return units per second
     */
    public double velocity() {
        return legs.velocity();
    }

    /**
     * Returns whether the drive is moving.
     *
     * @return false at rest
     */
    public boolean moving() {
        return legs.moving();
    }

    /**
     * The planned duration of the current motion, from beginning to end.
     *
     * @return seconds; for an endless motion, the time until it reaches its speed
     */
    public double plannedSeconds() {
        return legs.plannedTime();
    }

    /**
     * Sets the rate of change of the acceleration for the motions that start from now on.
     *
     * @param rate units per second cubed; with 0 or less the acceleration jumps
     */
    public void jerk(double rate) {
        jerk = Math.max(0, rate);
    }

    /**
     * Moves to a target and stops there. A moving drive continues from its current speed if it can, otherwise it brakes
     * first.
     *
     * @param target the position
     * @param speed the greatest speed, above 0
     * @param acceleration above 0
     * @param deceleration above 0
     */
    public void moveTo(double target, double speed, double acceleration, double deceleration) {
        legs.begin();
        double now = legs.velocity();
        double way = target - legs.position();
        if (now != 0 && (now * way <= 0 || Math.abs(now) / 2 * time(now, deceleration) > Math.abs(way))) {
            change(-now, deceleration);
        }
        double sign = Math.signum(target - legs.plannedPosition());
        double entry = Math.abs(legs.plannedVelocity());
        if (entry > speed) {
            change(-sign * (entry - speed), deceleration);
            entry = speed;
        }
        double distance = Math.abs(target - legs.plannedPosition());
        double top = top(distance, entry, speed, acceleration, deceleration);
        change(sign * (top - entry), acceleration);
        double ramps = ramps(entry, top, acceleration, deceleration);
        legs.leg(top == 0 ? 0 : Math.max(0, (distance - ramps) / top), 0);
        change(-sign * top, deceleration);
        legs.endsAt(target);
    }

    /** The highest speed that a distance permits. */
    private double top(double distance, double entry, double speed, double acceleration, double deceleration) {
        if (jerk == 0) {
            double peak = Math.sqrt((2 * distance * acceleration * deceleration + entry * entry * deceleration)
                    / (acceleration + deceleration));
            return Math.max(entry, Math.min(speed, peak));
        }
        if (ramps(entry, speed, acceleration, deceleration) <= distance) {
            return speed;
        }
        double low = entry;
        double high = speed;
        for (int i = 0; i < HALVINGS; i++) {
            double middle = (low + high) / 2;
            if (ramps(entry, middle, acceleration, deceleration) <= distance) {
                low = middle;
            } else {
                high = middle;
            }
        }
        return low;
    }

    /** The distance from one speed to a higher one, and from that to rest. */
    private double ramps(double entry, double top, double acceleration, double deceleration) {
        return (entry + top) / 2 * time(top - entry, acceleration) + top / 2 * time(top, deceleration);
    }

    /**
     * Changes to a speed and keeps it.
     *
     * @param velocity the speed, with its direction as sign; 0 stops
     * @param acceleration above 0
     * @param deceleration above 0
     */
    public void runAt(double velocity, double acceleration, double deceleration) {
        legs.begin();
        if (legs.velocity() * velocity < 0) {
            change(-legs.velocity(), deceleration);
        }
        double by = velocity - legs.plannedVelocity();
        boolean faster = Math.abs(velocity) > Math.abs(legs.plannedVelocity());
        change(by, faster ? acceleration : deceleration);
        if (velocity == 0) {
            legs.endsAt(legs.plannedPosition());
        } else {
            legs.goesOn();
        }
    }

    /** Stops instantly. */
    public void halt() {
        legs.halt();
    }

    /**
     * Stops instantly at a given position.
     *
     * @param place the position
     */
    public void haltAt(double place) {
        legs.haltAt(place);
    }

    /**
     * Lets time pass.
     *
     * @param nanos nanoseconds, at least 0
     */
    public void advance(long nanos) {
        legs.advance(nanos);
    }

    /** How long a change of speed takes. */
    private double time(double by, double acceleration) {
        double change = Math.abs(by);
        if (jerk == 0) {
            return change / acceleration;
        }
        double ramp = acceleration / jerk;
        return change >= acceleration * ramp ? change / acceleration + ramp : 2 * Math.sqrt(change / jerk);
    }

    private void change(double by, double acceleration) {
        double time = time(by, acceleration);
        legs.leg(time, by, jerk == 0 ? 0 : Math.min(time / 2, acceleration / jerk));
    }
}
