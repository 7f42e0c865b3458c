package tickbus.petri.control;

import java.io.IOException;
import java.io.UncheckedIOException;
import java.nio.file.Files;
import java.nio.file.Path;
import java.util.concurrent.atomic.AtomicInteger;
import java.util.function.BooleanSupplier;
import tickbus.Tickbus;

/** A gripper's driver.cfg, for either end of any bus. */
final class Line {
    private static final AtomicInteger LINKS = new AtomicInteger();
    static final String SIGNALS = """

        [[signal]]
        name    = "Piece at stop"
        address = "%IX0.0"

        [[signal]]
        name    = "Gripper closed"
        address = "%IX0.1"

        [[signal]]
        name    = "Weight"
        address = "%IW2"
        type    = "INT"

        [[signal]]
        name    = "Gripper"
        address = "%QX0.0"

        [[signal]]
        name      = "Brake"
        address   = "%QX0.1"
        fail_safe = true

        [[signal]]
        name    = "Pieces"
        address = "%QW2"
        type    = "INT"
        """;

    private Line() {
    }

    /** One end with these lines of [fieldbus]. */
    static Tickbus open(Path folder, int id, String fieldbus) {
        try {
            Path file = Files.createTempFile(folder, "driver", ".cfg");
            return Tickbus.open(Files.writeString(file, "[driver]\nid = " + id + "\nname = \"Gripper\"\n\n[fieldbus]\n"
                + fieldbus + SIGNALS));
        } catch (IOException e) {
            throw new UncheckedIOException(e);
        }
    }

    /** Lines for the device and the controller of a link in simulation time. */
    static String[] steppedLink() {
        String link = "kind = \"loopback\"\nmode = \"stepped\"\nlink = \"nets " + LINKS.incrementAndGet() + "\"\nrole = ";
        return new String[] {link + "\"device\"\n", link + "\"controller\"\n"};
    }

    /** Lets both ends work until a condition holds. */
    static void until(String what, BooleanSupplier so, Runnable both) {
        long limit = System.nanoTime() + 20_000_000_000L;
        while (!so.getAsBoolean()) {
            if (System.nanoTime() > limit) {
                throw new AssertionError("after 20 s: not " + what);
            }
            both.run();
            Thread.onSpinWait();
        }
    }
}
