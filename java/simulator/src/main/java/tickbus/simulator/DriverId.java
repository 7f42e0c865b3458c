package tickbus.simulator;

import java.io.IOException;
import java.nio.file.Files;
import java.nio.file.Path;
import java.util.regex.Matcher;
import java.util.regex.Pattern;

/**
 * Reads one value from a driver's {@code .cfg}: the {@code id} under {@code [driver]}.
 *
 * <p>The driver reads the rest of the file itself; the simulator only needs to make sure, before it opens anything,
 * that no two files have the same id. So this is not a TOML reader. It accepts the plain form, a line {@code id =
 * 4711} (decimal, with optional sign, {@code _} between digits, and a trailing comment) below a line {@code [driver]}
 * and above the next table header.
 */
final class DriverId {
    /** Some editors begin a file in UTF-8 with this mark. */
    private static final String BYTE_ORDER_MARK = "\uFEFF";
    private static final Pattern TABLE = Pattern.compile("\\s*\\[+\\s*([^\\]]*?)\\s*\\]+\\s*(#.*)?");
    private static final Pattern ID = Pattern.compile("\\s*(?:id|\"id\"|'id')\\s*=\\s*([+-]?\\d[\\d_]*)\\s*(#.*)?");

    private DriverId() {
    }

    /**
     * Reads a file's id.
     *
     * @throws WrongInput if the file cannot be read or has no such line
     */
    static int read(Path cfg) {
        String text;
        try {
            text = Files.readString(cfg);
        } catch (IOException e) {
            throw new WrongInput(cfg + ": cannot be read as text in UTF-8: " + e, e);
        }
        if (text.startsWith(BYTE_ORDER_MARK)) {
            text = text.substring(BYTE_ORDER_MARK.length());
        }
        boolean inDriver = false;
        for (String line : text.split("\\R")) {
            Matcher table = TABLE.matcher(line);
            Matcher id = ID.matcher(line);
            if (table.matches()) {
                inDriver = table.group(1).equals("driver");
            } else if (inDriver && id.matches()) {
                try {
                    return Integer.parseInt(id.group(1).replace("_", ""));
                } catch (NumberFormatException e) {
                    throw new WrongInput(cfg + ": the id " + id.group(1) + " does not fit into 32 bits", e);
                }
            }
        }
        throw new WrongInput(cfg + ": there is no id; every driver's file has a table [driver] with a line"
                + " id = <whole number>, different from all other ids in the folder");
    }
}
