package tickbus.machines.motion;

/**
 * Motion of one drive in legs: in each, the speed is constant, or changes linearly or along an S-curve.
 *
 * <p>The position is computed from the time since the motion began, never accumulated from step to step: the result does not
 * depend on the step size, and the drive ends exactly at its target.
 *
 * <p>Lengths are in any unit, speeds in that unit per second.
 */
public final class Legs {
    private static final double SECONDS = 1e-9;
    /** Braking first, then accelerating, decelerating to the highest speed, constant speed, and braking. */
    private static final int MOST = 5;

    private final double[] duration = new double[MOST];
    private final double[] change = new double[MOST];
    /** How long the acceleration of a leg rises, and falls; 0 if it jumps. */
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
     * @param position the drive's position
     */
    public Legs(double position) {
        this.position = position;
    }

    /**
     * The position of the drive.
     *
     * @return in the drive's unit
     */
    public double position() {
        return position;
    }

    /**
     * The speed of the drive, with its direction as sign.
     *
     * @return units per second
     */
    public double velocity() {
        return velocity;
    }

    /**
     * Returns whether the drive is moving.
     *
     * @return false at rest
     */
    public boolean moving() {
        return moving;
    }

    /**
     * The position after the legs added so far.
     *
     * @return in the drive's unit
     */
    public double plannedPosition() {
        return plannedPosition;
    }

    /**
     * The speed of the drive after the legs added so far.
     *
     * @return units per second
     */
    public double plannedVelocity() {
        return plannedVelocity;
    }

    /**
     * The duration of the legs added so far.
     *
     * @return seconds
     */
    public double plannedTime() {
        return plannedTime;
    }

    /**
     * Shifts the scale of positions; rotating drives use it to stay within one turn.
     *
     * @param by the amount added to every position
     */
    public void shift(double by) {
        position += by;
        startPosition += by;
        plannedPosition += by;
    }

    /** Starts a new motion at the current position and speed; legs must follow, and then one of the two ends. */
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
     * Adds a leg with a linear change of speed, or without a change.
     *
     * @param time the duration in seconds, at least 0
     * @param by the change of speed, in units per second
     */
    public void leg(double time, double by) {
        leg(time, by, 0);
    }

    /**
     * Adds a leg in which the speed changes along an S-curve: the acceleration rises linearly, stays, and falls linearly.
     *
     * @param time the duration in seconds, at least 0
     * @param by the change of speed, in units per second
     * @param ramp how long the acceleration rises, and likewise falls, in seconds, at most half the time
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
     * After the legs the drive stops.
     *
     * @param at the exact position, equal to that of the legs except for rounding
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

    /** After the legs the drive continues at its final speed. */
    public void goesOn() {
        endless = plannedVelocity != 0;
        moving = endless || velocity != 0;
    }

    /** Stops instantly. */
    public void halt() {
        moving = false;
        velocity = 0;
    }

    /**
     * Stops instantly at a given position, where there is an obstacle.
     *
     * @param place the position
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

    /** The change of speed so far in a leg. */
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

    /** The distance covered so far in a leg. */
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
