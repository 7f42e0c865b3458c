/**
 * The plain Java API of tickbus: a simulation exchanges one process image with a PLC at every tick.
 *
 * <p>Start at {@link tickbus.Tickbus}. Directions are named from the PLC: {@code %I} is a PLC input, which
 * the simulation writes; {@code %Q} is a PLC output, which the simulation reads.
 */
package tickbus;
