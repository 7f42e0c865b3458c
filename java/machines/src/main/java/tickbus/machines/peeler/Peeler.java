package tickbus.machines.peeler;

import java.util.ArrayList;
import java.util.List;
import java.util.stream.Stream;
import tickbus.simulator.Machine;
import tickbus.simulator.ModelFault;
import tickbus.simulator.ModelFaults;
import tickbus.simulator.ModelVariable;

/**
 * The peeling line as a machine: charger and lathe, with 25 axes.
 *
 * <p>Inputs are {@code <axis>.Execute} and the other parts of each axis's command; an axis that opens and closes has
 * {@code .Close} and {@code .Open} instead of {@code .Tracking} and {@code .TorqueControl}. Outputs are {@code
 * <axis>.Healthy}, {@code .InPosition}, {@code .ActualPosition}, {@code .ActualSpeed}, {@code .Status} and {@code
 * .Error} of each axis, then the sensors of the charger and the simulation time. The same inputs at the same steps
 * give the same motion, bit for bit. A step allocates nothing except when a block changes hands or something goes
 * wrong.
 */
public final class Peeler implements Machine {
    private static final double SECONDS = 1e-9;
    private static final int AXIS_INPUTS = Axes.inputs().size();
    private static final int AXIS_OUTPUTS = Axes.outputs().size();

    private final Axes axes;
    private final Mishaps mishaps = new Mishaps();
    private final ModelFaults modelFaults = new ModelFaults();
    private final Charger charger;
    private final Lathe lathe;
    private final List<ModelVariable> variables;
    private long now;

    /** A line with an unlimited supply of blocks, and blocks on all steps of its feeder. */
    public Peeler() {
        this(Integer.MAX_VALUE, Charger.STEPS);
    }

    /**
     * A line.
     *
     * @param blocks the number of blocks; after the last one the charger runs empty
     * @param onSteps the number of them on the step feeder at the beginning, at most 4
     */
    public Peeler(int blocks, int onSteps) {
        axes = new Axes();
        axes.declare(modelFaults);
        charger = new Charger(axes, new BlockSupply(blocks), mishaps, onSteps);
        lathe = new Lathe(axes, mishaps);
        variables = PeelerVariables.of(this);
    }

    @Override
    public String name() {
        return "peeler";
    }

    @Override
    public List<String> inputs() {
        return Axes.inputs();
    }

    @Override
    public List<String> outputs() {
        List<String> names = new ArrayList<>(Axes.outputs());
        for (int i = 1; i <= Charger.SENSORS; i++) {
            names.add("block at feeder step " + i);
        }
        names.add("pre-centring distance 1");
        names.add("pre-centring distance 2");
        names.add("simulation time");
        return names;
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
        if (index < 0 || index >= AXIS_INPUTS) {
            throw new IndexOutOfBoundsException(index);
        }
        axes.input(index, value);
    }

    @Override
    public double output(int index) {
        if (index < AXIS_OUTPUTS) {
            return axes.output(index);
        }
        int other = index - AXIS_OUTPUTS;
        if (other < Charger.SENSORS) {
            return charger.sensor(other) ? 1 : 0;
        }
        return switch (other - Charger.SENSORS) {
            case 0 -> charger.distance(true);
            case 1 -> charger.distance(false);
            case 2 -> now * SECONDS;
            default -> throw new IndexOutOfBoundsException(index);
        };
    }

    @Override
    public void step(long nanos) {
        if (nanos < 0) {
            throw new IllegalArgumentException("the machine cannot go back by " + -nanos + " ns");
        }
        now += nanos;
        charger.obstruct();
        lathe.obstruct(charger.presented());
        axes.step(nanos);
        lathe.step(nanos, charger.presented(), charger.clamped());
        charger.step(nanos, lathe.block());
    }

    /**
     * Sets or clears a fault of an axis: with a fault the axis is not healthy, and does not move.
     *
     * @param name the axis
     * @param failed true for a fault
     */
    public void fail(AxisName name, boolean failed) {
        axes.get(name).fail(failed);
    }

    /**
     * The axes with a fault.
     *
     * @return in the order of the names; empty in a good run
     */
    public List<AxisName> failed() {
        return Stream.of(AxisName.values()).filter(name -> !axes.get(name).healthy()).toList();
    }

    /**
     * Events that must not happen.
     *
     * @return texts in the order of the events; empty in a good run
     */
    public List<String> mishaps() {
        return mishaps.texts();
    }

    /**
     * The position of an axis.
     *
     * @param name the axis
     * @return in the axis's unit
     */
    public double position(AxisName name) {
        return axes.get(name).position();
    }

    /**
     * The speed of an axis, with its direction as sign.
     *
     * @param name the axis
     * @return in the axis's unit per second
     */
    public double speed(AxisName name) {
        return axes.get(name).velocity();
    }

    /**
     * The torque of an axis's last command.
     *
     * @param name the axis
     * @return percent; of the knife carriage, the thickness of the veneer in millimetres
     */
    public double torque(AxisName name) {
        return axes.get(name).torque();
    }

    /**
     * The number of commands that an axis has started.
     *
     * @param name the axis
     * @return counts from 0
     */
    public int commands(AxisName name) {
        return axes.get(name).commands();
    }

    /**
     * The block in a place.
     *
     * @param place the place
     * @return the block's number from 1 on; 0 if the place is empty
     */
    public int blockAt(Place place) {
        Block block = block(place);
        return block == null ? 0 : block.number();
    }

    /**
     * The shape of the block in a place.
     *
     * @param place the place
     * @return such as {@code cylinder}; empty if the place is
     */
    public String shapeAt(Place place) {
        Block block = block(place);
        return block == null ? "" : block.shape();
    }

    private Block block(Place place) {
        return switch (place) {
            case STEP_1, STEP_2, STEP_3, STEP_4 -> charger.onStep(place.ordinal());
            case LINEAR_FEEDER -> charger.fed();
            case CENTRING -> charger.centred();
            case CLAMPS -> charger.clamped();
            case LATHE -> lathe.block();
        };
    }

    /**
     * How far off its axis the lathe holds the block.
     *
     * @return millimetres, at the worse end; 0 without a block
     */
    public double eccentricity() {
        Block block = lathe.block();
        return block == null ? 0 : Math.max(block.eccentricity(true), block.eccentricity(false));
    }

    /**
     * Returns whether the veneer from the block in the lathe is a continuous ribbon.
     *
     * @return true for a continuous ribbon; false without a block
     */
    public boolean round() {
        return lathe.held() != null && lathe.held().round();
    }

    /**
     * The remaining volume of the block in the lathe.
     *
     * @return cubic metres; 0 without a block
     */
    public double held() {
        return lathe.held() == null ? 0 : lathe.held().volume() / 1e9;
    }

    /**
     * The speed of the block's surface at the knife.
     *
     * @return metres per second
     */
    public double surfaceSpeed() {
        return lathe.surfaceSpeed() / 1e3;
    }

    /**
     * The balance of wood.
     *
     * @return live counts
     */
    public Wood wood() {
        return lathe.wood();
    }

    Axes axes() {
        return axes;
    }

    Charger charger() {
        return charger;
    }

    Lathe lathe() {
        return lathe;
    }
}
