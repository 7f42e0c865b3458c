package tickbus.petri.run;

import java.util.HashMap;
import java.util.Map;

/**
 * The transitions that may fire now. The first one has the greatest priority, among those the earliest due time, and among
 * those the lowest index. Adding and removing take logarithmic time.
 */
final class Ready {
    /** The due time of a transition that does not wait for the time. */
    static final long UNTIMED = Long.MIN_VALUE;

    private final int[] priority;
    private final long[] since;
    private final int[] heap;
    /** One more than the position in the heap; 0 if the transition is not there. */
    private final int[] position;
    private int size;
    /** Transitions of one cluster and one priority share a bucket; -1 for a transition without conflicts. */
    private final int[] bucket;
    private final int[] bucketFirst;
    private final int[] bucketSize;
    /** The number of transitions in the bucket with a due time. */
    private final int[] bucketTimed;
    private final int[] members;
    private final int[] memberAt;
    private final int[] candidates;
    private int base;
    private int[] from;

    Ready(int[] priority, int[] cluster) {
        this.priority = priority;
        int all = priority.length;
        since = new long[all];
        heap = new int[all];
        position = new int[all];
        bucket = new int[all];
        members = new int[all];
        memberAt = new int[all];
        candidates = new int[all];
        Map<Long, Integer> numbers = new HashMap<>();
        for (int t = 0; t < all; t++) {
            long key = (long) cluster[t] << 32 | priority[t] & 0xFFFFFFFFL;
            Integer known = cluster[t] < 0 ? Integer.valueOf(-1) : numbers.putIfAbsent(key, numbers.size());
            bucket[t] = known == null ? numbers.size() - 1 : known;
        }
        bucketFirst = new int[numbers.size() + 1];
        bucketSize = new int[numbers.size()];
        bucketTimed = new int[numbers.size()];
        for (int t = 0; t < all; t++) {
            if (bucket[t] >= 0) {
                bucketFirst[bucket[t] + 1]++;
            }
        }
        for (int b = 0; b < bucketSize.length; b++) {
            bucketFirst[b + 1] += bucketFirst[b];
        }
    }

    int size() {
        return size;
    }

    long since(int t) {
        return since[t];
    }

    void clear() {
        while (size > 0) {
            remove(heap[size - 1]);
        }
    }

    void add(int t, long at) {
        if (position[t] != 0) {
            return;
        }
        since[t] = at;
        up(size++, t);
        int b = bucket[t];
        if (b >= 0) {
            memberAt[t] = bucketFirst[b] + bucketSize[b]++;
            members[memberAt[t]] = t;
            bucketTimed[b] += at == UNTIMED ? 0 : 1;
        }
    }

    void remove(int t) {
        int hole = position[t] - 1;
        if (hole < 0) {
            return;
        }
        position[t] = 0;
        int last = heap[--size];
        if (last != t) {
            up(hole, last);
            down(position[last] - 1);
        }
        int b = bucket[t];
        if (b >= 0) {
            int moved = members[bucketFirst[b] + --bucketSize[b]];
            members[memberAt[t]] = moved;
            memberAt[moved] = memberAt[t];
            bucketTimed[b] -= since[t] == UNTIMED ? 0 : 1;
        }
    }

    /**
     * The number of transitions that chance chooses from: the first one, and those in conflict with it that have the same
     * rank.
     */
    int choices() {
        int first = heap[0];
        int b = bucket[first];
        from = candidates;
        base = 0;
        candidates[0] = first;
        if (b < 0) {
            return 1;
        }
        if (bucketTimed[b] == 0) {
            from = members;
            base = bucketFirst[b];
            return bucketSize[b];
        }
        int count = 0;
        for (int i = bucketFirst[b]; i < bucketFirst[b] + bucketSize[b]; i++) {
            if (since[members[i]] == since[first]) {
                candidates[count++] = members[i];
            }
        }
        return count;
    }

    /** One of the last {@link #choices}. */
    int choice(int number) {
        return from[base + number];
    }

    private boolean before(int a, int b) {
        if (priority[a] != priority[b]) {
            return priority[a] > priority[b];
        }
        return since[a] < since[b] || since[a] == since[b] && a < b;
    }

    private void place(int t, int at) {
        heap[at] = t;
        position[t] = at + 1;
    }

    private void up(int start, int t) {
        int at = start;
        while (at > 0 && before(t, heap[(at - 1) / 2])) {
            place(heap[(at - 1) / 2], at);
            at = (at - 1) / 2;
        }
        place(t, at);
    }

    private void down(int start) {
        int at = start;
        int t = heap[at];
        while (2 * at + 1 < size) {
            int child = 2 * at + 1;
            if (child + 1 < size && before(heap[child + 1], heap[child])) {
                child++;
            }
            if (!before(heap[child], t)) {
                break;
            }
            place(heap[child], at);
            at = child;
        }
        place(t, at);
    }
}
