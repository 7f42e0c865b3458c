package tickbus.machines.cell;

import static org.junit.jupiter.api.Assertions.assertEquals;
import static org.junit.jupiter.api.Assertions.assertTrue;

import java.nio.file.Files;
import java.nio.file.Path;
import java.util.Set;
import java.util.TreeSet;
import java.util.regex.Matcher;
import java.util.regex.Pattern;
import org.junit.jupiter.api.Test;

/** The cell's picture. */
class CellPictureTest {
    /** {@code TICKBUS_UPDATE=1} redraws the picture. */
    @Test
    void thePictureOfTheLivePageIsTheSameDrawing() throws Exception {
        Path file = Path.of("cell.svg");
        if (System.getenv("TICKBUS_UPDATE") != null) {
            CellPicture.write(file);
        }
        assertEquals(Files.readString(file), CellPicture.draw());
    }

    @Test
    void eachSignalOfThePictureIsOfTheCell() {
        ManufacturingCell cell = new ManufacturingCell();
        Set<String> bound = new TreeSet<>();
        Matcher one = Pattern.compile("data-tb-(?!smooth)\\w+=\"([^:\"]+)").matcher(CellPicture.draw());
        while (one.find()) {
            assertTrue(cell.inputs().contains(one.group(1)) || cell.outputs().contains(one.group(1)), one.group(1));
            bound.add(one.group(1));
        }
        // All but what only the nets need, and valves whose cylinders have sensors.
        assertEquals(52, bound.size(), bound::toString);
    }
}
