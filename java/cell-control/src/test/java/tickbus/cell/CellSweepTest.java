package tickbus.cell;

import static org.junit.jupiter.api.Assertions.assertEquals;

import java.io.IOException;
import java.nio.file.Files;
import java.nio.file.Path;
import java.util.ArrayList;
import java.util.List;
import org.junit.jupiter.api.Tag;
import org.junit.jupiter.api.Test;
import tickbus.Signal;

/**
 * A sweep of the nets: each input sticks, on and off, from the start and from the first cylinder on.
 *
 * <p>The verdicts are those of sweep.txt, a line for each fault: the verdict at either moment, the input, and why that is
 * accepted. The nets are no program that {@code tickbus test} hosts, so the runs take place here.
 */
@Tag("native")
class CellSweepTest extends CellLoop {
    private static final String ACCEPTED = "src/test/resources/tickbus/cell/sweep.txt";
    /** Longer than the nets need for a cylinder. */
    private static final long PATIENCE_NANOS = 25_000_000_000L;

    @Test
    void eachInputThatSticksHasTheAcceptedVerdict() throws IOException {
        int inputs = written.size();
        close();
        List<String> found = new ArrayList<>();
        for (int input = 0; input < inputs; input++) {
            for (int value = 0; value < 2; value++) {
                String begin = verdict(input, value, 0);
                String later = verdict(input, value, 1);
                found.add(String.format("%-5s %-5s | %s %s", begin, later, stuck.name(), value == 0 ? "off" : "on"));
            }
        }
        open();
        Files.write(Path.of("target/sweep.txt"), found);
        List<String> accepted = Files.readAllLines(Path.of(ACCEPTED)).stream().filter(line -> !line.startsWith("#"))
            .map(line -> line.replaceFirst(" *#.*", "")).toList();
        assertEquals(String.join("\n", accepted), String.join("\n", found));
    }

    /** One run whose input sticks when so many cylinders are out. */
    private String verdict(int input, int value, int cylinders) {
        open();
        try {
            delivers(cylinders);
            stuck = written.get(input);
            stuckAt = value;
            long end = nanos + PATIENCE_NANOS;
            while (nanos < end && cell.delivered().size() < cylinders + 2) {
                tick();
                if (cell.counters().fallen() + cell.counters().wasted() + cell.counters().collisions() > 0) {
                    return "never";
                }
                if (!nets.stops().isEmpty() || cell.showsEmptyParts() || cell.showsEmptyCaps()) {
                    return "told";
                }
            }
            return cell.delivered().size() == cylinders + 2 ? "right" : "still";
        } finally {
            close();
        }
    }
}
