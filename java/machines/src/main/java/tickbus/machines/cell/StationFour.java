package tickbus.machines.cell;

import java.util.ArrayList;
import java.util.List;

/**
 * Station 4: presses a cap on the piece at stop 4, and takes the piece to the exit with a vacuum gripper. If the vacuum
 * fails while the arm lifts the piece, the piece falls back on its pallet.
 */
final class StationFour {
    private static final long VACUUM_NANOS = 40_000_000;
    private static final long EXIT_NANOS = 150_000_000;

    private final Counters counters;
    private final List<Workpiece> delivered = new ArrayList<>();
    final Feeder caps = new Feeder();
    final PneumaticCylinder press = new PneumaticCylinder(100_000_000);
    final PneumaticCylinder arm = new PneumaticCylinder(120_000_000);
    final PneumaticCylinder lift = new PneumaticCylinder(80_000_000);
    final ReadWriteHead head = new ReadWriteHead();
    private boolean capReady;
    private Workpiece held;
    private long vacuumNanos;
    private long exitNanos;
    private boolean willLose;
    boolean pressValve;
    /** The gauge beside the press sees a cap on the piece at the stop. */
    boolean capped;
    boolean armOut;
    boolean armIn;
    boolean armLower;
    boolean vacuumValve;

    StationFour(Counters counters) {
        this.counters = counters;
    }

    void loseVacuum() {
        willLose = true;
    }

    void keepsVacuum() {
        willLose = false;
    }

    List<Workpiece> delivered() {
        return delivered;
    }

    void step(Pallet pallet, long nanos) {
        boolean below = capReady;
        boolean comes = caps.step(nanos);
        if (below && comes) {
            counters.wasted++;
        }
        capReady |= comes;
        boolean wasDown = press.isForward();
        press.step(pressValve, nanos);
        if (press.isForward() && !wasDown && capReady) {
            capReady = false;
            if (pallet == null || pallet.piece == null || pallet.piece.has(Part.CAP)) {
                counters.wasted++;
            } else {
                pallet.piece.add(Part.CAP);
            }
        }
        if (!lift.isBack() && (armOut && !arm.isForward() || armIn && !arm.isBack())) {
            counters.collisions++;
        }
        arm.step(armOut, armIn, nanos);
        lift.step(armLower, nanos);
        suck(pallet, nanos);
        exitNanos = Math.max(0, exitNanos - nanos);
        capped = pallet != null && pallet.piece != null && pallet.piece.has(Part.CAP);
        head.step(pallet == null ? null : pallet.carrier());
    }

    private void suck(Pallet pallet, long nanos) {
        boolean onPiece = lift.isForward() && arm.isBack() && pallet != null && pallet.piece != null;
        vacuumNanos = vacuumValve && onPiece ? vacuumNanos + nanos : 0;
        if (held == null && vacuumNanos >= VACUUM_NANOS) {
            held = pallet.piece;
            pallet.piece = null;
        }
        boolean loses = willLose && held != null && arm.isBack() && !lift.isForward() && !lift.isBack();
        if (held != null && (!vacuumValve || loses)) {
            if (loses) {
                willLose = false;
                counters.vacuumLosses++;
            }
            if (arm.isBack() && pallet != null) {
                pallet.piece = held;
            } else if (arm.isForward() && lift.isForward()) {
                held.deliver(counters.nanos);
                delivered.add(held);
                exitNanos = EXIT_NANOS;
            } else {
                counters.fallen++;
            }
            held = null;
        }
    }

    boolean hasVacuum() {
        return held != null;
    }

    boolean seesExit() {
        return exitNanos > 0;
    }
}
