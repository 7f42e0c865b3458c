package tickbus.petri.format;

/** The kinds of PNML that {@link Pnml} reads and writes. */
public enum Dialect {
    /**
     * The type of the standard's place/transition nets, with test and inhibitor arcs in all the places where tools look for
     * them.
     */
    STANDARD,
    /**
     * For reading: also the files of ProM and pm4py ({@code pnmlcoremodel}, {@code <finalmarkings>}), WoPeD and LoLA
     * ({@code ptNetb} of 2003), ProM 5, Yasper, PIPE ({@code P/T net} with {@code <value>} and {@code <token>}), and the
     * project files of TAPAAL without ages. Unknown elements and attributes are refused in this dialect, too. Written, it is
     * {@link #STANDARD}.
     */
    ANY,
    /** TAPAAL: inhibitor arcs by the attribute {@code type}. Read as {@link #ANY}. */
    TAPAAL,
    /** ProM and pm4py: {@code pnmlcoremodel} with {@code <arctype>}; inhibitor arcs of weight 1. Read as {@link #ANY}. */
    PROM,
    /** WoPeD: {@code ptNetb} without pages; neither inhibitor arcs nor capacities. Read as {@link #ANY}. */
    WOPED,
    /** PIPE: {@code P/T net}, with capacities, priorities from 0 and inhibitor arcs. Read as {@link #ANY}. */
    PIPE
}
