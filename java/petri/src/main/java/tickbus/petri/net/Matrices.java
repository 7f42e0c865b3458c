package tickbus.petri.net;

/** Nets from matrices; row = place, column = transition. */
final class Matrices {
    private Matrices() {
    }

    static PetriNet net(String name, int[][] pre, int[][] post, int[] marking) {
        int places = marking.length;
        int transitions = places == 0 || pre.length == 0 ? 0 : pre[0].length;
        check(name, "input weights", pre, places, transitions);
        check(name, "output weights", post, places, transitions);
        NetBuilder builder = new NetBuilder(name);
        for (int p = 0; p < places; p++) {
            builder.place("P" + p, marking[p]);
        }
        for (int t = 0; t < transitions; t++) {
            TransitionStep transition = builder.transition("T" + t);
            for (int p = 0; p < places; p++) {
                if (pre[p][t] != 0) {
                    transition.input("P" + p, pre[p][t]);
                }
                if (post[p][t] != 0) {
                    transition.output("P" + p, post[p][t]);
                }
            }
        }
        return builder.build();
    }

    private static void check(String name, String what, int[][] matrix, int places, int transitions) {
        if (matrix.length != places) {
            throw new NetException("net " + name, 0, what, matrix.length + " rows; expected " + places
                + ", one for each place of the marking");
        }
        for (int p = 0; p < places; p++) {
            if (matrix[p].length != transitions) {
                throw new NetException("net " + name, 0, what, "row " + p + " has " + matrix[p].length
                    + " columns; expected " + transitions + ", one for each transition");
            }
        }
    }

    /** The entries of one sign, as weights; 0 for the others. */
    static int[][] positive(int[][] matrix, int sign) {
        int[][] result = new int[matrix.length][];
        for (int p = 0; p < matrix.length; p++) {
            result[p] = new int[matrix[p].length];
            for (int t = 0; t < matrix[p].length; t++) {
                result[p][t] = Math.max(0, Math.multiplyExact(matrix[p][t], sign));
            }
        }
        return result;
    }
}
