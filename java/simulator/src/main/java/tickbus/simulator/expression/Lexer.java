package tickbus.simulator.expression;

import java.math.BigDecimal;
import java.util.ArrayList;
import java.util.List;
import java.util.Locale;
import java.util.regex.Matcher;
import java.util.regex.Pattern;

/** Splits the text of an expression into tokens. */
final class Lexer {
    private static final Pattern BLANK = Pattern.compile("\\s+");
    private static final Pattern QUOTED = Pattern.compile("\"([^\"]*)\"");
    /** TIME literals before words: both begin with a letter. */
    private static final Pattern TIME = Pattern.compile("(?i)(?:T|TIME)#(-?)([0-9a-z_.]*)");
    private static final Pattern TIME_PART = Pattern.compile("(\\d+(?:\\.\\d+)?)(ms|us|ns|d|h|m|s)");
    private static final Pattern BASED = Pattern.compile("(2|8|16)#([0-9A-Fa-f_]+)");
    private static final Pattern REAL = Pattern.compile("[0-9][0-9_]*(?:\\.[0-9][0-9_]*(?:[eE][+-]?\\d+)?|[eE][+-]?\\d+)");
    private static final Pattern WHOLE = Pattern.compile("[0-9][0-9_]*");
    private static final Pattern WORD = Pattern.compile("[A-Za-z_][A-Za-z0-9_]*");
    private static final Pattern SIGN = Pattern.compile(":=|<>|<=|>=|[-+*/<>=&(),.]");

    private final String text;
    private final List<Token> tokens = new ArrayList<>();
    private Matcher match;
    private int at;

    private Lexer(String text) {
        this.text = text;
    }

    /**
     * All tokens, the last one of the kind END.
     *
     * @throws ExpressionException at the first character that begins none
     */
    static List<Token> tokens(String text) {
        Lexer lexer = new Lexer(text);
        while (lexer.at < text.length()) {
            if (!lexer.comes(BLANK)) {
                lexer.tokens.add(lexer.next());
            }
            lexer.at = lexer.match.end();
        }
        lexer.tokens.add(new Token(Token.Kind.END, "", text.length(), 0));
        return lexer.tokens;
    }

    private boolean comes(Pattern pattern) {
        match = pattern.matcher(text).region(at, text.length());
        return match.lookingAt();
    }

    private Token next() {
        if (comes(QUOTED)) {
            return token(Token.Kind.QUOTED, match.group(1), 0);
        }
        if (comes(TIME)) {
            return token(Token.Kind.TIME, match.group(), nanos());
        }
        if (comes(BASED)) {
            return token(Token.Kind.WHOLE, match.group(), whole(match.group(2), Integer.parseInt(match.group(1))));
        }
        if (comes(REAL)) {
            double number = Double.parseDouble(match.group().replace("_", ""));
            return token(Token.Kind.REAL, match.group(), Double.doubleToRawLongBits(number));
        }
        if (comes(WHOLE)) {
            return token(Token.Kind.WHOLE, match.group(), whole(match.group(), 10));
        }
        if (comes(WORD)) {
            return token(Token.Kind.WORD, match.group(), 0);
        }
        if (comes(SIGN)) {
            return token(Token.Kind.SIGN, match.group(), 0);
        }
        if (text.charAt(at) == '"') {
            throw new ExpressionException(at, "a quotation mark is opened and not closed");
        }
        throw new ExpressionException(at, "\"" + text.charAt(at) + "\" has no meaning in Structured Text"
                + (":'".indexOf(text.charAt(at)) >= 0 || Character.isLetter(text.charAt(at))
                        ? "; put a name with other characters than A to Z, 0 to 9 and _ into double quotes" : ""));
    }

    private Token token(Token.Kind kind, String written, long number) {
        return new Token(kind, written, at, number);
    }

    private long whole(String digits, int base) {
        try {
            return Long.parseLong(digits.replace("_", ""), base);
        } catch (NumberFormatException e) {
            throw new ExpressionException(at, "\"" + match.group() + "\" is no whole number of 64 bits"
                    + (base == 10 ? "" : " with the base " + base));
        }
    }

    private long nanos() {
        String parts = match.group(2).replace("_", "").toLowerCase(Locale.ROOT);
        Matcher part = TIME_PART.matcher(parts);
        BigDecimal sum = BigDecimal.ZERO;
        int end = 0;
        while (part.lookingAt()) {
            sum = sum.add(new BigDecimal(part.group(1)).multiply(BigDecimal.valueOf(unit(part.group(2)))));
            end = part.end();
            part.region(end, parts.length());
        }
        try {
            if (end > 0 && end == parts.length()) {
                long nanos = sum.longValueExact();
                return match.group(1).isEmpty() ? nanos : -nanos;
            }
        } catch (ArithmeticException e) {
            throw new ExpressionException(at, "\"" + match.group() + "\" does not fit into whole nanoseconds of 64 bits");
        }
        throw new ExpressionException(at, "\"" + match.group() + "\" is no duration; right is such as T#500ms or T#1m30s");
    }

    private static long unit(String name) {
        return switch (name) {
            case "d" -> 86_400_000_000_000L;
            case "h" -> 3_600_000_000_000L;
            case "m" -> 60_000_000_000L;
            case "s" -> 1_000_000_000L;
            case "ms" -> 1_000_000L;
            case "us" -> 1_000L;
            default -> 1L;
        };
    }
}
