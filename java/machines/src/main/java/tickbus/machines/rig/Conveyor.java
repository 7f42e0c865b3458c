package tickbus.machines.rig;

import java.util.ArrayList;
import java.util.Comparator;
import java.util.List;

/**
 * The flow of bottles through index wheel 1: the infeed gives a new bottle to an empty pocket at rest there, and the
 * outfeed's rail takes treated bottles off the wheel as they reach it.
 */
final class Conveyor {
    /** The total capacity of pockets, sleeves and cups. */
    private static final int MOST = 8;

    /** The rail begins here, and ends where no pocket can pass it within one step. */
    private static final double RAIL_BEGIN = Geometry.OUTFEED - Geometry.ALIGNED;
    private static final double RAIL_END = Geometry.OUTFEED + 30.0;

    private final Slots pockets;
    private final Bottle[] bottles = new Bottle[MOST];
    private int fed;
    private long delivered;
    private boolean dry;

    Conveyor(Slots pockets) {
        this.pockets = pockets;
        for (int i = 0; i < MOST; i++) {
            bottles[i] = new Bottle();
        }
    }

    /** Sets whether the infeed has no bottles. */
    void dry(boolean on) {
        dry = on;
    }

    void work() {
        for (int i = 0; i < pockets.count(); i++) {
            Bottle bottle = pockets.bottle(i);
            if (bottle != null && bottle.treated()) {
                double station = pockets.station(i);
                if (station >= RAIL_BEGIN && station <= RAIL_END) {
                    away(pockets.take(i));
                    delivered++;
                }
            }
        }
        if (!dry && !pockets.wheel().moving()) {
            int slot = pockets.at(Geometry.INFEED);
            if (slot >= 0 && pockets.bottle(slot) == null) {
                Bottle bottle = spare();
                bottle.number(++fed);
                pockets.hold(slot, bottle);
            }
        }
    }

    /** A bottle leaves the rig. */
    void away(Bottle bottle) {
        bottle.put(Bottle.Place.AWAY, 0, 0);
    }

    List<Bottle> present() {
        List<Bottle> present = new ArrayList<>();
        for (Bottle bottle : bottles) {
            if (bottle.place() != Bottle.Place.AWAY) {
                present.add(bottle);
            }
        }
        present.sort(Comparator.comparingInt(Bottle::id));
        return present;
    }

    long fed() {
        return fed;
    }

    long delivered() {
        return delivered;
    }

    private Bottle spare() {
        for (Bottle bottle : bottles) {
            if (bottle.place() == Bottle.Place.AWAY) {
                return bottle;
            }
        }
        throw new IllegalStateException("more bottles than pockets, sleeves and cups can carry");
    }
}
