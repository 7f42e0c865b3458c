package tickbus.machines.rig;

/**
 * A bottle in the rig.
 *
 * <p>The rig reuses a fixed set of bottles, so that motion allocates nothing: read a bottle between two steps and do not
 * keep it.
 */
public final class Bottle {
    /** The carriers of a bottle. */
    public enum Place {
        /** No carrier: the bottle is not in the rig. */
        AWAY,
        /** A pocket of index wheel 1. */
        POCKET,
        /** The suction cup of lift 1. */
        CUP1,
        /** A sleeve of the chamber wheel. */
        SLEEVE,
        /** The suction cup of lift 2. */
        CUP2,
        /** Wedged in the guide of lift 1, released by its cup. */
        STUCK1,
        /** Wedged in the guide of lift 2, released by its cup. */
        STUCK2
    }

    private int id;
    private Place place = Place.AWAY;
    private int slot;
    private double height;
    private boolean treated;
    private boolean back;

    Bottle() {}

    /**
     * The bottle's number.
     *
     * @return 1 for the first bottle ever fed
     */
    public int id() {
        return id;
    }

    /**
     * The bottle's carrier.
     *
     * @return the place
     */
    public Place place() {
        return place;
    }

    /**
     * The number of the pocket (0 to 3) or sleeve (0 or 1) that carries the bottle.
     *
     * @return the number; 0 in other places
     */
    public int slot() {
        return slot;
    }

    /**
     * Height of the bottle's base above the pockets' floor.
     *
     * @return millimetres
     */
    public double height() {
        return height;
    }

    /**
     * Returns whether the bottle has been at the lamp.
     *
     * @return true once it has been there
     */
    public boolean treated() {
        return treated;
    }

    /** Numbers a new bottle. */
    void number(int newId) {
        id = newId;
        treated = false;
        back = false;
    }

    void put(Place newPlace, int newSlot, double newHeight) {
        place = newPlace;
        slot = newSlot;
        height = newHeight;
    }

    void raise(double newHeight) {
        height = newHeight;
    }

    void treat() {
        treated = true;
    }

    /** The bottle is in a pocket again; returns whether it was treated, the first time only. */
    boolean comesBack() {
        boolean first = treated && !back;
        back |= first;
        return first;
    }
}
