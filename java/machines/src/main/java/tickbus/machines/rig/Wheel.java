package tickbus.machines.rig;

/**
 * The drive of an index wheel.
 *
 * <p>A rising index command turns the wheel to the next index position. While it jogs, it turns slowly. At rest inside the
 * homing window but off the index position, it creeps onto the drive's index pulse, so that jogging ends exactly.
 */
final class Wheel {
    private static final double TURN = 360.0;
    private static final double JOG_SPEED = 45.0;
    private static final double JOG_STEEPNESS = 240.0;
    private static final double CREEP_SPEED = 10.0;
    private static final double CREEP_STEEPNESS = 100.0;

    private enum State {
        REST,
        INDEXING,
        JOGGING,
        STOPPING,
        CAPTURING
    }

    private final double pitch;
    private final double speed;
    private final double steepness;
    private final Ramp ramp;
    private State state = State.REST;
    private double wear;
    private boolean pending;
    private boolean jogArmed;
    private long retriggers;

    /**
     * A wheel at rest.
     *
     * @param pitch degrees between index positions
     * @param speed degrees per second while indexing
     * @param steepness degrees per second squared while indexing
     * @param angle the wheel's position
     */
    Wheel(double pitch, double speed, double steepness, double angle) {
        this.pitch = pitch;
        this.speed = speed;
        this.steepness = steepness;
        this.ramp = new Ramp(angle);
        wrap();
    }

    /** A worn drive has this part less of the speed and the acceleration of the turns that begin from now on; 0 is a new one. */
    void wear(double part) {
        wear = part;
    }

    double angle() {
        return ramp.position();
    }

    /** Degrees per second. */
    double velocity() {
        return ramp.velocity();
    }

    boolean moving() {
        return state != State.REST || pending;
    }

    boolean turning() {
        return state != State.REST;
    }

    boolean aligned() {
        return Math.abs(offset()) <= Geometry.ALIGNED;
    }

    boolean inHomingWindow() {
        return Math.abs(offset()) <= Geometry.HOMING_WINDOW;
    }

    long retriggers() {
        return retriggers;
    }

    /** Applies the control's commands of this step. */
    void command(boolean indexRising, boolean jogRising, boolean jogHigh) {
        if (indexRising) {
            index();
        }
        jogArmed = jogHigh && (jogArmed || jogRising);
        if (jogArmed && !pending && state != State.INDEXING && state != State.JOGGING) {
            state = State.JOGGING;
            ramp.runAt(JOG_SPEED, JOG_STEEPNESS);
        } else if (!jogArmed && state == State.JOGGING) {
            state = State.STOPPING;
            ramp.runAt(0, JOG_STEEPNESS);
        }
    }

    /** Stops instantly and discards all commands. */
    void halt() {
        ramp.halt();
        state = State.REST;
        pending = false;
        jogArmed = false;
    }

    /**
     * Turns for a time.
     *
     * @param nanos the time
     * @param free true if nothing obstructs the wheel, so that it can creep to the index position
     */
    void advance(long nanos, boolean free) {
        ramp.advance(nanos);
        wrap();
        if (!ramp.moving()) {
            state = State.REST;
            if (free && nearPulse()) {
                state = State.CAPTURING;
                ramp.moveTo(angle() - offset(), CREEP_SPEED, CREEP_STEEPNESS, CREEP_STEEPNESS);
            } else if (pending) {
                startIndex();
            }
        }
    }

    private void index() {
        boolean settling = state == State.STOPPING || state == State.CAPTURING || (state == State.REST && nearPulse());
        if (pending) {
            retriggers++;
        } else if (state == State.REST && !settling) {
            startIndex();
        } else if (settling) {
            // Creeping is not the control's motion: a command that arrives meanwhile is executed afterwards.
            pending = true;
        } else {
            retriggers++;
        }
    }

    private void startIndex() {
        pending = false;
        state = State.INDEXING;
        double target = (Math.floor(angle() / pitch) + 1) * pitch;
        ramp.moveTo(target, speed * (1 - wear), steepness * (1 - wear), steepness);
    }

    private boolean nearPulse() {
        return offset() != 0 && inHomingWindow();
    }

    /** Signed distance from the nearest index position. */
    private double offset() {
        return angle() - Math.rint(angle() / pitch) * pitch;
    }

    private void wrap() {
        if (angle() >= TURN) {
            ramp.shift(-TURN);
        } else if (angle() < 0) {
            ramp.shift(TURN);
        }
    }
}
