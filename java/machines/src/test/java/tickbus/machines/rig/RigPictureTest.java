package tickbus.machines.rig;

import static org.junit.jupiter.api.Assertions.assertEquals;
import static org.junit.jupiter.api.Assertions.assertFalse;
import static org.junit.jupiter.api.Assertions.assertTrue;

import java.io.ByteArrayInputStream;
import java.nio.charset.StandardCharsets;
import java.nio.file.Files;
import java.nio.file.Path;
import java.util.Locale;
import javax.xml.parsers.DocumentBuilderFactory;
import org.junit.jupiter.api.Test;
import org.junit.jupiter.api.io.TempDir;

/** The rig as a picture and as text. */
class RigPictureTest {
    @TempDir
    Path folder;

    private final WordPlayer player = WordPlayer.homed().cycles(2).steps(1, 4);

    @Test
    void thePictureIsWellFormedAndSelfContained() throws Exception {
        show(3, 5, 2);
        player.playFor(WordPlayer.STEPS[4], 400);
        Path file = folder.resolve("rig.svg");
        RigPicture.write(player.rig, file);
        String svg = Files.readString(file);
        var document = DocumentBuilderFactory.newInstance().newDocumentBuilder()
                .parse(new ByteArrayInputStream(svg.getBytes(StandardCharsets.UTF_8)));
        assertEquals("svg", document.getDocumentElement().getTagName());
        assertFalse(svg.contains("href"), "nothing outside is needed");
        assertTrue(svg.contains(">lamp on</text>"));
        assertTrue(svg.contains("phase run, step 5, cycle 2"));
        for (Bottle bottle : player.rig.bottles()) {
            assertTrue(svg.contains(">" + bottle.id() + "</text>"), "bottle " + bottle.id());
        }
        assertEquals(svg, RigPicture.draw(player.rig), "drawing changes nothing");
    }

    /** {@code TICKBUS_UPDATE=1} redraws the picture. */
    @Test
    void thePictureOfTheLivePageIsTheSameDrawing() throws Exception {
        Rig rig = new Rig(0, 0, 0, 0);
        rig.step(WordPlayer.MILLI);
        Path file = Path.of("rig.svg");
        if (System.getenv("TICKBUS_UPDATE") != null) {
            RigPicture.write(rig, file);
        }
        assertEquals(Files.readString(file), RigPicture.draw(rig));
    }

    /** A bound element stays where it was drawn while its signal has the value of that moment. */
    @Test
    void whatMovesIsBoundRelativeToWhereItWasDrawn() {
        player.play(WordPlayer.LA1_BIG_UP, 1000);
        double position = player.rig.position(Lift.LA1);
        String svg = RigPicture.draw(player.rig);
        String expected = String.format(Locale.ROOT, "data-tb-y=\"LA1 position: -1.06 + %.4f\"", position * 1.06);
        assertTrue(position > 100 && svg.contains(expected), expected);
    }

    @Test
    void theTextTellsWhatMovesAndWhatIsWrong() {
        show(3, 5, 2);
        player.rig.jamNext(Lift.LA2);
        player.playFor(WordPlayer.STEPS[4], 2_000);
        String line = RigPanel.line(player.rig);
        assertTrue(line.contains("run        step 5  cycle 2"), line);
        assertTrue(line.endsWith("lamp NOT OK"), line);
        assertFalse(line.contains("\n"));
        String lines = RigPanel.lines(player.rig);
        assertTrue(lines.contains("package 2 blocked"), lines);
        assertTrue(lines.contains("NOT OK: jam: package sensor 2"), lines);
        assertTrue(lines.contains("3@stuck2"), lines);
        assertEquals("finalise", RigPanel.phase(6));
        assertEquals("9", RigPanel.phase(9));
    }

    private void show(int phase, int step, int cycles) {
        Rig rig = player.rig;
        rig.input(rig.inputs().indexOf("panel.running"), 1);
        rig.input(rig.inputs().indexOf("panel.phase"), phase);
        rig.input(rig.inputs().indexOf("panel.step"), step);
        rig.input(rig.inputs().indexOf("panel.cycles"), cycles);
    }
}
