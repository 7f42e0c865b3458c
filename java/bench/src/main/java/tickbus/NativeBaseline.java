package tickbus;

/** The cheapest native call there is, for benchmarks: it is an inner matter of the package. */
public final class NativeBaseline {
    private NativeBaseline() {
    }

    /** Makes {@link #call} possible. */
    public static void load() {
        NativeLibrary.load();
    }

    /**
     * Crosses into the native library, does nothing there, and comes back.
     *
     * @return 0
     */
    public static int call() {
        return Tickbus.emptyNative();
    }
}
