package tickbus.petri.sfc;

import java.util.ArrayList;
import java.util.HashMap;
import java.util.Iterator;
import java.util.List;
import java.util.Locale;
import java.util.Map;
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
    /** More would fill the memory. */
    static final int MOST = 4_000_000;
    private static final Pattern ONE = Pattern.compile(
        "(?<skip>\\s+|//[^\\n]*|\\(\\*(?s:.*?)\\*\\)|\\{[^}]*\\})"
            + "|%[A-Za-z]+[0-9.]+|(?:T|t|TIME|time)#[-0-9A-Za-z_.]+|16#[0-9A-Fa-f_]+|2#[01_]+|8#[0-7_]+|[0-9][0-9_]*(?:\\.[0-9]+)?"
            + "|[A-Za-z_][A-Za-z0-9_]*|:=|<=|>=|<>|\\((?!\\*)|[-+*/)=<>;:,.&\\[\\]#]");

    /**
     * Text without a gap in the file.
     *
     * @param text the text
     * @param line the line at which it begins, from 1
     * @param column the column at which it begins, from 1
     */
    record Piece(String text, int line, int column) {
    }

    static Word of(String written, int line, int column) {
        return new Word(written.toUpperCase(Locale.ROOT), written, line, column);
    }

    static List<Word> all(String file, String text) {
        return all(file, List.of(new Piece(text, 1, 1)));
    }

    /** The words of some pieces of a file, which follow each other, and the end as the last word. */
    static List<Word> all(String file, List<Piece> pieces) {
        List<Word> words = new ArrayList<>();
        String text = String.join("", pieces.stream().map(Piece::text).toList());
        Matcher matcher = ONE.matcher(text);
        Places places = new Places(pieces);
        // Most words come again and again.
        Map<String, Word> known = new HashMap<>();
        int at = 0;
        while (at < text.length()) {
            places.goTo(text, at);
            if (!matcher.region(at, text.length()).lookingAt()) {
                throw new NetException(file, places.line, "", "column " + places.column(at) + ": '" + shown(text.charAt(at))
                    + "' begins no word" + (text.startsWith("(*", at) ? "; the comment has no end" : ""));
            }
            if (matcher.group("skip") == null) {
                if (words.size() == MOST) {
                    throw new NetException(file, places.line, "", "column " + places.column(at) + ": more than " + MOST + " words");
                }
                Word same = known.computeIfAbsent(matcher.group(), written -> of(written, 0, 0));
                words.add(new Word(same.text, same.written, places.line, places.column(at)));
            }
            at = matcher.end();
        }
        places.goTo(text, at);
        words.add(new Word("", "the end of the file", places.line, places.column(at)));
        return words;
    }

    /** Goes through the lines of the pieces of a text. */
    private static final class Places {
        private final Iterator<Piece> rest;
        private int nextPiece;
        private int at;
        private int line = 1;
        private int lineStart;

        Places(List<Piece> pieces) {
            rest = pieces.iterator();
        }

        /** Continues to an offset in the text. */
        void goTo(String text, int offset) {
            while (true) {
                while (at == nextPiece && rest.hasNext()) {
                    Piece piece = rest.next();
                    line = piece.line;
                    lineStart = at + 1 - piece.column;
                    nextPiece += piece.text.length();
                }
                if (at == offset) {
                    return;
                }
                if (text.charAt(at++) == '\n') {
                    line++;
                    lineStart = at;
                }
            }
        }

        int column(int offset) {
            return offset - lineStart + 1;
        }
    }

    /** Without control characters, which a terminal would execute. */
    private static char shown(char of) {
        return Character.isISOControl(of) ? '\uFFFD' : of;
    }
}
