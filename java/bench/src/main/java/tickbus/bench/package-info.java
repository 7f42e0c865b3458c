/** Benchmarks of the tick, seen from Java. All that are to be compared run in one JMH run. */
package tickbus.bench;
