import java.io.FileOutputStream;
import java.nio.charset.StandardCharsets;
import java.nio.file.Path;
import java.util.concurrent.locks.LockSupport;
import tickbus.Signal;
import tickbus.Tickbus;

/** An end of a line of the storm, in Java. See README.md in this folder for its arguments and for what it writes. */
public final class End {
    private static final String[] NAMES = {"stamp", "pulse", "level", "whole", "real"};

    private End() {}

    public static void main(String[] arguments) throws Exception {
        long life = Long.parseLong(arguments[2]);
        long area = arguments[3].equals("I") ? 1 : 0;
        int stations = Integer.parseInt(arguments[4]);
        long period = Long.parseLong(arguments[5]);
        long pulseEvery = Long.parseLong(arguments[6]);
        boolean halves = arguments[7].equals("1");
        long pauseAt = Long.parseLong(arguments[8]);
        long pause = Long.parseLong(arguments[9]);
        // SIGTERM ends it, and closes the driver: that is for the library to do.
        try (FileOutputStream out = new FileOutputStream(arguments[1], true);
                Tickbus plc = Tickbus.open(Path.of(arguments[0]))) {
            Signal[][] written = new Signal[stations][];
            Signal[][] read = new Signal[stations][];
            for (int station = 0; station < stations; station++) {
                written[station] = signals(plc, area == 1 ? "I" : "Q", station);
                read[station] = signals(plc, area == 1 ? "Q" : "I", station);
            }
            long due = System.nanoTime();
            for (long tick = 1;; tick++) {
                due = Math.max(due + period, System.nanoTime() - period);
                for (long rest = due - System.nanoTime(); rest > 0; rest = due - System.nanoTime()) {
                    LockSupport.parkNanos(rest);
                }
                long began = System.nanoTime();
                int status = halves ? plc.receive() : 0;
                long received = System.nanoTime();
                for (int station = 0; station < stations; station++) {
                    long stamp = life << 48 | area << 44 | (long) station << 40 | tick;
                    long mixed = stamp * 0x9E3779B97F4A7C15L;
                    Signal[] to = written[station];
                    to[0].setLong(stamp);
                    to[1].setBoolean(tick % pulseEvery == 0);
                    to[2].setBoolean(mixed < 0);
                    to[3].set((short) (mixed >> 32));
                    to[4].set((short) (mixed >> 16) / 2.0);
                }
                if (halves) {
                    plc.send();
                } else {
                    status = plc.exchange();
                }
                long ended = System.nanoTime();
                StringBuilder line = new StringBuilder(200);
                line.append(tick).append(' ').append(began).append(' ').append(halves ? received : ended).append(' ').append(ended);
                line.append(' ').append(status).append(' ').append(plc.ageNanos()).append(' ').append(plc.sequence());
                for (Signal[] from : read) {
                    line.append(' ').append(Long.toUnsignedString(from[0].getLong())).append(' ').append(from[2].getBoolean() ? 1 : 0);
                    line.append(' ').append(from[1].edges()).append(' ').append(from[3].get()).append(' ').append(from[4].get());
                }
                out.write(line.append('\n').toString().getBytes(StandardCharsets.US_ASCII));
                if (tick == pauseAt) {
                    Thread.sleep(pause / 1_000_000);
                }
            }
        }
    }

    private static Signal[] signals(Tickbus plc, String area, int station) {
        Signal[] signals = new Signal[NAMES.length];
        for (int index = 0; index < NAMES.length; index++) {
            signals[index] = plc.signal(NAMES[index] + area + station);
        }
        return signals;
    }
}
