package tickbus.petri;

/** An answer about a net. */
public enum Verdict {
    /** It is so. */
    YES,
    /** It is not so. */
    NO,
    /** The exploration gave up before it was known. */
    UNKNOWN;

    static Verdict of(boolean so) {
        return so ? YES : NO;
    }
}
