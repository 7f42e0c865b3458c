package tickbus.simulator.control;

/**
 * Computes a value on its way from its source to its destination. Can remember earlier ticks; is applied exactly once per
 * tick; allocates nothing.
 */
@FunctionalInterface
interface TransferFunction {
    /**
     * Computes one tick's result.
     *
     * @param values all values of the table
     * @param from indices of the function's sources in {@code values}
     * @return the result
     */
    double apply(double[] values, int[] from);
}
