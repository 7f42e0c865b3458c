/** Small readers and writers of text that the rooms of the simulator share. */
package tickbus.simulator.text;
