package tickbus.cell;

import static org.junit.jupiter.api.Assertions.assertEquals;
import static org.junit.jupiter.api.Assertions.assertFalse;
import static org.junit.jupiter.api.Assertions.assertTrue;

import java.io.IOException;
import java.nio.file.Files;
import java.nio.file.Path;
import java.nio.file.StandardCopyOption;
import java.util.List;
import java.util.Map;
import java.util.Random;
import java.util.TreeMap;
import org.junit.jupiter.api.Tag;
import org.junit.jupiter.api.Test;
import org.junit.jupiter.api.io.TempDir;
import tickbus.Signal;
import tickbus.machines.cell.Workpiece;

/**
 * The control ends at random moments and is started again, and the emergency stop is pressed: no piece is lost, whatever the
 * machine did meanwhile. {@code -Dcell.seeds=200} runs more seeds.
 */
@Tag("native")
class CellRestartTest extends CellLoop {
    private static final int SEEDS = Integer.getInteger("cell.seeds", 12);
    /** Longer than every stroke of the cell. */
    private static final int MOST_TICKS_GONE = 60;

    /** Happenings between the end of a control and its next start. */
    private enum Gap {
        /** The machine keeps the last outputs: a bus that holds them, and a fast start. */
        HELD,
        /** The machine gets the fail-safe values for some time. */
        FAIL_SAFE,
        /** As FAIL_SAFE, and the markings are gone. */
        NO_FILE,
        /** As FAIL_SAFE, and the markings are older than the machine. */
        OLD_FILE,
    }

    @TempDir
    Path folder;

    private int resumed;
    private int homed;
    private final Map<String, Integer> reasons = new TreeMap<>();

    private void begin(long seed) {
        close();
        file = folder.resolve("markings-" + seed);
        open();
    }

    private void restart(Gap gap, Random random, Path old) {
        int gone = random.nextInt(MOST_TICKS_GONE);
        closeControl();
        if (gap != Gap.HELD) {
            fail();
        }
        for (int i = 0; i < gone; i++) {
            move();
            nanos += STEP;
        }
        try {
            if (gap == Gap.NO_FILE) {
                Files.deleteIfExists(file);
            } else if (gap == Gap.OLD_FILE && Files.exists(old)) {
                Files.copy(old, file, StandardCopyOption.REPLACE_EXISTING);
            }
        } catch (IOException e) {
            throw new AssertionError(e);
        }
        reader.restart();
        openControl();
        while (program.why() == null) {
            move();
            heads.exchange(nanos);
            program.scan(nanos);
            nanos += STEP;
        }
        if (program.isHoming()) {
            homed++;
            reasons.merge(program.why().replaceAll("[0-9]{2,}", "N"), 1, Integer::sum);
            until("Rearm is asked for", cell::asksForRearm);
            for (int i = 0; i < 40; i++) {
                tick();
            }
            assertTrue(cell.asksForRearm());
            assertEquals(0, plc.signal("Belt").get(), "nothing moves before Rearm");
            press();
            assertFalse(cell.asksForRearm());
        } else {
            resumed++;

        }
    }

    private void press() {
        cell.rearm(true);
        ticks(20);
        cell.rearm(false);
        ticks(2);
    }

    /** The values of the outputs at a machine without a control. */
    private void fail() {
        for (String name : cell.inputs()) {
            if (plcWrites(name)) {
                cell.input(cell.inputs().indexOf(name), name.equals("S1 gripper") || name.equals("S4 vacuum valve") ? 1 : 0);
            }
        }
    }

    private boolean plcWrites(String name) {
        return machine.signals().stream().anyMatch(signal -> !signal.isWritten() && signal.name().equals(name));
    }

    private void whole(String when) {
        assertEquals(12, cell.delivered().size(), when);
        assertTrue(cell.delivered().stream().allMatch(Workpiece::isComplete), when);
        assertEquals(12, cell.delivered().stream().mapToInt(Workpiece::number).distinct().count(), when);
        assertEquals(0, cell.counters().fallen(), when);
        assertEquals(0, cell.counters().wasted(), when);
        assertEquals(0, cell.counters().collisions(), when);
        assertEquals(12, cell.counters().begun(), when);
    }

    private void run(Gap gap) throws IOException {
        long longest = 0;
        for (int seed = 0; seed < SEEDS; seed++) {
            begin(seed);
            until("Rearm is asked for", cell::asksForRearm);
            press();
            Random random = new Random(seed);
            long at = nanos + random.nextInt(12_000) * 1_000_000L;
            String when = gap + ", seed " + seed + ", at " + at / 1_000_000 + " ms";
            Path old = folder.resolve("old");
            long copied = at - 5_000_000L * (1 + random.nextInt(300));
            while (nanos < at) {
                tick();
                if (gap == Gap.OLD_FILE && nanos >= copied && !Files.exists(old) && Files.exists(file)) {
                    Files.copy(file, old);
                }
            }
            String was = state();
            try {
                restart(gap, random, old);
                delivers(12);
                whole(when);
            } catch (AssertionError e) {
                throw new AssertionError(when + "; before: " + was + "; now: " + state() + " because " + program.why(), e);
            }
            longest = Math.max(longest, nanos);
            Files.deleteIfExists(old);
        }
        System.out.println(gap + ": " + SEEDS + " restarts, " + resumed + " resumed, " + homed + " homed, the longest run took "
            + longest / 1_000_000 + " ms; " + reasons);
    }

    @Test
    void whileTheMachineKeepsItsOutputsTheNetsResume() throws IOException {
        run(Gap.HELD);
        // Before the first markings are saved, and before a feeder has moved.
        assertTrue(resumed > 10 * homed, resumed + " resumed, " + homed + " homed");
    }

    @Test
    void afterFailSafeOutputsTheNetsResumeOrHome() throws IOException {
        run(Gap.FAIL_SAFE);
        assertTrue(resumed > 0 && homed > 0, resumed + " resumed, " + homed + " homed");
    }

    @Test
    void withoutMarkingsTheNetsHome() throws IOException {
        run(Gap.NO_FILE);
        assertEquals(0, resumed);
    }

    @Test
    void withOldMarkingsTheNetsHome() throws IOException {
        run(Gap.OLD_FILE);
        assertTrue(homed > resumed);
    }

    /** Stops at a random moment, for a random time; a control that is started again meanwhile changes nothing. */
    private void stops(boolean restarts) throws IOException {
        for (int seed = 0; seed < SEEDS; seed++) {
            begin(seed);
            until("Rearm is asked for", cell::asksForRearm);
            press();
            Random random = new Random(seed);
            long at = nanos + random.nextInt(17_000) * 1_000_000L;
            String when = "stop, seed " + seed + ", at " + at / 1_000_000 + " ms";
            while (nanos < at) {
                tick();
            }
            String was = state();
            try {
                cell.emergency(true);
                ticks(1 + random.nextInt(300));
                if (restarts) {
                    closeControl();
                    fail();
                    reader.restart();
                    openControl();
                }
                assertEquals(List.of("S1 gripper", "S4 vacuum valve"), commands(), "the fail-safe values");
                cell.emergency(false);
                ticks(random.nextInt(300));
                assertEquals(List.of("S1 gripper", "S4 vacuum valve"), commands(), "the release starts nothing");
                cell.rearm(true);
                ticks(20);
                cell.rearm(false);
                ticks(2);
                if (restarts && program.why() == null) {
                    // The button was down when the new control first saw it.
                    press();
                }
                if (restarts && program.isHoming()) {
                    homed++;
                    press();
                } else {
                    resumed++;
                }
                delivers(12);
                whole(when);
            } catch (AssertionError e) {
                throw new AssertionError(when + "; before: " + was + "; now: " + state(), e);
            }
        }
        System.out.println(SEEDS + " emergency stops" + (restarts ? " with a restart, " : ", ") + resumed + " continued, " + homed
            + " homed");
    }

    private void ticks(int count) {
        for (int i = 0; i < count; i++) {
            tick();
        }
    }

    private List<String> commands() {
        return plc.signals().stream().filter(one -> one.isWritten() && one.get() != 0 && !one.name().equals("Marking number")
            && !one.name().equals("Rearm lamp")).map(Signal::name).toList();
    }

    @Test
    void afterAnEmergencyStopAndRearmTheNetsContinue() throws IOException {
        stops(false);
    }

    @Test
    void aControlThatIsStartedDuringAnEmergencyStopMovesNothingBeforeRearm() throws IOException {
        stops(true);
    }
}
