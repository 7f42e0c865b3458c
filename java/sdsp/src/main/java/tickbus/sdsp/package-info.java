/**
 * A client of SDSP in plain Java: a simulation joins a run in virtual time, in lock-step with a PLC and with other
 * simulations, over TCP and without a native library.
 *
 * <p>Start at {@link tickbus.sdsp.Participant}; {@link tickbus.sdsp.Client#join} lets it take part. {@code docs/sdsp.md}
 * describes the protocol.
 */
package tickbus.sdsp;
