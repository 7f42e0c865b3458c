package tickbus;

import java.util.LinkedHashMap;
import java.util.Map;
import java.util.regex.Matcher;
import java.util.regex.Pattern;
import java.util.stream.Collectors;

/** Statistics as text: a line {@code key=value} per entry, and in the key a backslash before each {@code =} and backslash. */
final class StatisticsText {
    private static final Pattern ENTRY = Pattern.compile("([^=\\\\]++(?:\\\\.[^=\\\\]*+)*+)=(.*)");

    private StatisticsText() {
    }

    static Map<String, String> read(String text) {
        Map<String, String> statistics = new LinkedHashMap<>();
        text.lines().map(ENTRY::matcher).filter(Matcher::matches)
            .forEach(entry -> statistics.put(entry.group(1).replaceAll("\\\\(.)", "$1"), entry.group(2)));
        return statistics;
    }

    static String write(Map<String, String> statistics) {
        return statistics.entrySet().stream()
            .map(entry -> entry.getKey().replaceAll("[=\\\\]", "\\\\$0") + "=" + entry.getValue())
            .collect(Collectors.joining("\n"));
    }
}
