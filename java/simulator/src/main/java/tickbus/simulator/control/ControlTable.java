package tickbus.simulator.control;

import java.io.IOException;
import java.nio.charset.CharacterCodingException;
import java.nio.file.Files;
import java.nio.file.NoSuchFileException;
import java.nio.file.Path;
import java.util.ArrayList;
import java.util.Collection;
import java.util.HashSet;
import java.util.LinkedHashSet;
import java.util.List;
import java.util.Map;
import java.util.Set;
import java.util.function.DoubleSupplier;
import tickbus.simulator.text.NearestName;

/**
 * Connects hardware components with the machine's variables.
 *
 * <p>The file is text in UTF-8, one row per line, with four columns separated by bars:
 *
 * <pre>
 * # source                     | variable | transfer         | destination
 * 4711:IM1 index               |          |                  | machine:im1.index
 * machine:tank.level           | level    | scale(0.001, 0)  | 4711:Level
 * level                        | full     | gt(2.5)          | 4711:Tank full
 * full, 4711:Enable            |          | and              | machine:valve.open
 *                              |          | TON(full AND NOT "4711:Enable", T#2s) | 4711:Alarm
 * </pre>
 *
 * <ul>
 * <li><b>source</b>: one or several, separated by commas: {@code <driver id>:<component>},
 *       {@code machine:<variable>}, {@code model:<variable>}, or the name of a variable of this table. {@code const} has
 *       none.
 *   <li><b>variable</b>: a name for the row's result, so that other rows can use it; may be empty.
 *   <li><b>transfer</b>: a {@linkplain TransferFunctions transfer function}, empty for a copy of the source; or an {@linkplain
 *       tickbus.simulator.expression.Expression expression in Structured Text}. An expression names variables of the table
 *       as they are, sources in double quotes, and those of its source column {@code IN1}, {@code IN2}, …, or {@code IN}
 *       where there is one. A signal of type BOOL is BOOL there, every other signal LREAL, in its unit; a variable of
 *       the machine is BOOL or LREAL, as the table uses it.
 *   <li><b>destination</b>: {@code <driver id>:<component>} or {@code machine:<variable>}; may be empty if
 *       there is a variable. No destination is written twice.
 * </ul>
 *
 * <p>{@code #} at the start of a line or after a blank begins a comment. A name that contains a bar, a comma, or
 * {@code #} after a blank must be in double quotes. Destinations that no row writes stay 0, except components that have the
 * name of a model's variable, {@code model:<variable>}: they get its value.
 *
 * <p>Rows are computed once per tick, each after the rows whose variables it reads, otherwise in the order
 * of the file. The rows that write to the machine, and those that they depend on, are computed before the machine's
 * step: they see the latest values of the drivers and the machine as of the previous step. All others are computed
 * after the step and see the machine's current state.
 */
public final class ControlTable {
    private final Endpoints endpoints;
    private final Map<String, Integer> variables;
    private final Binder.BoundRow[] beforeStep;
    private final Binder.BoundRow[] afterStep;
    private final double[] values;
    private final double[] destinations;

    private ControlTable(Endpoints endpoints, Binder binder) {
        this.endpoints = endpoints;
        variables = Map.copyOf(binder.variables());
        beforeStep = binder.beforeStep().toArray(Binder.BoundRow[]::new);
        afterStep = binder.afterStep().toArray(Binder.BoundRow[]::new);
        values = new double[endpoints.sources().size() + variables.size()];
        destinations = new double[endpoints.destinations().size()];
    }

    /**
     * Reads a control table from a file.
     *
     * @param file the file
     * @param endpoints the names that rows can use
     * @param stepNanos the simulation's step size in nanoseconds, above 0; the unit of delays
     * @return the table, all values 0
     * @throws ControlTableException with all mistakes, or if the file cannot be read
     */
    public static ControlTable load(Path file, Endpoints endpoints, long stepNanos) {
        String text;
        try {
            text = Files.readString(file);
        } catch (NoSuchFileException e) {
            throw new ControlTableException(List.of(new Mistake(file.toString(), 0,
                    "there is no such file; name an existing control table")));
        } catch (CharacterCodingException e) {
            throw new ControlTableException(List.of(new Mistake(file.toString(), 0,
                    "this is no text in UTF-8; save it as UTF-8")));
        } catch (IOException e) {
            throw new ControlTableException(List.of(new Mistake(file.toString(), 0, "cannot be read: " + e)));
        }
        return parse(file.toString(), text, endpoints, stepNanos);
    }

    /**
     * Reads a control table.
     *
     * @param file the file's name in messages
     * @param text its content
     * @param endpoints the names that rows can use
     * @param stepNanos the simulation's step size in nanoseconds, above 0; the unit of delays
     * @return the table, all values 0
     * @throws ControlTableException with all mistakes
     */
    public static ControlTable parse(String file, String text, Endpoints endpoints, long stepNanos) {
        List<Mistake> mistakes = new ArrayList<>();
        List<Row> rows = new RowReader(file, mistakes).read(text);
        Binder binder = new Binder(file, endpoints, stepNanos, mistakes);
        binder.bind(rows);
        if (!mistakes.isEmpty()) {
            throw new ControlTableException(mistakes);
        }
        return new ControlTable(endpoints, binder);
    }

    /**
     * Sets consecutive sources, numbered as in {@link Endpoints#sources}.
     *
     * @param first number of the first
     * @param block their values
     */
    public void setSources(int first, double[] block) {
        System.arraycopy(block, 0, values, first, block.length);
    }

    /**
     * Sets one source.
     *
     * @param index the source's number in {@link Endpoints#sources}
     * @param value the source's value
     */
    public void setSource(int index, double value) {
        values[index] = value;
    }

    /** Computes the rows that the machine's inputs depend on. */
    public void computeBeforeStep() {
        compute(beforeStep);
    }

    /** Computes all other rows. */
    public void computeAfterStep() {
        compute(afterStep);
    }

    /**
     * A destination's value.
     *
     * @param index the destination's number in {@link Endpoints#destinations}
     * @return the value of the last computation
     */
    public double destination(int index) {
        return destinations[index];
    }

    /**
     * Copies consecutive destinations.
     *
     * @param first number of the first in {@link Endpoints#destinations}
     * @param block gets as many values as it has room for
     */
    public void getDestinations(int first, double[] block) {
        System.arraycopy(destinations, first, block, 0, block.length);
    }

    /**
     * A window on one value, for displays.
     *
     * @param name of a source, a destination or a variable
     * @return gives the current value at each call; allocates nothing
     * @throws IllegalArgumentException if nothing has this name; the message has the nearest one
     */
    public DoubleSupplier probe(String name) {
        Integer value = endpoints.sources().getOrDefault(name, variables.get(name));
        if (value != null) {
            int index = value;
            return () -> values[index];
        }
        Integer destination = endpoints.destinations().get(name);
        if (destination != null) {
            int index = destination;
            return () -> destinations[index];
        }
        Set<String> known = new LinkedHashSet<>(endpoints.sources().keySet());
        known.addAll(endpoints.destinations().keySet());
        known.addAll(variables.keySet());
        throw new IllegalArgumentException(
                "there is no source, destination or variable \"" + name + "\"" + NearestName.hint(name, known));
    }

    /**
     * Destinations that no row writes; they stay 0.
     *
     * @return their names in numerical order
     */
    public List<String> unconnected() {
        Set<String> names = new LinkedHashSet<>(endpoints.destinations().keySet());
        names.removeAll(written(List.of(beforeStep)));
        names.removeAll(written(List.of(afterStep)));
        return List.copyOf(names);
    }

    /**
     * Signals and machine outputs that no row reads. Values that only an observer reads are not among them: those about the
     * exchange itself, such as the age of data, and the model's variables.
     *
     * @return their names in numerical order
     */
    public List<String> unread() {
        Set<Integer> read = read();
        return endpoints.sources().entrySet().stream()
                .filter(source -> !read.contains(source.getValue()) && endpoints.isSignal(source.getValue()))
                .map(Map.Entry::getKey).toList();
    }

    /**
     * Returns whether a row reads a source.
     *
     * @param index the source's number in {@link Endpoints#sources}
     * @return false if the source need not be set
     */
    public boolean reads(int index) {
        return read().contains(index);
    }

    private Set<Integer> read() {
        Set<Integer> read = new HashSet<>();
        for (Binder.BoundRow[] rows : List.of(beforeStep, afterStep)) {
            for (Binder.BoundRow row : rows) {
                for (int index : row.from) {
                    read.add(index);
                }
            }
        }
        return read;
    }

    private static Set<String> written(Collection<Binder.BoundRow> rows) {
        Set<String> names = new LinkedHashSet<>();
        rows.forEach(row -> names.add(row.row.destination()));
        return names;
    }

    private void compute(Binder.BoundRow[] rows) {
        for (Binder.BoundRow row : rows) {
            double result = row.function.apply(values, row.from);
            if (row.variable >= 0) {
                values[row.variable] = result;
            }
            if (row.destination >= 0) {
                destinations[row.destination] = result;
            }
        }
    }
}
