package tickbus.machines.rig;

import tickbus.simulator.ModelFaults;

/**
 * The rig's mechanics: two wheels, two lifts and the bottles between them, moved by the control's commands.
 *
 * <p>{@link Rig} puts the panel, the step bits and the variables around it.
 */
final class Cell {
    /** The longest motion between two collision checks. */
    private static final long SLICE_NANOS = 10_000_000L;

    /** The most play that the spindle of a lift can have, in millimetres. */
    private static final double MOST_BACKLASH = 20;

    /** The most that wear can take of a drive's speed and acceleration. */
    private static final double MOST_WEAR = 0.9;

    private final Faults faults = new Faults();
    private final Wheel wheel1;
    private final Wheel wheel2;
    private final Slots pockets;
    private final Slots sleeves;
    private final Conveyor conveyor;
    private final LiftPath path1;
    private final LiftPath path2;
    private boolean run1;
    private boolean run2;
    private boolean leak1;
    private boolean leak2;
    private boolean dark;
    private long treated;
    private long removed;
    private long fallen;

    Cell(double wheel1Degrees, double wheel2Degrees, double lift1Millimetres, double lift2Millimetres) {
        wheel1 = new Wheel(90, 180, 600, range("wheel1Degrees", wheel1Degrees, 360));
        wheel2 = new Wheel(180, 300, 1000, range("wheel2Degrees", wheel2Degrees, 360));
        pockets = new Slots("index wheel 1", wheel1, Bottle.Place.POCKET, 4, Geometry.POCKET_FLOOR);
        sleeves = new Slots("the chamber wheel", wheel2, Bottle.Place.SLEEVE, 2, Geometry.SLEEVE_FLOOR);
        conveyor = new Conveyor(pockets);
        path1 = new LiftPath(
                Lift.LA1,
                new LiftDrive("lift 1", range("lift1Millimetres", lift1Millimetres, Geometry.STROKE)),
                new SuctionCup("SC1", Bottle.Place.CUP1),
                new Beam(Geometry.BEAM1),
                new Seat(pockets, Geometry.LIFT_STATION),
                new Seat(sleeves, Geometry.OVER_LIFT1),
                faults);
        path2 = new LiftPath(
                Lift.LA2,
                new LiftDrive("lift 2", range("lift2Millimetres", lift2Millimetres, Geometry.STROKE)),
                new SuctionCup("SC2", Bottle.Place.CUP2),
                new Beam(Geometry.BEAM2),
                new Seat(sleeves, Geometry.OVER_LIFT2),
                null,
                faults);
    }

    /** Applies the commands of this step and moves. */
    void step(Inputs in, long nanos) {
        if (in.rising(Inputs.ACKNOWLEDGE)) {
            acknowledge();
        }
        suction(path1, in.high(Inputs.SC1) && !leak1);
        suction(path2, in.high(Inputs.SC2) && !leak2);
        if (!faults.latched()) {
            command(in);
        }
        long left = nanos;
        while (left > 0) {
            long slice = Math.min(left, SLICE_NANOS);
            move(in, slice);
            left -= slice;
        }
        if (faults.latched()) {
            halt();
        }
    }

    /** The operator removes every bottle on a lift's path or in a sleeve. */
    void clear() {
        remove(path1.takeAway());
        remove(path2.takeAway());
        for (int i = 0; i < sleeves.count(); i++) {
            remove(sleeves.take(i));
        }
    }

    boolean jammed() {
        return path1.stuck() != null || path2.stuck() != null;
    }

    boolean moving() {
        return wheel1.moving() || wheel2.moving() || path1.drive().moving() || path2.drive().moving();
    }

    /** True if a run bit is on without effect, because a fault came after it rose. */
    boolean ignores(Inputs in) {
        return in.high(Inputs.LA1_RUN) && !run1 || in.high(Inputs.LA2_RUN) && !run2;
    }

    Faults faults() {
        return faults;
    }

    Conveyor conveyor() {
        return conveyor;
    }

    LiftPath path(Lift lift) {
        return lift == Lift.LA1 ? path1 : path2;
    }

    Wheel wheel(int number) {
        return number == 1 ? wheel1 : wheel2;
    }

    long treated() {
        return treated;
    }

    long removed() {
        return removed;
    }

    long fallen() {
        return fallen;
    }

    private void acknowledge() {
        if (faults.latched() && !jammed()) {
            faults.acknowledge();
            path1.drive().acknowledge();
            path2.drive().acknowledge();
        }
    }

    /** The faults that the cell can have, by name. */
    void declare(ModelFaults list) {
        declare(list, path1, leak -> leak1 = leak);
        declare(list, path2, leak -> leak2 = leak);
        declare(list, "index wheel 1", wheel1);
        declare(list, "chamber wheel", wheel2);
        list.add("infeed empty", "no new bottle comes to index wheel 1", conveyor::dry);
        list.add("lamp burnt out", "bottles at the lamp are not treated", on -> dark = on);
    }

    private void declare(ModelFaults list, LiftPath path, ModelFaults.Switch leak) {
        LiftDrive drive = path.drive();
        list.add("jam at " + drive.name(), "the next bottle that the lift carries through its beam sticks there",
                on -> {
                    if (on) {
                        path.jamNext();
                    } else {
                        remove(path.jamsNoMore());
                    }
                });
        list.add("leak at " + drive.name(), "the suction cup has no vacuum, and its bottle falls", leak);
        list.add("backlash of " + drive.name(), MOST_BACKLASH, "mm",
                "play between motor and lift, which follows half of it late in either direction", drive::backlash);
        list.add("wear of " + drive.name(), MOST_WEAR, "",
                "the next moves have this part less of their speed and acceleration", drive::wear);
    }

    private static void declare(ModelFaults list, String name, Wheel wheel) {
        list.add("wear of " + name, MOST_WEAR, "",
                "the next turns have this part less of their speed and acceleration", wheel::wear);
    }

    private void suction(LiftPath path, boolean on) {
        if (on == path.cup().vacuum()) {
            return;
        }
        Bottle onCup = path.cup().held();
        Bottle fell = path.suction(on);
        if (fell != null) {
            fallen++;
            conveyor.away(fell);
        } else if (onCup != null && onCup.place() == Bottle.Place.POCKET && onCup.comesBack()) {
            treated++;
        }
    }

    private void command(Inputs in) {
        wheel1.command(in.rising(Inputs.IM1_INDEX), in.rising(Inputs.IM1_JOG), in.high(Inputs.IM1_JOG));
        wheel2.command(in.rising(Inputs.IM2_INDEX), in.rising(Inputs.IM2_JOG), in.high(Inputs.IM2_JOG));
        run1 = in.high(Inputs.LA1_RUN) && (run1 || in.rising(Inputs.LA1_RUN));
        run2 = in.high(Inputs.LA2_RUN) && (run2 || in.rising(Inputs.LA2_RUN));
        boolean otherCode = in.changed(Inputs.LA1_CODE_LOW) || in.changed(Inputs.LA1_CODE_HIGH);
        if (in.falling(Inputs.LA1_RUN)) {
            path1.drive().stop();
        } else if (run1 && (in.rising(Inputs.LA1_RUN) || otherCode)) {
            moveLift1(in);
        }
        if (in.falling(Inputs.LA2_RUN)) {
            path2.drive().stop();
        } else if (run2 && (in.rising(Inputs.LA2_RUN) || in.changed(Inputs.LA2_UP))) {
            moveLift2(in);
        }
    }

    private void moveLift1(Inputs in) {
        int code = (in.high(Inputs.LA1_CODE_HIGH) ? 2 : 0) + (in.high(Inputs.LA1_CODE_LOW) ? 1 : 0);
        switch (code) {
            case 0 -> path1.drive().by(Geometry.BIG, LiftDrive.Pace.BIG, faults);
            case 1 -> path1.drive().by(-Geometry.SMALL, LiftDrive.Pace.SMALL, faults);
            case 2 -> path1.drive().by(Geometry.SMALL, LiftDrive.Pace.SMALL, faults);
            default -> path1.drive().toBottom();
        }
    }

    private void moveLift2(Inputs in) {
        if (in.high(Inputs.LA2_UP)) {
            path2.drive().by(Geometry.BIG, LiftDrive.Pace.BIG, faults);
        } else {
            path2.drive().toBottom();
        }
    }

    private void move(Inputs in, long nanos) {
        if (!faults.latched()) {
            checkWheels();
        }
        if (faults.latched()) {
            halt();
        } else {
            wheel1.advance(nanos, path1.clearOfLower());
            wheel2.advance(nanos, path1.clearOfUpper() && path2.clearOfLower());
            path1.advance(nanos);
            path2.advance(nanos);
            checkWheels();
        }
        path1.watch(in.high(Inputs.LA1_RUN), nanos);
        path2.watch(in.high(Inputs.LA2_RUN), nanos);
        treat(in.high(Inputs.LAMP) && !dark);
        conveyor.work();
    }

    private void checkWheels() {
        path1.checkWheels();
        path2.checkWheels();
    }

    private void treat(boolean lamp) {
        Bottle bottle = path2.cup().held();
        if (bottle != null && lamp && bottle.height() >= Geometry.LAMP_FLOOR - Geometry.REACH) {
            bottle.treat();
        }
    }

    private void halt() {
        wheel1.halt();
        wheel2.halt();
        path1.drive().halt();
        path2.drive().halt();
        run1 = false;
        run2 = false;
    }

    private void remove(Bottle bottle) {
        if (bottle != null) {
            conveyor.away(bottle);
            removed++;
        }
    }

    private static double range(String what, double value, double top) {
        if (value >= 0 && value <= top) {
            return value;
        }
        throw new IllegalArgumentException(what + " is " + value + ": it must be from 0 to " + top);
    }
}
