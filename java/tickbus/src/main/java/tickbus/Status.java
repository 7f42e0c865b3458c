package tickbus;

/**
 * The result of an exchange, or of another call on a driver.
 *
 * <p>{@link #FRESH}, {@link #UNCHANGED} and {@link #STALE} are returned by {@link Tickbus#exchange()}; all others
 * have negative codes and are thrown as {@link FieldbusException}.
 */
public enum Status {
    /** 0: a new bus cycle has arrived since the last exchange, even if nothing changed in it. */
    FRESH(0, "a new bus cycle has arrived since the last exchange",
        "nothing to do"),
    /** 1: the link is alive, but no new bus cycle has arrived since the last exchange. */
    UNCHANGED(1, "the link lives, no new bus cycle since the last exchange",
        "nothing to do; the simulation ticks faster than the bus"),
    /** 2: the PLC has been silent for longer than {@code max_age}; fail-safe values are delivered. */
    STALE(2, "nothing has come from the PLC for longer than max_age; the fail-safe values are delivered",
        "check that the PLC runs and is connected; statistics() tells the state and the reason"),
    /** -1: no driver was ever opened under this handle. */
    NOT_OPEN(-1, "no driver was ever opened under this handle",
        "open the driver first, and use the object that open returned"),
    /** -2: another thread is using the driver. */
    BUSY(-2, "another thread is using this driver at this moment",
        "let one thread tick a driver, and close it when that thread has done its last tick"),
    /** -3: the driver was closed. */
    CLOSED(-3, "the driver was closed",
        "open it again, and drop what still refers to the closed one"),
    /** -4: driver.cfg has mistakes; the message lists them all. */
    BAD_CONFIG(-4, "driver.cfg cannot be used",
        "correct the lines named in the message; `tickbus check FILE` lists every mistake"),
    /** -5: the fieldbus could not be opened, or failed for good. */
    BUS_FAILED(-5, "the fieldbus could not be opened, or failed for good",
        "check interface, cable, address and permissions named in the message; then open again"),
    /** -6: this build or platform cannot do what driver.cfg asks for. */
    UNSUPPORTED(-6, "this build or this platform cannot do what driver.cfg asks for",
        "use a build with the feature named in the message, or another kind of bus"),
    /** -7: all places for drivers in this process are taken. */
    TOO_MANY_DRIVERS(-7, "all places for drivers in this process are taken",
        "close drivers that are no longer used, or spread them over several processes"),
    /** -8: the driver has a defect, and stays in this state until closed. */
    INTERNAL(-8, "the driver met a defect of its own and has stopped",
        "close and open it again; report the message and your driver.cfg"),
    /** -9: the native library cannot be loaded. */
    LIBRARY(-9, "the native library cannot be loaded",
        "see the message for every place that was tried, and why each failed"),
    /** -10: an argument is invalid. */
    BAD_ARGUMENT(-10, "a call had an argument that makes no sense",
        "correct the calling code as the message says");

    private static final Status[] ALL = values();

    private final int code;
    private final String text;
    private final String remedy;

    Status(int code, String text, String remedy) {
        this.code = code;
        this.text = text;
        this.remedy = remedy;
    }

    /**
     * The number of this status in the native library.
     *
     * @return 0 or more if the exchange was done; below 0 if it was not
     */
    public int code() {
        return code;
    }

    /**
     * The meaning of the status.
     *
     * @return one clause, without a full stop
     */
    public String text() {
        return text;
    }

    /**
     * The remedy.
     *
     * @return one clause, without a full stop
     */
    public String remedy() {
        return remedy;
    }

    /**
     * The status with this code.
     *
     * @param code a status code
     * @return the status; {@link #INTERNAL} for an unknown number
     */
    public static Status of(int code) {
        for (Status status : ALL) {
            if (status.code == code) {
                return status;
            }
        }
        return INTERNAL;
    }
}
