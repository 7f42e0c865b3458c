package tickbus.machines.peeler;

import java.util.List;

/**
 * The axes of the line: the charger's twelve, then the lathe's thirteen, in the order of their records.
 *
 * <p>Positions count outwards from the lathe's centre line, from the middle of the block, or from the ground.
 */
public enum AxisName {
    /** One stroke up and down moves every block one step on. */
    STEP_FEEDER("step feeder", AxisKind.POSITION, 0, 400, 0),
    /** 650: beside the step feeder; 0: under the centring spindles. */
    LINEAR_FEEDER("linear feeder", AxisKind.POSITION, 0, 650, 650),
    /** Tip to the middle of the block. */
    CENTRING_SPINDLE_LEFT("centring spindle left", AxisKind.POSITION, 0, 700, 700),
    /** Tip to the middle of the block. */
    CENTRING_SPINDLE_RIGHT("centring spindle right", AxisKind.POSITION, 0, 700, 700),
    /** 300: over the linear feeder; 0: where the transfer arm comes. */
    CENTRING_X_LEFT("centring x left", AxisKind.POSITION, 0, 300, 300),
    /** Height of the left spindle above the V of the linear feeder. */
    CENTRING_Y_LEFT("centring y left", AxisKind.POSITION, 0, 300, 0),
    /** As for the left one. */
    CENTRING_X_RIGHT("centring x right", AxisKind.POSITION, 0, 300, 300),
    /** As for the left one. */
    CENTRING_Y_RIGHT("centring y right", AxisKind.POSITION, 0, 300, 0),
    /** 900: at the centring spindles; 0: between the lathe's spindles. */
    TRANSFER_ARM("transfer arm", AxisKind.POSITION, 0, 900, 900),
    /** Jaw to the middle of the block. */
    TRANSFER_CLAMP_LEFT("transfer clamp left", AxisKind.TORQUE, 0, 800, 800),
    /** Jaw to the middle of the block. */
    TRANSFER_CLAMP_RIGHT("transfer clamp right", AxisKind.TORQUE, 0, 800, 800),
    /** Open, it lets a block onto the first step. */
    CHARGER_GATE("charger gate", AxisKind.TORQUE, 0, 100, 0),

    /** Tip to the middle of the block. */
    SPINDLE_LEFT("spindle left", AxisKind.TORQUE, 0, 800, 800),
    /** Tip to the middle of the block. */
    SPINDLE_RIGHT("spindle right", AxisKind.TORQUE, 0, 800, 800),
    /** In revolutions. */
    SPINDLE_ROTATION("spindle rotation", AxisKind.SPEED, Double.NEGATIVE_INFINITY, Double.POSITIVE_INFINITY, 0),
    /**
     * Edge to the axis of the block. Tracking, the knife advances per revolution by one thickness of veneer, which is its
     * torque.
     */
    KNIFE_CARRIAGE("knife carriage", AxisKind.TRACKING, 0, 400, 300),
    /** In degrees; tracking, a function of the knife's distance, plus an offset. */
    PITCH_ANGLE("pitch angle", AxisKind.TRACKING, -5, 10, 0),
    /** Gap to the knife. */
    NOSEBAR("nosebar", AxisKind.POSITION, 0, 20, 20),
    /** Tracking, the roll keeps the knife's distance, plus an offset. */
    TOP_ROLL("top roll", AxisKind.TRACKING, 0, 400, 300),
    /** As for the top roll. */
    BOTTOM_ROLL_LEFT("bottom roll left", AxisKind.TRACKING, 0, 400, 300),
    /** As for the top roll. */
    BOTTOM_ROLL_RIGHT("bottom roll right", AxisKind.TRACKING, 0, 400, 300),
    /** In revolutions; tracking, the speed of the block's surface, increased by the torque in percent. */
    ROLL_ROTATION("roll rotation", AxisKind.TRACKING, Double.NEGATIVE_INFINITY, Double.POSITIVE_INFINITY, 0),
    /** When open, veneer falls onto the veneer belt. */
    VENEER_GATE("veneer gate", AxisKind.TORQUE, 0, 100, 0),
    /** When open, veneer falls into the chipper. */
    ROUND_UP_GATE("round-up gate", AxisKind.TORQUE, 0, 100, 0),
    /** When open, the core falls out. */
    CORE_DROP("core drop", AxisKind.TORQUE, 0, 100, 0);

    /** The rolls that support the block. */
    static final List<AxisName> ROLLS = List.of(TOP_ROLL, BOTTOM_ROLL_LEFT, BOTTOM_ROLL_RIGHT);

    private final String label;
    private final AxisKind kind;
    private final double low;
    private final double high;
    private final double home;

    AxisName(String label, AxisKind kind, double low, double high, double home) {
        this.label = label;
        this.kind = kind;
        this.low = low;
        this.high = high;
        this.home = home;
    }

    /**
     * The axis's name in driver.cfg.
     *
     * @return such as {@code step feeder}
     */
    public String label() {
        return label;
    }

    /**
     * The commands that the axis accepts.
     *
     * @return the axis's kind
     */
    public AxisKind kind() {
        return kind;
    }

    /**
     * The axis's lower end position.
     *
     * @return in the axis's unit, negative infinity if the axis turns without end
     */
    public double low() {
        return low;
    }

    /**
     * The axis's upper end position.
     *
     * @return in the axis's unit, infinity if the axis turns without end
     */
    public double high() {
        return high;
    }

    /**
     * The axis's position when the simulation starts.
     *
     * @return in the axis's unit
     */
    public double home() {
        return home;
    }

    /**
     * Returns whether the charger's PLC moves the axis.
     *
     * @return false if the lathe's PLC does
     */
    public boolean ofCharger() {
        return compareTo(SPINDLE_LEFT) < 0;
    }
}
