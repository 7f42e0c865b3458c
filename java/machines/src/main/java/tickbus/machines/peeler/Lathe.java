package tickbus.machines.peeler;

/**
 * The lathe: spindles that hold a block and turn it, a knife that advances by one thickness of veneer with each
 * revolution, rolls that support the block, gates for the veneer, and a flap through which the core falls.
 */
final class Lathe {
    /** Cutting force, in newtons per square millimetre of wood cut at once. */
    private static final double CUTTING_FORCE = 3;

    /** Torque that the spindles transmit without slipping, in newton metres per percent of pressure. */
    private static final double GRIP = 60;

    private static final double MM_PER_M = 1000;

    /** A thicker cut, in millimetres, means that the knife was driven into the wood. */
    private static final double THICKEST = 10;

    /** The largest radius of a core, in millimetres. */
    private static final double CORE = 45;

    private static final double FLAP_OPEN = 50;
    private static final double GATE_CLOSED = 10;

    /** Diameter of the rolls, in millimetres. */
    private static final double ROLL_DIAMETER = 120;

    /** The knife's pitch angle in degrees at the axis, and its increase per millimetre of distance. */
    private static final double PITCH_AT_AXIS = -1;

    private static final double PITCH_SLOPE = 0.02;

    private final Axes axes;
    private final Mishaps mishaps;
    private final Wood wood = new Wood();
    private Peeling held;
    private Block dropped;
    private double rotationBefore;
    private double knifeBefore;
    private double surfaceSpeed;
    private boolean scolded;

    Lathe(Axes axes, Mishaps mishaps) {
        this.axes = axes;
        this.mishaps = mishaps;
    }

    private Axis axis(AxisName name) {
        return axes.get(name);
    }

    /** The block that the spindles hold, or null. */
    Peeling held() {
        return held;
    }

    /** The block between the spindles, or null. */
    Block block() {
        return held == null ? null : held.block();
    }

    Wood wood() {
        return wood;
    }

    /** The speed of the block's surface in front of the knife, in millimetres per second. */
    double surfaceSpeed() {
        return surfaceSpeed;
    }

    /** Sets obstacles for the axes; call it before they move. */
    void obstruct(Block presented) {
        double tip = held != null || presented != null ? Block.HALF : 0;
        axis(AxisName.SPINDLE_LEFT).meets(tip);
        axis(AxisName.SPINDLE_RIGHT).meets(tip);
        rotationBefore = axis(AxisName.SPINDLE_ROTATION).position();
        knifeBefore = axis(AxisName.KNIFE_CARRIAGE).position();
    }

    /** Turns and cuts; call it after the axes have moved. */
    void step(long nanos, Block presented, Block clamped) {
        double revolutions = axis(AxisName.SPINDLE_ROTATION).position() - rotationBefore;
        track(revolutions, nanos);
        hold(presented, clamped);
        if (held != null) {
            peel(revolutions, clamped);
        }
        flap();
    }

    private void track(double revolutions, long nanos) {
        Axis knife = axis(AxisName.KNIFE_CARRIAGE);
        if (knife.tracks()) {
            knife.trackTo(knife.position() - knife.torque() * Math.max(0, revolutions), nanos);
        }
        for (int i = 0; i < AxisName.ROLLS.size(); i++) {
            Axis axis = axis(AxisName.ROLLS.get(i));
            if (axis.tracks()) {
                axis.trackTo(knife.position() + axis.offset(), nanos);
            }
        }
        Axis pitch = axis(AxisName.PITCH_ANGLE);
        if (pitch.tracks()) {
            pitch.trackTo(PITCH_AT_AXIS + PITCH_SLOPE * knife.position() + pitch.offset(), nanos);
        }
        surfaceSpeed = held == null ? 0
                : 2 * Math.PI * held.surface() * axis(AxisName.SPINDLE_ROTATION).velocity();
        Axis rotation = axis(AxisName.ROLL_ROTATION);
        if (rotation.tracks()) {
            rotation.trackAt(surfaceSpeed / (Math.PI * ROLL_DIAMETER) * (1 + rotation.torque() / 100), nanos);
        }
    }

    private void hold(Block presented, Block clamped) {
        Axis left = axis(AxisName.SPINDLE_LEFT);
        Axis right = axis(AxisName.SPINDLE_RIGHT);
        if (held == null && presented != null && left.presses() && right.presses()) {
            held = new Peeling(presented, wood);
            scolded = false;
        } else if (held != null && Charger.away(left, right)) {
            drop(clamped);
        }
    }

    private void drop(Block clamped) {
        Peeling gone = held;
        held = null;
        if (gone.reach() <= CORE) {
            wood.core(gone.volume());
        } else {
            wood.drop(gone.volume());
        }
        if (gone.block() == clamped) {
            return;
        }
        if (dropped != null) {
            mishaps.add("block " + gone.block().number() + " fell onto the core of block " + dropped.number()
                    + ", because the core drop was never opened");
        }
        dropped = gone.block();
    }

    private void flap() {
        if (axis(AxisName.CORE_DROP).position() > FLAP_OPEN) {
            dropped = null;
        }
    }

    private void peel(double revolutions, Block clamped) {
        Axis knife = axis(AxisName.KNIFE_CARRIAGE);
        Block block = held.block();
        if (revolutions != 0 && block == clamped) {
            scold("the spindles turned block " + block.number() + " while the clamps held it");
            return;
        }
        if (revolutions == 0) {
            if (knife.position() < knifeBefore && knife.position() < held.front() - 1) {
                knife.blame(AxisError.KNIFE_HIT);
                scold("the knife ran into block " + block.number() + ", which stood still");
            }
            return;
        }
        double belt = axis(AxisName.VENEER_GATE).position();
        double chipper = axis(AxisName.ROUND_UP_GATE).position();
        held.turn(revolutions, knifeBefore, knife.position(), knife.torque(), belt > chipper);
        if (held.thickest() > THICKEST) {
            scold("the knife was driven into block " + block.number());
        }
        if (held.thickest() > 0 && Math.max(belt, chipper) < GATE_CLOSED) {
            scold("what came off block " + block.number() + " had nowhere to go: both gates were closed");
        }
        double grip = GRIP * Math.min(axis(AxisName.SPINDLE_LEFT).pressure(), axis(AxisName.SPINDLE_RIGHT).pressure());
        if (held.load() * CUTTING_FORCE * knife.position() / MM_PER_M > grip) {
            axis(AxisName.SPINDLE_ROTATION).blame(AxisError.SPIN_OUT);
            scold("spin-out: the spindles slipped in block " + block.number() + ", which they held too loosely");
        }
    }

    /** Reports one mishap per block; later ones are its consequences. */
    private void scold(String what) {
        if (!scolded) {
            scolded = true;
            mishaps.add(what);
        }
    }
}
