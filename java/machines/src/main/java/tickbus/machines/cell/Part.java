package tickbus.machines.cell;

/** The contents in a pallet's record, in the record's order. */
public enum Part {
    /** The tube of the cylinder. */
    SLEEVE,
    /** The piston in it. */
    PISTON,
    /** The spring behind the piston. */
    SPRING,
    /** The cylinder's head, which closes it. */
    HEAD,
    /** The coloured cap. */
    CAP,
    /** The piece itself: on if the pallet carries one. */
    PIECE;

    /** The part's bit in {@code Head n contents}. */
    public int bit() {
        return 1 << ordinal();
    }
}
