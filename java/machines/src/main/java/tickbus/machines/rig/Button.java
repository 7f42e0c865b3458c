package tickbus.machines.rig;

/** A push button on the rig's operator panel. */
public enum Button {
    /** Starts production, and homes a parked rig. */
    START,
    /** Ends production after the current cycle. */
    STOP,
    /** Lets the control recover from a fault. */
    RESET
}
