package tickbus.simulator.control;

import static org.junit.jupiter.api.Assertions.assertArrayEquals;
import static org.junit.jupiter.api.Assertions.assertEquals;
import static org.junit.jupiter.api.Assertions.assertThrows;
import static org.junit.jupiter.api.Assertions.assertTrue;

import java.nio.file.Files;
import java.nio.file.Path;
import java.util.List;
import java.util.stream.Collectors;
import org.junit.jupiter.api.Test;
import org.junit.jupiter.api.io.TempDir;
import org.junit.jupiter.params.ParameterizedTest;
import org.junit.jupiter.params.provider.CsvSource;
import tickbus.simulator.FakeDriver;

/** Reading, naming, ordering; the functions are in {@link TransferFunctionsTest}. */
class ControlTableTest {
    private static final long STEP = 2_000_000;

    private final Endpoints endpoints = new Endpoints(
            List.of(new FakeDriver(1, List.of("w", "v"), List.of("r", "Level, left | #1")),
                    new FakeDriver(2, List.of("w"), List.of("r"))),
            List.of("valve", "motor"), List.of("level"));

    private ControlTable table(String... rows) {
        return ControlTable.parse("t.table", String.join("\n", rows), endpoints, STEP);
    }

    private String mistakes(String... rows) {
        ControlTableException e = assertThrows(ControlTableException.class, () -> table(rows));
        return e.mistakes().stream().map(Mistake::toString).collect(Collectors.joining("\n"));
    }

    @Test
    void endpointsAreNumberedDriverByDriverWithTheMachineLast() {
        assertEquals(List.of("1:r", "1:Level, left | #1", "2:r", "machine:level"),
                List.copyOf(endpoints.sources().keySet()));
        assertEquals(List.of("1:w", "1:v", "2:w", "machine:valve", "machine:motor"),
                List.copyOf(endpoints.destinations().keySet()));
        assertEquals(2, endpoints.sourceStart(1));
        assertEquals(3, endpoints.destinationStart(2));
    }

    @Test
    void valuesTravelThroughVariablesWhateverTheOrderOfRows() {
        ControlTable table = table(
                "# a comment",
                "both           |        |               | machine:valve   # behind a row",
                "twice, 2:r     | both   | add           |",
                "",
                "1:r            | twice  | scale(2, 1)   | machine:motor");
        table.setSources(0, new double[] {5, 0, 100, 0});
        table.computeBeforeStep();
        assertEquals(111, table.destination(3));
        assertEquals(11, table.destination(4));
        assertEquals(111, table.probe("both").getAsDouble());
        assertEquals(11, table.probe("machine:motor").getAsDouble());
        assertEquals(100, table.probe("2:r").getAsDouble());
    }

    @Test
    void rowsForTheMachineAreComputedBeforeTheStepAndAllOthersAfterIt() {
        ControlTable table = table(
                "machine:level | full  | gt(10) | 1:w",
                "full          | empty | not    | machine:valve",
                "machine:level |       |        | 2:w");
        table.setSource(3, 20);
        table.computeBeforeStep();
        assertArrayEquals(new double[] {1, 0, 0, 0}, destinations(table, 4));
        table.setSource(3, 5);
        table.computeAfterStep();
        assertArrayEquals(new double[] {1, 0, 5, 0}, destinations(table, 4), "full was needed before the step");
    }

    private static double[] destinations(ControlTable table, int count) {
        double[] block = new double[count];
        table.getDestinations(0, block);
        return block;
    }

    @Test
    void aNameWithSeparatorsStandsInQuotes() {
        ControlTable table = table("\"1:Level, left | #1\", 1:r | | add | machine:valve");
        table.setSources(0, new double[] {1, 2, 0, 0});
        table.computeBeforeStep();
        assertEquals(3, table.destination(3));
    }

    @Test
    void whatNoRowWritesIsListed() {
        assertEquals(List.of("1:v", "2:w", "machine:valve"),
                table("1:r | | | machine:motor", "1:r | | | 1:w").unconnected());
        assertEquals(5, table("").unconnected().size());
    }

    @ParameterizedTest
    @CsvSource(delimiter = ';', quoteCharacter = '\u0001', value = {
        "1:r | | machine:motor; a row has four columns, source | variable | transfer | destination; this one has 3",
        "1:r | | copy |; the result goes nowhere; name a variable or a destination",
        "\"1:r | a | | ; a quotation mark is opened and not closed",
        "1:r, | a | add |; a source between the commas is missing",
        "1:r | a:b | |; \"a:b\" is no name for a variable; it must not have a colon",
        "1:rr | a | |; there is no source \"1:rr\"; did you mean \"1:r\"?",
        "3:rrrr | a | |; there is no source \"3:rrrr\"; names begin with one of 1: 2: machine:",
        "machine:levle | a | |; there is no source \"machine:levle\"; did you mean \"machine:level\"?",
        "level | a | |; no row gives variable \"level\" a value; did you mean \"machine:level\"?",
        "machine:valve | a | |; \"machine:valve\" can only be written; it is a destination, not a source",
        "1:r | | | machine:level; \"machine:level\" can only be read; it is a source, not a destination",
        "1:r | | | motor; \"motor\" is no destination; write <driver id>:<component> or machine:<variable>",
        "1:r | | | machine:mottor; there is no destination \"machine:mottor\"; did you mean \"machine:motor\"?",
        "1:r | a | scael(1, 2) |; there is no transfer function \"scael\"; did you mean \"scale\"?",
        "1:r | a | xyz |; there is no transfer function \"xyz\"; there are copy, not, and, or,",
        "1:r | a | scale(1) |; \"scale(1)\" has 1 value in parentheses; right is scale(gain, offset)",
        "1:r | a | and(1) |; \"and(1)\" has 1 value in parentheses; right is and",
        "1:r, 2:r | a | not |; not takes one source, this row has 2 sources",
        " | a | and |; and takes at least one source, this row has no sources",
        "1:r | a | const(1) |; const takes no source, this row has 1 source",
        "1:r | a | scale(x, 1) |; gain is \"x\"; it must be a finite number",
        "1:r | a | gt(NaN) |; x is \"NaN\"; it must be a finite number",
        "1:r | a | clamp(2, 1) |; lo is 2 and greater than hi, 1",
        "1:r | a | deadband(-1) |; width is -1; it must be 0 or more",
        "1:r | a | bit(53) |; n is \"53\"; it must be a whole number, 0 to 52",
        "1:r | a | delay(5) |; \"5\" is no duration; write a number and a unit, such as 2ms",
        "1:r | a | delay(0s) |; a delay of 0s is 0 ticks of 2ms; it must be 1 to 1000000 ticks",
        "1:r | a | delay(1000000s) |; a delay of 1000000s is 500000000 ticks of 2ms; it must be 1 to 1000000 ticks",
        "a | a | |; a cycle, each value waits for the next: a -> a",
    })
    void aMistakeIsToldWithItsLineAndWhatWouldBeRight(String row, String what) {
        String told = mistakes("# first line", row);
        assertTrue(told.startsWith("t.table:2: " + what), told);
    }

    @Test
    void anExpressionReadsVariablesSourcesAndTheSourceColumn() {
        ControlTable table = table(
                "1:r              | half   | IN / 2.0 > \"2:r\"                     |",
                "1:r, machine:level | sum  | IN1 + IN2 * 2                        | 1:w",
                "                 |        | half AND NOT (sum < 10)              | machine:valve",
                "                 | a name | \"1:Level, left | #1\" + TO_LREAL(half) | machine:motor",
                "                 | twice  | 2 * \"a name\"                        |");
        table.setSources(0, new double[] {9, 4, 1, 3});
        table.computeBeforeStep();
        assertEquals(1, table.destination(3));
        assertEquals(5, table.destination(4));
        table.computeAfterStep();
        assertEquals(15, table.destination(0), "as of before the step, for the valve needs it");
        assertEquals(10, table.probe("twice").getAsDouble());
    }

    @Test
    void aVariableOfTheMachineHasOneTypeInTheWholeTable() {
        assertEquals("t.table:3:13: \"machine:level\" is used as LREAL elsewhere in the table; NOT takes BOOL",
                mistakes("1:r | b | gt(1) |", "  | a | \"machine:level\" > 1.0 |", "  | c | NOT \"machine:level\" |"));
        table(" | a | \"machine:level\" AND b |", "1:r | b | rising |", "machine:level | c | |", " | d | NOT c |");
    }

    @Test
    void theOldFunctionsHaveTypes() {
        table("1:r | on | bit(3) |", "1:r | level | scale(2, 1) |", "on | later | delay(4ms) |", "1:r | held | deadband(1) |",
                " | a | NOT later AND level > held |", " | one | const(1) |", " | both | one AND a |",
                "a | b | not |", " | c | not (a OR b) |");
    }

    /** The mistake's place is behind the mark ^. */
    @ParameterizedTest
    @CsvSource(delimiter = ';', quoteCharacter = '\u0001', value = {
        "1:r | a | ^IN AND TRUE |; AND takes BOOL§ this is LREAL§ compare it, such as … <> 0",
        "| a | ^\"1:x\" > 2.0 |; there is no source \"1:x\"§ did you mean \"1:r\"?",
        "| a | ^\"1:w\" > 2.0 |; \"1:w\" can only be written§ it is a destination, not a source",
        "| abc | 1.0 + ^abd |; no row gives variable \"abd\" a value§ did you mean \"abc\"?",
        "| a | 1.0 + ^level |; no row gives variable \"level\" a value§ did you mean \"machine:level\"?",
        "1:r, 2:r | a | ^IN1 > 2.0 |; the expression does not use the source \"2:r\"§ its name there is IN2",
        "1:r, 2:r | a | ^IN > IN2 |; \"IN\" is no source of this row§ it has IN1 to IN2",
        "1:r | a | ^5 + 3 |; the expression does not use the source \"1:r\"§ its name there is IN",
        "1:r |  |   IN ^> 2.0 | 1:w; the result is BOOL, and \"1:w\" is a number§ write SEL(…, 0, 1)",
        "1:r | a | TON(IN > 0.0, ^5) |; PT of TON takes TIME§ this is LINT§ write a duration, such as T#500ms",
        "1:r | a | IN > ^? |; \"?\" has no meaning in Structured Text",
        "\"1:Level, left | #1\" | a | IN > ^TRUE |; > takes numbers or durations§ this is BOOL§ SEL(…, 0, 1) makes",
    })
    void aMistakeInAnExpressionIsToldWithItsColumn(String row, String what) {
        int column = row.indexOf('^') + 1;
        assertTrue(mistakes("# first line", row.replace("^", "")).startsWith(
                "t.table:2:" + column + ": " + what.replace('§', ';')), mistakes("# first line", row.replace("^", "")));
    }

    @Test
    void anExpressionCannotReadItself() {
        assertEquals("t.table:1: a cycle, each value waits for the next: a -> a", mistakes("| a | NOT a |"));
    }

    @Test
    void aSignalOfTypeBoolTakesAndGivesBools() {
        Endpoints two = new Endpoints(List.of(new FakeDriver(1, "lamp", "button")), List.of(),
                List.of());
        ControlTable.parse("t.table", "| | NOT \"1:button\" | 1:lamp", two, STEP);
        String told = assertThrows(ControlTableException.class,
                () -> ControlTable.parse("t.table", "| | SEL(\"1:button\", 0.0, 1.0) | 1:lamp", two, STEP)).getMessage();
        assertEquals("t.table:1:5: the result is LREAL, and \"1:lamp\" is BOOL; compare it, such as … <> 0", told);
    }

    @Test
    void whatNoRowReadsIsListed() {
        assertEquals(List.of("1:Level, left | #1", "machine:level"),
                table("1:r | a | IN > \"2:r\" |", "a | | | 1:w").unread());
        Endpoints counting = new Endpoints(List.of(new FakeDriver(1, List.of(), List.of("r", "r.edges", "bus.age"))),
                List.of(), List.of());
        assertEquals(List.of("1:r"), ControlTable.parse("t.table", "", counting, STEP).unread());
    }

    @Test
    void allMistakesAreToldAtOnceInTheOrderOfLines() {
        assertEquals("""
                t.table:1: there is no source "1:x"; did you mean "1:r"?
                t.table:1: there is no destination "2:x"; did you mean "2:w"?
                t.table:2: a row has four columns, source | variable | transfer | destination; this one has 1
                t.table:4: variable "a" already gets its value in line 3
                t.table:4: destination "1:w" is already written in line 3""",
                mistakes("1:x | | | 2:x", "nonsense", "1:r | a | | 1:w", "2:r | a | | 1:w"));
    }

    @Test
    void aCycleIsToldOnceFromItsFirstRow() {
        assertEquals("t.table:2: a cycle, each value waits for the next: a -> c -> b -> a",
                mistakes("a | d | | 1:w", "c | a | | ", "a | b | | ", "b | c | | "));
    }

    @Test
    void filesThatCannotBeReadAreTold(@TempDir Path folder) throws Exception {
        Path missing = folder.resolve("missing.table");
        Path binary = folder.resolve("binary.table");
        Files.write(binary, new byte[] {(byte) 0xff, (byte) 0xfe, (byte) 0xff});
        assertTrue(assertThrows(ControlTableException.class, () -> ControlTable.load(missing, endpoints, STEP))
                .getMessage().endsWith("missing.table: there is no such file; name an existing control table"));
        assertTrue(assertThrows(ControlTableException.class, () -> ControlTable.load(binary, endpoints, STEP))
                .getMessage().contains("no text in UTF-8"));
    }

    @Test
    void probesKnowTheNearestName() {
        ControlTable table = table("1:r | flow | | 1:w");
        assertTrue(assertThrows(IllegalArgumentException.class, () -> table.probe("flaw")).getMessage()
                .endsWith("did you mean \"flow\"?"));
    }
}
