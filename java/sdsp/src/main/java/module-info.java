/** Simulations in virtual time; start at {@link tickbus.sdsp}. */
module org.tickbus.sdsp {
    requires jdk.net;

    exports tickbus.sdsp;
}
