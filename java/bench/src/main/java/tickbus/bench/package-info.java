/** Benchmarks of the tick as seen from Java. Those to be compared run by turns in one process, the others under JMH. */
package tickbus.bench;
