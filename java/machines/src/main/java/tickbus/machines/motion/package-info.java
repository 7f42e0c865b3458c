/** Motion of drives, shared by the machines: the position of a drive as a function of the time since it started. */
package tickbus.machines.motion;
