package tickbus.machines.peeler;

import static org.junit.jupiter.api.Assertions.fail;

import java.util.List;
import java.util.function.BooleanSupplier;

/** Commands the whole line as its PLCs do, through its variables, in ticks of 2 ms. */
final class LinePlayer {
    private static final long TICK = 2_000_000L;
    private static final int PATIENCE = 30_000;

    private final Peeler line;
    private final List<String> inputs;
    private final List<String> outputs;

    LinePlayer(Peeler line) {
        this.line = line;
        inputs = line.inputs();
        outputs = line.outputs();
        for (AxisName name : AxisName.values()) {
            set(name, "Enable", 1);
        }
    }

    Peeler line() {
        return line;
    }

    void set(AxisName axis, String part, double value) {
        line.input(inputs.indexOf(axis.label() + "." + part), value);
    }

    double get(String output) {
        return line.output(outputs.indexOf(output));
    }

    boolean sensor(int number) {
        return get("block at feeder step " + number) != 0;
    }

    double position(AxisName axis) {
        return get(axis.label() + ".ActualPosition");
    }

    private boolean inPosition(AxisName axis) {
        return get(axis.label() + ".InPosition") != 0;
    }

    void tick() {
        line.step(TICK);
    }

    void ticks(int count) {
        for (int i = 0; i < count; i++) {
            tick();
        }
    }

    void until(String what, BooleanSupplier so) {
        for (int i = 0; !so.getAsBoolean(); i++) {
            if (i == PATIENCE) {
                fail(what + " did not come to be; mishaps: " + line.mishaps());
            }
            tick();
        }
    }

    /** Gives commands to axes at once: Execute falls and rises. */
    private void execute(AxisName... axes) {
        for (AxisName axis : axes) {
            set(axis, "Execute", 0);
        }
        tick();
        for (AxisName axis : axes) {
            set(axis, "Execute", 1);
        }
        tick();
    }

    private void command(double target, double speed, AxisName... axes) {
        for (AxisName axis : axes) {
            set(axis, "Tracking", 0);
            set(axis, "SpeedControl", 0);
            set(axis, "TargetPosition", target);
            set(axis, "Speed", speed);
            set(axis, "Acceleration", 1500);
            set(axis, "Deceleration", 1500);
        }
        execute(axes);
    }

    /** Moves axes to one position, and waits until they are there. */
    void move(double target, AxisName... axes) {
        command(target, 400, axes);
        for (AxisName axis : axes) {
            until(axis + " at " + target, () -> inPosition(axis));
        }
    }

    void run(double speed) {
        AxisName axis = AxisName.SPINDLE_ROTATION;
        set(axis, "TargetPosition", 1e9);
        set(axis, "Speed", speed);
        set(axis, "Acceleration", 4);
        set(axis, "Deceleration", 4);
        set(axis, "SpeedControl", 1);
        execute(axis);
    }

    void brake() {
        set(AxisName.SPINDLE_ROTATION, "SpeedControl", 0);
        until("standing spindles", () -> get("spindle rotation.ActualSpeed") == 0);
    }

    void press(boolean close, double torque, AxisName... axes) {
        for (AxisName axis : axes) {
            set(axis, "Close", close ? 1 : 0);
            set(axis, "Open", close ? 0 : 1);
            set(axis, "Torque", torque);
        }
        execute(axes);
        for (AxisName axis : axes) {
            until(axis + " standing", () -> get(axis.label() + ".ActualSpeed") == 0);
        }
    }

    void track(AxisName axis, double offset, double torque) {
        set(axis, "Tracking", 1);
        set(axis, "TargetPosition", offset);
        set(axis, "Torque", torque);
        execute(axis);
    }

    /** Brings the next block between the lathe's spindles, as the charger's PLC does. */
    void charge() {
        until("the linear feeder free", () -> !sensor(5));
        move(400, AxisName.STEP_FEEDER);
        move(0, AxisName.STEP_FEEDER);
        move(0, AxisName.LINEAR_FEEDER);
        double left = Math.sqrt(2) * (800 - get("pre-centring distance 1")) / (1 + Math.sqrt(2));
        double right = Math.sqrt(2) * (800 - get("pre-centring distance 2")) / (1 + Math.sqrt(2));
        move(left, AxisName.CENTRING_Y_LEFT);
        move(right, AxisName.CENTRING_Y_RIGHT);
        move(640, AxisName.CENTRING_SPINDLE_LEFT, AxisName.CENTRING_SPINDLE_RIGHT);
        move(280, AxisName.CENTRING_Y_LEFT, AxisName.CENTRING_Y_RIGHT);
        move(650, AxisName.LINEAR_FEEDER);
        move(0, AxisName.CENTRING_X_LEFT, AxisName.CENTRING_X_RIGHT);
        press(true, 60, AxisName.TRANSFER_CLAMP_LEFT, AxisName.TRANSFER_CLAMP_RIGHT);
        move(700, AxisName.CENTRING_SPINDLE_LEFT, AxisName.CENTRING_SPINDLE_RIGHT);
        move(0, AxisName.CENTRING_Y_LEFT, AxisName.CENTRING_Y_RIGHT);
        move(300, AxisName.CENTRING_X_LEFT, AxisName.CENTRING_X_RIGHT);
        move(0, AxisName.TRANSFER_ARM);
    }

    /** Takes the presented block. */
    void take() {
        press(true, 80, AxisName.SPINDLE_LEFT, AxisName.SPINDLE_RIGHT);
        press(false, 60, AxisName.TRANSFER_CLAMP_LEFT, AxisName.TRANSFER_CLAMP_RIGHT);
        move(900, AxisName.TRANSFER_ARM);
    }

    /** Peels the block that the spindles hold, as the lathe's PLC does, and lets the core fall. */
    void peel() {
        press(true, 40, AxisName.SPINDLE_LEFT, AxisName.SPINDLE_RIGHT);
        press(false, 50, AxisName.ROUND_UP_GATE);
        move(160, AxisName.KNIFE_CARRIAGE);
        move(165, AxisName.TOP_ROLL, AxisName.BOTTOM_ROLL_LEFT, AxisName.BOTTOM_ROLL_RIGHT);
        run(5);
        track(AxisName.TOP_ROLL, 0, 0);
        track(AxisName.PITCH_ANGLE, 0.5, 0);
        track(AxisName.ROLL_ROTATION, 0, 2);
        track(AxisName.KNIFE_CARRIAGE, 0, 3);
        until("the knife at 125", () -> position(AxisName.KNIFE_CARRIAGE) <= 125);
        track(AxisName.KNIFE_CARRIAGE, 0, 1.5);
        press(false, 50, AxisName.VENEER_GATE);
        press(true, 50, AxisName.ROUND_UP_GATE);
        until("the knife at 40", () -> position(AxisName.KNIFE_CARRIAGE) <= 40);
        for (AxisName axis : List.of(AxisName.KNIFE_CARRIAGE, AxisName.TOP_ROLL, AxisName.PITCH_ANGLE,
                AxisName.ROLL_ROTATION)) {
            set(axis, "Tracking", 0);
        }
        move(300, AxisName.KNIFE_CARRIAGE, AxisName.TOP_ROLL, AxisName.BOTTOM_ROLL_LEFT, AxisName.BOTTOM_ROLL_RIGHT);
        brake();
        press(true, 50, AxisName.VENEER_GATE);
        press(false, 50, AxisName.CORE_DROP);
        press(false, 50, AxisName.SPINDLE_LEFT, AxisName.SPINDLE_RIGHT);
        press(true, 50, AxisName.CORE_DROP);
    }
}
