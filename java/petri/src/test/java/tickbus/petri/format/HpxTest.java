package tickbus.petri.format;

import static org.junit.jupiter.api.Assertions.assertArrayEquals;
import static org.junit.jupiter.api.Assertions.assertEquals;
import static org.junit.jupiter.api.Assertions.assertThrows;
import static org.junit.jupiter.api.Assertions.assertTrue;

import java.util.List;
import java.util.Optional;
import org.junit.jupiter.api.Test;
import tickbus.petri.net.Delay;
import tickbus.petri.net.NetException;
import tickbus.petri.net.PetriNet;
import tickbus.petri.net.Positions;
import tickbus.petri.run.Draws;

public class HpxTest {
    private static final String HEAD = """
        [DOCUMENT]
        APPLICATION=HPSim
        VERSION=0.9
        LAST_CONN_ID=2000005
        LAST_POSI_ID=1000002
        LAST_TRAN_ID=2
        DOC_SIZE=SIZE(1000,1000)
        """;
    /** Nodes of all kinds. */
    public static final String NET = HEAD + place(1_000_000, 3, 2_147_483_647) + place(1_000_001, 0, 9)
        + label(1_000_000, "store") + label(1_000_001, "belt") + label(0, "load") + label(1, "unload")
        + transition(0, 0, 0, 0) + transition(1, 3, 20, 30)
        + arc(2_000_000, 1_000_000, 0, 2, 0) + arc(2_000_001, 0, 1_000_001, 1, 0) + arc(2_000_002, 1_000_001, 1, 1, 0)
        + arc(2_000_003, 1_000_000, 1, 4, 1) + arc(2_000_004, 1_000_001, 0, 1, 2)
        + "[OBJECT 99]\nTEXT=a remark\nRUNTIME_CLASS=CHText\n";

    private static String place(int id, int tokens, int capacity) {
        return "[OBJECT p]\nRUNTIME_CLASS=CHPosition\nPOSITION_SIZE=25\nPOSITION_ID=" + id + "\nTOKENS_START=" + tokens
            + "\nTOKENS_CAPAZITY=" + capacity + "\n";
    }

    private static String transition(int id, int mode, int delay, int range) {
        return "[OBJECT t]\nTRANSITION_ID=" + id + "\nRUNTIME_CLASS=CHTransition\nFIRE_DELAY=" + delay
            + "\nFIRE_DELAY_RANGE=" + range + "\nTRANSITION_TIME_MODE=" + mode + "\n";
    }

    private static String arc(int id, int from, int to, int weight, int type) {
        return "[OBJECT a]\nARC_ID=" + id + "\nSOURCE_ID=" + from + "\nTARGET_ID=" + to + "\nARC_WEIGHT=" + weight
            + "\nRUNTIME_CLASS=CHConnector\nARC_TYP=" + type + "\n";
    }

    private static String label(int owner, String text) {
        return "[OBJECT l]\nRUNTIME_CLASS=CHLabel\nOWNER_IDENT=" + owner + "\nSUB_IDENT=0\nTEXT=" + text + "\n";
    }

    private static String mistake(String text) {
        return assertThrows(NetException.class, () -> Hpx.parse("n.hpx", text, 1_000_000)).getMessage();
    }

    @Test
    void weightsCapacitiesKindsAndDelaysAreRead() {
        Imported imported = Hpx.parse("n.hpx", NET, 1_000_000);
        assertEquals(List.of(), imported.warnings());
        PetriNet expected = PetriNet.named("n").place("store", 3).place("belt").capacity(9)
            .transition("load").input("store", 2).output("belt").test("belt", 1)
            .transition("unload").delay(Delay.uniform(20_000_000, 30_000_000)).input("belt").inhibitor("store", 4).build();
        assertTrue(expected.isSameAs(imported.net()), imported.net().arcs() + " " + imported.net().places());
    }

    @Test
    void whatIsWrongIsReportedWithLineAndElement() {
        assertTrue(mistake(NET.replace("VERSION=0.9", "VERSION=1.0")).equals("n.hpx:3: DOCUMENT: VERSION 1.0; expected 0.9"));
        assertTrue(mistake(NET.replace("ARC_WEIGHT=4", "ARC_WEIGHT=-4")).contains("ARC_WEIGHT -4; expected 1 to"));
        assertTrue(mistake(NET.replace("ARC_WEIGHT=4", "ARC_WEIGHT=four")).contains("ARC_WEIGHT 'four'; expected a whole number"));
        assertTrue(mistake(NET.replace("TOKENS_START=3", "TOKENS_START=-3")).contains("TOKENS_START -3"));
        assertTrue(mistake(NET.replace("SOURCE_ID=1000001", "SOURCE_ID=1000009")).contains("an arc from 1000009 to"));
        assertTrue(mistake(NET.replace("ARC_TYP=2", "ARC_TYP=3")).contains("ARC_TYP 3; expected 0 (normal)"));
        assertTrue(mistake(NET.replace("TRANSITION_TIME_MODE=3", "TRANSITION_TIME_MODE=4")).contains("TRANSITION_TIME_MODE 4"));
        assertTrue(mistake(NET.replace("FIRE_DELAY_RANGE=30", "FIRE_DELAY_RANGE=3")).contains("expected at least FIRE_DELAY, 20"));
        assertTrue(mistake(NET.replace("=CHLabel", "=CHLable")).contains("RUNTIME_CLASS CHLable; expected"));
        assertTrue(mistake(NET + arc(2_000_004, 0, 1_000_001, 1, 0)).contains("ARC_ID 2000004 is given twice"));
        assertTrue(mistake(NET + arc(2_000_005, 0, 1_000_001, 1, 1)).contains("on an arc to a place"));
        assertTrue(mistake(NET + "nonsense\n").contains("'nonsense'; expected [SECTION]"));
        assertTrue(mistake("").contains("cut off"));
    }

    @Test
    void nodesWithoutLabelsAreNamedByTheirIds() {
        Imported imported = Hpx.parse("n.hpx", NET.replace("TEXT=unload", "TEXT=load"), 1);
        assertEquals("T1", imported.net().transition(1).name());
        assertEquals(1, imported.warnings().size());
    }

    @Test
    void aFileThatIsCutOffIsNeverAWrongNetWithoutAWarning() {
        PetriNet whole = Hpx.parse("n.hpx", NET, 1).net();
        for (int length = 0; length < NET.length(); length++) {
            try {
                Imported cut = Hpx.parse("cut.hpx", NET.substring(0, length), 1);
                assertTrue(whole.isSameAs(cut.net()) || !cut.warnings().isEmpty(), "cut at " + length);
            } catch (NetException expected) {
                assertTrue(expected.getMessage().startsWith("cut.hpx"), expected.getMessage());
            }
        }
    }

    @Test
    void linesThatAreLostOrChangedGiveANetOrANetException() {
        Draws random = new Draws(7);
        String[] lines = NET.split("\n");
        for (int i = 0; i < 4_000; i++) {
            String[] changed = lines.clone();
            int at = random.below(lines.length);
            changed[at] = switch (random.below(4)) {
                case 0 -> lines[random.below(lines.length)];
                case 1 -> lines[at].replaceAll("=.*", "=-1");
                case 2 -> lines[at].replaceAll("=.*", "=");
                default -> lines[at].replaceAll("[0-9]", "x");
            };
            try {
                Hpx.parse("fuzz", String.join("\n", changed) + "\n", 1);
            } catch (NetException expected) {
                assertTrue(expected.getMessage().contains("fuzz"), expected.getMessage());
            }
        }
    }

    @Test
    void theRectanglesOfNodesGiveTheirPositions() {
        String drawn = NET.replace("RUNTIME_CLASS=CHPosition\n", "RUNTIME_CLASS=CHPosition\nBOUNDING_RECT=RECT(10,-20,30,40)\n")
            .replace("RUNTIME_CLASS=CHTransition\n", "RUNTIME_CLASS=CHTransition\nBOUNDING_RECT=RECT(0,0,5,10)\n");
        Positions nodes = Hpx.parse("n.hpx", drawn, 1).net().positions().orElseThrow();
        assertArrayEquals(new double[] {20, 10}, new double[] {nodes.x(1), nodes.y(1)});
        assertArrayEquals(new double[] {2.5, 5}, new double[] {nodes.x(2), nodes.y(2)});
        assertEquals(Optional.empty(), Hpx.parse("n.hpx", drawn.replace("10,-20", "ten"), 1).net().positions());
    }
}
