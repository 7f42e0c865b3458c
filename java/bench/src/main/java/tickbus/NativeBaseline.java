package tickbus;

/** The cheapest native call possible, for benchmarks; package-private in the library. */
public final class NativeBaseline {
    private NativeBaseline() {
    }

    /** Loads the library, which {@link #call} needs. */
    public static void load() {
        NativeLibrary.load();
    }

    /**
     * Calls the native library, which returns at once.
     *
     * @return 0
     */
    public static int call() {
        return Tickbus.emptyNative();
    }
}
