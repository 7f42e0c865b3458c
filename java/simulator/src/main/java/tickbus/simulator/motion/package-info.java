/** Motion of drives that the machines share: where a drive stands, computed from the time since it set out. */
package tickbus.simulator.motion;
