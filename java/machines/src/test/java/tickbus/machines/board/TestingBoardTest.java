package tickbus.machines.board;

import static org.junit.jupiter.api.Assertions.assertEquals;
import static org.junit.jupiter.api.Assertions.assertFalse;
import static org.junit.jupiter.api.Assertions.assertThrows;
import static org.junit.jupiter.api.Assertions.assertTrue;

import java.io.StringReader;
import java.nio.file.Files;
import java.nio.file.Path;
import javax.xml.parsers.DocumentBuilderFactory;
import org.junit.jupiter.api.Test;
import org.junit.jupiter.api.io.TempDir;
import org.xml.sax.InputSource;

/** The testing board and its picture. */
class TestingBoardTest {
    private static final long STEP = 2_000_000;

    private final TestingBoard board = new TestingBoard();

    private void input(String name, double value) {
        board.input(board.inputs().indexOf(name), value);
    }

    private double output(String name) {
        return board.output(board.outputs().indexOf(name));
    }

    private void run(double seconds) {
        for (long time = 0; time < seconds * 1e9; time += STEP) {
            board.step(STEP);
        }
    }

    @Test
    void liquidFlowsFromTankToTankAndIsNotLost() {
        input("valve", 1);
        run(1);
        assertEquals(TestingBoard.VALVE_FLOW, output("level 1"), 1e-6);
        assertEquals(0, output("level 2"));
        input("valve", 0);
        input("pump", 1);
        run(1);
        assertEquals(TestingBoard.VALVE_FLOW, output("level 1") + output("level 2"), 1e-6);
        assertEquals(TestingBoard.PUMP_FLOW, output("level 2"), 1e-6);
        input("pump", 0);
        board.tap(true);
        run(0.5);
        assertEquals(TestingBoard.PUMP_FLOW - TestingBoard.TAP_FLOW / 2, output("level 2"), 1e-6);
    }

    @Test
    void anEmptyTankGivesNothingAndAFullOneOverflows() {
        input("pump", 1);
        board.tap(true);
        run(1);
        assertEquals(0, output("level 2"));
        input("pump", 0);
        input("valve", 1);
        run(5);
        assertEquals(100, output("level 1"));
    }

    @Test
    void switchesLampsAndGaugeAreWhatTheyAreCalled() {
        board.set(3, true);
        assertEquals(1, output("switch 3"));
        assertEquals(0, output("switch 4"));
        input("lamp 2", 1);
        input("gauge", -4.5);
        assertTrue(board.isLit(2));
        assertFalse(board.isLit(3));
        assertEquals(-4.5, board.gauge());
        assertThrows(IllegalArgumentException.class, () -> board.step(-1));
    }

    @Test
    void thePictureShowsWhatIsOn(@TempDir Path folder) throws Exception {
        input("lamp 1", 1);
        input("pump", 1);
        input("gauge", 20);
        board.set(2, true);
        String svg = BoardPicture.draw(board);
        DocumentBuilderFactory.newInstance().newDocumentBuilder().parse(new InputSource(new StringReader(svg)));
        for (String part : new String[] {"switch 1: off", "switch 2: on", "pump on", "valve off", "20.0", "0.0 %"}) {
            assertTrue(svg.contains(part), part);
        }
        BoardPicture.write(board, folder.resolve("board.svg"));
        assertEquals(svg, Files.readString(folder.resolve("board.svg")));
    }

    /** {@code TICKBUS_UPDATE=1} redraws the picture. */
    @Test
    void thePictureOfTheLivePageIsTheSameDrawing() throws Exception {
        Path file = Path.of("board.svg");
        if (System.getenv("TICKBUS_UPDATE") != null) {
            BoardPicture.write(new TestingBoard(), file);
        }
        assertEquals(Files.readString(file), BoardPicture.draw(new TestingBoard()));
    }
}
