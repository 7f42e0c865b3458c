package tickbus.simulator;

/**
 * A fault that a machine model can have.
 *
 * @param name the name by which a fault of the kind {@code model} names it
 * @param values the values that it can have and their unit, such as {@code 0 to 20 mm}; 0 is no fault
 * @param effect what happens, for people
 */
public record ModelFault(String name, String values, String effect) {
}
