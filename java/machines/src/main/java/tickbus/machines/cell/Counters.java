package tickbus.machines.cell;

/** The counted events of the cell. */
public final class Counters {
    /** The time that the cell has been simulated. */
    long nanos;
    int begun;
    int fallen;
    int wasted;
    int collisions;
    int vacuumLosses;
    int loaderJams;
    int palletJams;
    int carriersMissed;

    Counters() {
    }

    /** Sleeves that came out of the magazine. */
    public int begun() {
        return begun;
    }

    /** Pieces that fell without support. */
    public int fallen() {
        return fallen;
    }

    /** Parts that were pressed into an empty place. */
    public int wasted() {
        return wasted;
    }

    /** Steps in which an arm was moved to the side while it was not up. */
    public int collisions() {
        return collisions;
    }

    /** How often the vacuum was lost. */
    public int vacuumLosses() {
        return vacuumLosses;
    }

    /** How often the loader jammed and got free again. */
    public int loaderJams() {
        return loaderJams;
    }

    /** How often a pallet jammed and got free again. */
    public int palletJams() {
        return palletJams;
    }

    /** How often head 1 missed a carrier and was drawn back. */
    public int carriersMissed() {
        return carriersMissed;
    }
}
