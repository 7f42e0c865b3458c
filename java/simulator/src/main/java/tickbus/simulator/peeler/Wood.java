package tickbus.simulator.peeler;

/**
 * Where the wood went, in cubic millimetres: nothing is lost on the way from the block to veneer, waste and core.
 */
final class Wood {
    private static final double MM3_PER_M3 = 1e9;
    private static final double MM_PER_M = 1e3;

    private double chucked;
    private double veneer;
    private double torn;
    private double chipped;
    private double cores;
    private double unpeeled;
    private double ribbon;
    private int blocks;
    private int coreCount;
    private int unpeeledCount;

    void chuck(double volume) {
        blocks++;
        chucked += volume;
    }

    /** A piece of a whole ribbon goes to the belt. */
    void veneer(double volume, double length) {
        veneer += volume;
        ribbon += length;
    }

    /** A piece that is no ribbon goes to the belt. */
    void torn(double volume) {
        torn += volume;
    }

    void chip(double volume) {
        chipped += volume;
    }

    void core(double volume) {
        coreCount++;
        cores += volume;
    }

    void drop(double volume) {
        unpeeledCount++;
        unpeeled += volume;
    }

    /** Blocks that the lathe took. */
    int blocks() {
        return blocks;
    }

    /** Blocks that were peeled down to their cores. */
    int coreCount() {
        return coreCount;
    }

    /** Blocks that fell before that. */
    int unpeeledCount() {
        return unpeeledCount;
    }

    /** Metres of whole ribbon on the belt. */
    double ribbon() {
        return ribbon / MM_PER_M;
    }

    /** All that was ever between the lathe's spindles, in cubic metres, as the others. */
    double chucked() {
        return chucked / MM3_PER_M3;
    }

    double veneer() {
        return veneer / MM3_PER_M3;
    }

    double torn() {
        return torn / MM3_PER_M3;
    }

    double chipped() {
        return chipped / MM3_PER_M3;
    }

    double cores() {
        return cores / MM3_PER_M3;
    }

    double unpeeled() {
        return unpeeled / MM3_PER_M3;
    }
}
