package tickbus.machines.board;

import java.util.ArrayList;
import java.util.List;
import tickbus.simulator.Machine;

/**
 * A board with four switches, four lamps, a gauge and two tanks.
 *
 * <p>The valve lets liquid into tank 1, the pump lifts it from there to tank 2, and it leaves tank 2 through the tap, which
 * the operator opens. Inputs are the lamps, the valve, the pump and the gauge; outputs are the switches and the levels, in
 * percent. Motion is a pure function of the inputs at each step, and a step allocates nothing. Not thread-safe; call
 * everything between two steps.
 */
public final class TestingBoard implements Machine {
    /** The number of switches, and of lamps. */
    public static final int SWITCHES = 4;

    /** The flow through the open valve, in percent of a tank per second. */
    public static final double VALVE_FLOW = 45;

    /** The flow of the running pump, in percent of a tank per second. */
    public static final double PUMP_FLOW = 30;

    /** The flow through the open tap, in percent of a tank per second. */
    public static final double TAP_FLOW = 10;

    private static final double SECONDS = 1e-9;
    private static final double HIGH = 0.5;
    private static final int VALVE = SWITCHES;
    private static final int PUMP = SWITCHES + 1;
    private static final int GAUGE = SWITCHES + 2;

    private final double[] inputs = new double[SWITCHES + 3];
    private final boolean[] switches = new boolean[SWITCHES];
    private final Tank tank1 = new Tank();
    private final Tank tank2 = new Tank();
    private boolean tap;

    private static List<String> numbered(String name, String... more) {
        List<String> names = new ArrayList<>();
        for (int i = 1; i <= SWITCHES; i++) {
            names.add(name + " " + i);
        }
        names.addAll(List.of(more));
        return names;
    }

    @Override
    public String name() {
        return "Testing board";
    }

    @Override
    public List<String> inputs() {
        return numbered("lamp", "valve", "pump", "gauge");
    }

    @Override
    public List<String> outputs() {
        return numbered("switch", "level 1", "level 2");
    }

    @Override
    public void input(int index, double value) {
        inputs[index] = value;
    }

    @Override
    public double output(int index) {
        return switch (index - SWITCHES) {
            case 0 -> tank1.level();
            case 1 -> tank2.level();
            default -> switches[index] ? 1 : 0;
        };
    }

    @Override
    public void step(long nanos) {
        if (nanos < 0) {
            throw new IllegalArgumentException("a step of " + nanos + " ns: time cannot run backwards");
        }
        double seconds = nanos * SECONDS;
        if (tap) {
            tank2.draw(TAP_FLOW * seconds);
        }
        if (pump()) {
            tank2.fill(tank1.draw(PUMP_FLOW * seconds));
        }
        if (valve()) {
            tank1.fill(VALVE_FLOW * seconds);
        }
    }

    /**
     * Switches a switch.
     *
     * @param number from 1
     * @param on true for on
     */
    public void set(int number, boolean on) {
        switches[number - 1] = on;
    }

    /**
     * Opens or closes the tap of tank 2.
     *
     * @param open true for open
     */
    public void tap(boolean open) {
        tap = open;
    }

    /**
     * Returns whether a switch is on.
     *
     * @param number from 1
     * @return true for on
     */
    public boolean isOn(int number) {
        return switches[number - 1];
    }

    /**
     * Returns whether a lamp is lit.
     *
     * @param number from 1
     * @return true for lit
     */
    public boolean isLit(int number) {
        return inputs[number - 1] >= HIGH;
    }

    /**
     * Returns whether the valve is open.
     *
     * @return true for open
     */
    public boolean valve() {
        return inputs[VALVE] >= HIGH;
    }

    /**
     * Returns whether the pump runs.
     *
     * @return true while it runs
     */
    public boolean pump() {
        return inputs[PUMP] >= HIGH;
    }

    /**
     * Returns whether the tap is open.
     *
     * @return true for open
     */
    public boolean tap() {
        return tap;
    }

    /**
     * The gauge's value.
     *
     * @return any number
     */
    public double gauge() {
        return inputs[GAUGE];
    }

    /**
     * The level of a tank.
     *
     * @param tank 1 or 2
     * @return percent
     */
    public double level(int tank) {
        return tank == 1 ? tank1.level() : tank2.level();
    }
}
