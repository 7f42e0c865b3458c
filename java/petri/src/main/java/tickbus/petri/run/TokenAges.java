package tickbus.petri.run;

/** The tokens of a timed place that are not available yet: a ring of times and counts, the earliest first. */
final class TokenAges {
    private long[] due = new long[4];
    private int[] count = new int[4];
    private int first;
    private int size;

    void add(long at, int tokens) {
        if (size == due.length) {
            long[] longer = new long[2 * size];
            int[] more = new int[2 * size];
            for (int i = 0; i < size; i++) {
                longer[i] = due[(first + i) % size];
                more[i] = count[(first + i) % size];
            }
            due = longer;
            count = more;
            first = 0;
        }
        int last = size++;
        // A time before the last ones is rare.
        for (int before; last > 0 && due[before = (first + last - 1) % due.length] > at; last--) {
            due[(first + last) % due.length] = due[before];
            count[(first + last) % due.length] = count[before];
        }
        due[(first + last) % due.length] = at;
        count[(first + last) % due.length] = tokens;
    }

    /** When the next tokens become available; {@link Long#MAX_VALUE} if all are. */
    long next() {
        return size == 0 ? Long.MAX_VALUE : due[first];
    }

    boolean isDue(long now) {
        return size > 0 && due[first] <= now && now != Long.MAX_VALUE;
    }

    /** Takes out the next tokens. */
    int release() {
        int tokens = count[first];
        first = (first + 1) % due.length;
        size--;
        return tokens;
    }
}
