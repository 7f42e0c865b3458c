package tickbus.machines.cell;

import java.util.ArrayList;
import java.util.Collections;
import java.util.List;
import java.util.Locale;
import java.util.Random;
import tickbus.machines.demo.Timeline;

/** Fills magazines, turns the switch, provokes mishaps, and logs events. */
final class CellOperator {
    /** The number of cylinders that are out when each mishap is provoked; at least one more is made after it. */
    private static final int CARRIER_IS_MISSED_AFTER = 1;
    private static final int LOADER_JAMS_AFTER = 2;
    private static final int PALLET_JAMS_AFTER = 4;
    private static final int VACUUM_IS_LOST_AFTER = 6;
    private static final int EMERGENCY_AFTER = 8;
    private static final int CONTROL_ENDS_AFTER = 10;
    /** How long the emergency stop is pressed. */
    private static final long EMERGENCY_NANOS = 1_000_000_000;
    /** The first filling of station 3's magazine, which is too small, and how long the operator then lets it wait. */
    private static final int FIRST_PARTS = 7;
    private static final long WALK_NANOS = 500_000_000;
    private static final long SEED = 12;
    /** When, in a later round, the operator presses Rearm after station 1 found its magazine empty, and for how long. */
    private static final long REARM_AFTER_NANOS = 1_000_000_000;
    private static final long PRESS_NANOS = 200_000_000;

    private final ManufacturingCell cell;
    private final Timeline timeline;
    private final int cylinders;
    private final boolean restartable;
    private int delivered;
    private int mishaps;
    private int refills;
    private long emptySince = -1;
    private boolean begun;
    private boolean jammed;
    /** Earlier rounds, and the refills in them. */
    private int rounds;
    private int refillsBefore;
    private long rearmAt = Long.MAX_VALUE;
    private boolean refillRearms;
    private long releaseAt = Long.MAX_VALUE;
    private int emergencies;
    private int restarts;
    private boolean restartWanted;

    /**
     * An operator.
     *
     * @param restartable true if the control can be killed and started again
     */
    CellOperator(ManufacturingCell cell, Timeline timeline, int cylinders, boolean restartable) {
        this.restartable = restartable;
        this.cell = cell;
        this.timeline = timeline;
        this.cylinders = cylinders;
    }

    /** The number of provoked mishaps, including the empty magazine. */
    int mishaps() {
        return mishaps;
    }

    int refills() {
        return refills;
    }

    int emergencies() {
        return emergencies;
    }

    int restarts() {
        return restarts;
    }

    /** True once each time that the operator wants the control killed and started again. */
    boolean wantsRestart() {
        boolean wanted = restartWanted;
        restartWanted = false;
        return wanted;
    }

    boolean done() {
        return cell.delivered().size() >= ordered();
    }

    /** The number of cylinders at which the operator is {@link #done}. */
    int ordered() {
        return (rounds + 1) * cylinders;
    }

    /** Orders the same number of cylinders again, with the same mishaps. */
    void again() {
        rounds++;
        refillsBefore = refills;
        begun = false;
    }

    /** Acts before each tick. */
    void act(long nanos) {
        if (!begun) {
            begun = true;
            begin(nanos);
        }
        release(nanos);
        rearm(nanos);
        List<Workpiece> out = cell.delivered();
        for (; delivered < out.size(); delivered++) {
            Workpiece piece = out.get(delivered);
            timeline.add(nanos, "exit", "cylinder " + piece.number() + ", " + PieceKind.of(piece).name().toLowerCase(Locale.ROOT)
                    .replace('_', ' '));
            mishapAfter(delivered + 1 - rounds * cylinders, nanos);
        }
        if (cell.isJammed() != jammed) {
            jammed = !jammed;
            timeline.add(nanos, "cell", jammed ? "something is stuck" : "it is free again");
        }
        refill(nanos);
        if (done()) {
            cell.start(false);
        }
    }

    private void begin(long nanos) {
        List<Colour> sleeves = new ArrayList<>();
        for (int i = 0; i < cylinders; i++) {
            sleeves.add(Colour.values()[i % Colour.values().length]);
        }
        Collections.shuffle(sleeves, new Random(SEED));
        cell.fillSleeves(sleeves);
        if (rounds == 0) {
            // Later rounds begin with the rest of the refill.
            cell.fillParts(FIRST_PARTS);
        } else {
            pressRearm(nanos + REARM_AFTER_NANOS, true);
        }
        cell.fillHeads(cylinders);
        cell.fillCaps(cylinders);
        cell.start(true);
        timeline.add(nanos, "operator", cylinders + " sleeves are in the magazine, and the cell is started");
    }

    private void rearm(long nanos) {
        if (rearmAt != Long.MAX_VALUE && nanos >= rearmAt + PRESS_NANOS) {
            cell.rearm(false);
            rearmAt = Long.MAX_VALUE;
            if (refillRearms) {
                refills++;
                refillsBefore++;
            }
        } else if (nanos >= rearmAt) {
            cell.rearm(true);
        } else if (rearmAt == Long.MAX_VALUE && cell.asksForRearm()) {
            timeline.add(nanos, "operator", "Rearm, for the control that begins");
            pressRearm(nanos + WALK_NANOS, false);
        }
    }

    private void pressRearm(long at, boolean refill) {
        rearmAt = at;
        refillRearms = refill;
    }

    private void release(long nanos) {
        if (nanos >= releaseAt) {
            releaseAt = Long.MAX_VALUE;
            cell.emergency(false);
            timeline.add(nanos, "operator", "the emergency stop is released; Rearm follows");
            pressRearm(nanos + WALK_NANOS, false);
        }
    }

    private void mishapAfter(int count, long nanos) {
        if (count == CARRIER_IS_MISSED_AFTER && count + 1 < cylinders) {
            mishap(nanos, "head 1 will miss a carrier", cell::missCarrier);
        } else if (count == LOADER_JAMS_AFTER && count + 1 < cylinders) {
            mishap(nanos, "the loader will jam", cell::jamLoader);
        } else if (count == PALLET_JAMS_AFTER && count + 1 < cylinders) {
            mishap(nanos, "a pallet will get stuck", cell::jamPallet);
        } else if (count == VACUUM_IS_LOST_AFTER && count + 1 < cylinders) {
            mishap(nanos, "station 4 will lose its vacuum", cell::loseVacuum);
        } else if (count == EMERGENCY_AFTER && count + 1 < cylinders) {
            emergencies++;
            cell.emergency(true);
            releaseAt = nanos + EMERGENCY_NANOS;
            timeline.add(nanos, "operator", "the emergency stop is pressed");
        } else if (restartable && count == CONTROL_ENDS_AFTER && count + 1 < cylinders) {
            restarts++;
            restartWanted = true;
        }
    }

    private void mishap(long nanos, String what, Runnable how) {
        how.run();
        mishaps++;
        timeline.add(nanos, "mishap", what);
    }

    private void refill(long nanos) {
        if (!cell.showsEmptyParts()) {
            emptySince = -1;
        } else if (emptySince < 0) {
            emptySince = nanos;
            timeline.add(nanos, "station 3", "its magazine is empty");
        } else if (refills == refillsBefore && nanos - emptySince >= WALK_NANOS) {
            refills++;
            cell.fillParts(cylinders);
            timeline.add(nanos, "operator", "the magazine is filled");
        }
    }
}
