package tickbus.simulator.expression;

import static org.junit.jupiter.api.Assertions.assertEquals;
import static org.junit.jupiter.api.Assertions.assertThrows;
import static org.junit.jupiter.api.Assertions.assertTrue;

import java.io.IOException;
import java.util.List;
import java.util.stream.Stream;
import org.junit.jupiter.api.Test;
import org.junit.jupiter.params.ParameterizedTest;
import org.junit.jupiter.params.provider.CsvSource;
import org.junit.jupiter.params.provider.MethodSource;

class ExpressionTest {
    private static final long STEP = 10_000_000;

    static Stream<Golden> golden() throws IOException {
        return Golden.all().stream();
    }

    private static Expression.Value value(String text) {
        return Expression.read(text).compile(new Golden.Inputs(), STEP).value();
    }

    @ParameterizedTest
    @MethodSource("golden")
    void theResultsAreThoseOfTheStandard(Golden golden) {
        Expression.Value value = value(golden.text());
        for (int set = 0; set < Golden.INPUTS.length; set++) {
            // 0.0 in the place of -0.0, which is equal.
            assertEquals(golden.results()[set], value.of(Golden.INPUTS[set]) + 0.0, golden.text() + ", set " + set);
        }
    }

    @Test
    void thereAreMoreThanFifty() throws IOException {
        assertTrue(Golden.all().size() > 50);
    }

    /** The golden rows of the blocks in crates/core/plc, and rows of the standard's diagrams. A tick takes 10 ms. */
    @ParameterizedTest
    @CsvSource(delimiter = ';', value = {
        "TON(a, T#30ms);           0111111001100100000011110000; 0000111000000000000000010000",
        "TOF(a, T#30ms);           0111111001100100000011110000; 0111111111111111100011111110",
        "TP(a, T#30ms);            0111111001100100000011110000; 0111000001110111000011100000",
        "TON(a, T#0s);             0110; 0110",
        "TP(a, T#0s);              0110; 0000",
        "TOF(a, T#0s);             0110; 0110",
        "TON(PT := T#20ms, IN := a).Q; 11110; 00110",
        "R_TRIG(a);                1100110; 1000100",
        "F_TRIG(a);                0110010; 1001001",
        "CTU(a, FALSE, 2);         0101101; 0001111",
        "TON(TON(a, T#10ms), T#10ms); 1111; 0011",
        "a AND NOT TON(a, T#20ms); 111101111; 110001100",
        "FALSE AND TON(a, T#10ms) OR TON(a, T#20ms); 1111; 0011",
    })
    void blocksFollowTheirRow(String text, String input, String output) {
        Expression.Value value = value(text);
        StringBuilder got = new StringBuilder();
        for (char on : input.toCharArray()) {
            got.append(value.of(new double[] {on - '0', 0, 0, 0, 0, 0, 0, 0, 0}) != 0 ? '1' : '0');
        }
        assertEquals(output, got.toString());
    }

    @ParameterizedTest
    @CsvSource(delimiter = ';', value = {
        "SR(a, b); 00 10 00 01 11 00; 011011",
        "SR(a, b); 00 10 00 01 11 01; 011010",
        "RS(a, b); 00 10 00 01 11 00; 011000",
        "CTU(a, b, 2).CV; 00 10 10 00 10 01 11 10 00 10; 0111200001",
    })
    void blocksWithTwoInputsFollowTheirRow(String text, String inputs, String output) {
        Expression.Value value = value(text);
        StringBuilder got = new StringBuilder();
        for (String input : inputs.split(" ")) {
            got.append((int) value.of(new double[] {input.charAt(0) - '0', input.charAt(1) - '0', 0, 0, 0, 0, 0, 0, 0}));
        }
        assertEquals(output, got.toString());
    }

    @Test
    void timeThatHasPassedIsReadInSeconds() {
        Expression.Value value = value("TO_LREAL(TON(a, T#25ms).ET)");
        double[] on = {1, 0, 0, 0, 0, 0, 0, 0, 0};
        assertEquals(List.of(0.0, 0.01, 0.02, 0.025, 0.025), Stream.generate(() -> value.of(on)).limit(5).toList());
    }

    @Test
    void dividingAWholeNumberBy0IsZero() {
        assertEquals(0, value("i / (j - j)").of(Golden.INPUTS[0]));
        assertEquals(0, value("i MOD (j - j)").of(Golden.INPUTS[0]));
        assertEquals(Double.POSITIVE_INFINITY, value("x / 0.0").of(Golden.INPUTS[0]));
    }

    @Test
    void limitIsTheStandardsFormulaAlsoWithEndsInTheWrongOrder() {
        assertEquals(-2, value("LIMIT(3, i, -2)").of(Golden.INPUTS[0]));
        assertEquals(-2, value("LIMIT(3.0, x, -2.0)").of(Golden.INPUTS[0]));
    }

    @Test
    void muxTakesTheNearestBeyondItsEnds() {
        assertEquals(7, value("MUX(-1, i, j)").of(Golden.INPUTS[0]));
        assertEquals(-3, value("MUX(9, i, j)").of(Golden.INPUTS[0]));
    }

    @ParameterizedTest
    @CsvSource(delimiter = ';', quoteCharacter = '\u0001', value = {
        "a AND x; 6; AND takes BOOL§ this is LREAL§ compare it, such as … <> 0",
        "NOT i; 4; NOT takes BOOL§ this is LINT§ compare it, such as … <> 0",
        "x + i; 4; + takes LREAL§ this is LINT§ write TO_LREAL(…)",
        "i * x; 4; * takes LINT§ this is LREAL§ write TO_LINT(…), which rounds",
        "i + 2.5; 4; + takes LINT§ this is LREAL§ write TO_LINT(…), which rounds",
        "(1 + 2) * x; 10; * takes LINT§ this is LREAL",
        "a + 1; 0; + takes numbers or durations§ this is BOOL§ SEL(…, 0, 1) makes a number of it",
        "a < b; 0; < takes numbers or durations§ this is BOOL",
        "a = 1; 4; = takes BOOL§ this is LINT",
        "x MOD 2; 0; MOD takes LINT§ this is LREAL§ write TO_LINT(…), which rounds",
        "2 * T#1s; 4; * takes numbers§ this is TIME§ write TO_LREAL(…), which gives seconds",
        "T#1s * T#1s; 0; * takes numbers§ this is TIME§ write TO_LREAL(…), which gives seconds",
        "T#1s + T#1s; 5; the result is TIME§ write TO_LREAL(…), which gives seconds",
        "TON(a, 5); 7; PT of TON takes TIME§ this is LINT§ write a duration, such as T#500ms",
        "TON(a); 0; TON has 1 argument§ right is TON(IN, PT)",
        "TON(IN := a, a); 0; name all arguments of TON or none§ right is TON(IN, PT)",
        "TON(INN := a); 4; TON has no input \"INN\"§ right is TON(IN, PT)",
        "TON(IN := a, IN := b); 13; input \"IN\" is given twice",
        "TON(a, T#1s).CV; 13; TON has no output \"CV\"§ there are Q, ET",
        "ABS(x).Q; 7; ABS has no output \"Q\"§ functions have none",
        "TON(a, T#1s,); 12; a value is expected in the place of \")\"",
        "MAX(x); 0; MAX has 1 argument§ right is MAX(IN1, IN2, …)",
        "SEL(x, 1, 2); 4; G of SEL takes BOOL§ this is LREAL§ compare it, such as … <> 0",
        "SEL(a, x, b); 10; SEL takes LREAL§ this is BOOL§ write TO_LREAL(…)",
        "MUX(x, 1, 2); 4; K of MUX takes LINT§ this is LREAL",
        "LIMT(1, i, 2); 0; there is no function or block \"LIMT\"§ did you mean \"LIMIT\"?",
        "LOGARITHM(x); 0; there is no function or block \"LOGARITHM\"§ there are SEL, MUX, LIMIT,",
        "a AND; 5; a value is expected in the place of the end",
        "a AND AND b; 6; a value is expected in the place of \"AND\"",
        "a b; 2; an operator is expected before \"b\"",
        "(a OR b; 7; \")\" is expected in the place of the end",
        "a := b; 2; an operator is expected before \":=\"",
        "d; 0; there is no \"d\"",
        "\"a; 0; a quotation mark is opened and not closed",
        "a ? b; 2; \"?\" has no meaning in Structured Text",
        "1:r > 2.0; 1; \":\" has no meaning in Structured Text§ put a name with other characters than A to Z, 0 to 9 and _",
        "xü > 2.0; 1; \"ü\" has no meaning in Structured Text§ put a name with other",
        "T#5; 0; \"T#5\" is no duration§ right is such as T#500ms or T#1m30s",
        "T#0.1ns > T#0s; 0; \"T#0.1ns\" does not fit into whole nanoseconds of 64 bits",
        "9223372036854775808; 0; \"9223372036854775808\" is no whole number of 64 bits",
        "8#9; 0; \"8#9\" is no whole number of 64 bits with the base 8",
    })
    void aMistakeIsToldAtItsPlace(String text, int offset, String what) {
        ExpressionException e = assertThrows(ExpressionException.class, () -> value(text));
        assertTrue(e.getMessage().startsWith(what.replace('§', ';')), e.getMessage());
        assertEquals(offset, e.offset(), e.getMessage());
    }

    @Test
    void anExpressionThatNobodyCanReadIsRefused() {
        String nested = "(".repeat(60) + "a" + ")".repeat(60);
        assertTrue(assertThrows(ExpressionException.class, () -> value(nested)).getMessage().contains("nested too deeply"));
        String wide = "a" + " OR a".repeat(600);
        assertTrue(assertThrows(ExpressionException.class, () -> value(wide)).getMessage().contains("too long"));
        assertEquals(1, value("a" + " OR a".repeat(400)).of(Golden.INPUTS[0]));
        assertEquals(1, value("(".repeat(40) + "a" + ")".repeat(40)).of(Golden.INPUTS[0]));
    }

    @Test
    void helpNamesThemAll() {
        for (String name : List.of("SEL(G, IN0, IN1)", "MUX(K, IN0, IN1, …)", "TON(IN, PT) .Q .ET", "CTU(CU, R, PV) .Q .CV",
                "RS(S, R1)", "R_TRIG(CLK)")) {
            assertTrue(Expression.help().contains(name), Expression.help());
        }
    }
}
