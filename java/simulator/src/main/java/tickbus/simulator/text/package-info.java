/** Small text utilities shared by the packages of the simulator. */
package tickbus.simulator.text;
