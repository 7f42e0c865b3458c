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
    /** The front of a bucket: those of its members that are due first, once {@link #choices} has asked for them. */
    private final int[] front;
    private final int[] frontSize;
    private final long[] frontSince;
    /** The other members of a bucket, a heap by due time. */
    private final int[] behind;
    private final int[] behindSize;
    private final boolean[] isFront;
    /** The position of a member in the front, or among the others. */
    private final int[] memberAt;
    private int chosen;

    Ready(int[] priority, int[] cluster) {
        this.priority = priority;
        int all = priority.length;
        since = new long[all];
        heap = new int[all];
        position = new int[all];
        bucket = new int[all];
        front = new int[all];
        behind = new int[all];
        isFront = new boolean[all];
        memberAt = new int[all];
        Map<Long, Integer> numbers = new HashMap<>();
        for (int t = 0; t < all; t++) {
            long key = (long) cluster[t] << 32 | priority[t] & 0xFFFFFFFFL;
            Integer known = cluster[t] < 0 ? Integer.valueOf(-1) : numbers.putIfAbsent(key, numbers.size());
            bucket[t] = known == null ? numbers.size() - 1 : known;
        }
        bucketFirst = new int[numbers.size() + 1];
        frontSize = new int[numbers.size()];
        frontSince = new long[numbers.size()];
        behindSize = new int[numbers.size()];
        for (int t = 0; t < all; t++) {
            if (bucket[t] >= 0) {
                bucketFirst[bucket[t] + 1]++;
            }
        }
        for (int b = 0; b < frontSize.length; b++) {
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
        if (b < 0) {
            return;
        }
        if (frontSize[b] == 0 && behindSize[b] == 0) {
            frontSince[b] = at;
        }
        if (at == frontSince[b] && (frontSize[b] > 0 || behindSize[b] == 0)) {
            addToFront(b, t);
            return;
        }
        // An earlier one is rare: it ends the front.
        while (frontSize[b] > 0 && at < frontSince[b]) {
            int back = front[bucketFirst[b] + --frontSize[b]];
            addBehind(b, back);
        }
        addBehind(b, t);
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
        if (b >= 0 && isFront[t]) {
            int moved = front[bucketFirst[b] + --frontSize[b]];
            front[memberAt[t]] = moved;
            memberAt[moved] = memberAt[t];
        } else if (b >= 0) {
            removeBehind(b, t);
        }
    }

    private void addToFront(int b, int t) {
        isFront[t] = true;
        memberAt[t] = bucketFirst[b] + frontSize[b]++;
        front[memberAt[t]] = t;
    }

    private void addBehind(int b, int t) {
        isFront[t] = false;
        raise(b, bucketFirst[b] + behindSize[b]++, t);
    }

    private void removeBehind(int b, int t) {
        int hole = memberAt[t];
        int last = behind[bucketFirst[b] + --behindSize[b]];
        if (last != t) {
            raise(b, hole, last);
            sink(b, memberAt[last]);
        }
    }

    /**
     * The number of transitions that chance chooses from: the first one, and those in conflict with it that have the same
     * rank.
     */
    int choices() {
        chosen = heap[0];
        int b = bucket[chosen];
        if (b < 0) {
            return 1;
        }
        if (frontSize[b] == 0) {
            frontSince[b] = since[chosen];
            while (behindSize[b] > 0 && since[behind[bucketFirst[b]]] == frontSince[b]) {
                int t = behind[bucketFirst[b]];
                removeBehind(b, t);
                addToFront(b, t);
            }
        }
        return frontSize[b];
    }

    /** One of the last {@link #choices}. */
    int choice(int number) {
        return bucket[chosen] < 0 ? chosen : front[bucketFirst[bucket[chosen]] + number];
    }

    private void putBehind(int t, int at) {
        behind[at] = t;
        memberAt[t] = at;
    }

    private void raise(int b, int start, int t) {
        int root = bucketFirst[b];
        int at = start;
        while (at > root && since[t] < since[behind[root + (at - root - 1) / 2]]) {
            int parent = root + (at - root - 1) / 2;
            putBehind(behind[parent], at);
            at = parent;
        }
        putBehind(t, at);
    }

    private void sink(int b, int start) {
        int root = bucketFirst[b];
        int end = root + behindSize[b];
        int at = start;
        int t = behind[at];
        for (int child = 2 * at - root + 1; child < end; child = 2 * at - root + 1) {
            child += child + 1 < end && since[behind[child + 1]] < since[behind[child]] ? 1 : 0;
            if (since[behind[child]] >= since[t]) {
                break;
            }
            putBehind(behind[child], at);
            at = child;
        }
        putBehind(t, at);
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
