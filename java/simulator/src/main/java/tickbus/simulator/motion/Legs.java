package tickbus.simulator.motion;

/**
 * Motion of one drive in legs: in each, the speed changes evenly or along an S, or not at all.
 *
 * <p>The position is computed from the time since the motion began, never summed up from step to step: however that
 * time was cut into steps, the drive stands at the same place, and at the end exactly where it was to stop.
 *
 * <p>Lengths are in any unit, speeds in that unit per second.
 */
public final class Legs {
    private static final double SECONDS = 1e-9;
    /** Braking first, then speeding up, slowing to the greatest speed, going on, and braking. */
    private static final int MOST = 5;

    private final double[] duration = new double[MOST];
    private final double[] change = new double[MOST];
    /** How long the acceleration of a leg takes to rise, and to fall; 0 where it jumps. */
    private final double[] rise = new double[MOST];
    private int legs;
    private double startPosition;
    private double startVelocity;
    private double plannedPosition;
    private double plannedVelocity;
    private double plannedTime;
    private boolean endless;
    private long elapsed;
    private boolean moving;
    private double position;
    private double velocity;

    /**
     * A drive at rest.
     *
     * @param position where it stands
     */
    public Legs(double position) {
        this.position = position;
    }

    /**
     * Where the drive is.
     *
     * @return in the drive's unit
     */
    public double position() {
        return position;
    }

    /**
     * How fast it is, with its direction as sign.
     *
     * @return units per second
     */
    public double velocity() {
        return velocity;
    }

    /**
     * Whether a motion is under way.
     *
     * @return false at rest
     */
    public boolean moving() {
        return moving;
    }

    /**
     * Where the legs that were added so far lead to.
     *
     * @return in the drive's unit
     */
    public double plannedPosition() {
        return plannedPosition;
    }

    /**
     * How fast the drive will be at the end of the legs that were added so far.
     *
     * @return units per second
     */
    public double plannedVelocity() {
        return plannedVelocity;
    }

    /**
     * How long the legs that were added so far take.
     *
     * @return seconds
     */
    public double plannedTime() {
        return plannedTime;
    }

    /**
     * Shifts the scale under the drive; what turns uses it to stay within one turn.
     *
     * @param by what is added to every position
     */
    public void shift(double by) {
        position += by;
        startPosition += by;
        plannedPosition += by;
    }

    /** Begins a new motion here and now, at the present speed; legs are to follow, and then one of the two ends. */
    public void begin() {
        startPosition = position;
        startVelocity = velocity;
        plannedPosition = position;
        plannedVelocity = velocity;
        plannedTime = 0;
        elapsed = 0;
        legs = 0;
    }

    /**
     * Adds a leg in which the speed changes evenly, or not at all.
     *
     * @param time how long it lasts, in seconds, at least 0
     * @param by how much the speed changes in it, in units per second
     */
    public void leg(double time, double by) {
        leg(time, by, 0);
    }

    /**
     * Adds a leg in which the speed changes along an S: the acceleration rises evenly, stays, and falls evenly.
     *
     * @param time how long it lasts, in seconds, at least 0
     * @param by how much the speed changes in it, in units per second
     * @param ramp how long the acceleration takes to rise, and likewise to fall, in seconds, at most half the time
     */
    public void leg(double time, double by, double ramp) {
        duration[legs] = time;
        change[legs] = by;
        rise[legs] = ramp;
        legs++;
        plannedPosition += (plannedVelocity + by / 2) * time;
        plannedVelocity += by;
        plannedTime += time;
    }

    /**
     * After the legs the drive stands.
     *
     * @param at exactly where: what the legs lead to, but for rounding
     */
    public void endsAt(double at) {
        plannedPosition = at;
        plannedVelocity = 0;
        endless = false;
        moving = plannedTime > 0;
        if (!moving) {
            position = at;
            velocity = 0;
        }
    }

    /** After the legs the drive goes on at the speed that it has then. */
    public void goesOn() {
        endless = plannedVelocity != 0;
        moving = endless || velocity != 0;
    }

    /** Stands still at once. */
    public void halt() {
        moving = false;
        velocity = 0;
    }

    /**
     * Stands still at once at a given place: something is in the way there.
     *
     * @param place where
     */
    public void haltAt(double place) {
        halt();
        position = place;
    }

    /**
     * Lets time pass.
     *
     * @param nanos nanoseconds, at least 0
     */
    public void advance(long nanos) {
        if (!moving) {
            return;
        }
        elapsed += nanos;
        double time = elapsed * SECONDS;
        double from = startPosition;
        double speed = startVelocity;
        for (int i = 0; i < legs; i++) {
            if (time < duration[i]) {
                within(i, from, speed, time);
                return;
            }
            from += (speed + change[i] / 2) * duration[i];
            speed += change[i];
            time -= duration[i];
        }
        position = plannedPosition + (endless ? plannedVelocity * time : 0);
        velocity = plannedVelocity;
        moving = endless;
    }

    private void within(int leg, double from, double speed, double time) {
        double gained = gained(leg, time);
        position = from + speed * time + way(leg, time);
        velocity = speed + gained;
    }

    /** By how much the speed has changed so far in a leg. */
    private double gained(int leg, double time) {
        double ramp = rise[leg];
        double left = duration[leg] - time;
        double steepest = change[leg] / (duration[leg] - ramp);
        if (time < ramp) {
            return steepest * time * time / ramp / 2;
        }
        if (left < ramp) {
            return change[leg] - steepest * left * left / ramp / 2;
        }
        return steepest * (time - ramp / 2);
    }

    /** How far this change has led so far. */
    private double way(int leg, double time) {
        double ramp = rise[leg];
        double left = duration[leg] - time;
        double steepest = change[leg] / (duration[leg] - ramp);
        if (time < ramp) {
            return steepest * time * time * time / ramp / 6;
        }
        if (left < ramp) {
            return change[leg] * (duration[leg] / 2 - left) + steepest * left * left * left / ramp / 6;
        }
        double steady = time - ramp;
        return steepest * (ramp * ramp / 6 + steady * (ramp + steady) / 2);
    }
}
