package tickbus.machines.cell;

/** A pallet on the transport: a code carrier, and perhaps a piece. */
public final class Pallet {
    private final int number;
    private final CodeCarrier carrier = new CodeCarrier();
    /** The position on the loop, in micrometres from stop 1. */
    long micrometres;
    Workpiece piece;

    Pallet(int number, long micrometres) {
        this.number = number;
        this.micrometres = micrometres;
    }

    /** The pallet's number, from 1. */
    public int number() {
        return number;
    }

    /** The pallet's code carrier. */
    public CodeCarrier carrier() {
        return carrier;
    }

    /** The piece on it, or null. */
    public Workpiece piece() {
        return piece;
    }
}
