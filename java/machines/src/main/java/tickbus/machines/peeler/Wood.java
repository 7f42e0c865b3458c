package tickbus.machines.peeler;

/**
 * The balance of wood, in cubic millimetres: nothing is lost between the block and veneer, waste and core.
 */
public final class Wood {
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

    /** A piece of a continuous ribbon goes to the belt. */
    void veneer(double volume, double length) {
        veneer += volume;
        ribbon += length;
    }

    /** A piece that is not a ribbon goes to the belt. */
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

    /**
     * The number of blocks that the lathe took.
     *
     * @return a count
     */
    public int blocks() {
        return blocks;
    }

    /**
     * The number of blocks that were peeled down to their cores.
     *
     * @return a count
     */
    public int coreCount() {
        return coreCount;
    }

    /**
     * The number of blocks that fell before that.
     *
     * @return a count
     */
    public int unpeeledCount() {
        return unpeeledCount;
    }

    /**
     * Continuous ribbon on the veneer belt.
     *
     * @return metres
     */
    public double ribbon() {
        return ribbon / MM_PER_M;
    }

    /**
     * All wood that was ever between the lathe's spindles.
     *
     * @return cubic metres
     */
    public double chucked() {
        return chucked / MM3_PER_M3;
    }

    /**
     * The part of that wood that is continuous ribbon on the veneer belt.
     *
     * @return cubic metres
     */
    public double veneer() {
        return veneer / MM3_PER_M3;
    }

    /**
     * The part of that wood that is torn or short pieces on the veneer belt.
     *
     * @return cubic metres
     */
    public double torn() {
        return torn / MM3_PER_M3;
    }

    /**
     * The part of that wood that went into the chipper.
     *
     * @return cubic metres
     */
    public double chipped() {
        return chipped / MM3_PER_M3;
    }

    /**
     * The part of that wood that is cores.
     *
     * @return cubic metres
     */
    public double cores() {
        return cores / MM3_PER_M3;
    }

    /**
     * The part of that wood that fell in blocks before they were peeled.
     *
     * @return cubic metres
     */
    public double unpeeled() {
        return unpeeled / MM3_PER_M3;
    }
}
