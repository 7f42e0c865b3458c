package tickbus.petri.format;

/** The files that {@link Pnml} accepts. */
public enum Dialect {
    /** The type of the standard's place/transition nets, with the test and inhibitor arcs that several tools add. */
    STANDARD,
    /**
     * Also the files of ProM and pm4py ({@code pnmlcoremodel}, {@code <finalmarkings>}), WoPeD and LoLA ({@code ptNetb} of
     * 2003) and PIPE ({@code P/T net} with {@code <value>} and {@code <token>}). Unknown elements and attributes are refused
     * in this dialect, too.
     */
    ANY
}
