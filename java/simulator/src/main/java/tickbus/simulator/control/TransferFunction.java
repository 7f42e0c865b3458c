package tickbus.simulator.control;

/**
 * What happens to a value between its source and its destination. May remember earlier ticks; is applied
 * exactly once per tick; allocates nothing.
 */
@FunctionalInterface
interface TransferFunction {
    /**
     * Computes one tick's result.
     *
     * @param from indices of the function's sources in {@code values}
     * @param from where in {@code values} the function's sources stand
     * @return the result
     */
    double apply(double[] values, int[] from);
}
