package tickbus;

import java.util.List;

/** The faults that a simulation's model has declared, on their way from the native library to the model. */
final class ModelFaults {
    /** The most changes fetched by one native call. */
    private static final int CHANGES = 32;
    /** Doubles per change: the place of the fault among the names, and its value. */
    private static final int CHANGE_WORDS = 2;

    private final long handle;
    private final List<String> names;
    private final double[] changes = new double[CHANGES * CHANGE_WORDS];

    private ModelFaults(long handle, List<String> names) {
        this.handle = handle;
        this.names = names;
    }

    /** Declares these names to the driver of a handle; throws {@link FieldbusException}. */
    static ModelFaults declare(long handle, List<String> names) {
        declareNative(handle, String.join("\n", names));
        return new ModelFaults(handle, names);
    }

    /** Hands over all changes since the last call, and returns their number; throws {@link FieldbusException}. */
    int poll(FaultHandler handler) {
        if (!hasNative(handle)) {
            return 0;
        }
        int total = 0;
        int count = CHANGES;
        while (count == CHANGES) {
            count = take();
            for (int i = 0; i < count; i++) {
                handler.fault(names.get((int) changes[i * CHANGE_WORDS]), changes[i * CHANGE_WORDS + 1]);
            }
            total += count;
        }
        return total;
    }

    /** Fetches changes. Like {@link Patience#untilIdle}, which would allocate. */
    private int take() {
        while (true) {
            try {
                return takeNative(handle, changes);
            } catch (FieldbusException e) {
                Patience.waitAfter(e);
            }
        }
    }

    /** Takes the names of the model's faults, one a line; throws {@link FieldbusException}. */
    private static native void declareNative(long handle, String names);

    /** False if there is no change; like a tick, this does not enter the JVM again. */
    private static native boolean hasNative(long handle);

    /** Moves changes into {@code into}, and returns their number; throws {@link FieldbusException}. */
    private static native int takeNative(long handle, double[] into);
}
