package tickbus.simulator.rig;

import java.util.List;
import tickbus.simulator.Machine;

/**
 * The bottle treatment cell of the test rig.
 *
 * <p>Index wheel 1 brings bottles in its four pockets from the infeed to lift 1. Lift 1 raises a bottle into a sleeve of
 * the chamber wheel, which turns it over to lift 2, which raises it to the lamp and lowers it again. The chamber wheel
 * turns it back, lift 1 lowers it into a pocket, and index wheel 1 takes it on to the outfeed. One bottle is on its way up
 * while another is on its way down. {@link Geometry} has the layout.
 *
 * <p>Motion is a pure function of the inputs at each step: no clock, no chance, and in normal motion no allocation. Not
 * safe for use by several threads; call everything between two steps.
 */
public final class Rig implements Machine {
    /** Longest stretch of motion between two looks for collisions. */
    private static final long SLICE_NANOS = 10_000_000L;

    private final Inputs in = new Inputs();
    private final Outputs out = new Outputs();
    private final Faults faults = new Faults();
    private final Panel panel = new Panel();
    private final StepMonitor monitor = new StepMonitor();
    private final Wheel wheel1;
    private final Wheel wheel2;
    private final Slots pockets;
    private final Slots sleeves;
    private final Conveyor conveyor;
    private final LiftPath path1;
    private final LiftPath path2;
    private boolean run1;
    private boolean run2;
    private long time;
    private long treated;
    private long removed;
    private long fallen;

    /**
     * A rig as it is found at power-up: somebody left lift 1 raised and the chamber wheel between two index positions.
     */
    public Rig() {
        this(0, 300, 40, 0);
    }

    /**
     * A rig that was left in a given state.
     *
     * @param wheel1Degrees angle of index wheel 1, from 0 up to 360
     * @param wheel2Degrees angle of the chamber wheel, from 0 up to 360
     * @param lift1Millimetres height of lift 1 above its bottom, from 0 to {@link Geometry#STROKE}
     * @param lift2Millimetres height of lift 2 above its bottom, from 0 to {@link Geometry#STROKE}
     */
    public Rig(double wheel1Degrees, double wheel2Degrees, double lift1Millimetres, double lift2Millimetres) {
        wheel1 = new Wheel(90, 180, 600, wheel1Degrees);
        wheel2 = new Wheel(180, 300, 1000, wheel2Degrees);
        pockets = new Slots("index wheel 1", wheel1, Bottle.Place.POCKET, 4, Geometry.POCKET_FLOOR);
        sleeves = new Slots("the chamber wheel", wheel2, Bottle.Place.SLEEVE, 2, Geometry.SLEEVE_FLOOR);
        conveyor = new Conveyor(pockets);
        path1 = new LiftPath(
                Lift.LA1,
                new LiftDrive("lift 1", lift1Millimetres),
                new SuctionCup("SC1", Bottle.Place.CUP1),
                new Beam(Geometry.BEAM1),
                new Seat(pockets, Geometry.LIFT_STATION),
                new Seat(sleeves, Geometry.OVER_LIFT1),
                faults);
        path2 = new LiftPath(
                Lift.LA2,
                new LiftDrive("lift 2", lift2Millimetres),
                new SuctionCup("SC2", Bottle.Place.CUP2),
                new Beam(Geometry.BEAM2),
                new Seat(sleeves, Geometry.OVER_LIFT2),
                null,
                faults);
        show();
    }

    @Override
    public String name() {
        return "Test rig";
    }

    @Override
    public List<String> inputs() {
        return Inputs.NAMES;
    }

    @Override
    public List<String> outputs() {
        return Outputs.NAMES;
    }

    @Override
    public void input(int index, double value) {
        in.write(index, value);
    }

    @Override
    public double output(int index) {
        return out.get(index);
    }

    @Override
    public void step(long nanos) {
        if (nanos < 0) {
            throw new IllegalArgumentException("a step of " + nanos + " ns: time cannot run backwards");
        }
        in.sample();
        acknowledge();
        suction(path1, Inputs.SC1);
        suction(path2, Inputs.SC2);
        if (!faults.latched()) {
            command();
        }
        long left = nanos;
        while (left > 0) {
            long slice = Math.min(left, SLICE_NANOS);
            move(slice);
            left -= slice;
        }
        if (faults.latched()) {
            halt();
        }
        time += nanos;
        panel.advance(nanos);
        monitor.look(in.pattern(), in.rising(Inputs.ACKNOWLEDGE), faults.latched(), moving());
        monitor.lamp(in.high(Inputs.LAMP), in.high(Inputs.LA2_RUN));
        show();
    }

    /**
     * Presses a button of the operator panel; it is held for 200 ms of simulation time.
     *
     * @param button which one
     */
    public void press(Button button) {
        panel.press(button);
    }

    /**
     * Makes the next bottle that a lift carries through its beam stick there: the lift stops, the bottle blocks the
     * beam, and Not OK rises when that has lasted 1.0 s while the lift is commanded to run.
     *
     * @param lift which lift
     */
    public void jamNext(Lift lift) {
        path(lift).jamNext();
    }

    /**
     * The operator's hand: takes away the stuck bottle and every bottle in a sleeve or on a cup. Bottles in pockets stay.
     * Not OK then goes off at the next rising Acknowledge.
     */
    public void clearJam() {
        remove(path1.takeAway());
        remove(path2.takeAway());
        for (int i = 0; i < sleeves.count(); i++) {
            remove(sleeves.take(i));
        }
    }

    /**
     * Whether a bottle is stuck in a lift's path.
     *
     * @return true until {@link #clearJam()}
     */
    public boolean jammed() {
        return path1.stuck() != null || path2.stuck() != null;
    }

    /**
     * The bottles in the rig, by number.
     *
     * @return a new list; its bottles are true until the next step
     */
    public List<Bottle> bottles() {
        return conveyor.present();
    }

    /**
     * Why Not OK is on.
     *
     * @return one sentence per cause, empty when all is well
     */
    public List<String> faults() {
        return faults.texts();
    }

    /**
     * What has been counted since power-up.
     *
     * @return the numbers as they are now
     */
    public Counters counters() {
        return new Counters(
                monitor.cycles(),
                conveyor.fed(),
                treated,
                conveyor.delivered(),
                removed,
                fallen,
                path1.jams() + path2.jams(),
                faults.collisions(),
                faults.risen(),
                wheel1.retriggers() + wheel2.retriggers(),
                monitor.lampErrors());
    }

    /**
     * Simulation time since power-up.
     *
     * @return nanoseconds
     */
    public long time() {
        return time;
    }

    /**
     * The angle of index wheel 1: where its pocket 0 stands; pocket n stands n × 90 further.
     *
     * @return degrees, from 0 up to 360
     */
    public double wheel1Angle() {
        return wheel1.angle();
    }

    /**
     * The angle of the chamber wheel: where its sleeve 0 stands; sleeve 1 stands opposite.
     *
     * @return degrees, from 0 up to 360
     */
    public double wheel2Angle() {
        return wheel2.angle();
    }

    /**
     * How far a lift is above its bottom.
     *
     * @param lift which lift
     * @return millimetres
     */
    public double position(Lift lift) {
        return path(lift).drive().position();
    }

    /**
     * The height of a lift's suction cup above the floor of index wheel 1's pockets.
     *
     * @param lift which lift
     * @return millimetres
     */
    public double cupHeight(Lift lift) {
        return path(lift).cupHeight();
    }

    /**
     * Whether a lift's suction cup has vacuum.
     *
     * @param lift which lift
     * @return true while the control commands it
     */
    public boolean vacuum(Lift lift) {
        return path(lift).cup().vacuum();
    }

    /**
     * Whether a lift trusts its position.
     *
     * @param lift which lift
     * @return false until a reference run, unless it stood at the bottom
     */
    public boolean referenced(Lift lift) {
        return path(lift).drive().referenced();
    }

    /**
     * Whether a bottle blocks a lift's package sensor.
     *
     * @param lift which lift
     * @return true while the beam is dark
     */
    public boolean beamBlocked(Lift lift) {
        return path(lift).beam().blocked();
    }

    /**
     * Whether a wheel's homing sensor shows.
     *
     * @param wheel 1 or 2
     * @return true near every index position
     */
    public boolean homed(int wheel) {
        return (wheel == 1 ? wheel1 : wheel2).inHomingWindow();
    }

    /**
     * Whether the lamp is lit.
     *
     * @return the commanded state
     */
    public boolean lamp() {
        return in.high(Inputs.LAMP);
    }

    /**
     * Whether any drive is under way.
     *
     * @return true also while a wedged bottle holds a lift up
     */
    public boolean moving() {
        return wheel1.moving() || wheel2.moving() || path1.drive().moving() || path2.drive().moving();
    }

    /**
     * Whether the rig reports Not OK.
     *
     * @return true from a fault to its acknowledgement
     */
    public boolean notOk() {
        return faults.latched();
    }

    /**
     * The step of the cycle whose command word stands.
     *
     * @return 1 to 6, or 0 if the word is none of theirs
     */
    public int step() {
        return monitor.step();
    }

    /**
     * The phase that the control shows on its panel.
     *
     * @return 0 to 7
     */
    public int panelPhase() {
        return (int) in.value(Inputs.PHASE);
    }

    /**
     * The cycles that the control shows on its panel.
     *
     * @return cycles since its program started
     */
    public long panelCycles() {
        return (long) in.value(Inputs.CYCLES);
    }

    private LiftPath path(Lift lift) {
        return lift == Lift.LA1 ? path1 : path2;
    }

    private void acknowledge() {
        if (in.rising(Inputs.ACKNOWLEDGE) && faults.latched() && !jammed()) {
            faults.acknowledge();
            path1.drive().acknowledge();
            path2.drive().acknowledge();
        }
    }

    private void suction(LiftPath path, int input) {
        if (!in.changed(input)) {
            return;
        }
        Bottle onCup = path.cup().held();
        Bottle fell = path.suction(in.high(input));
        if (fell != null) {
            fallen++;
            conveyor.away(fell);
        } else if (onCup != null && onCup.place() == Bottle.Place.POCKET && onCup.treated()) {
            treated++;
        }
    }

    private void command() {
        wheel1.command(in.rising(Inputs.IM1_INDEX), in.rising(Inputs.IM1_JOG), in.high(Inputs.IM1_JOG));
        wheel2.command(in.rising(Inputs.IM2_INDEX), in.rising(Inputs.IM2_JOG), in.high(Inputs.IM2_JOG));
        run1 = in.high(Inputs.LA1_RUN) && (run1 || in.rising(Inputs.LA1_RUN));
        run2 = in.high(Inputs.LA2_RUN) && (run2 || in.rising(Inputs.LA2_RUN));
        boolean otherCode = in.changed(Inputs.LA1_CODE_LOW) || in.changed(Inputs.LA1_CODE_HIGH);
        if (in.falling(Inputs.LA1_RUN)) {
            path1.drive().stop();
        } else if (run1 && (in.rising(Inputs.LA1_RUN) || otherCode)) {
            moveLift1();
        }
        if (in.falling(Inputs.LA2_RUN)) {
            path2.drive().stop();
        } else if (run2 && (in.rising(Inputs.LA2_RUN) || in.changed(Inputs.LA2_UP))) {
            moveLift2();
        }
    }

    private void moveLift1() {
        int code = (in.high(Inputs.LA1_CODE_HIGH) ? 2 : 0) + (in.high(Inputs.LA1_CODE_LOW) ? 1 : 0);
        switch (code) {
            case 0 -> path1.drive().by(Geometry.BIG, LiftDrive.Pace.BIG, faults);
            case 1 -> path1.drive().by(-Geometry.SMALL, LiftDrive.Pace.SMALL, faults);
            case 2 -> path1.drive().by(Geometry.SMALL, LiftDrive.Pace.SMALL, faults);
            default -> path1.drive().toBottom();
        }
    }

    private void moveLift2() {
        if (in.high(Inputs.LA2_UP)) {
            path2.drive().by(Geometry.BIG, LiftDrive.Pace.BIG, faults);
        } else {
            path2.drive().toBottom();
        }
    }

    private void move(long nanos) {
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
        treat();
        conveyor.work();
    }

    private void checkWheels() {
        path1.checkWheels();
        path2.checkWheels();
    }

    private void treat() {
        Bottle bottle = path2.cup().held();
        if (bottle != null && lamp() && bottle.height() >= Geometry.LAMP_FLOOR - Geometry.REACH) {
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

    private void show() {
        for (int n = 1; n <= StepMonitor.STEPS; n++) {
            out.set(Outputs.STEP1_COMPLETE + n - 1, monitor.complete(n));
        }
        out.set(Outputs.PACKAGE1, path1.beam().blocked());
        out.set(Outputs.PACKAGE2, path2.beam().blocked());
        out.set(Outputs.HOME1, wheel1.inHomingWindow());
        out.set(Outputs.HOME2, wheel2.inHomingWindow());
        out.set(Outputs.NOT_OK, faults.latched());
        out.set(Outputs.START, panel.down(Button.START));
        out.set(Outputs.STOP, panel.down(Button.STOP));
        out.set(Outputs.RESET, panel.down(Button.RESET));
        out.set(Outputs.LA1_BOTTOM, path1.drive().atBottom());
        out.set(Outputs.LA2_BOTTOM, path2.drive().atBottom());
        out.set(Outputs.LA1_POSITION, path1.drive().position());
        out.set(Outputs.LA2_POSITION, path2.drive().position());
    }
}
