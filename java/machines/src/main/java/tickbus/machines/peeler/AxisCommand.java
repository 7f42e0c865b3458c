package tickbus.machines.peeler;

import java.util.List;
import java.util.Map;

/**
 * The command of one axis as currently sent by the PLC: five bits and six values.
 *
 * <p>Nothing happens before Execute rises. Values are in the axis's unit, per second and per second squared.
 */
final class AxisCommand {
    /** The names of the variables, after the axis's name and a dot, in order. */
    static final List<String> NAMES = List.of("Execute", "Tracking", "TorqueControl", "SpeedControl", "Enable",
            "TargetPosition", "Speed", "Acceleration", "Deceleration", "Torque", "Jerk");

    /** The names of the same bits on an axis that opens and closes. */
    static final Map<String, String> NAMES_OF_TORQUE = Map.of("Tracking", "Close", "TorqueControl", "Open");

    private final double[] values = new double[NAMES.size()];

    void write(int index, double value) {
        values[index] = value;
    }

    private boolean bit(int index) {
        return values[index] >= 0.5;
    }

    boolean execute() {
        return bit(0);
    }

    /** Follow other axes; on an axis that opens and closes: close. */
    boolean tracking() {
        return bit(1);
    }

    /** On an axis that opens and closes: open. */
    boolean torqueControl() {
        return bit(2);
    }

    /** Move while this is on. */
    boolean speedControl() {
        return bit(3);
    }

    boolean enable() {
        return bit(4);
    }

    /** The target; with tracking, an offset. */
    double target() {
        return values[5];
    }

    /** The highest speed, without direction. */
    double speed() {
        return values[6];
    }

    double acceleration() {
        return values[7];
    }

    double deceleration() {
        return values[8];
    }

    /** Pressure in percent; for the knife carriage, the thickness of the veneer in millimetres. */
    double torque() {
        return values[9];
    }

    /** For an S-curve: the rate of change of the acceleration; with 0 the acceleration jumps. */
    double jerk() {
        return values[10];
    }

    /** True if speed, acceleration and deceleration permit a motion; NaN does not. */
    boolean movable() {
        return speed() > 0 && acceleration() > 0 && deceleration() > 0 && Double.isFinite(target());
    }
}
