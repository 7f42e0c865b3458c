package tickbus.simulator;

import java.util.List;

/** A machine without variables: for control tables that only link drivers with one another. */
public final class NoMachine implements Machine {
    /** Nothing to set up. */
    public NoMachine() {
    }

    @Override
    public String name() {
        return "none";
    }

    @Override
    public List<String> inputs() {
        return List.of();
    }

    @Override
    public List<String> outputs() {
        return List.of();
    }

    @Override
    public void input(int index, double value) {
        throw new IndexOutOfBoundsException(index);
    }

    @Override
    public double output(int index) {
        throw new IndexOutOfBoundsException(index);
    }

    @Override
    public void step(long nanos) {
    }
}
