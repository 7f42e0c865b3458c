package tickbus.simulator.control;

import java.util.ArrayList;
import java.util.LinkedHashMap;
import java.util.List;
import java.util.Locale;
import java.util.Map;
import java.util.Set;
import java.util.regex.Matcher;
import java.util.regex.Pattern;
import tickbus.simulator.expression.Expression;
import tickbus.simulator.expression.Type;
import tickbus.simulator.text.Columns;
import tickbus.simulator.text.Durations;
import tickbus.simulator.text.NearestName;

/**
 * The fixed set of transfer functions. Any other text of a transfer column is an {@link Expression}.
 *
 * <p>Values are doubles; 0 is false, every other value is true, and Boolean results are 0 or 1. Every function is assumed to
 * have seen 0 before its first tick, so that a value that starts at 1 rises at once.
 */
public final class TransferFunctions {
    /** A longer delay, in ticks, counts as a mistake. */
    private static final long LONGEST_DELAY_TICKS = 1_000_000;

    private static final Pattern CALL = Pattern.compile("([A-Za-z-]+)\\s*(?:\\((.*)\\))?");

    /** Words that begin an expression, although a function could have the same name. */
    private static final Set<String> WORDS = Set.of("NOT", "TRUE", "FALSE", "IN");
    private static final Set<String> BOOLEAN = Set.of("not", "and", "or", "bit", "rising", "falling", "gt", "lt");
    private static final Set<String> AS_SOURCE = Set.of("copy", "const", "deadband", "delay");

    private static final Map<String, Kind> KINDS = new LinkedHashMap<>();

    /** Makes a function from its checked count of arguments and the step size in nanoseconds. */
    @FunctionalInterface
    private interface Maker {
        TransferFunction make(String[] arguments, long stepNanos);
    }

    private record Kind(String name, List<String> parameters, int fewest, int most, String meaning, Maker maker) {
        String call() {
            return parameters.isEmpty() ? name : name + "(" + String.join(", ", parameters) + ")";
        }
    }

    static {
        one("copy", "the source; an empty transfer column means the same", (a, step) -> (v, from) -> v[from[0]]);
        one("not", "1 if the source is 0, else 0", (a, step) -> (v, from) -> truth(v[from[0]] == 0));
        many("and", "1 if no source is 0", (a, step) -> TransferFunctions::and);
        many("or", "1 if any source is not 0", (a, step) -> TransferFunctions::or);
        many("add", "the sum of the sources", (a, step) -> TransferFunctions::add);
        one("scale", "source × gain + offset", TransferFunctions::scale, "gain", "offset");
        one("clamp", "the source, but never below lo or above hi", TransferFunctions::clamp, "lo", "hi");
        one("deadband", "holds its result until the source is more than width away from it",
                (a, step) -> new Stateful.Deadband(notNegative(a[0], "width")), "width");
        one("bit", "bit n, 0 to 52, of the source as a whole number (two's complement)",
                TransferFunctions::bit, "n");
        one("rising", "1 for the one tick in which the source leaves 0", (a, step) -> new Stateful.Edge(true));
        one("falling", "1 for the one tick in which the source becomes 0", (a, step) -> new Stateful.Edge(false));
        one("delay", "the source as it was a duration ago, rounded up to whole ticks; 0 until then",
                TransferFunctions::delay, "duration");
        one("gt", "1 if the source is greater than x", TransferFunctions::greater, "x");
        one("lt", "1 if the source is less than x", TransferFunctions::less, "x");
        add(new Kind("const", List.of("x"), 0, 0, "always x; takes no source", TransferFunctions::constant));
    }

    private TransferFunctions() {
    }

    private static void one(String name, String meaning, Maker maker, String... parameters) {
        add(new Kind(name, List.of(parameters), 1, 1, meaning, maker));
    }

    private static void many(String name, String meaning, Maker maker) {
        add(new Kind(name, List.of(), 1, Integer.MAX_VALUE, meaning, maker));
    }

    private static void add(Kind kind) {
        KINDS.put(kind.name(), kind);
    }

    /**
     * The functions, for people.
     *
     * @return a table with one line per function
     */
    public static String help() {
        Columns table = new Columns("function", "sources", "result");
        for (Kind kind : KINDS.values()) {
            String sources = kind.most == 0 ? "none" : kind.most == 1 ? "one" : "one or more";
            table.row(kind.call(), sources, kind.meaning);
        }
        return table.text("  ");
    }

    /**
     * Returns whether a text calls one of these functions, rightly or not; else it is an expression.
     *
     * @param text of the transfer column
     * @param variables the names of the table's variables
     * @return true also for an unknown word, which is more likely a function than a name
     */
    static boolean isCall(String text, Set<String> variables) {
        Matcher call = CALL.matcher(text);
        if (text.isEmpty() || !call.matches()) {
            return text.isEmpty();
        }
        String name = call.group(1);
        if (KINDS.containsKey(name)) {
            // "not" alone is the function, not (a OR b) an expression.
            return !name.equals("not") || call.group(2) == null;
        }
        String capitals = name.toUpperCase(Locale.ROOT);
        return name.indexOf('-') < 0 && !variables.contains(name) && !WORDS.contains(capitals)
                && !Expression.functions().contains(capitals);
    }

    private static Matcher call(String text) {
        Matcher call = CALL.matcher(text.isEmpty() ? "copy" : text);
        if (!call.matches()) {
            throw new IllegalArgumentException("\"" + text + "\" calls no transfer function");
        }
        return call;
    }

    /**
     * The type of a function's result in expressions.
     *
     * @param text of the transfer column, with a function that exists
     * @param source the type of its source, null if that has none
     * @return null if the result has no type either
     */
    static Type result(String text, Type source) {
        String name = call(text).group(1);
        if (AS_SOURCE.contains(name)) {
            return source;
        }
        return BOOLEAN.contains(name) ? Type.BOOL : Type.LREAL;
    }

    /**
     * Makes a function from the text of a transfer column.
     *
     * @param text such as {@code scale(2, 0)}, of which {@link #isCall} is true
     * @param sources the number of the row's sources
     * @param stepNanos the simulation's step size
     * @return the function
     * @throws IllegalArgumentException with a text for people, if there is no such function or it does not fit
     */
    static TransferFunction read(String text, int sources, long stepNanos) {
        Matcher call = call(text);
        Kind kind = KINDS.get(call.group(1));
        if (kind == null) {
            List<String> known = new ArrayList<>(KINDS.keySet());
            known.addAll(Expression.functions());
            String hint = NearestName.hint(call.group(1), known);
            throw new IllegalArgumentException("there is no transfer function \"" + call.group(1) + "\""
                    + (hint.isEmpty() ? "; there are " + String.join(", ", KINDS.keySet()) : hint));
        }
        String[] arguments = arguments(call.group(2));
        if (arguments.length != kind.parameters.size()) {
            throw new IllegalArgumentException("\"" + text + "\" has " + count(arguments.length, "value")
                    + " in parentheses; right is " + kind.call());
        }
        if (sources < kind.fewest || sources > kind.most) {
            String want = kind.most == 0 ? "no source" : kind.most == 1 ? "one source" : "at least one source";
            throw new IllegalArgumentException(
                    kind.name + " takes " + want + ", this row has " + count(sources, "source"));
        }
        return kind.maker.make(arguments, stepNanos);
    }

    private static String count(int count, String noun) {
        return (count == 0 ? "no" : String.valueOf(count)) + " " + noun + (count == 1 ? "" : "s");
    }

    private static String[] arguments(String inside) {
        if (inside == null || inside.isBlank()) {
            return new String[0];
        }
        List<String> arguments = new ArrayList<>();
        for (String argument : inside.split(",", -1)) {
            arguments.add(argument.strip());
        }
        return arguments.toArray(String[]::new);
    }

    private static double number(String text, String parameter) {
        try {
            double number = Double.parseDouble(text);
            if (Double.isFinite(number)) {
                return number;
            }
        } catch (NumberFormatException e) {
            // Reported below, together with values that Java parses as numbers but that are useless here.
        }
        throw new IllegalArgumentException(parameter + " is \"" + text + "\"; it must be a finite number");
    }

    private static double notNegative(String text, String parameter) {
        double number = number(text, parameter);
        if (number < 0) {
            throw new IllegalArgumentException(parameter + " is " + text + "; it must be 0 or more");
        }
        return number;
    }

    private static double truth(boolean value) {
        return value ? 1 : 0;
    }

    private static double and(double[] values, int[] from) {
        for (int index : from) {
            if (values[index] == 0) {
                return 0;
            }
        }
        return 1;
    }

    private static double or(double[] values, int[] from) {
        for (int index : from) {
            if (values[index] != 0) {
                return 1;
            }
        }
        return 0;
    }

    private static double add(double[] values, int[] from) {
        double sum = 0;
        for (int index : from) {
            sum += values[index];
        }
        return sum;
    }

    private static TransferFunction scale(String[] arguments, long stepNanos) {
        double gain = number(arguments[0], "gain");
        double offset = number(arguments[1], "offset");
        return (v, from) -> v[from[0]] * gain + offset;
    }

    private static TransferFunction clamp(String[] arguments, long stepNanos) {
        double lo = number(arguments[0], "lo");
        double hi = number(arguments[1], "hi");
        if (lo > hi) {
            throw new IllegalArgumentException("lo is " + arguments[0] + " and greater than hi, " + arguments[1]);
        }
        return (v, from) -> Math.max(lo, Math.min(hi, v[from[0]]));
    }

    private static TransferFunction bit(String[] arguments, long stepNanos) {
        if (!arguments[0].matches("\\d{1,2}") || Integer.parseInt(arguments[0]) > 52) {
            throw new IllegalArgumentException("n is \"" + arguments[0] + "\"; it must be a whole number, 0 to 52");
        }
        int n = Integer.parseInt(arguments[0]);
        return (v, from) -> (double) ((long) v[from[0]] >> n & 1);
    }

    private static TransferFunction delay(String[] arguments, long stepNanos) {
        long ticks = (Durations.parse(arguments[0]) + stepNanos - 1) / stepNanos;
        if (ticks < 1 || ticks > LONGEST_DELAY_TICKS) {
            throw new IllegalArgumentException("a delay of " + arguments[0] + " is " + ticks + " ticks of "
                    + Durations.text(stepNanos) + "; it must be 1 to " + LONGEST_DELAY_TICKS + " ticks");
        }
        return new Stateful.Delay((int) ticks);
    }

    private static TransferFunction greater(String[] arguments, long stepNanos) {
        double x = number(arguments[0], "x");
        return (v, from) -> truth(v[from[0]] > x);
    }

    private static TransferFunction less(String[] arguments, long stepNanos) {
        double x = number(arguments[0], "x");
        return (v, from) -> truth(v[from[0]] < x);
    }

    private static TransferFunction constant(String[] arguments, long stepNanos) {
        double x = number(arguments[0], "x");
        return (v, from) -> x;
    }
}
