/**
 * The simulator's control interface: what a simulator requires of a device driver.
 *
 * <p>The 2003 thesis by Hammarlund and Persson drops a Java class into the {@code DeviceDriver} folder of
 * a simulation program; the class extends the program's driver base class and names three calls:
 * {@code updateComponentValues}, {@code deliverHardwareInputs} and {@code exit}. The original base class
 * is not public. This package is our reading of that text, and no more than a driver needs: a simulator
 * that has a base class of its own needs only a thin adapter.
 *
 * <p>One tick, always on the simulator's own thread:
 *
 * <pre>
 * simulator                                   driver
 *   simulationTime(nanos)            ──────▶
 *   updateComponentValues(value)     ──────▶   exchange with the hardware
 *   hardwareInputs(inputs)           ◀──────   deliverHardwareInputs(inputs)
 * </pre>
 */
package controlinterface;
