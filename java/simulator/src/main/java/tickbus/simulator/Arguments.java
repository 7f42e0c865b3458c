package tickbus.simulator;

import java.nio.file.InvalidPathException;
import java.nio.file.Path;
import java.util.ArrayList;
import java.util.HashMap;
import java.util.HashSet;
import java.util.List;
import java.util.Map;
import java.util.Set;
import tickbus.simulator.text.Durations;
import tickbus.simulator.text.NearestName;

/** Command line options of the form {@code --name value} and {@code --flag}. */
public final class Arguments {
    /** A command line that cannot be understood. */
    public static final class UsageException extends RuntimeException {
        private static final long serialVersionUID = 1L;

        UsageException(String message) {
            super(message);
        }
    }

    private final Map<String, String> values = new HashMap<>();
    private final Set<String> flags = new HashSet<>();

    /**
     * Reads a command line.
     *
     * @param line the words
     * @param options names of the options that take a value, with their dashes
     * @param flagNames names of the options without a value
     * @throws UsageException if an option is unknown, given twice, or lacks its value
     */
    public Arguments(String[] line, List<String> options, List<String> flagNames) {
        for (int i = 0; i < line.length; i++) {
            String name = line[i];
            if (flagNames.contains(name)) {
                flags.add(name);
            } else if (!options.contains(name)) {
                List<String> known = new ArrayList<>(options);
                known.addAll(flagNames);
                throw new UsageException("there is no option \"" + name + "\"" + NearestName.hint(name, known));
            } else if (i + 1 == line.length) {
                throw new UsageException(name + " needs a value behind it");
            } else if (values.put(name, line[++i]) != null) {
                throw new UsageException(name + " is given twice");
            }
        }
    }

    /**
     * Returns whether a flag is given.
     *
     * @param name with its dashes
     * @return true if it is given
     */
    public boolean has(String name) {
        return flags.contains(name) || values.containsKey(name);
    }

    /**
     * The words of a value.
     *
     * @param name with its dashes
     * @return the words between its blanks
     */
    public List<String> words(String name) {
        return List.of(values.getOrDefault(name, "").strip().split(" +"));
    }

    /**
     * A path that must be given.
     *
     * @param name with its dashes
     * @return the option's value
     * @throws UsageException if the option is missing or not a path
     */
    public Path path(String name) {
        String value = values.get(name);
        if (value == null) {
            throw new UsageException(name + " is missing");
        }
        try {
            return Path.of(value);
        } catch (InvalidPathException e) {
            throw new UsageException(name + " is \"" + value + "\"; that is no path: " + e.getMessage());
        }
    }

    /**
     * A duration.
     *
     * @param name with its dashes
     * @param otherwise the option's default
     * @return nanoseconds, above 0
     * @throws UsageException if the value is not a duration, or 0
     */
    public long duration(String name, String otherwise) {
        try {
            long nanos = Durations.parse(values.getOrDefault(name, otherwise));
            if (nanos > 0) {
                return nanos;
            }
        } catch (IllegalArgumentException e) {
            throw new UsageException(name + ": " + e.getMessage());
        }
        throw new UsageException(name + " is " + values.get(name) + "; it must be above 0");
    }

    /**
     * A count.
     *
     * @param name with its dashes
     * @param otherwise the option's default
     * @return 1 to 1,000,000
     * @throws UsageException if the value is anything else
     */
    public int count(String name, int otherwise) {
        String value = values.getOrDefault(name, String.valueOf(otherwise));
        if (!value.matches("[1-9]\\d{0,5}|1000000")) {
            throw new UsageException(name + " is \"" + value + "\"; it must be a whole number, 1 to 1000000");
        }
        return Integer.parseInt(value);
    }

    /**
     * One of several words.
     *
     * @param <T> the type of the choices
     * @param name with its dashes
     * @param choices the words and their meanings
     * @param otherwise the word if the option is not given
     * @return the meaning of the given word
     * @throws UsageException if it is another word
     */
    public <T> T choice(String name, Map<String, T> choices, String otherwise) {
        String value = values.getOrDefault(name, otherwise);
        if (!choices.containsKey(value)) {
            throw new UsageException(name + " is \"" + value + "\"; it must be " + (choices.size() == 1 ? "" : "one of ")
                    + String.join(", ", choices.keySet().stream().sorted().toList()));
        }
        return choices.get(value);
    }

    /** The values of {@code --mode}. */
    public static final Map<String, TickMode> MODES =
            Map.of("real-time", TickMode.REAL_TIME, "best-effort", TickMode.BEST_EFFORT);
}
