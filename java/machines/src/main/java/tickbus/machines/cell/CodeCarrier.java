package tickbus.machines.cell;

/** The memory at the bottom of a pallet: bytes, read and written in blocks by the head below it. */
public final class CodeCarrier {
    /** The size in bytes. */
    public static final int BYTES = 32;

    /** The size in words of four bytes. */
    static final int WORDS = BYTES / 4;

    private final byte[] memory = new byte[BYTES];

    /**
     * Reads a block.
     *
     * @param address the block's first byte, from 0
     * @param count the number of bytes
     * @return a copy
     * @throws IndexOutOfBoundsException if the block reaches beyond the memory
     */
    public byte[] read(int address, int count) {
        check(address, count);
        byte[] block = new byte[count];
        System.arraycopy(memory, address, block, 0, count);
        return block;
    }

    /**
     * Writes a block.
     *
     * @param address the block's first byte, from 0
     * @param block the bytes
     * @throws IndexOutOfBoundsException if the block reaches beyond the memory; nothing is written then
     */
    public void write(int address, byte[] block) {
        check(address, block.length);
        System.arraycopy(block, 0, memory, address, block.length);
    }

    /** A word, with its first byte as the highest: 0 to 2^32 - 1. */
    long word(int index) {
        long word = 0;
        for (int i = 4 * index; i < 4 * index + 4; i++) {
            word = word << 8 | memory[i] & 0xFF;
        }
        return word;
    }

    void word(int index, long value) {
        for (int i = 0; i < 4; i++) {
            memory[4 * index + i] = (byte) (value >> 24 - 8 * i);
        }
    }

    private static void check(int address, int count) {
        if (address < 0 || count < 0 || address > BYTES - count) {
            throw new IndexOutOfBoundsException("a block of " + count + " bytes from " + address
                    + " in a code carrier of " + BYTES + " bytes");
        }
    }
}
