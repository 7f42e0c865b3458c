/**
 * The demo: an operator's day at the test rig in half a minute.
 *
 * <p>A script presses the buttons, jams a bottle, clears it and parks the rig, while a watcher follows the PLC
 * program and the machine. At the end the edges counted at both ends of the link are compared.
 */
package tickbus.demo;
