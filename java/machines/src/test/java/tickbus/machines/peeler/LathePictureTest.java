package tickbus.machines.peeler;

import static org.junit.jupiter.api.Assertions.assertEquals;
import static org.junit.jupiter.api.Assertions.assertFalse;
import static org.junit.jupiter.api.Assertions.assertTrue;

import java.io.StringReader;
import java.nio.file.Files;
import java.nio.file.Path;
import javax.xml.parsers.DocumentBuilderFactory;
import org.junit.jupiter.api.Test;
import org.junit.jupiter.api.io.TempDir;
import org.xml.sax.InputSource;

/** The lathe's picture. */
class LathePictureTest {
    private final LinePlayer player = new LinePlayer(new Peeler());

    private String draw() throws Exception {
        String svg = LathePicture.draw(player.line());
        DocumentBuilderFactory.newInstance().newDocumentBuilder().parse(new InputSource(new StringReader(svg)));
        return svg;
    }

    @Test
    void anEmptyLatheShowsItsAxes(@TempDir Path folder) throws Exception {
        String svg = draw();
        assertTrue(svg.contains(">no block</text>") && svg.contains("top roll") && svg.contains(">300.0 mm</text>"), svg);
        assertFalse(svg.contains("pieces"), svg);
        LathePicture.write(player.line(), folder.resolve("lathe.svg"));
        assertEquals(svg, Files.readString(folder.resolve("lathe.svg")));
    }

    /** {@code TICKBUS_UPDATE=1} redraws the picture. */
    @Test
    void thePictureOfTheLivePageIsTheSameDrawing() throws Exception {
        Path file = Path.of("lathe.svg");
        if (System.getenv("TICKBUS_UPDATE") != null) {
            LathePicture.write(new Peeler(), file);
        }
        assertEquals(Files.readString(file), LathePicture.draw(new Peeler()));
    }

    @Test
    void whatComesOffIsTornFirstAndThenARibbon() throws Exception {
        player.charge();
        player.take();
        player.press(false, 50, AxisName.ROUND_UP_GATE);
        player.move(160, AxisName.KNIFE_CARRIAGE);
        player.run(4);
        player.track(AxisName.KNIFE_CARRIAGE, 0, 3);
        player.until("the first cut", () -> player.line().lathe().held().thickest() > 0);
        assertTrue(draw().contains("torn pieces: not round yet"));
        player.until("a round block", player.line()::round);
        String svg = draw();
        assertTrue(svg.contains("a whole ribbon") && svg.contains("block 1, cylinder"), svg);
    }
}
