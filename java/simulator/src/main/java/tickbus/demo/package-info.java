/**
 * The simulator's command line, and its machines and demos. The product does not use them.
 *
 * <p>This package has the demo of the test rig, whose machine is in {@code rig}; {@code peeler} is the machine of the
 * peeling line, {@code peeling} its demo. Both machines use {@code motion}. In the rig's demo, an operator's day takes half
 * a minute: a script presses the buttons, jams a bottle, clears it and parks the rig, while a watcher follows the PLC
 * program and the machine. At the end the demo compares the edges counted at both ends of the link.
 */
package tickbus.demo;
