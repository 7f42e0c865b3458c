package tickbus.demo.cell;

/** What a sleeve is made of, which the sensors of station 1 tell apart. */
public enum Colour {
    /** Seen by the capacitive sensor alone. */
    BLACK,
    /** Seen by the optical sensor, too. */
    RED,
    /** Seen by all three sensors. */
    METALLIC
}
