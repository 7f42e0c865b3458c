/**
 * The simulator's command line, and what runs in it: machines and demos. The product does not use them.
 *
 * <p>In here lies the demo of the test rig, whose machine is in {@code rig}; {@code peeler} is the machine of the peeling
 * line, {@code peeling} its demo. {@code motion} serves both machines.
 *
 * <p>The demo of the rig is an operator's day at it in half a minute. A script presses the buttons, jams a bottle, clears it and parks the rig, while a watcher follows the PLC
 * program and the machine. At the end the edges counted at both ends of the link are compared.
 */
package tickbus.demo;
