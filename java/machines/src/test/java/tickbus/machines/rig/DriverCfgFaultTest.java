package tickbus.machines.rig;

import static org.junit.jupiter.api.Assertions.assertEquals;
import static org.junit.jupiter.api.Assertions.assertFalse;
import static org.junit.jupiter.api.Assertions.assertThrows;
import static org.junit.jupiter.api.Assertions.assertTrue;

import DeviceDrivers.FieldbusDriver;
import java.io.IOException;
import java.nio.file.Files;
import java.nio.file.Path;
import java.nio.file.StandardOpenOption;
import java.util.List;
import org.junit.jupiter.api.Tag;
import org.junit.jupiter.api.Test;
import org.junit.jupiter.api.io.TempDir;
import tickbus.simulator.DriverSet;
import tickbus.simulator.Simulator;
import tickbus.simulator.TimeSource;
import tickbus.simulator.WrongInput;

/** A fault of the rig, written in the plant's own driver.cfg, on its way to the machine and to the PLC program's answer. */
@Tag("native")
class DriverCfgFaultTest {
    private static final long STEP = 2_000_000L;
    private static final long SECOND = 1_000_000_000L;

    @TempDir
    Path folder;

    private final Rig rig = new Rig();

    private Simulator simulator(String fault) throws IOException {
        Path cfg = Cfg.write(folder, "program = \"rig\"", "mode = \"stepped\"");
        Files.writeString(cfg, "\n[[fault]]\nkind = \"model\"\n" + fault, StandardOpenOption.APPEND);
        return new Simulator(new DriverSet(List.of(new FieldbusDriver(cfg))), rig, Path.of("rig.table"), STEP,
                TimeSource.system());
    }

    private void pass(Simulator simulator, long nanos) {
        for (long end = rig.time() + nanos; rig.time() < end;) {
            simulator.tick();
        }
    }

    @Test
    void aJamOfTheFileJamsTheRigAndLightsTheFaultLamp() throws IOException {
        try (Simulator simulator = simulator("name = \"jam at lift 1\"\nwhen = \"Step == 2\"\nfor = \"4s\"\n")) {
            pass(simulator, 20 * SECOND);
            rig.press(Button.START);
            for (long end = rig.time() + 10 * SECOND; !rig.jammed();) {
                assertTrue(rig.time() < end, "no bottle has stuck");
                simulator.tick();
            }
            pass(simulator, 2 * SECOND);
            assertTrue(rig.notOk());
            assertTrue(rig.panelLamp(2), "the Fault lamp");
            pass(simulator, 3 * SECOND);
            assertFalse(rig.jammed(), "the fault is over");
            assertEquals("1", simulator.drivers().get(0).statistics().get("fault.begun"));
        }
    }

    @Test
    void aFaultThatTheRigDoesNotHaveIsToldBeforeTheFirstTick() {
        WrongInput wrong = assertThrows(WrongInput.class, () -> simulator("name = \"jam at lift1\"\nat = \"1h\"\n"));
        String told = "the model has no fault \"jam at lift1\"; did you mean \"jam at lift 1\"?";
        assertTrue(wrong.getMessage().contains(told), wrong::getMessage);
        assertTrue(wrong.getMessage().startsWith("driver 4711, machine Test rig: "), wrong::getMessage);
    }
}
