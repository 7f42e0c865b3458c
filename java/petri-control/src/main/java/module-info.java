/** Petri nets that drive a PLC's fieldbus; start at {@link tickbus.petri.control}. */
module org.tickbus.petri.control {
    requires transitive org.tickbus;
    requires transitive org.tickbus.petri;

    exports tickbus.petri.control;
}
