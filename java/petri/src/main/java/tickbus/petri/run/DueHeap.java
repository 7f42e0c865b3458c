package tickbus.petri.run;

/** Due times: a binary heap of indexes by time, then by index, with each index at most once. */
final class DueHeap {
    private final int[] heap;
    /** One more than the position in the heap; 0 if the index is not there. */
    private final int[] position;
    private final long[] due;
    private int size;

    DueHeap(int universe) {
        heap = new int[universe];
        position = new int[universe];
        due = new long[universe];
    }

    /** The earliest time; {@link Long#MAX_VALUE} if nothing is due. */
    long next() {
        return size == 0 ? Long.MAX_VALUE : due[heap[0]];
    }

    /** When this index is due; {@link Long#MAX_VALUE} if it is not in the heap. */
    long at(int index) {
        return position[index] == 0 ? Long.MAX_VALUE : due[index];
    }

    boolean isDue(long now) {
        return size > 0 && due[heap[0]] <= now && now != Long.MAX_VALUE;
    }

    void put(int index, long at) {
        remove(index);
        due[index] = at;
        place(index, size++);
        up(size - 1);
    }

    void remove(int index) {
        int hole = position[index] - 1;
        if (hole < 0) {
            return;
        }
        position[index] = 0;
        int last = heap[--size];
        if (last != index) {
            place(last, hole);
            up(hole);
            down(position[last] - 1);
        }
    }

    int pop() {
        int first = heap[0];
        remove(first);
        return first;
    }

    private void place(int index, int at) {
        heap[at] = index;
        position[index] = at + 1;
    }

    private boolean before(int a, int b) {
        return due[a] < due[b] || due[a] == due[b] && a < b;
    }

    private void up(int from) {
        int at = from;
        int index = heap[at];
        while (at > 0 && before(index, heap[(at - 1) / 2])) {
            place(heap[(at - 1) / 2], at);
            at = (at - 1) / 2;
        }
        place(index, at);
    }

    private void down(int from) {
        int at = from;
        int index = heap[at];
        while (2 * at + 1 < size) {
            int child = 2 * at + 1;
            if (child + 1 < size && before(heap[child + 1], heap[child])) {
                child++;
            }
            if (!before(heap[child], index)) {
                break;
            }
            place(heap[child], at);
            at = child;
        }
        place(index, at);
    }
}
