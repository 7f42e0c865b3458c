/**
 * Petri nets that drive a bus: conditions and actions of nets, bound to the signals of a driver.cfg.
 *
 * <p>{@link tickbus.petri.control.BoundNet} says what belongs to what, {@link tickbus.petri.control.NetController} checks
 * that against a driver and runs it, and {@link tickbus.petri.control.Composition} makes one net of several for analysis.
 */
package tickbus.petri.control;
