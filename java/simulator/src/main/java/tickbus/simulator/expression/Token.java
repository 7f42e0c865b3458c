package tickbus.simulator.expression;

/**
 * A word, name, literal or sign of an expression.
 *
 * @param kind what it is
 * @param text as written; a quoted name without its quotes, a word that is no name in capitals
 * @param offset characters from the beginning of the expression
 * @param number the value of a literal: a whole number, the bits of a real one, or nanoseconds
 */
record Token(Kind kind, String text, int offset, long number) {
    /** The kinds of tokens. */
    enum Kind {
        /** A name, or a word of the language. */
        WORD,
        /** A name in double quotes. */
        QUOTED,
        /** A literal of type LINT. */
        WHOLE,
        /** A literal of type LREAL. */
        REAL,
        /** A literal of type TIME. */
        TIME,
        /** An operator or a bracket. */
        SIGN,
        /** Behind the last token. */
        END
    }

    boolean is(String sign) {
        return kind == Kind.SIGN && text.equals(sign);
    }

    boolean isWord(String word) {
        return kind == Kind.WORD && text.equalsIgnoreCase(word);
    }

    /** The token in messages. */
    String told() {
        return kind == Kind.END ? "the end" : kind == Kind.QUOTED ? '"' + text + '"' : "\"" + text + "\"";
    }
}
