/** Tests of PLC programs under JUnit; start at {@link tickbus.junit.PlcTest}. */
module org.tickbus.junit {
    requires transitive org.junit.jupiter.api;
    requires transitive org.tickbus;

    exports tickbus.junit;
}
