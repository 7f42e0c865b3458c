package tickbus.petri.analysis;

import java.util.Arrays;
import tickbus.petri.net.PetriNet;

/**
 * Different markings, numbered from 0 in the order of their addition, in words of 64 bits. Each place has as many bits as its
 * greatest count so far needs; a place whose tokens follow from the others' has none. Markings are in chunks, so adding
 * copies none of them, without the upper half of the last word where no place has it. A hash table with open addressing
 * finds them.
 */
final class MarkingStore {
    /** The most markings: their numbers fill the largest hash table to three quarters. */
    static final int MOST = 3 << 28;

    private static final int CHUNK_INTS = 1 << 14;

    private final Implied implied;
    private final int[] initial;
    /** The bits of each place; 0 for a place that follows from others. */
    private final int[] bits;
    final int[] word;
    final int[] shift;
    /** The place that has a bit, 64 per word. */
    int[] placeAt;
    int words;
    /** The ints of a marking in a chunk. */
    private int ints;
    private int perChunk;
    private int[][] chunks = {};
    private int[] table;
    private int tableBits = 10;
    private int size;
    private int slot;

    MarkingStore(PetriNet net) {
        implied = Implied.of(net);
        initial = net.initialMarking().toArray();
        bits = new int[initial.length];
        word = new int[initial.length];
        shift = new int[initial.length];
        for (int p = 0; p < bits.length; p++) {
            bits[p] = implied.isImplied(p) ? 0 : bitsFor(Math.max(1, initial[p]));
        }
        table = new int[1 << tableBits];
        layOut();
    }

    private static int bitsFor(int count) {
        return Integer.SIZE - Integer.numberOfLeadingZeros(count);
    }

    private void layOut() {
        int at = 0;
        for (int p = 0; p < bits.length; p++) {
            if (at % 64 + bits[p] > 64) {
                at += 64 - at % 64;
            }
            word[p] = at / 64;
            shift[p] = at % 64;
            at += bits[p];
        }
        words = Math.max(1, (at + 63) / 64);
        ints = Math.max(1, (at + 31) / 32);
        placeAt = new int[64 * words];
        for (int p = 0; p < bits.length; p++) {
            Arrays.fill(placeAt, 64 * word[p] + shift[p], 64 * word[p] + shift[p] + bits[p], p);
        }
        perChunk = Math.max(1, Integer.highestOneBit(CHUNK_INTS / ints));
    }

    int size() {
        return size;
    }

    Implied implied() {
        return implied;
    }

    /** The bits of a place, as a mask of its counts; 0 for a place that follows from others. */
    int mask(int place) {
        return (int) ((1L << bits[place]) - 1);
    }

    long bytes() {
        return 4L * ints * perChunk * chunks.length + 4L * table.length;
    }

    /** The bytes that another marking needs; 0 if it fits into what is there. */
    long bytesToGrow() {
        return (size == chunks.length * perChunk ? 4L * ints * perChunk : 0)
            + (isTableFull() ? 8L * table.length : 0);
    }

    private boolean isTableFull() {
        return size >= table.length / 4 * 3;
    }

    /** The bytes that {@link #widen} needs beside the present ones. */
    long bytesToWiden() {
        return 4L * (ints + 1) * ((long) size + perChunk);
    }

    /** A number for each word; the sum of the products of words and numbers is the hash of a marking. */
    static long factor(int of) {
        long mixed = (of + 1) * 0x9E3779B97F4A7C15L;
        mixed = (mixed ^ mixed >>> 30) * 0xBF58476D1CE4E5B9L;
        return (mixed ^ mixed >>> 27) | 1;
    }

    long hash(long[] of) {
        long hash = 0;
        for (int w = 0; w < words; w++) {
            hash += of[w] * factor(w);
        }
        return hash;
    }

    private static long mixed(long hash) {
        return (hash ^ hash >>> 32) * 0xD6E8FEB86659FD93L;
    }

    void pack(int[] tokens, long[] into) {
        Arrays.fill(into, 0, words, 0);
        for (int p = 0; p < bits.length; p++) {
            if (bits[p] > 0) {
                into[word[p]] |= (long) tokens[p] << shift[p];
            }
        }
    }

    /** The words of a marking. */
    void read(int number, long[] into) {
        int[] chunk = chunks[number / perChunk];
        int base = number % perChunk * ints;
        for (int w = 0; w < words; w++) {
            long low = chunk[base + 2 * w] & 0xFFFFFFFFL;
            into[w] = 2 * w + 1 < ints ? (long) chunk[base + 2 * w + 1] << 32 | low : low;
        }
    }

    private void write(int number, long[] packed) {
        int[] chunk = chunks[number / perChunk];
        int base = number % perChunk * ints;
        for (int i = 0; i < ints; i++) {
            chunk[base + i] = (int) (packed[i / 2] >>> i % 2 * 32);
        }
    }

    void get(int number, int[] tokens) {
        long[] packed = new long[words];
        read(number, packed);
        for (int p = 0; p < tokens.length; p++) {
            tokens[p] = bits[p] > 0 ? (int) (packed[word[p]] >>> shift[p]) & mask(p) : 0;
        }
        implied.complete(tokens, initial);
    }

    /** The number of this marking; -1 if it is not stored. */
    int find(int[] tokens) {
        for (int p = 0; p < tokens.length; p++) {
            if (bits[p] > 0 && (tokens[p] & ~mask(p)) != 0) {
                return -1;
            }
        }
        long[] packed = new long[words];
        pack(tokens, packed);
        int found = find(packed, hash(packed));
        if (found >= 0) {
            int[] stored = new int[tokens.length];
            get(found, stored);
            return Arrays.equals(stored, tokens) ? found : -1;
        }
        return found;
    }

    /** The number of the marking with these words and their hash; -1 if it is not stored, and {@link #append} can follow. */
    int find(long[] packed, long hash) {
        long mixed = mixed(hash);
        int tag = (int) mixed << tableBits;
        int numbers = table.length - 1;
        slot = (int) (mixed >>> 64 - tableBits);
        // The bits of an entry that no number needs are from the hash: few entries need a look at their marking.
        while (table[slot] != 0) {
            int entry = table[slot];
            if ((entry & ~numbers) == tag && isAt((entry & numbers) - 1, packed)) {
                return (entry & numbers) - 1;
            }
            slot = slot + 1 & numbers;
        }
        return -1;
    }

    private boolean isAt(int number, long[] packed) {
        int[] chunk = chunks[number / perChunk];
        int base = number % perChunk * ints;
        for (int i = 0; i < ints; i++) {
            if (chunk[base + i] != (int) (packed[i >> 1] >>> (i & 1) * 32)) {
                return false;
            }
        }
        return true;
    }

    /** Adds the marking that {@link #find(long[], long)} has just not found; returns its number. */
    int append(long[] packed, long hash) {
        if (size == chunks.length * perChunk) {
            int[][] more = Arrays.copyOf(chunks, chunks.length + 1);
            more[chunks.length] = new int[ints * perChunk];
            chunks = more;
        }
        if (isTableFull()) {
            enlarge();
            find(packed, hash);
        }
        write(size, packed);
        table[slot] = (int) mixed(hash) << tableBits | ++size;
        return size - 1;
    }

    private void enlarge() {
        int[] larger = new int[2 * table.length];
        table = larger;
        tableBits++;
        enterAll();
    }

    private void enterAll() {
        long[] packed = new long[words];
        int numbers = table.length - 1;
        for (int number = 0; number < size; number++) {
            read(number, packed);
            long mixed = mixed(hash(packed));
            int at = (int) (mixed >>> 64 - tableBits);
            while (table[at] != 0) {
                at = at + 1 & numbers;
            }
            table[at] = (int) mixed << tableBits | number + 1;
        }
    }

    /** Gives a place the bits for a count, and packs all markings again. */
    void widen(int place, int count) {
        MarkingStore old = new MarkingStore(this);
        bits[place] = bitsFor(count);
        layOut();
        chunks = new int[(size + perChunk - 1) / perChunk][];
        long[] before = new long[old.words];
        long[] after = new long[words];
        for (int number = 0; number < size; number++) {
            if (number % perChunk == 0) {
                chunks[number / perChunk] = new int[ints * perChunk];
            }
            old.read(number, before);
            Arrays.fill(after, 0);
            for (int p = 0; p < bits.length; p++) {
                if (bits[p] > 0) {
                    after[word[p]] |= (before[old.word[p]] >>> old.shift[p] & old.mask(p)) << shift[p];
                }
            }
            write(number, after);
            if ((number + 1) % old.perChunk == 0) {
                old.chunks[number / old.perChunk] = null;
            }
        }
        Arrays.fill(table, 0);
        enterAll();
    }

    /** The former layout while markings are packed again. */
    private MarkingStore(MarkingStore of) {
        implied = of.implied;
        initial = of.initial;
        bits = of.bits.clone();
        word = of.word.clone();
        shift = of.shift.clone();
        words = of.words;
        ints = of.ints;
        perChunk = of.perChunk;
        chunks = of.chunks;
    }
}
