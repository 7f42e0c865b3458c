package tickbus.simulator;

import java.util.ArrayList;
import java.util.LinkedHashMap;
import java.util.List;
import java.util.Map;
import java.util.function.DoubleConsumer;
import tickbus.simulator.text.NearestName;

/** The faults of a machine model, each with the method that sets its value. */
public final class ModelFaults {
    /** The values of a fault that is on or off. */
    private static final String ON = "1";

    private final List<ModelFault> faults = new ArrayList<>();
    private final Map<String, DoubleConsumer> setters = new LinkedHashMap<>();

    /** A model without faults. */
    public ModelFaults() {
    }

    /** Sets a fault on or off. */
    @FunctionalInterface
    public interface Switch {
        /**
         * The fault begins or ends.
         *
         * @param on false when it ends
         */
        void set(boolean on);
    }

    /**
     * Adds a fault that is on or off.
     *
     * @param name a name that no other fault has
     * @param effect what happens, for people
     * @param setter gets true for every value but 0
     */
    public void add(String name, String effect, Switch setter) {
        add(new ModelFault(name, ON, effect), value -> setter.set(value != 0));
    }

    /**
     * Adds a fault with a size.
     *
     * @param name a name that no other fault has
     * @param most its greatest value, above 0; a value beyond it, or below 0, becomes the nearest one in the range
     * @param unit the unit; empty for none
     * @param effect what happens, for people
     * @param setter gets the value, 0 for no fault
     */
    public void add(String name, double most, String unit, String effect, DoubleConsumer setter) {
        String top = most == Math.rint(most) ? String.valueOf((long) most) : String.valueOf(most);
        add(new ModelFault(name, ("0 to " + top + " " + unit).strip(), effect),
                value -> setter.accept(Math.max(0, Math.min(most, value))));
    }

    private void add(ModelFault fault, DoubleConsumer setter) {
        if (setters.put(fault.name(), setter) != null) {
            throw new IllegalArgumentException("two faults of the model are called \"" + fault.name() + "\"");
        }
        faults.add(fault);
    }

    /**
     * All faults.
     *
     * @return unmodifiable, in the order in which they were added
     */
    public List<ModelFault> list() {
        return List.copyOf(faults);
    }

    /**
     * Sets the value of a fault.
     *
     * @param name the fault's name
     * @param value its value; 0 ends it
     * @throws IllegalArgumentException if there is no such fault; the message has the nearest name
     */
    public void set(String name, double value) {
        DoubleConsumer setter = setters.get(name);
        if (setter == null) {
            throw new IllegalArgumentException("the machine has no fault \"" + name + "\""
                    + NearestName.hint(name, setters.keySet()));
        }
        setter.accept(value);
    }
}
