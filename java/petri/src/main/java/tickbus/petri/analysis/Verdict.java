package tickbus.petri.analysis;

/** An answer about a net. */
public enum Verdict {
    /** The property holds. */
    YES,
    /** The property does not hold. */
    NO,
    /** The exploration gave up before the answer was known. */
    UNKNOWN;

    static Verdict of(boolean so) {
        return so ? YES : NO;
    }
}
