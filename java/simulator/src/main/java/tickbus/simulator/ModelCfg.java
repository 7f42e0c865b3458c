package tickbus.simulator;

import java.io.IOException;
import java.nio.charset.StandardCharsets;
import java.nio.file.FileAlreadyExistsException;
import java.nio.file.Files;
import java.nio.file.Path;
import java.nio.file.StandardOpenOption;
import tickbus.simulator.control.Endpoints;

/**
 * A driver.cfg whose signals are the variables of a machine's model: in a DeviceDriver folder it shows them on the live page,
 * and records them.
 */
final class ModelCfg {
    private static final String HEAD = """
            # The variables of the machine %1$s: on the live page, and recorded.
            # In a DeviceDriver folder this file needs no rows in the control table: its signals have the variables' names.

            [driver]
            id   = 9000                        # unique among the drivers in the folder
            name = %2$s

            [fieldbus]
            kind    = "loopback"               # there is no PLC
            program = "mirror"
            cycle   = "100ms"
            scan    = "100ms"

            [page]

            [record]
            file = "model.vcd"
            """;

    private static final String SIGNAL = """

            [[signal]]
            name    = %s
            address = "%%IL%d"
            type    = "LREAL"
            """;

    private ModelCfg() {
    }

    /** Writes a machine's driver.cfg to a file that does not exist yet. */
    static void write(Machine machine, Path file) {
        if (machine.variables().isEmpty()) {
            throw new WrongInput("the machine " + machine.name() + " shows no variables of its model");
        }
        StringBuilder text = new StringBuilder(HEAD.formatted(machine.name(), quoted(machine.name() + ", model")));
        int at = 0;
        for (ModelVariable variable : machine.variables()) {
            text.append(SIGNAL.formatted(quoted(Endpoints.MODEL + ":" + variable.name()), at));
            if (!variable.unit().isEmpty()) {
                text.append("unit    = ").append(quoted(variable.unit())).append('\n');
            }
            at += Double.BYTES;
        }
        try {
            Files.write(file, text.toString().getBytes(StandardCharsets.UTF_8), StandardOpenOption.CREATE_NEW,
                    StandardOpenOption.WRITE);
        } catch (FileAlreadyExistsException e) {
            throw new WrongInput(file + ": this file exists already; name a new one", e);
        } catch (IOException e) {
            throw new WrongInput(file + ": the file cannot be written: " + e, e);
        }
    }

    private static String quoted(String text) {
        return '"' + text.replace("\\", "\\\\").replace("\"", "\\\"") + '"';
    }
}
