package tickbus.petri.sfc;

import java.util.ArrayList;
import java.util.List;
import java.util.Locale;
import java.util.regex.Matcher;
import java.util.regex.Pattern;
import tickbus.petri.net.NetException;

/**
 * A word or sign of a program.
 *
 * @param text in capitals
 * @param written as in the file
 * @param line from 1
 * @param column from 1
 */
record Word(String text, String written, int line, int column) {
    private static final Pattern ONE = Pattern.compile(
        "(?<skip>\\s+|//[^\\n]*|\\(\\*(?s:.*?)\\*\\)|\\{[^}]*\\})"
            + "|%[A-Za-z]+[0-9.]+|(?:T|t|TIME|time)#[-0-9A-Za-z_.]+|16#[0-9A-Fa-f_]+|2#[01_]+|8#[0-7_]+|[0-9][0-9_]*(?:\\.[0-9]+)?"
            + "|[A-Za-z_][A-Za-z0-9_]*|:=|<=|>=|<>|\\((?!\\*)|[-+*/)=<>;:,.&\\[\\]#]");

    static List<Word> all(String file, String text) {
        List<Word> words = new ArrayList<>();
        Matcher matcher = ONE.matcher(text);
        int line = 1;
        int lineStart = 0;
        int at = 0;
        while (at < text.length()) {
            if (!matcher.region(at, text.length()).lookingAt()) {
                throw new NetException(file, line, "", "column " + (at - lineStart + 1) + ": '" + shown(text.charAt(at))
                    + "' begins no word" + (text.startsWith("(*", at) ? "; the comment has no end" : ""));
            }
            if (matcher.group("skip") == null) {
                words.add(new Word(matcher.group().toUpperCase(Locale.ROOT), matcher.group(), line, at - lineStart + 1));
            }
            for (int i = at; i < matcher.end(); i++) {
                if (text.charAt(i) == '\n') {
                    line++;
                    lineStart = i + 1;
                }
            }
            at = matcher.end();
        }
        words.add(new Word("", "the end of the file", line, text.length() - lineStart + 1));
        return words;
    }

    /** Without control characters, which a terminal would execute. */
    private static char shown(char of) {
        return Character.isISOControl(of) ? '\uFFFD' : of;
    }
}
