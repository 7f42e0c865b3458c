package tickbus.machines.rig;

import static org.junit.jupiter.api.Assertions.assertEquals;
import static org.junit.jupiter.api.Assertions.assertTrue;

import DeviceDrivers.FieldbusDriver;
import java.io.IOException;
import java.nio.file.Files;
import java.nio.file.Path;
import java.util.Arrays;
import java.util.List;
import org.junit.jupiter.api.Tag;
import org.junit.jupiter.api.Test;
import org.junit.jupiter.api.io.TempDir;
import tickbus.machines.Main;
import tickbus.simulator.DriverSet;
import tickbus.simulator.Simulator;
import tickbus.simulator.TimeSource;

/** The driver.cfg with the variables of the rig's model, beside that of the rig. */
@Tag("native")
class ModelCfgTest {
    private static final long STEP = 2_000_000L;
    private static final int TICKS = 100;

    @TempDir
    Path folder;

    @Test
    void theModelsVariablesAreRecordedBesideTheSignals() throws IOException {
        Path model = folder.resolve("model.cfg");
        String[] line = {"--machine", "rig", "--model-cfg", model.toString()};
        assertEquals(0, Main.run(line, System.out, System.err));
        // A port of the system's choice, a table, and a bus that waits for it.
        Files.writeString(model, Files.readString(model).replace("[page]\n", "[page]\nlisten = \"127.0.0.1:0\"\n")
                .replace("model.vcd", "model.csv").replace("program = \"mirror\"", "program = \"mirror\"\nmode = \"stepped\""));
        Path cfg = Cfg.write(folder, "program = \"rig\"", "mode = \"stepped\"");
        Rig rig = new Rig(0, 0, 0, 100);
        double height;
        try (Simulator simulator = new Simulator(
                new DriverSet(List.of(new FieldbusDriver(cfg), new FieldbusDriver(model))), rig, Path.of("rig.table"), STEP,
                TimeSource.system())) {
            assertEquals(List.of(), simulator.unconnected());
            for (int i = 0; i < TICKS; i++) {
                simulator.tick();
            }
            height = rig.position(Lift.LA2);
        }
        List<String> rows = Files.readAllLines(folder.resolve("model.csv"));
        assertEquals(1 + TICKS, rows.size());
        int column = Arrays.asList(rows.get(0).split(",")).indexOf("model:lift 2 position");
        assertTrue(column > 0, rows.get(0));
        assertTrue(height != 0, "the lift is not down yet");
        assertEquals(height, Double.parseDouble(rows.get(rows.size() - 1).split(",")[column]), 1e-9);
    }
}
