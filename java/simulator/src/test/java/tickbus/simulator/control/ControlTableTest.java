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
        "1:r | a | 5 + 3 |; \"5 + 3\" is no transfer function; write name or name(value, …)",
        "1:r | a | scale(1) |; \"scale(1)\" has 1 value in parentheses; right is scale(gain, offset)",
        "1:r | a | not(1) |; \"not(1)\" has 1 value in parentheses; right is not",
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
