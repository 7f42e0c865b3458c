package tickbus.bench;

import java.io.IOException;
import java.io.UncheckedIOException;
import java.nio.file.Files;
import java.nio.file.Path;

/** Writes the driver.cfg of a benchmark: a mirror PLC, and the given number of signals in each direction. */
final class BenchCfg {
    /** Simulation time per tick, and the scan interval of the stepped PLC: each tick gets a fresh frame. */
    static final long TICK_NANOS = 1_000_000;

    private BenchCfg() {
    }

    /** Signals of one bit each: {@code in 0}, {@code out 0} and so on. */
    static Path bits(String mode, int eachWay) {
        StringBuilder text = head(mode);
        for (int i = 0; i < eachWay; i++) {
            text.append(signal("in " + i, "%IX" + i / 8 + "." + i % 8, "BOOL"));
        }
        for (int i = 0; i < eachWay; i++) {
            text.append(signal("out " + i, "%QX" + i / 8 + "." + i % 8, "BOOL"));
        }
        return write(text);
    }

    /** Signals of type REAL, with the same names. */
    static Path reals(String mode, int eachWay) {
        StringBuilder text = head(mode);
        for (int i = 0; i < eachWay; i++) {
            text.append(signal("in " + i, "%ID" + 4 * i, "REAL"));
        }
        for (int i = 0; i < eachWay; i++) {
            text.append(signal("out " + i, "%QD" + 4 * i, "REAL"));
        }
        return write(text);
    }

    private static StringBuilder head(String mode) {
        return new StringBuilder("""
            [driver]
            id = 1
            name = "Benchmark"

            [fieldbus]
            kind = "loopback"
            program = "mirror"
            scan = "1ms"
            """).append("mode = \"").append(mode).append("\"\n");
    }

    private static String signal(String name, String address, String type) {
        return "\n[[signal]]\nname = \"" + name + "\"\naddress = \"" + address + "\"\ntype = \"" + type + "\"\n";
    }

    private static Path write(StringBuilder text) {
        try {
            Path file = Files.createTempFile("tickbus-bench-", ".cfg");
            file.toFile().deleteOnExit();
            return Files.writeString(file, text);
        } catch (IOException e) {
            throw new UncheckedIOException(e);
        }
    }
}
