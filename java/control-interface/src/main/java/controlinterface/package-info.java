/**
 * The simulator's control interface: what a simulator requires of a device driver.
 *
 * <p>In the 2003 thesis by Hammarlund and Persson, a Java class in the {@code DeviceDriver} folder of a simulation
 * program extends the program's driver base class. The thesis names three calls: {@code updateComponentValues},
 * {@code deliverHardwareInputs} and {@code exit}. The original base class is not public. This package is our reading of
 * that text, and has only what a driver needs; a simulator with its own base class needs only a thin adapter.
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
