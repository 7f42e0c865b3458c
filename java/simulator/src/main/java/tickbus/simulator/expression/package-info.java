/**
 * Expressions in Structured Text (IEC 61131-3) for the transfer column of a control table.
 *
 * <p>{@link tickbus.simulator.expression.Expression} describes them. A recursive-descent parser makes typed nodes; a node
 * computes its value from the table's values, once per tick and without garbage.
 */
package tickbus.simulator.expression;
