package tickbus.petri.sfc;

import java.math.BigDecimal;
import java.util.List;
import java.util.Set;
import java.util.regex.Matcher;
import java.util.regex.Pattern;
import tickbus.petri.net.NetException;

/** Goes through the words of a program. */
final class Words {
    /** A longer literal is no time. Its digits would be read in quadratic time. */
    private static final int LONGEST_TIME = 100;
    private static final Pattern PART = Pattern.compile("([0-9]+(?:\\.[0-9]+)?)(D|H|MS|M|S|US|NS)_?");

    private final String file;
    private final List<Word> words;
    private int at;

    Words(String file, String text) {
        this(file, Word.all(file, text));
    }

    /** Goes through words whose last one is the end. */
    Words(String file, List<Word> words) {
        this.file = file;
        this.words = words;
    }

    Word next() {
        Word word = words.get(at);
        at += at < words.size() - 1 ? 1 : 0;
        return word;
    }

    Word look() {
        return words.get(at);
    }

    boolean isNext(String text) {
        return look().text().equals(text);
    }

    int position() {
        return at;
    }

    void goTo(int position) {
        at = position;
    }

    /** The text from one position up to another, without its comments. */
    String text(int from, int to) {
        StringBuilder text = new StringBuilder();
        for (int i = from; i < to; i++) {
            Word word = words.get(i);
            if (i > from) {
                String before = words.get(i - 1).text();
                boolean isClose = Set.of(".", "(").contains(before) || Set.of(".", ")", ";", ",").contains(word.text());
                text.append(words.get(i - 1).line() < word.line() ? "\n" : isClose ? "" : " ");
            }
            text.append(word.written());
        }
        return text.toString();
    }

    /** Takes the next word if it is this one. */
    boolean takes(String text) {
        boolean is = isNext(text);
        at += is ? 1 : 0;
        return is;
    }

    void expect(String text) {
        if (!takes(text)) {
            throw mistake(look(), "'" + look().written() + "'; expected " + text);
        }
    }

    Word name(String of) {
        Word word = next();
        if (!word.text().matches("[A-Z_][A-Z0-9_]*")) {
            throw mistake(word, "'" + word.written() + "'; expected the name of " + of);
        }
        return word;
    }

    NetException mistake(Word word, String message) {
        return new NetException(file, word.line(), "", "column " + word.column() + ": " + message);
    }

    static boolean isTime(Word word) {
        return word.text().startsWith("T#") || word.text().startsWith("TIME#");
    }

    /** Nanoseconds of a literal such as T#1m30s. */
    long time(Word word) {
        String text = word.text().substring(word.text().indexOf('#') + 1);
        if (text.length() > LONGEST_TIME) {
            throw mistake(word, "a time of " + text.length() + " characters; expected one such as T#1m30s");
        }
        Matcher part = PART.matcher(text);
        BigDecimal sum = BigDecimal.ZERO;
        int end = 0;
        while (part.find() && part.start() == end) {
            long unit = switch (part.group(2)) {
                case "D" -> 86_400_000_000_000L;
                case "H" -> 3_600_000_000_000L;
                case "M" -> 60_000_000_000L;
                case "S" -> 1_000_000_000L;
                case "MS" -> 1_000_000L;
                case "US" -> 1_000L;
                default -> 1L;
            };
            sum = sum.add(new BigDecimal(part.group(1)).multiply(BigDecimal.valueOf(unit)));
            end = part.end();
        }
        if (end < text.length() || end == 0 || sum.compareTo(BigDecimal.valueOf(Long.MAX_VALUE)) > 0) {
            throw mistake(word, word.written() + " is no time; expected one such as T#1m30s, at most 292 years");
        }
        return sum.longValue();
    }

    long number(Word word) {
        String text = word.text().replace("_", "");
        int hash = text.indexOf('#');
        try {
            return Long.parseLong(text.substring(hash + 1), hash < 0 ? 10 : Integer.parseInt(text.substring(0, hash)));
        } catch (NumberFormatException wrong) {
            throw mistake(word, "'" + word.written() + "'; expected a whole number"
                + (text.contains(".") ? ", because charts with REAL are not read" : ""));
        }
    }
}
