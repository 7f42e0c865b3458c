package tickbus.machines.rig;

import static org.junit.jupiter.api.Assertions.assertTrue;

import java.io.IOException;
import java.nio.file.Files;
import java.nio.file.Path;
import java.util.ArrayList;
import java.util.Arrays;
import java.util.List;

/** The project's driver.cfg with another bus. */
final class Cfg {
    private static final Path DRIVER_CFG = Path.of("../../driver.cfg");

    private Cfg() {
    }

    /** Writes the file into a folder, with the lines of its [fieldbus] table replaced by those of a loopback. */
    static Path write(Path folder, String... loopback) throws IOException {
        return writeBus(folder, "loopback", loopback);
    }

    /** Writes the file into a folder, with the lines of its [fieldbus] table replaced by those of another kind of bus. */
    static Path writeBus(Path folder, String kind, String... lines) throws IOException {
        List<String> cfg = new ArrayList<>(Files.readAllLines(DRIVER_CFG));
        int table = cfg.indexOf("[fieldbus]") + 1;
        assertTrue(table > 0, "driver.cfg has a line [fieldbus]");
        while (!cfg.get(table).startsWith("[[signal]]")) {
            cfg.remove(table);
        }
        cfg.add(table, "kind = \"" + kind + "\"");
        cfg.addAll(table + 1, Arrays.asList(lines));
        return Files.write(Files.createDirectories(folder).resolve("driver.cfg"), cfg);
    }
}
