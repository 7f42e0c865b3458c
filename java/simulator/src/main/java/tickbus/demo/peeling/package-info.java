/**
 * The demo of the peeling line: two PLCs peel some blocks over two links. At the end the times between records are compared
 * with those measured in 2018.
 */
package tickbus.demo.peeling;
