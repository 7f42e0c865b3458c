package tickbus.petri.command;

import java.util.ArrayList;
import java.util.HashMap;
import java.util.List;
import java.util.Map;

/** The words behind a command: one file, and options with a value, some of which can be repeated. */
final class CommandLine {
    /** An option that needs no value, because its value is unmistakable: an address with a port. */
    private static final String PAGE = "--page";

    private final Map<String, List<String>> options = new HashMap<>();
    private final String file;

    CommandLine(List<String> words, List<String> known) {
        String found = null;
        for (int i = 0; i < words.size(); i++) {
            String word = words.get(i);
            if (!word.startsWith("--")) {
                if (found != null) {
                    throw new UsageException("there are two files, '" + found + "' and '" + word + "'; expected one");
                }
                found = word;
                continue;
            }
            if (!known.contains(word)) {
                throw new UsageException("there is no option '" + word + "' here; there are " + String.join(", ", known));
            }
            List<String> values = options.computeIfAbsent(word, key -> new ArrayList<>());
            boolean more = i + 1 < words.size();
            if (word.equals(PAGE) && !(more && words.get(i + 1).matches(".*:\\d+"))) {
                values.add("127.0.0.1:0");
            } else if (!more) {
                throw new UsageException(word + " needs a value behind it");
            } else {
                values.add(words.get(++i));
            }
        }
        if (found == null) {
            throw new UsageException("there is no file; expected a net in PNML, in .hpx, or in HPSim's text");
        }
        file = found;
    }

    String file() {
        return file;
    }

    List<String> all(String option) {
        return options.getOrDefault(option, List.of());
    }

    boolean has(String option) {
        return options.containsKey(option);
    }

    /** The value of an option that is given at most once. */
    String one(String option, String otherwise) {
        List<String> values = all(option);
        if (values.size() > 1) {
            throw new UsageException(option + " is given twice");
        }
        return values.isEmpty() ? otherwise : values.get(0);
    }

    long number(String option, long otherwise, long least, long most) {
        String text = one(option, Long.toString(otherwise));
        try {
            long value = Long.parseLong(text);
            if (value >= least && value <= most) {
                return value;
            }
        } catch (NumberFormatException none) {
            // The message below says what was expected.
        }
        throw new UsageException(option + " " + text + ": expected a whole number from " + least + " to " + most);
    }
}
