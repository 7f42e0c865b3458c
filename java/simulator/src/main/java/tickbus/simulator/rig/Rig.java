package tickbus.simulator.rig;

import java.util.List;
import tickbus.simulator.Machine;

/** The bottle treatment cell of the test rig. */
public final class Rig implements Machine {
    private static final List<String> OUTPUTS = List.of(
            "step1.complete", "step2.complete", "step3.complete", "step4.complete", "step5.complete", "step6.complete",
            "package1", "package2", "home1", "home2", "not.ok", "start", "stop", "reset",
            "la1.bottom", "la2.bottom", "la1.position", "la2.position");

    private final Inputs inputs = new Inputs();
    private final double[] outputs = new double[OUTPUTS.size()];

    /** A rig as it is found at power-up. */
    public Rig() {}

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
        return OUTPUTS;
    }

    @Override
    public void input(int index, double value) {
        inputs.write(index, value);
    }

    @Override
    public double output(int index) {
        return outputs[index];
    }

    @Override
    public void step(long nanos) {
        inputs.sample();
    }

    /**
     * Presses a button of the operator panel; it is held for 200 ms of simulation time.
     *
     * @param button which one
     */
    public void press(Button button) {}

    /**
     * Makes the next bottle that a lift carries through its beam stick there.
     *
     * @param lift which lift
     */
    public void jamNext(Lift lift) {}

    /** The operator's hand: takes away the stuck bottle and every bottle in a sleeve or on a cup. */
    public void clearJam() {}

    /**
     * Whether a bottle is stuck in a lift's path.
     *
     * @return true until {@link #clearJam()}
     */
    public boolean jammed() {
        return false;
    }

    /**
     * The bottles in the rig.
     *
     * @return true to the last step only
     */
    public List<Bottle> bottles() {
        return List.of();
    }

    /**
     * Why Not OK is on.
     *
     * @return one sentence per cause, empty when all is well
     */
    public List<String> faults() {
        return List.of();
    }

    /**
     * What has been counted since power-up.
     *
     * @return the numbers as they are now
     */
    public Counters counters() {
        return new Counters(0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0);
    }
}
