package tickbus.simulator.motion;

/**
 * Plans the motion of a drive from a command's speed, acceleration and deceleration: a trapezoid of speed over time,
 * or a triangle where the way is too short to reach the speed.
 *
 * <p>From rest over a way d with speed v, acceleration a and deceleration b that takes v/a + (d − v²/2a − v²/2b)/v + v/b
 * where d is at least v²/2a + v²/2b, else w/a + w/b with the peak w = √(2dab/(a+b)).
 *
 * <p>A smooth drive changes its speed along an S instead of evenly; the acceleration of the command is then the greatest
 * one in the S, so that each change of speed takes 1.5 times as long.
 */
public final class Drive {
    /** Greatest acceleration of an S compared with the even change of speed in the same time. */
    private static final double PEAK = 1.5;

    private final Legs legs;
    private final boolean smooth;

    /**
     * A drive at rest.
     *
     * @param position where it stands
     * @param smooth whether it changes its speed along an S
     */
    public Drive(double position, boolean smooth) {
        this.legs = new Legs(position);
        this.smooth = smooth;
    }

    /**
     * Where the drive is.
     *
     * @return in its unit
     */
    public double position() {
        return legs.position();
    }

    /**
     * How fast it is, with its direction as sign.
     *
     * @return units per second
     */
    public double velocity() {
        return legs.velocity();
    }

    /**
     * Whether a motion is under way.
     *
     * @return false at rest
     */
    public boolean moving() {
        return legs.moving();
    }

    /**
     * How long the present motion takes from its beginning to its end, as planned.
     *
     * @return seconds; for one without end, the time until it has its speed
     */
    public double plannedSeconds() {
        return legs.plannedTime();
    }

    /**
     * Goes to a target and stops there. One that is under way goes on from its present speed if it can, else it brakes
     * first.
     *
     * @param target where to
     * @param speed the greatest speed, above 0
     * @param acceleration above 0
     * @param deceleration above 0
     */
    public void moveTo(double target, double speed, double acceleration, double deceleration) {
        double up = steady(acceleration);
        double down = steady(deceleration);
        legs.begin();
        double now = legs.velocity();
        double way = target - legs.position();
        if (now != 0 && (now * way <= 0 || now * now / (2 * down) > Math.abs(way))) {
            change(-now, down);
        }
        double sign = Math.signum(target - legs.plannedPosition());
        double distance = Math.abs(target - legs.plannedPosition());
        double entry = Math.abs(legs.plannedVelocity());
        if (entry > speed) {
            distance -= (entry * entry - speed * speed) / (2 * down);
            change(-sign * (entry - speed), down);
            entry = speed;
        }
        double peak = Math.sqrt((2 * distance * up * down + entry * entry * down) / (up + down));
        double top = Math.max(entry, Math.min(speed, peak));
        double ramps = (top * top - entry * entry) / (2 * up) + top * top / (2 * down);
        change(sign * (top - entry), up);
        legs.leg(top == 0 ? 0 : Math.max(0, (distance - ramps) / top), 0, false);
        change(-sign * top, down);
        legs.endsAt(target);
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
            change(-legs.velocity(), steady(deceleration));
        }
        double by = velocity - legs.plannedVelocity();
        boolean faster = Math.abs(velocity) > Math.abs(legs.plannedVelocity());
        change(by, steady(faster ? acceleration : deceleration));
        if (velocity == 0) {
            legs.endsAt(legs.plannedPosition());
        } else {
            legs.goesOn();
        }
    }

    /** Stands still at once. */
    public void halt() {
        legs.halt();
    }

    /**
     * Stands still at once at a given place.
     *
     * @param place where
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

    private double steady(double acceleration) {
        return smooth ? acceleration / PEAK : acceleration;
    }

    private void change(double by, double acceleration) {
        legs.leg(Math.abs(by) / acceleration, by, smooth);
    }
}
