package tickbus;

/** The cheapest native call possible, for benchmarks; package-private in the library. */
public final class NativeBaseline {
    private NativeBaseline() {
    }

    /** Makes {@link #call} possible. */
    public static void load() {
        NativeLibrary.load();
    }

    /**
     * Calls the native library, which does nothing, and returns.
     *
     * @return 0
     */
    public static int call() {
        return Tickbus.emptyNative();
    }
}
