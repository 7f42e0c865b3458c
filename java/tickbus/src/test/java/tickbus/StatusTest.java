package tickbus;

import static org.junit.jupiter.api.Assertions.assertEquals;

import java.io.IOException;
import java.nio.file.Files;
import java.nio.file.Path;
import java.util.Arrays;
import java.util.List;
import org.junit.jupiter.api.Test;

class StatusTest {
    @Test
    void enumAndTableOfTheNativeSideAreTheSame() throws IOException {
        Path table = Path.of(System.getProperty("tickbus.root"), "crates", "core", "driver", "src", "status.tsv");
        List<String> expected = Files.readAllLines(table).stream()
            .filter(line -> !line.startsWith("#") && !line.isEmpty())
            .toList();
        List<String> actual = Arrays.stream(Status.values())
            .map(status -> String.join("\t", String.valueOf(status.code()), status.name(), status.text(), status.remedy()))
            .toList();
        assertEquals(expected, actual);
    }

    @Test
    void statusIsFoundByItsCode() {
        for (Status status : Status.values()) {
            assertEquals(status, Status.of(status.code()));
        }
        assertEquals(Status.INTERNAL, Status.of(Integer.MIN_VALUE));
        assertEquals(Status.BUSY, new FieldbusException(Status.BUSY, "both").status());
    }
}
