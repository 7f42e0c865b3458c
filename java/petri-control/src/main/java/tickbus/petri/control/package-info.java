/**
 * Petri nets that drive a bus: conditions and actions of nets, bound to the signals of a driver.cfg.
 *
 * <p>{@link tickbus.petri.control.BoundNet} binds a net to signals, {@link tickbus.petri.control.NetController} checks the
 * binding against a driver and runs it, and {@link tickbus.petri.control.Composition} makes one net of several for analysis.
 */
package tickbus.petri.control;
