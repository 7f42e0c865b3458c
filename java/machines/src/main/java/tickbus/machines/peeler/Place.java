package tickbus.machines.peeler;

/** The places of a block, in the order in which it reaches them. */
public enum Place {
    /** The first step of the step feeder. */
    STEP_1,
    /** The second one. */
    STEP_2,
    /** The third one. */
    STEP_3,
    /** The last one. */
    STEP_4,
    /** The V of the linear feeder. */
    LINEAR_FEEDER,
    /** The centring spindles. */
    CENTRING,
    /** The clamps of the transfer arm. */
    CLAMPS,
    /** The spindles of the lathe. */
    LATHE
}
