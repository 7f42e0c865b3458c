package tickbus.machines.cell;

import java.util.ArrayList;
import java.util.List;

/**
 * A belt in a loop that carries pallets past four stops; at stop 2 no station is on the bus, and pallets only wait. Running
 * back, the belt moves the pallets between stops; pallets at a stop are clamped.
 */
public final class Transport {
    static final int STOPS = 4;

    /** Lengths in micrometres, so that a pallet can be exactly at its stop. */
    private static final long LOOP = 2_000_000;
    private static final long SECTION = LOOP / STOPS;
    /** 1.25 m/s. */
    private static final long NANOS_PER_MICROMETRE = 800;
    private static final long SENSOR = 15_000;
    private static final long PALLET = 150_000;
    private static final long FIRST = 100_000;
    private static final long FREEING_NANOS = 100_000_000;

    private final List<Pallet> pallets = new ArrayList<>();
    private boolean willJam;
    private Pallet jammed;
    private long freedNanos;
    boolean forward;
    boolean backward;
    final boolean[] open = new boolean[STOPS];

    /** Pallets on their way to stops 1, 3 and 4. */
    Transport() {
        for (int stop : new int[] {0, 2, 3}) {
            pallets.add(new Pallet(pallets.size() + 1, (stop * SECTION + LOOP - FIRST) % LOOP));
        }
    }

    /** The pallets. */
    public List<Pallet> pallets() {
        return List.copyOf(pallets);
    }

    /** The pallet at a stop, 1 to 4, or null. */
    public Pallet at(int stop) {
        for (int i = 0; i < pallets.size(); i++) {
            Pallet pallet = pallets.get(i);
            if (between((stop - 1) * SECTION, pallet.micrometres) < SENSOR) {
                return pallet;
            }
        }
        return null;
    }

    /**
     * Makes the next pallet that passes the middle between two stops stick, until the belt has run back a little; one at a
     * time.
     */
    void jam() {
        willJam = true;
    }

    /** Frees the pallet, and lets the next ones pass. */
    void jamsNoMore() {
        willJam = false;
        jammed = null;
    }

    boolean isJammed() {
        return jammed != null;
    }

    void step(long nanos) {
        if (jammed != null) {
            freedNanos = backward && !forward ? freedNanos + nanos : 0;
            if (freedNanos >= FREEING_NANOS) {
                jammed = null;
            }
        }
        if (forward == backward) {
            return;
        }
        long way = nanos / NANOS_PER_MICROMETRE;
        for (int i = 0; i < pallets.size(); i++) {
            Pallet pallet = pallets.get(i);
            if (pallet != jammed) {
                if (forward) {
                    advance(pallet, way);
                } else {
                    goBack(pallet, way);
                }
            }
        }
    }

    private void advance(Pallet pallet, long way) {
        int section = (int) (pallet.micrometres / SECTION);
        long inSection = pallet.micrometres % SECTION;
        long most = way;
        if (inSection == 0 && !open[section]) {
            return;
        }
        if (inSection > 0) {
            most = Math.min(most, SECTION - inSection);
        }
        for (int i = 0; i < pallets.size(); i++) {
            long ahead = between(pallet.micrometres, pallets.get(i).micrometres);
            if (pallets.get(i) != pallet) {
                most = Math.min(most, Math.max(0, ahead - PALLET));
            }
        }
        pallet.micrometres = (pallet.micrometres + most) % LOOP;
        long middle = SECTION / 2;
        if (willJam && jammed == null && inSection < middle && inSection + most >= middle) {
            willJam = false;
            jammed = pallet;
        }
    }

    /** The way along the belt. */
    private static long between(long from, long to) {
        return (to - from + LOOP) % LOOP;
    }

    private void goBack(Pallet pallet, long way) {
        long most = Math.min(way, pallet.micrometres % SECTION - SENSOR);
        for (int i = 0; i < pallets.size(); i++) {
            if (pallets.get(i) != pallet) {
                most = Math.min(most, between(pallets.get(i).micrometres, pallet.micrometres) - PALLET);
            }
        }
        pallet.micrometres -= Math.max(0, most);
    }
}
