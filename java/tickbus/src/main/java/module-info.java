/** A simulation's end of a PLC's fieldbus; start at {@link tickbus.Tickbus}. */
module org.tickbus {
    exports tickbus;
    exports tickbus.identification;
}
