/**
 * The test rig: a machine that turns bottles over with two wheels and two lifts; and its demo.
 *
 * <p>In the demo, an operator's day takes half a minute: a script presses the buttons, jams a bottle, clears it and parks
 * the rig, while a watcher follows the PLC program and the machine. At the end the demo compares the edges counted at both
 * ends of the link.
 */
package tickbus.machines.rig;
