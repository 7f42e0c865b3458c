package tickbus.demo.cell;

/** What a pallet's record says of its contents, in its order. */
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
    /** Whether there is a piece at all. */
    PIECE;

    /** Its bit in {@code Head n contents}. */
    public int bit() {
        return 1 << ordinal();
    }
}
