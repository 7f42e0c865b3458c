package tickbus;

import java.io.IOException;
import java.io.UncheckedIOException;
import java.nio.file.Files;
import java.nio.file.Path;
import java.util.concurrent.atomic.AtomicInteger;

/** Writes driver.cfg files for tests. */
final class DriverCfg {
    private static final AtomicInteger LINKS = new AtomicInteger();

    private final StringBuilder text = new StringBuilder();

    private DriverCfg(int id, String fieldbus) {
        text.append("[driver]\nid = ").append(id).append("\nname = \"Driver ").append(id)
            .append("\"\n\n[fieldbus]\nkind = \"loopback\"\n").append(fieldbus).append('\n');
    }

    /** A device whose PLC copies every byte of %I to %Q, within the same exchange. */
    static DriverCfg mirror(int id) {
        return new DriverCfg(id, "program = \"mirror\"\nmode = \"stepped\"\nscan = \"1ms\"");
    }

    /** One end of a link in this process. */
    static DriverCfg link(int id, String link, String role) {
        return new DriverCfg(id, "link = \"" + link + "\"\nrole = \"" + role + "\"\ncycle = \"1ms\"");
    }

    /** A link name that no other test has. */
    static String freshLink() {
        return "test " + LINKS.incrementAndGet();
    }

    /** A line for the fieldbus section; to be called before signals are added. */
    DriverCfg fieldbus(String line) {
        text.append(line).append('\n');
        return this;
    }

    /** A signal, with further lines such as {@code type = "INT"}. */
    DriverCfg signal(String name, String address, String... lines) {
        text.append("\n[[signal]]\nname = \"").append(name).append("\"\naddress = \"").append(address).append("\"\n");
        for (String line : lines) {
            text.append(line).append('\n');
        }
        return this;
    }

    Path write(Path directory) {
        try {
            return Files.writeString(Files.createTempFile(directory, "driver", ".cfg"), text);
        } catch (IOException e) {
            throw new UncheckedIOException(e);
        }
    }

    Tickbus open(Path directory) {
        return Tickbus.open(write(directory));
    }
}
