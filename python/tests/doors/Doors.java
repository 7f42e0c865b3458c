import java.nio.file.Path;
import tickbus.Signal;
import tickbus.Tickbus;

/** Doors FILE TABLES TICKS: the run of test_doors.py, in Java. */
final class Doors {
    private Doors() {
    }

    public static void main(String[] arguments) {
        try (Tickbus plc = Tickbus.open(Path.of(arguments[0]), arguments[1])) {
            int ticks = Integer.parseInt(arguments[2]);
            long seed = 1;
            for (int tick = 1; tick <= ticks; tick++) {
                long time = tick * 2_000_000L;
                if (tick % 2 == 1) {
                    plc.receive(time);
                }
                for (Signal signal : plc.signals()) {
                    if (!signal.isWritten()) {
                        continue;
                    }
                    seed = seed * 6364136223846793005L + 1442695040888963407L;
                    if (seed >>> 58 == 0) {
                        set(signal, seed);
                    }
                }
                if (tick % 2 == 1) {
                    plc.send();
                } else {
                    plc.exchange(time);
                }
            }
        }
    }

    private static void set(Signal signal, long seed) {
        switch (signal.type()) {
            case "LINT", "ULINT", "LWORD" -> signal.setLong(seed);
            case "BOOL" -> signal.setBoolean((seed >>> 40 & 1) != 0);
            default -> signal.set((seed >>> 20 & 0xFFFFFF) / 16.0 - 1000);
        }
    }
}
