package controlinterface;

/** Which way a hardware component's value travels. */
public enum Direction {
    /** The simulation writes the value and the hardware gets it: a PLC input, {@code %I}. */
    WRITTEN_BY_SIMULATION,
    /** The hardware delivers the value and the simulation reads it: a PLC output, {@code %Q}. */
    READ_BY_SIMULATION
}
