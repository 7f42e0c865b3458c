package tickbus.petri.sfc;

/** The types of values, which are all kept as longs: 0 or 1, a whole number, nanoseconds. */
enum Kind {
    BOOL, NUMBER, TIME
}
