/**
 * The demo of the peeling line: two PLCs peel some blocks, over two links; in the end the times between records are laid
 * beside those that were measured in 2018.
 */
package tickbus.simulator.demo.peeling;
