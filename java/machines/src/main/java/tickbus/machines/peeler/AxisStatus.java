package tickbus.machines.peeler;

/** The bits of an axis's status word, from bit 0 on. */
enum AxisStatus {
    /** Enabled, and not failed. */
    READY,
    /** The speed is not 0. */
    MOVING,
    /** The same as the bit of that name. */
    IN_POSITION,
    /** At its lower end position. */
    LOW_END,
    /** At its upper end position. */
    HIGH_END,
    /** A speed command is carried out, or brakes. */
    JOGGING,
    /** A tracking command is carried out. */
    TRACKING,
    /** There is pressure for closing or opening. */
    PRESSURE,
    /** There is an obstacle in the axis's way. */
    MET,
    /** The last command was not carried out, or not completely: the error word says why. */
    REFUSED;

    int when(boolean so) {
        return so ? 1 << ordinal() : 0;
    }
}
