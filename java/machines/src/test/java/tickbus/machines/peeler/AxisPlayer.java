package tickbus.machines.peeler;

import static org.junit.jupiter.api.Assertions.assertTrue;

import java.util.function.BooleanSupplier;

/** Commands one axis as a PLC does, in ticks of 2 ms. */
final class AxisPlayer {
    private static final long TICK = 2_000_000L;
    private static final long PATIENCE = 100_000;

    private final Axis axis;

    AxisPlayer(Axis axis) {
        this.axis = axis;
        set("Enable", 1);
    }

    Axis axis() {
        return axis;
    }

    void set(String part, double value) {
        axis.command().write(AxisCommand.NAMES.indexOf(part), value);
    }

    void tick() {
        axis.step(TICK);
    }

    void ticks(int count) {
        for (int i = 0; i < count; i++) {
            tick();
        }
    }

    /** Clears Execute and sets it again; the tick with the rising edge is done on return. */
    void execute() {
        release();
        set("Execute", 1);
        tick();
    }

    void release() {
        set("Execute", 0);
        tick();
    }

    void position(double target, double speed, double acceleration) {
        set("TargetPosition", target);
        set("Speed", speed);
        set("Acceleration", acceleration);
        set("Deceleration", acceleration);
        execute();
    }

    /** The number of ticks until this is true. */
    long until(BooleanSupplier so) {
        for (long ticks = 0; ticks < PATIENCE; ticks++) {
            if (so.getAsBoolean()) {
                return ticks;
            }
            tick();
        }
        assertTrue(so.getAsBoolean(), "not within " + PATIENCE + " ticks");
        return PATIENCE;
    }
}
