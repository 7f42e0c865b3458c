package tickbus.simulator.expression;

/** The names that an expression can use: variables and sources of a control table. */
public interface Names {
    /**
     * Resolves a name.
     *
     * @param name as written, without quotes
     * @return the index among the table's values
     * @throws IllegalArgumentException with a text for people, if nothing has this name
     */
    int index(String name);

    /**
     * The type of a value.
     *
     * @param index as {@link #index} returned it
     * @return null if the value has no type of its own: a machine's variable is BOOL or LREAL, as it is used
     */
    Type type(int index);

    /**
     * The type with which a value without a type is used.
     *
     * @param index as {@link #index} returned it
     * @return null before its first {@link #use}
     */
    Type used(int index);

    /**
     * A value without a type is used as one, and has this type from now on.
     *
     * @param index as {@link #index} returned it
     * @param type BOOL or LREAL
     */
    void use(int index, Type type);
}
