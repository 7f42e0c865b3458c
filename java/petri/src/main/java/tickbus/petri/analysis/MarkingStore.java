package tickbus.petri.analysis;

import java.util.Arrays;

/**
 * Different markings, numbered from 0 in the order of their addition. Each place has 1, 2, 4, … or 32 bits, as many as the
 * greatest count so far needs; a count that needs more repacks all markings.
 */
final class MarkingStore {
    private final int places;
    private int bits = 1;
    private int words;
    private long[] packed;
    private int[] table = new int[1 << 10];
    private int size;
    private long[] scratch;

    MarkingStore(int places) {
        this.places = places;
        words = wordsFor(bits);
        packed = new long[words * 64];
        scratch = new long[words];
    }

    private int wordsFor(int width) {
        int perWord = 64 / width;
        return Math.max(1, (places + perWord - 1) / perWord);
    }

    int size() {
        return size;
    }

    long bytes() {
        return 8L * packed.length + 4L * table.length;
    }

    /** The bytes needed while longer arrays replace the full ones; 0 if another marking fits. */
    long bytesToGrow() {
        return ((size + 1L) * words > packed.length ? 12L * packed.length : 0)
            + (size + 1 > table.length / 2 ? 8L * table.length : 0);
    }

    /** The number of this marking; a new marking gets the current size. */
    int add(int[] tokens) {
        fit(tokens);
        pack(tokens);
        int slot = slot();
        if (table[slot] != 0) {
            return table[slot] - 1;
        }
        append(slot);
        return size - 1;
    }

    /** The number of this marking; -1 if it is not stored. */
    int find(int[] tokens) {
        for (int count : tokens) {
            if (bits < 32 && count >>> bits != 0) {
                return -1;
            }
        }
        pack(tokens);
        return table[slot()] - 1;
    }

    void get(int number, int[] tokens) {
        int perWord = 64 / bits;
        long mask = (1L << bits) - 1;
        int base = number * words;
        int p = 0;
        for (int w = 0; w < words; w++) {
            long word = packed[base + w];
            for (int i = 0; i < perWord && p < places; i++) {
                tokens[p++] = (int) (word & mask);
                word >>>= bits;
            }
        }
    }

    private void pack(int[] tokens) {
        int perWord = 64 / bits;
        int p = 0;
        for (int w = 0; w < words; w++) {
            long word = 0;
            for (int i = 0; i < perWord && p < places; i++) {
                word |= (long) tokens[p++] << i * bits;
            }
            scratch[w] = word;
        }
    }

    private void fit(int[] tokens) {
        int all = 0;
        for (int count : tokens) {
            all |= count;
        }
        if (bits == 32 || all >>> bits == 0) {
            return;
        }
        int[][] old = new int[1][places];
        MarkingStore wider = new MarkingStore(places);
        wider.bits = bits;
        while (wider.bits < 32 && all >>> wider.bits != 0) {
            wider.bits *= 2;
        }
        wider.words = wordsFor(wider.bits);
        wider.scratch = new long[wider.words];
        wider.packed = new long[wider.words * Math.max(64, size + size / 2)];
        wider.table = new int[table.length];
        for (int i = 0; i < size; i++) {
            get(i, old[0]);
            wider.pack(old[0]);
            wider.append(wider.slot());
        }
        bits = wider.bits;
        words = wider.words;
        scratch = wider.scratch;
        packed = wider.packed;
        table = wider.table;
    }

    /** The slot of the scratch marking in the table, or its free slot. */
    private int slot() {
        int slot = hash(scratch, 0) & table.length - 1;
        while (table[slot] != 0 && !isAt(table[slot] - 1)) {
            slot = slot + 1 & table.length - 1;
        }
        return slot;
    }

    private boolean isAt(int number) {
        int base = number * words;
        for (int w = 0; w < words; w++) {
            if (packed[base + w] != scratch[w]) {
                return false;
            }
        }
        return true;
    }

    private int hash(long[] from, int base) {
        long hash = 0;
        for (int w = 0; w < words; w++) {
            hash = (hash ^ from[base + w]) * 0x9E3779B97F4A7C15L;
            hash ^= hash >>> 32;
        }
        return (int) hash ^ (int) (hash >>> 17);
    }

    private void append(int slot) {
        long needed = (size + 1L) * words;
        if (needed > Integer.MAX_VALUE - 16) {
            throw new GaveUpException("gave up at " + size + " markings, which fill an array");
        }
        if (needed > packed.length) {
            packed = Arrays.copyOf(packed, (int) Math.min(Integer.MAX_VALUE - 16, Math.max(needed, packed.length * 3L / 2)));
        }
        System.arraycopy(scratch, 0, packed, size * words, words);
        table[slot] = ++size;
        if (size > table.length / 2) {
            int[] larger = new int[table.length * 2];
            for (int i = 0; i < size; i++) {
                int at = hash(packed, i * words) & larger.length - 1;
                while (larger[at] != 0) {
                    at = at + 1 & larger.length - 1;
                }
                larger[at] = i + 1;
            }
            table = larger;
        }
    }
}
