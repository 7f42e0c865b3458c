/** The parts that the demos of all machines share: the PLC as a process, the timeline, the screen, the page and the verdict. */
package tickbus.machines.demo;
