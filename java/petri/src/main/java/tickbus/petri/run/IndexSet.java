package tickbus.petri.run;

/** A set of indexes in an array: adding, removing and testing take constant time. */
final class IndexSet {
    private final int[] members;
    /** One more than the position among the members; 0 if the index is no member. */
    private final int[] position;
    private int size;

    IndexSet(int universe) {
        members = new int[universe];
        position = new int[universe];
    }

    boolean contains(int index) {
        return position[index] != 0;
    }

    void add(int index) {
        if (position[index] == 0) {
            members[size++] = index;
            position[index] = size;
        }
    }

    void remove(int index) {
        int hole = position[index] - 1;
        if (hole >= 0) {
            int last = members[--size];
            members[hole] = last;
            position[last] = hole + 1;
            position[index] = 0;
        }
    }

    void clear() {
        while (size > 0) {
            position[members[--size]] = 0;
        }
    }

    int size() {
        return size;
    }

    /** The member at a position from 0; removing another member can move it. */
    int get(int at) {
        return members[at];
    }
}
