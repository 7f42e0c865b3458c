package tickbus.machines.cell;

import java.util.ArrayDeque;
import java.util.Queue;

/**
 * Station 1: a loader pushes a sleeve out of a magazine on a belt, and sensors at the belt's back end detect its material.
 * At the front end an arm takes the sleeve and puts it on the pallet at stop 1, where a cylinder holds head 1.
 */
final class StationOne {
    private static final long BELT_NANOS = 250_000_000;

    private final Counters counters;
    private final Queue<Colour> magazine = new ArrayDeque<>();
    final PneumaticCylinder loader = new PneumaticCylinder(100_000_000);
    final PneumaticCylinder arm = new PneumaticCylinder(120_000_000);
    final PneumaticCylinder lift = new PneumaticCylinder(70_000_000);
    final PneumaticCylinder reader = new PneumaticCylinder(80_000_000);
    final PneumaticCylinder fingers = new PneumaticCylinder(40_000_000);
    final ReadWriteHead head = new ReadWriteHead();
    private Workpiece onBelt;
    private long beltNanos;
    private Workpiece held;
    private boolean loaded;
    private boolean optical;
    private boolean willMiss;
    private boolean askew;
    boolean beltForward;
    boolean beltBackward;
    boolean armOut;
    boolean armIn;
    boolean armLower;
    boolean loaderValve;
    boolean gripper;
    boolean readerValve;

    StationOne(Counters counters) {
        this.counters = counters;
    }

    void fill(Colour sleeve) {
        magazine.add(sleeve);
    }

    int sleeves() {
        return magazine.size();
    }

    void step(Pallet pallet, long nanos) {
        loader.step(loaderValve, nanos);
        if (loader.isForward() && !loaded && onBelt == null && !magazine.isEmpty()) {
            onBelt = new Workpiece(++counters.begun, magazine.remove(), counters.nanos);
            beltNanos = 0;
            loaded = true;
        }
        loaded &= !loader.isBack();
        if (beltForward != beltBackward) {
            beltNanos = Math.max(0, Math.min(beltNanos + (beltForward ? nanos : -nanos), BELT_NANOS));
        }
        if (!lift.isBack() && (armOut && !arm.isForward() || armIn && !arm.isBack())) {
            counters.collisions++;
        }
        arm.step(armOut, armIn, nanos);
        lift.step(armLower, nanos);
        boolean wereClosed = fingers.isForward();
        fingers.step(gripper, nanos);
        if (fingers.isForward() && !wereClosed && held == null && lift.isForward() && arm.isBack() && isAtFront()) {
            held = onBelt;
            onBelt = null;
        } else if (held != null && !fingers.isForward()) {
            if (lift.isForward() && arm.isForward() && pallet != null && pallet.piece == null) {
                pallet.piece = held;
            } else if (lift.isForward() && arm.isBack() && onBelt == null) {
                onBelt = held;
                beltNanos = BELT_NANOS;
            } else {
                counters.fallen++;
            }
            held = null;
        }
        reader.step(readerValve, nanos);
        optical = pallet != null;
        askew |= willMiss && reader.isForward();
        willMiss &= !askew;
        if (askew && reader.isBack()) {
            askew = false;
            counters.carriersMissed++;
        }
        head.step(pallet != null && reader.isForward() && !askew ? pallet.carrier() : null);
    }

    boolean isAtBack() {
        return onBelt != null && beltNanos == 0;
    }

    boolean isAtFront() {
        return onBelt != null && beltNanos == BELT_NANOS;
    }

    /** True if a sleeve keeps the gripper's fingers apart. */
    boolean isHolding() {
        return held != null;
    }

    /** True if the sleeve at the belt's back end has at least this colour, so that the sensor for it responds. */
    boolean sees(Colour least) {
        return isAtBack() && onBelt.colour().compareTo(least) >= 0;
    }

    /** Makes the head miss the carrier the next time that its cylinder comes forward, until it has been back. */
    void missCarrier() {
        willMiss = true;
    }

    /** Lets the head meet the carriers again. */
    void missesNoCarrier() {
        willMiss = false;
        askew = false;
    }

    boolean seesPallet() {
        return optical;
    }
}
