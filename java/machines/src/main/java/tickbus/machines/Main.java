package tickbus.machines;

import java.io.PrintStream;
import java.util.LinkedHashMap;
import java.util.Map;
import java.util.function.Supplier;
import tickbus.machines.board.TestingBoard;
import tickbus.machines.cell.ManufacturingCell;
import tickbus.machines.peeler.Peeler;
import tickbus.machines.rig.Rig;
import tickbus.simulator.Machine;

/** The simulator's command line with all machines of this jar. */
public final class Main {
    private Main() {
    }

    /**
     * Runs the simulator and ends the JVM with its exit code.
     *
     * @param args the command line
     */
    public static void main(String[] args) {
        System.exit(run(args, System.out, System.err));
    }

    /**
     * Runs the simulator.
     *
     * @param args the command line
     * @param out gets results
     * @param err gets error messages
     * @return the exit code
     */
    public static int run(String[] args, PrintStream out, PrintStream err) {
        // In the order of the help text; the first one is the default.
        Map<String, Supplier<Machine>> machines = new LinkedHashMap<>();
        machines.put("rig", Rig::new);
        machines.put("peeler", Peeler::new);
        machines.put("board", TestingBoard::new);
        machines.put("cell", ManufacturingCell::new);
        return tickbus.simulator.Main.run(args, machines, out, err);
    }
}
