package tickbus.simulator.rig;

/**
 * Trapezoidal motion of one drive: constant acceleration, constant speed, constant deceleration.
 *
 * <p>The position is computed from the time since the motion began, never summed up from step to step: however that
 * time was cut into steps, the drive stands at the same place, and at the end exactly on its target.
 */
final class Ramp {
    private static final double SECONDS = 1e-9;
    private static final int LEGS = 4;

    private final double[] duration = new double[LEGS];
    private final double[] acceleration = new double[LEGS];
    private int legs;
    private double startPosition;
    private double startVelocity;
    private double endPosition;
    private double endVelocity;
    private boolean endless;
    private long elapsed;
    private boolean moving;
    private double position;
    private double velocity;

    Ramp(double position) {
        this.position = position;
    }

    double position() {
        return position;
    }

    double velocity() {
        return velocity;
    }

    boolean moving() {
        return moving;
    }

    /** Shifts the scale under a resting or endlessly turning drive; a wheel uses it to stay within one turn. */
    void shift(double by) {
        position += by;
        startPosition += by;
        endPosition += by;
    }

    /**
     * Goes to a target and stops there. A drive under way first brakes to rest.
     *
     * @param target where to stop
     * @param speed greatest speed, above 0
     * @param steepness acceleration and deceleration, above 0
     * @param brake deceleration from the present speed, above 0
     */
    void moveTo(double target, double speed, double steepness, double brake) {
        begin();
        double from = position;
        if (velocity != 0) {
            double time = Math.abs(velocity) / brake;
            leg(time, -Math.signum(velocity) * brake);
            from += velocity * time / 2;
        }
        double distance = Math.abs(target - from);
        double sign = Math.signum(target - from);
        double rise = Math.min(speed / steepness, Math.sqrt(distance / steepness));
        double cruise = Math.max(0, (distance - steepness * rise * rise) / speed);
        leg(rise, sign * steepness);
        leg(cruise, 0);
        leg(rise, -sign * steepness);
        endPosition = target;
        endVelocity = 0;
        endless = false;
        moving = velocity != 0 || distance != 0;
    }

    /**
     * Changes to a speed and keeps it; speed 0 stops.
     *
     * @param speed signed speed to reach
     * @param steepness acceleration or deceleration, above 0
     */
    void runAt(double speed, double steepness) {
        begin();
        double time = Math.abs(speed - velocity) / steepness;
        leg(time, Math.signum(speed - velocity) * steepness);
        endPosition = position + (velocity + speed) / 2 * time;
        endVelocity = speed;
        endless = speed != 0;
        moving = speed != 0 || velocity != 0;
    }

    /** Stands still at once. */
    void halt() {
        moving = false;
        velocity = 0;
    }

    /** Stands still at once at a given place: something is in the way there. */
    void haltAt(double place) {
        halt();
        position = place;
    }

    void advance(long nanos) {
        if (!moving) {
            return;
        }
        elapsed += nanos;
        double time = elapsed * SECONDS;
        double from = startPosition;
        double speed = startVelocity;
        for (int i = 0; i < legs; i++) {
            double spent = Math.min(time, duration[i]);
            position = from + speed * spent + acceleration[i] * spent * spent / 2;
            velocity = speed + acceleration[i] * spent;
            if (time < duration[i]) {
                return;
            }
            from = position;
            speed = velocity;
            time -= duration[i];
        }
        position = endPosition + (endless ? endVelocity * time : 0);
        velocity = endVelocity;
        moving = endless;
    }

    private void begin() {
        startPosition = position;
        startVelocity = velocity;
        elapsed = 0;
        legs = 0;
    }

    private void leg(double time, double steepness) {
        duration[legs] = time;
        acceleration[legs] = steepness;
        legs++;
    }
}
