/** Benchmarks of the tick as seen from Java. Figures to be compared are measured by turns in one process, the others by JMH. */
package tickbus.bench;
