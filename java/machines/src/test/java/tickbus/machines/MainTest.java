package tickbus.machines;

import static org.junit.jupiter.api.Assertions.assertEquals;
import static org.junit.jupiter.api.Assertions.assertTrue;

import java.io.ByteArrayOutputStream;
import java.io.PrintStream;
import java.nio.charset.StandardCharsets;
import org.junit.jupiter.api.Test;

/** The simulator's own tests have the rest of the command line. */
class MainTest {
    private final ByteArrayOutputStream out = new ByteArrayOutputStream();
    private final ByteArrayOutputStream err = new ByteArrayOutputStream();

    private int run(String... args) {
        return Main.run(args, new PrintStream(out, true, StandardCharsets.UTF_8),
                new PrintStream(err, true, StandardCharsets.UTF_8));
    }

    @Test
    void aMachineThatIsNotHereExitsWith2() {
        assertEquals(2, run("--machine", "mill"));
        String told = err.toString(StandardCharsets.UTF_8);
        assertTrue(told.contains("--machine is \"mill\"; it must be one of board, cell, none, peeler, rig"), told);
        assertTrue(told.contains("usage: simulator"), told);
    }

    @Test
    void theRigIsTheDefault() {
        assertEquals(0, run("--help"));
        String told = out.toString(StandardCharsets.UTF_8);
        assertTrue(told.contains("--machine NAME   rig (default), peeler, board, cell, none;\n"), told);
    }
}
