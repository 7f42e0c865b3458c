package tickbus.machines.cell;

/** The material of a sleeve, which the sensors of station 1 distinguish. */
public enum Colour {
    /** Detected by the capacitive sensor alone. */
    BLACK,
    /** Also detected by the optical sensor. */
    RED,
    /** Detected by all three sensors. */
    METALLIC
}
