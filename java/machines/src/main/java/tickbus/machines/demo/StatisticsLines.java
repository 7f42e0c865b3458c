package tickbus.machines.demo;

import java.util.Map;
import java.util.Optional;
import java.util.regex.Matcher;
import java.util.regex.Pattern;
import java.util.stream.Collectors;

/** Statistics in the command's format: a line {@code key=value}, in the key a backslash before each {@code =} and backslash. */
final class StatisticsLines {
    private static final Pattern LINE = Pattern.compile("([^=\\\\]++(?:\\\\.[^=\\\\]*+)*+)=(.*)");

    private StatisticsLines() {
    }

    /** The key and value of a line; empty if the line has no "=". */
    static Optional<Map.Entry<String, String>> read(String line) {
        Matcher entry = LINE.matcher(line);
        return entry.matches()
                ? Optional.of(Map.entry(entry.group(1).replaceAll("\\\\(.)", "$1"), entry.group(2)))
                : Optional.empty();
    }

    static String write(Map<String, String> statistics) {
        return statistics.entrySet().stream()
                .map(entry -> entry.getKey().replaceAll("[=\\\\]", "\\\\$0") + "=" + entry.getValue() + "\n")
                .collect(Collectors.joining());
    }
}
