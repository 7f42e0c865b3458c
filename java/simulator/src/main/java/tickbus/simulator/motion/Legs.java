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
    private final boolean[] soft = new boolean[MOST];
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
     * Adds a leg.
     *
     * @param time how long it lasts, in seconds, at least 0
     * @param by how much the speed changes in it, in units per second
     * @param smooth whether the acceleration rises from 0 and falls back to 0 as a parabola, to 1.5 times its mean;
     *     otherwise it is the same all the time. The way is the same
     */
    public void leg(double time, double by, boolean smooth) {
        duration[legs] = time;
        change[legs] = by;
        soft[legs] = smooth;
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
        double part = time / duration[leg];
        double gained;
        double way;
        if (soft[leg]) {
            gained = part * part * (3 - 2 * part);
            way = part * part * part * (1 - part / 2);
        } else {
            gained = part;
            way = part * part / 2;
        }
        position = from + speed * time + change[leg] * way * duration[leg];
        velocity = speed + change[leg] * gained;
    }
}
