/** Petri nets; start at {@link tickbus.petri.net.PetriNet}. */
module org.tickbus.petri {
    requires java.xml;
    // For the page alone.
    requires static org.tickbus;

    exports tickbus.petri.analysis;
    exports tickbus.petri.draw;
    exports tickbus.petri.format;
    exports tickbus.petri.net;
    exports tickbus.petri.page;
    exports tickbus.petri.run;
    exports tickbus.petri.sfc;
}
