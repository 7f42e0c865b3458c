package tickbus.petri.run;

/** The inputs of a scan, read once at its start and constant until its end. */
public final class Inputs {
    final Signals signals;

    Inputs(Signals signals) {
        this.signals = signals;
    }

    /** The index of an input; an {@link IllegalArgumentException} if no input or output has this name. */
    public int index(String name) {
        return signals.index(name);
    }

    /** The value of the input with this index. */
    public double get(int index) {
        return signals.values[index];
    }

    /** The value of the input with this name. */
    public double get(String name) {
        return signals.values[signals.index(name)];
    }

    /** True if the input with this index is not 0. */
    public boolean isOn(int index) {
        return signals.values[index] != 0;
    }

    /** True if the input with this name is not 0. */
    public boolean isOn(String name) {
        return get(name) != 0;
    }
}
