package tickbus.machines.rig;

import java.util.Locale;

/**
 * A lift with its cup, its beam, and the wheels that its path passes: the bottles and parts that it grips, carries, hits and
 * drops.
 *
 * <p>Faults between a lift and a bottle are detected by comparing the cup's previous and current position, so that none is
 * missed however long the step is.
 */
final class LiftPath {
    private final Lift lift;
    private final LiftDrive drive;
    private final SuctionCup cup;
    private final Beam beam;
    private final Seat lower;
    private final Seat upper;
    private final Faults faults;
    private boolean jamArmed;
    private Bottle stuck;
    private long jams;

    /**
     * A lift's path.
     *
     * @param upper the wheel at the top of the path, or null
     */
    LiftPath(Lift lift, LiftDrive drive, SuctionCup cup, Beam beam, Seat lower, Seat upper, Faults faults) {
        this.lift = lift;
        this.drive = drive;
        this.cup = cup;
        this.beam = beam;
        this.lower = lower;
        this.upper = upper;
        this.faults = faults;
    }

    LiftDrive drive() {
        return drive;
    }

    SuctionCup cup() {
        return cup;
    }

    Beam beam() {
        return beam;
    }

    /** Height of the cup, which is the base of the bottle on it. */
    double cupHeight() {
        return lower.floor() + drive.position();
    }

    /** The wedged bottle, or null. */
    Bottle stuck() {
        return stuck;
    }

    long jams() {
        return jams;
    }

    /** Makes the next bottle that passes the beam stick in it. */
    void jamNext() {
        jamArmed = true;
    }

    /** Lets bottles pass the beam again; returns the bottle that stuck in it, or null. */
    Bottle jamsNoMore() {
        jamArmed = false;
        return stuck == null ? null : takeAway();
    }

    /** The operator takes the bottle off the cup or out of the guide; null if both are empty. */
    Bottle takeAway() {
        if (stuck != null) {
            Bottle bottle = stuck;
            stuck = null;
            drive.unwedge();
            return bottle;
        }
        return cup.letGo();
    }

    /**
     * Switches the vacuum.
     *
     * @return the bottle that fell, or null
     */
    Bottle suction(boolean on) {
        cup.vacuum(on);
        if (on) {
            gripAtRest(lower);
            gripAtRest(upper);
            return null;
        }
        Bottle bottle = cup.letGo();
        if (bottle == null || setDown(bottle, lower) || setDown(bottle, upper)) {
            return null;
        }
        faults.raise(Faults.Kind.FELL, String.format(Locale.ROOT,
                "bottle %d fell: %s let go %.1f mm up, at no free pocket or sleeve",
                bottle.id(), cup.name(), drive.position()));
        return bottle;
    }

    /** Moves the lift, and handles everything on the way. */
    void advance(long nanos) {
        double from = cupHeight();
        drive.advance(nanos);
        double to = cupHeight();
        if (to > from) {
            up(from, to);
        } else if (to < from) {
            down(from, to);
        }
        gripAtRest(lower);
        gripAtRest(upper);
        if (cup.held() != null) {
            cup.held().raise(cupHeight());
        }
    }

    /** Checks the beam. */
    void watch(boolean running, long nanos) {
        beam.look(stuck != null ? stuck : cup.held(), running, nanos);
        if (beam.blockedTooLong()) {
            faults.raise(Faults.Kind.JAM, String.format(Locale.ROOT,
                    "jam: package sensor %d was blocked for more than %.1f s while %s ran",
                    lift.ordinal() + 1, Beam.JAM_NANOS * 1e-9, drive.name()));
        }
    }

    /** True if no part of this lift obstructs the wheel at the bottom of its path. */
    boolean clearOfLower() {
        return drive.position() <= Geometry.REACH && cup.held() == null;
    }

    /** True if no part of this lift obstructs the wheel at the top of its path. */
    boolean clearOfUpper() {
        return upper == null || top(cupHeight()) <= Geometry.CHAMBER_UNDERSIDE;
    }

    /** Raises a fault if a wheel turns through this lift. */
    void checkWheels() {
        if (lower.wheelTurning() && !clearOfLower()) {
            wheelInto(lower);
        }
        if (upper != null && upper.wheelTurning() && !clearOfUpper()) {
            wheelInto(upper);
        }
    }

    private void wheelInto(Seat seat) {
        Bottle held = cup.held();
        if (held != null && near(seat)) {
            faults.raise(Faults.Kind.DOUBLE_GRIP, String.format(Locale.ROOT,
                    "double grip: bottle %d was held by %s and turned by %s", held.id(), cup.name(), seat.wheelName()));
        } else {
            faults.raise(Faults.Kind.COLLISION, String.format(Locale.ROOT,
                    "collision: %s turned while %s stood %.1f mm up in its way",
                    seat.wheelName(), drive.name(), drive.position()));
        }
    }

    private void up(double from, double to) {
        if (jams(from, to)) {
            return;
        }
        if (crossesUp(lower.floor() + Geometry.REACH, from, to) && !lower.aligned()) {
            intoWheel(lower);
        }
        meetBase(lower, from, to);
        if (upper == null) {
            return;
        }
        if (crossesUp(Geometry.CHAMBER_UNDERSIDE, top(from), top(to)) && !upper.aligned()) {
            intoWheel(upper);
        }
        if (cup.held() == null) {
            meetBase(upper, from, to);
        } else if (crossesUp(upper.floor(), top(from), top(to)) && upper.bottle() != null) {
            occupied(upper);
        }
    }

    private void down(double from, double to) {
        if (jams(from, to) || cup.held() == null) {
            return;
        }
        double contact = lower.floor() + Geometry.BOTTLE_HEIGHT;
        if (from > contact && to <= contact) {
            if (!lower.aligned()) {
                intoWheel(lower);
            } else if (lower.bottle() != null) {
                occupied(lower);
            }
        }
    }

    /** The empty cup reaches a bottle from below: with vacuum it grips the bottle, without vacuum it pushes it. */
    private void meetBase(Seat seat, double from, double to) {
        Bottle bottle = seat.bottle();
        if (bottle == null || cup.held() != null) {
            return;
        }
        if (cup.vacuum() && from <= seat.floor() + Geometry.REACH && to >= seat.floor() - Geometry.REACH) {
            cup.grip(seat.take(), to);
        } else if (crossesUp(seat.floor() + Geometry.REACH, from, to)) {
            faults.raise(Faults.Kind.PUSHED, String.format(Locale.ROOT,
                    "collision: %s pushed bottle %d up without vacuum on %s",
                    drive.name(), bottle.id(), cup.name()));
        }
    }

    private void gripAtRest(Seat seat) {
        if (seat != null && cup.canGrip() && near(seat) && !seat.wheelTurning() && seat.bottle() != null) {
            cup.grip(seat.take(), cupHeight());
        }
    }

    private boolean setDown(Bottle bottle, Seat seat) {
        if (seat == null || !near(seat) || !seat.free()) {
            return false;
        }
        seat.hold(bottle);
        return true;
    }

    private boolean near(Seat seat) {
        return Math.abs(cupHeight() - seat.floor()) <= Geometry.REACH;
    }

    private boolean jams(double from, double to) {
        double middle = beam.middle();
        boolean passes = (from < middle && to >= middle) || (from > middle && to <= middle);
        if (!jamArmed || !passes || cup.held() == null) {
            return false;
        }
        jamArmed = false;
        jams++;
        stuck = cup.letGo();
        stuck.put(lift == Lift.LA1 ? Bottle.Place.STUCK1 : Bottle.Place.STUCK2, 0, middle);
        drive.wedge(middle - lower.floor());
        return true;
    }

    private void intoWheel(Seat seat) {
        faults.raise(Faults.Kind.COLLISION, String.format(Locale.ROOT,
                "collision: %s ran into %s, which stood between two index positions", drive.name(), seat.wheelName()));
    }

    private void occupied(Seat seat) {
        faults.raise(Faults.Kind.OCCUPIED, String.format(Locale.ROOT,
                "collision: %s brought bottle %d to %s, where bottle %d already was",
                drive.name(), cup.held().id(), seat.wheelName(), seat.bottle().id()));
    }

    private double top(double cupAt) {
        return cup.held() == null ? cupAt : cupAt + Geometry.BOTTLE_HEIGHT;
    }

    private static boolean crossesUp(double line, double from, double to) {
        return from <= line && to > line;
    }
}
