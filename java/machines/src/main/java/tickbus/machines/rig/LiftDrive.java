package tickbus.machines.rig;

import java.util.Locale;

/**
 * The drive of a lift: a linear motor with taught moves, a bottom switch and two end stops.
 *
 * <p>At power-up and after a fault its position is only valid if it is at the bottom. Otherwise the only permitted
 * move is downwards, which becomes a reference run: slowly down to the mechanical stop, which is position 0.
 *
 * <p>The motor carries the lift by a spindle, and measures its own position. With backlash the lift follows at up to half the
 * backlash on either side: after a reversal it stays where it is until the motor has gone the whole backlash.
 */
final class LiftDrive {
    /** Speed in millimetres per second and acceleration in millimetres per second squared of a move. */
    enum Pace {
        BIG(400, 2000),
        SMALL(80, 320),
        REFERENCE(100, 1000);

        private final double speed;
        private final double steepness;

        Pace(double speed, double steepness) {
            this.speed = speed;
            this.steepness = steepness;
        }
    }

    private static final double BRAKE = 2000;

    private final String name;
    private final Ramp ramp;
    private boolean referenced;
    private boolean referencing;
    private double target;
    private Pace pace = Pace.BIG;
    /** Millimetres of the lift, not of the motor. */
    private double lift;
    private double backlash;
    private double wear;
    private boolean wedged;
    private boolean underWay;

    LiftDrive(String name, double position) {
        this.name = name;
        this.ramp = new Ramp(position);
        this.lift = position;
        this.referenced = atBottom();
    }

    String name() {
        return name;
    }

    /** Millimetres above the bottom. */
    double position() {
        return lift;
    }

    /** The position that the motor measures, in millimetres: that of the lift, but for the backlash. */
    double measured() {
        return ramp.position();
    }

    /** The speed of the motor, in millimetres per second; upwards positive. */
    double velocity() {
        return ramp.velocity();
    }

    /** The play between motor and lift, in millimetres; 0 for none. */
    void backlash(double millimetres) {
        backlash = millimetres;
    }

    /** A worn drive has this part less of the speed and the acceleration of the moves that begin from now on; 0 is a new one. */
    void wear(double part) {
        wear = part;
    }

    boolean atBottom() {
        return Math.abs(position()) <= Geometry.BOTTOM_WINDOW;
    }

    boolean referenced() {
        return referenced;
    }

    /** True while a move or its final ramp is in progress, or a wedged bottle blocks the lift. */
    boolean moving() {
        return underWay;
    }

    /** A big downward move: to the bottom, from any position; without a reference, a reference run. */
    void toBottom() {
        referencing = !referenced;
        go(0, referencing ? Pace.REFERENCE : Pace.BIG);
    }

    /** A move by a distance, which requires a reference and enough room. */
    void by(double distance, Pace newPace, Faults faults) {
        double end = measured() + distance;
        if (!referenced) {
            faults.raise(Faults.Kind.UNREFERENCED, String.format(Locale.ROOT,
                    "%s was told to move %+.0f mm without a reference: move it down to its stop first", name, distance));
        } else if (end < -Geometry.BOTTOM_WINDOW || end > Geometry.STROKE) {
            faults.raise(Faults.Kind.END_STOP, String.format(Locale.ROOT,
                    "%s was told to move %+.0f mm from %.1f mm, past its end stop at %.0f mm",
                    name, distance, measured(), distance < 0 ? 0 : Geometry.STROKE));
        } else {
            go(Math.max(0, end), newPace);
        }
    }

    /**
     * The run command fell: the lift brakes at once. A lift already at the bottom switch sinks the last half millimetre onto
     * its stop, because a control drops the run command as soon as it sees the switch.
     */
    void stop() {
        if (target == 0 && atBottom()) {
            return;
        }
        referencing = false;
        if (wedged) {
            underWay = false;
        } else {
            ramp.runAt(0, BRAKE);
            underWay = ramp.moving();
        }
    }

    /** A fault: stops instantly. */
    void halt() {
        ramp.halt();
        underWay = false;
        referencing = false;
    }

    /** The fault is over; the position is only valid at the bottom. */
    void acknowledge() {
        referenced = atBottom();
    }

    /** A bottle is stuck: the motor runs against it. */
    void wedge(double place) {
        ramp.haltAt(place);
        lift = place;
        wedged = true;
    }

    /** The stuck bottle is gone: a move that is still commanded continues. */
    void unwedge() {
        wedged = false;
        if (underWay) {
            go(target, pace);
        }
    }

    void advance(long nanos) {
        if (wedged || !underWay) {
            return;
        }
        ramp.advance(nanos);
        lift = Math.max(measured() - backlash / 2, Math.min(measured() + backlash / 2, lift));
        if (!ramp.moving()) {
            underWay = false;
            referenced |= referencing;
            referencing = false;
        }
    }

    private void go(double newTarget, Pace newPace) {
        target = newTarget;
        pace = newPace;
        if (wedged) {
            underWay = true;
            return;
        }
        ramp.moveTo(target, pace.speed * (1 - wear), pace.steepness * (1 - wear), BRAKE);
        underWay = ramp.moving();
        if (!underWay) {
            referenced |= referencing;
            referencing = false;
        }
    }
}
