package tickbus;

import java.util.Comparator;
import java.util.List;
import java.util.Locale;
import java.util.stream.Collectors;

/** Finds the existing names that an unknown name resembles. */
final class NearestNames {
    private static final int SHOWN = 3;

    private NearestNames() {
    }

    /** Text for a message: the most similar names; empty if no name is similar. */
    static String hint(String wrong, List<String> names) {
        int tolerated = Math.max(2, wrong.length() / 3);
        List<String> near = names.stream()
            .filter(name -> distance(wrong, name) <= tolerated)
            .sorted(Comparator.comparingInt(name -> distance(wrong, name)))
            .limit(SHOWN)
            .toList();
        if (near.isEmpty()) {
            return "";
        }
        return near.stream().map(name -> "'" + name + "'").collect(Collectors.joining(", ", "; did you mean ", "?"));
    }

    /** The number of insertions, deletions and replacements that turn one into the other, ignoring case. */
    static int distance(String one, String other) {
        String a = one.toLowerCase(Locale.ROOT);
        String b = other.toLowerCase(Locale.ROOT);
        int[] row = new int[b.length() + 1];
        for (int j = 0; j <= b.length(); j++) {
            row[j] = j;
        }
        for (int i = 1; i <= a.length(); i++) {
            int diagonal = row[0];
            row[0] = i;
            for (int j = 1; j <= b.length(); j++) {
                int replaced = diagonal + (a.charAt(i - 1) == b.charAt(j - 1) ? 0 : 1);
                diagonal = row[j];
                row[j] = Math.min(replaced, Math.min(row[j], row[j - 1]) + 1);
            }
        }
        return row[b.length()];
    }
}
