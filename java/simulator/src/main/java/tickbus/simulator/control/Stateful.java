package tickbus.simulator.control;

/** The transfer functions that remember earlier ticks. */
final class Stateful {
    private Stateful() {
    }

    /** Follows its source only when the source has moved by more than the deadband. */
    static final class Deadband implements TransferFunction {
        private final double width;
        private double held;

        Deadband(double width) {
            this.width = width;
        }

        @Override
        public double apply(double[] values, int[] from) {
            double value = values[from[0]];
            if (Math.abs(value - held) > width) {
                held = value;
            }
            return held;
        }
    }

    /** Shows a change between 0 and not 0 for one tick. */
    static final class Edge implements TransferFunction {
        private final boolean rising;
        private boolean before;

        Edge(boolean rising) {
            this.rising = rising;
        }

        @Override
        public double apply(double[] values, int[] from) {
            boolean now = values[from[0]] != 0;
            boolean edge = now != before && now == rising;
            before = now;
            return edge ? 1 : 0;
        }
    }

    /** A line of past values, one per tick. */
    static final class Delay implements TransferFunction {
        private final double[] line;
        private int next;

        Delay(int ticks) {
            line = new double[ticks];
        }

        @Override
        public double apply(double[] values, int[] from) {
            double oldest = line[next];
            line[next] = values[from[0]];
            next = next + 1 == line.length ? 0 : next + 1;
            return oldest;
        }
    }
}
