package tickbus.petri.run;

/** The outputs of a controller, which keep their values until an action changes them, and are written after the scan. */
public final class Outputs {
    final Signals signals;

    Outputs(Signals signals) {
        this.signals = signals;
    }

    /** The index of an output; an {@link IllegalArgumentException} if no input or output has this name. */
    public int index(String name) {
        return signals.index(name);
    }

    /** The value of the output with this index. */
    public double get(int index) {
        return signals.values[index];
    }

    /** The value of the output with this name. */
    public double get(String name) {
        return signals.values[signals.index(name)];
    }

    /** Sets the output with this index. */
    public void set(int index, double value) {
        signals.values[index] = value;
    }

    /** Sets the output with this name. */
    public void set(String name, double value) {
        signals.values[signals.index(name)] = value;
    }

    /** Sets the output with this name to 1 or 0. */
    public void set(String name, boolean on) {
        set(name, on ? 1 : 0);
    }

    /** Sets the output with this index to 1 or 0. */
    public void set(int index, boolean on) {
        set(index, on ? 1 : 0);
    }
}
