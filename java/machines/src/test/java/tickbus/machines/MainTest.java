package tickbus.machines;

import static org.junit.jupiter.api.Assertions.assertEquals;
import static org.junit.jupiter.api.Assertions.assertTrue;

import java.io.ByteArrayOutputStream;
import java.io.PrintStream;
import java.nio.charset.StandardCharsets;
import java.util.HashSet;
import java.util.Map;
import java.util.Set;
import org.junit.jupiter.api.Test;
import tickbus.machines.cell.ManufacturingCell;
import tickbus.machines.peeler.Peeler;
import tickbus.machines.rig.Lift;
import tickbus.machines.rig.Rig;
import tickbus.simulator.Machine;
import tickbus.simulator.ModelVariable;

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
    void everyMachineShowsTheVariablesOfItsModel() {
        Map<Machine, Integer> counts = Map.of(new Rig(), 29, new Peeler(), 103, new ManufacturingCell(), 23);
        counts.forEach((machine, count) -> {
            machine.step(2_000_000);
            Set<String> names = new HashSet<>();
            for (ModelVariable variable : machine.variables()) {
                assertTrue(names.add(variable.name()), machine.name() + " has two variables " + variable.name());
                assertTrue(Double.isFinite(variable.value().getAsDouble()), variable.name());
            }
            assertEquals(count, names.size(), machine.name() + ", as in docs/control-table.md");
        });
    }

    @Test
    void theRigsLiftIsWhereItsVariableShows() {
        Rig rig = new Rig(0, 0, 0, 0);
        rig.input(rig.inputs().indexOf("la2.run"), 1);
        rig.input(rig.inputs().indexOf("la2.up"), 1);
        for (int i = 0; i < 50; i++) {
            rig.step(2_000_000);
        }
        assertEquals(rig.position(Lift.LA2), value(rig, "lift 2 position"));
        assertTrue(value(rig, "lift 2 position") > 1 && value(rig, "lift 2 motor speed") > 100,
                "the lift is on its way up, " + value(rig, "lift 2 motor speed") + " mm/s");
    }

    private static double value(Machine machine, String name) {
        return machine.variables().stream().filter(one -> one.name().equals(name)).findFirst().orElseThrow().value()
                .getAsDouble();
    }

    @Test
    void theRigIsTheDefault() {
        assertEquals(0, run("--help"));
        String told = out.toString(StandardCharsets.UTF_8);
        assertTrue(told.contains("--machine NAME   rig (default), peeler, board, cell, none;\n"), told);
    }
}
