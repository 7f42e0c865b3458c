/** Benchmarks of the tick as seen from Java. Those to be compared run in a single JMH run. */
package tickbus.bench;
