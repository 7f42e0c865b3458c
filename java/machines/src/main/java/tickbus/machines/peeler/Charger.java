package tickbus.machines.peeler;

/**
 * The charger: a step feeder with four steps, a linear feeder with a V, centring spindles that move sideways and up,
 * and the transfer arm with its clamps.
 *
 * <p>The charger follows its axes, which the PLC controls. Letting a block fall is a mishap.
 */
final class Charger {
    /** Steps of the step feeder. */
    static final int STEPS = 4;

    /** Sensors: the steps, the linear feeder, the centring spindles, the clamps, the gate; the remaining ones are spare. */
    static final int SENSORS = 16;

    /** Height of the pre-centring sensors above the bottom of the V, in millimetres. */
    static final double SENSOR_HEIGHT = 800;

    /** The height at which the clamps take a block over, and the tolerance. */
    private static final double TRANSFER_HEIGHT = 280;

    private static final double NEAR = 5;
    private static final double OVER_FEEDER = 300;
    private static final double STROKE = 400;
    private static final double DOWN = 10;
    private static final double GATE_OPEN = 50;
    private static final double BESIDE_STEPS = 650;
    private static final double ARM_AT_SPINDLES = 900;

    /** How far tips and jaws bite into the wood. */
    private static final double BITE = 5;

    /** The time that a block takes from the gate to the first step. */
    private static final long ROLL_NANOS = 300_000_000L;

    private final Axes axes;
    private final BlockSupply supply;
    private final Mishaps mishaps;
    private final Block[] steps = new Block[STEPS];
    private Block waiting;
    private Block fed;
    private Block centred;
    private Block clamped;
    private boolean stroked;
    private long rolling;

    Charger(Axes axes, BlockSupply supply, Mishaps mishaps, int onSteps) {
        this.axes = axes;
        this.supply = supply;
        this.mishaps = mishaps;
        for (int i = STEPS - 1; i >= STEPS - onSteps && supply.hasNext(); i--) {
            steps[i] = supply.next();
        }
        waiting = next();
    }

    private Block next() {
        return supply.hasNext() ? supply.next() : null;
    }

    private Axis axis(AxisName name) {
        return axes.get(name);
    }

    /** The block in the clamps, or null. */
    Block clamped() {
        return clamped;
    }

    /** The block in the clamps while the arm is between the lathe's spindles, else null. */
    Block presented() {
        return axis(AxisName.TRANSFER_ARM).standsAt(0) ? clamped : null;
    }

    /** The block in the centring spindles, or null. */
    Block centred() {
        return centred;
    }

    /** The block on the linear feeder, or null. */
    Block fed() {
        return fed;
    }

    /** The block on a step, counted from 0, or null. */
    Block onStep(int step) {
        return steps[step];
    }

    /** True if a sensor, counted from 0, detects a block. */
    boolean sensor(int index) {
        return switch (index) {
            case 0, 1, 2, 3 -> steps[index] != null;
            case 4 -> fed != null;
            case 5 -> centred != null;
            case 6 -> clamped != null;
            case 7 -> waiting != null;
            default -> false;
        };
    }

    /** The distance that the sensor above an end measures down to the block, in millimetres. */
    double distance(boolean left) {
        boolean below = fed != null && axis(AxisName.LINEAR_FEEDER).standsAt(0);
        return SENSOR_HEIGHT - (below ? fed.lyingTop(left) : 0);
    }

    /** Sets obstacles for the axes; call it before they move. */
    void obstruct() {
        boolean offered = fed != null && axis(AxisName.LINEAR_FEEDER).standsAt(0);
        axis(AxisName.CENTRING_SPINDLE_LEFT).meets(centred != null || offered && tipHits(true) ? Block.HALF : 0);
        axis(AxisName.CENTRING_SPINDLE_RIGHT).meets(centred != null || offered && tipHits(false) ? Block.HALF : 0);
        double jaw = clamped != null || centred != null && atTransfer() ? Block.HALF : 0;
        axis(AxisName.TRANSFER_CLAMP_LEFT).meets(jaw);
        axis(AxisName.TRANSFER_CLAMP_RIGHT).meets(jaw);
    }

    /** Moves the blocks; call it after the axes have moved. */
    void step(long nanos, Block onLathe) {
        gate(nanos);
        stroke();
        centre();
        clamp(onLathe);
    }

    private void gate(long nanos) {
        boolean open = axis(AxisName.CHARGER_GATE).position() > GATE_OPEN;
        boolean free = steps[0] == null && axis(AxisName.STEP_FEEDER).position() < DOWN;
        if (rolling > 0) {
            rolling -= nanos;
            if (rolling <= 0) {
                steps[0] = waiting;
                waiting = next();
            }
        } else if (open && free && waiting != null) {
            rolling = ROLL_NANOS;
        }
    }

    private void stroke() {
        Axis feeder = axis(AxisName.STEP_FEEDER);
        if (feeder.position() < DOWN) {
            stroked = false;
        } else if (!stroked && feeder.standsAt(STROKE)) {
            stroked = true;
            if (steps[STEPS - 1] != null) {
                if (fed != null || !axis(AxisName.LINEAR_FEEDER).standsAt(BESIDE_STEPS)) {
                    mishaps.add("the step feeder pushed block " + steps[STEPS - 1].number()
                            + " down beside the linear feeder");
                } else {
                    fed = steps[STEPS - 1];
                }
            }
            System.arraycopy(steps, 0, steps, 1, STEPS - 1);
            steps[0] = null;
        }
    }

    /** The horizontal position of a tip, relative to the axis of the block on the linear feeder. */
    private double tipX(boolean left) {
        Axis x = axis(left ? AxisName.CENTRING_X_LEFT : AxisName.CENTRING_X_RIGHT);
        return x.position() - OVER_FEEDER - fed.lyingAside(left);
    }

    /** The vertical position of a tip, relative to the same axis. */
    private double tipY(boolean left) {
        Axis y = axis(left ? AxisName.CENTRING_Y_LEFT : AxisName.CENTRING_Y_RIGHT);
        return y.position() - fed.lyingHeight(left);
    }

    private boolean tipHits(boolean left) {
        return fed.isHitAt(left, tipX(left), tipY(left));
    }

    private void centre() {
        Axis left = axis(AxisName.CENTRING_SPINDLE_LEFT);
        Axis right = axis(AxisName.CENTRING_SPINDLE_RIGHT);
        if (centred == null && fed != null && left.presses() && right.presses()) {
            fed.holdAt(true, tipX(true), tipY(true));
            fed.holdAt(false, tipX(false), tipY(false));
            centred = fed;
            fed = null;
        } else if (centred != null && away(left, right)) {
            if (centred != clamped) {
                mishaps.add("the centring spindles let block " + centred.number() + " fall");
            }
            centred = null;
        }
    }

    /** True if at least one of a pair has released. */
    static boolean away(Axis left, Axis right) {
        return Math.max(left.position(), right.position()) > Block.HALF + BITE;
    }

    private boolean atTransfer() {
        return axis(AxisName.TRANSFER_ARM).standsAt(ARM_AT_SPINDLES) && transferX(true) <= NEAR
                && transferX(false) <= NEAR && Math.abs(transferY(true)) <= NEAR && Math.abs(transferY(false)) <= NEAR;
    }

    private double transferX(boolean left) {
        return axis(left ? AxisName.CENTRING_X_LEFT : AxisName.CENTRING_X_RIGHT).position();
    }

    private double transferY(boolean left) {
        return axis(left ? AxisName.CENTRING_Y_LEFT : AxisName.CENTRING_Y_RIGHT).position() - TRANSFER_HEIGHT;
    }

    private void clamp(Block onLathe) {
        Axis left = axis(AxisName.TRANSFER_CLAMP_LEFT);
        Axis right = axis(AxisName.TRANSFER_CLAMP_RIGHT);
        if (clamped == null && centred != null && left.presses() && right.presses()) {
            clamped = centred;
            // The arm brings the transfer place, not the tips, to the lathe's axis.
            clamped.shift(true, -transferX(true), -transferY(true));
            clamped.shift(false, -transferX(false), -transferY(false));
        } else if (clamped != null && away(left, right)) {
            if (clamped != centred && clamped != onLathe) {
                mishaps.add("the clamps let block " + clamped.number() + " fall");
            }
            clamped = null;
        } else if (clamped != null && centred != null && clamped != centred && atTransfer()) {
            mishaps.add("block " + centred.number() + " in the centring spindles ran into block " + clamped.number()
                    + " in the clamps");
            centred = null;
        } else if (clamped != null && clamped == centred
                && axis(AxisName.TRANSFER_ARM).position() < ARM_AT_SPINDLES - NEAR) {
            mishaps.add("the transfer arm tore block " + clamped.number() + " from the centring spindles");
            centred = null;
        }
    }
}
