package tickbus.machines.rig;

import java.util.List;
import tickbus.simulator.Machine;
import tickbus.simulator.ModelFault;
import tickbus.simulator.ModelFaults;
import tickbus.simulator.ModelVariable;

/**
 * The bottle treatment cell of the test rig.
 *
 * <p>Index wheel 1 brings bottles in its four pockets from the infeed to lift 1. Lift 1 raises a bottle into a sleeve
 * of the chamber wheel, which turns it over to lift 2, which raises it to the lamp and lowers it again. The chamber
 * wheel turns it back, lift 1 lowers it into a pocket, and index wheel 1 takes it on to the outfeed. One bottle moves
 * up while another moves down. {@link Geometry} has the layout.
 *
 * <p>Motion is a pure function of the inputs at each step: no clock, no randomness, and in normal motion no
 * allocation. Not thread-safe; call everything between two steps.
 */
public final class Rig implements Machine {
    private final Inputs in = new Inputs();
    private final Outputs out = new Outputs();
    private final Panel panel = new Panel();
    private final StepMonitor monitor = new StepMonitor();
    private final ModelFaults modelFaults = new ModelFaults();
    private final Cell cell;
    private final List<ModelVariable> variables;
    private long time;

    /**
     * A rig as found at power-up: lift 1 was left raised, and the chamber wheel between two index positions.
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
     * @throws IllegalArgumentException if a value is outside its range
     */
    public Rig(double wheel1Degrees, double wheel2Degrees, double lift1Millimetres, double lift2Millimetres) {
        cell = new Cell(wheel1Degrees, wheel2Degrees, lift1Millimetres, lift2Millimetres);
        cell.declare(modelFaults);
        variables = RigVariables.of(cell, monitor);
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
    public List<ModelVariable> variables() {
        return variables;
    }

    @Override
    public List<ModelFault> modelFaults() {
        return modelFaults.list();
    }

    @Override
    public void fault(String name, double value) {
        modelFaults.set(name, value);
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
        cell.step(in, nanos);
        time += nanos;
        panel.advance(nanos);
        boolean busy = cell.moving() || cell.ignores(in);
        monitor.look(in.pattern(), in.rising(Inputs.ACKNOWLEDGE), cell.faults().latched(), busy);
        monitor.lamp(in.high(Inputs.LAMP), in.high(Inputs.LA2_RUN));
        show();
    }

    /**
     * Presses a button of the operator panel, and holds it for 200 ms of simulation time.
     *
     * @param button the button
     */
    public void press(Button button) {
        panel.press(button);
    }

    /**
     * Makes the next bottle that a lift carries through its beam stick there: the lift stops, the bottle blocks the
     * beam, and Not OK rises when that has lasted 1.0 s while the lift is commanded to run.
     *
     * @param lift the lift
     */
    public void jamNext(Lift lift) {
        cell.path(lift).jamNext();
    }

    /**
     * The operator takes away the stuck bottle and every bottle in a sleeve or on a cup. Bottles in pockets stay. Not
     * OK then goes off at the next rising Acknowledge.
     */
    public void clearJam() {
        cell.clear();
    }

    /**
     * Returns whether a bottle is stuck in a lift's path.
     *
     * @return true until {@link #clearJam()}
     */
    public boolean jammed() {
        return cell.jammed();
    }

    /**
     * The bottles in the rig, by number.
     *
     * @return a new list; its bottles are valid until the next step
     */
    public List<Bottle> bottles() {
        return cell.conveyor().present();
    }

    /**
     * The causes of Not OK.
     *
     * @return one sentence per cause; empty without a fault
     */
    public List<String> faults() {
        return cell.faults().texts();
    }

    /**
     * The counts since power-up.
     *
     * @return the current numbers
     */
    public Counters counters() {
        return new Counters(
                monitor.cycles(),
                cell.conveyor().fed(),
                cell.treated(),
                cell.conveyor().delivered(),
                cell.removed(),
                cell.fallen(),
                cell.path(Lift.LA1).jams() + cell.path(Lift.LA2).jams(),
                cell.faults().collisions(),
                cell.faults().risen(),
                cell.wheel(1).retriggers() + cell.wheel(2).retriggers(),
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
     * The angle of index wheel 1: the position of its pocket 0; pocket n is n × 90 further.
     *
     * @return degrees, from 0 up to 360
     */
    public double wheel1Angle() {
        return cell.wheel(1).angle();
    }

    /**
     * The angle of the chamber wheel: the position of its sleeve 0; sleeve 1 is opposite.
     *
     * @return degrees, from 0 up to 360
     */
    public double wheel2Angle() {
        return cell.wheel(2).angle();
    }

    /**
     * How far a lift is above its bottom.
     *
     * @param lift the lift
     * @return millimetres
     */
    public double position(Lift lift) {
        return cell.path(lift).drive().position();
    }

    /**
     * The height of a lift's suction cup above the floor of index wheel 1's pockets.
     *
     * @param lift the lift
     * @return millimetres
     */
    public double cupHeight(Lift lift) {
        return cell.path(lift).cupHeight();
    }

    /**
     * Returns whether a lift's suction cup has vacuum.
     *
     * @param lift the lift
     * @return true while the control commands it
     */
    public boolean vacuum(Lift lift) {
        return cell.path(lift).cup().vacuum();
    }

    /**
     * Returns whether a lift has a valid position.
     *
     * @param lift the lift
     * @return false until a reference run, unless it was at the bottom
     */
    public boolean referenced(Lift lift) {
        return cell.path(lift).drive().referenced();
    }

    /**
     * Returns whether a bottle blocks a lift's package sensor.
     *
     * @param lift the lift
     * @return true while the beam is interrupted
     */
    public boolean beamBlocked(Lift lift) {
        return cell.path(lift).beam().blocked();
    }

    /**
     * Returns whether a wheel's homing sensor is on.
     *
     * @param wheel 1 or 2
     * @return true near every index position
     */
    public boolean homed(int wheel) {
        return cell.wheel(wheel).inHomingWindow();
    }

    /**
     * Returns whether the lamp is lit.
     *
     * @return the commanded state
     */
    public boolean lamp() {
        return in.high(Inputs.LAMP);
    }

    /**
     * Returns whether any drive is moving.
     *
     * @return true also while a wedged bottle blocks a lift
     */
    public boolean moving() {
        return cell.moving();
    }

    /**
     * Returns whether the rig reports Not OK.
     *
     * @return true from a fault to its acknowledgement
     */
    public boolean notOk() {
        return cell.faults().latched();
    }

    /**
     * The step of the cycle that has the current command word.
     *
     * @return 1 to 6, or 0 if no step has it
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
     * The step that the control shows on its panel.
     *
     * @return 1 to 6, or 0 outside production
     */
    public int panelStep() {
        return (int) in.value(Inputs.STEP);
    }

    /**
     * Returns whether a lamp of the operator panel is lit.
     *
     * @param number 0 Ready, 1 Running, 2 Fault, 3 Parked
     * @return the commanded state
     */
    public boolean panelLamp(int number) {
        return in.high(Inputs.READY + number);
    }

    /**
     * The cycles that the control shows on its panel.
     *
     * @return cycles since the control's program started
     */
    public long panelCycles() {
        return (long) in.value(Inputs.CYCLES);
    }

    private void show() {
        LiftPath path1 = cell.path(Lift.LA1);
        LiftPath path2 = cell.path(Lift.LA2);
        for (int n = 1; n <= StepMonitor.STEPS; n++) {
            out.set(Outputs.STEP1_COMPLETE + n - 1, monitor.complete(n));
        }
        out.set(Outputs.PACKAGE1, path1.beam().blocked());
        out.set(Outputs.PACKAGE2, path2.beam().blocked());
        out.set(Outputs.HOME1, cell.wheel(1).inHomingWindow());
        out.set(Outputs.HOME2, cell.wheel(2).inHomingWindow());
        out.set(Outputs.NOT_OK, cell.faults().latched());
        out.set(Outputs.START, panel.down(Button.START));
        out.set(Outputs.STOP, panel.down(Button.STOP));
        out.set(Outputs.RESET, panel.down(Button.RESET));
        out.set(Outputs.LA1_BOTTOM, path1.drive().atBottom());
        out.set(Outputs.LA2_BOTTOM, path2.drive().atBottom());
        out.set(Outputs.LA1_POSITION, path1.drive().measured());
        out.set(Outputs.LA2_POSITION, path2.drive().measured());
    }
}
