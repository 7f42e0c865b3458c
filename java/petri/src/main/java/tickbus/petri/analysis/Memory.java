package tickbus.petri.analysis;

/** The heap as a limit of analyses, which give up before it is full. */
final class Memory {
    private Memory() {
    }

    /** True if an analysis may have this many bytes: three quarters of the heap. The rest is for its answers. */
    static boolean has(long bytes) {
        return bytes < Runtime.getRuntime().maxMemory() / 4 * 3;
    }
}
