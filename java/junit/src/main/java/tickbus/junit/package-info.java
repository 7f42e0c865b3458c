/**
 * Testing PLC programs with JUnit: the program and a machine model run in one process, tick by tick, in simulation
 * time.
 *
 * <p>Begin with {@link tickbus.junit.PlcTest}.
 */
package tickbus.junit;
