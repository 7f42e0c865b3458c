package tickbus.machines.peeler;

import static org.junit.jupiter.api.Assertions.assertEquals;
import static org.junit.jupiter.api.Assertions.assertFalse;
import static org.junit.jupiter.api.Assertions.assertNull;
import static org.junit.jupiter.api.Assertions.assertThrows;
import static org.junit.jupiter.api.Assertions.assertTrue;

import java.util.List;
import java.util.Set;
import java.util.TreeSet;
import java.util.stream.Stream;
import org.junit.jupiter.api.Test;

/** The whole line, commanded step by step. */
class PeelerTest {
    private final LinePlayer player = new LinePlayer(new Peeler());
    private final Peeler line = player.line();

    private void noMishap() {
        assertEquals(List.of(), line.mishaps());
    }

    @Test
    void namesAreUniqueAndThoseOfTheRecords() {
        assertEquals(25, AxisName.values().length);
        assertEquals(12, Stream.of(AxisName.values()).filter(AxisName::ofCharger).count());
        Set<String> names = new TreeSet<>(line.inputs());
        assertEquals(line.inputs().size(), names.size());
        names = new TreeSet<>(line.outputs());
        assertEquals(line.outputs().size(), names.size());
        assertTrue(names.containsAll(List.of("step feeder.ActualPosition", "core drop.InPosition", "simulation time")));
        assertThrows(IndexOutOfBoundsException.class, () -> line.input(line.inputs().size(), 0));
        assertThrows(IndexOutOfBoundsException.class, () -> line.output(line.outputs().size()));
        assertThrows(IllegalArgumentException.class, () -> line.step(-1));
    }

    @Test
    void theSensorsSeeTheBlocksOnTheirWay() {
        assertTrue(player.sensor(1) && player.sensor(4) && player.sensor(8));
        assertFalse(player.sensor(5) || player.sensor(6) || player.sensor(7) || player.sensor(16));
        assertEquals(800, player.get("pre-centring distance 1"));
        player.move(400, AxisName.STEP_FEEDER);
        assertTrue(player.sensor(2) && player.sensor(4) && player.sensor(5));
        assertFalse(player.sensor(1));
        player.ticks(100);
        assertTrue(player.sensor(4), "one stroke is one step");
        player.move(0, AxisName.STEP_FEEDER);
        player.press(false, 50, AxisName.CHARGER_GATE);
        player.until("a block on step 1", () -> player.sensor(1));
        player.move(0, AxisName.LINEAR_FEEDER);
        assertEquals(800 - (1 + Math.sqrt(2)) * 140, player.get("pre-centring distance 1"), 0.01);
        assertEquals(0.001 * 2 * Math.round(player.get("simulation time") / 0.002), player.get("simulation time"), 1e-9);
        noMishap();
    }

    @Test
    void aBlockIsCentredTakenAndPeeledAndNoWoodIsLost() {
        player.charge();
        assertTrue(player.sensor(7));
        assertFalse(player.sensor(6));
        player.take();
        assertFalse(player.sensor(7));
        assertEquals(1, line.lathe().block().number());
        player.peel();
        noMishap();
        assertNull(line.lathe().held());
        Wood wood = line.lathe().wood();
        assertEquals(1, wood.coreCount());
        assertEquals(Math.PI * 140 * 140 * 1300 / 1e9, wood.chucked(), 1e-4);
        assertEquals(wood.chucked(), wood.veneer() + wood.torn() + wood.chipped() + wood.cores(), 1e-9);
        double whole = Math.PI * (125 * 125 - 40 * 40) / 1.5 / 1000;
        assertTrue(wood.ribbon() > 0.9 * whole && wood.ribbon() < whole, "the ribbon has " + wood.ribbon() + " m");
        assertEquals(wood.ribbon() * 1.3 * 0.0015, wood.veneer(), wood.veneer() * 0.002);
        assertEquals(0, wood.torn(), 2e-5, "only the ribbon's end, where the knife stops, is thinner");
    }

    @Test
    void oneThatIsNotRoundIsHeldOffItsAxisAndTornAtFirst() {
        for (int i = 0; i < 2; i++) {
            player.charge();
            player.take();
            if (i == 1) {
                assertEquals(2, line.lathe().block().number());
                double off = line.lathe().block().eccentricity(true);
                assertTrue(off > 1 && off < 10, "it is held off its axis by " + off);
            }
            player.peel();
        }
        noMishap();
        Wood wood = line.lathe().wood();
        assertEquals(2, wood.coreCount());
        assertEquals(wood.chucked(), wood.veneer() + wood.torn() + wood.chipped() + wood.cores(), 1e-9);
    }

    @Test
    void rollsPitchAndRollRotationFollowTheKnife() {
        player.charge();
        player.take();
        player.press(false, 50, AxisName.ROUND_UP_GATE);
        player.move(160, AxisName.KNIFE_CARRIAGE);
        player.move(165, AxisName.TOP_ROLL);
        player.run(4);
        player.track(AxisName.TOP_ROLL, 2, 0);
        player.track(AxisName.PITCH_ANGLE, 0.5, 0);
        player.track(AxisName.ROLL_ROTATION, 0, 2);
        player.track(AxisName.KNIFE_CARRIAGE, 0, 3);
        player.until("the knife at 130", () -> player.position(AxisName.KNIFE_CARRIAGE) <= 130);
        double knife = player.position(AxisName.KNIFE_CARRIAGE);
        double turns = player.position(AxisName.SPINDLE_ROTATION);
        assertEquals(knife + 2, player.position(AxisName.TOP_ROLL), 0.06);
        assertEquals(-1 + 0.02 * knife + 0.5, player.position(AxisName.PITCH_ANGLE), 0.01);
        assertEquals(2 * Math.PI * line.lathe().held().surface() * 4 / (Math.PI * 120) * 1.02,
                player.get("roll rotation.ActualSpeed"), 0.2);
        player.ticks(500);
        assertEquals(3 * (player.position(AxisName.SPINDLE_ROTATION) - turns),
                knife - player.position(AxisName.KNIFE_CARRIAGE), 1e-6, "one thickness per revolution");
        noMishap();
    }

    @Test
    void whatGoesWrongIsTold() {
        player.charge();
        player.press(false, 60, AxisName.TRANSFER_CLAMP_LEFT);
        assertEquals(List.of("the clamps let block 1 fall"), line.mishaps());
        player.move(900, AxisName.TRANSFER_ARM);
        player.press(false, 60, AxisName.TRANSFER_CLAMP_RIGHT);
        player.charge();
        player.take();
        player.move(120, AxisName.KNIFE_CARRIAGE);
        assertEquals("the knife ran into block 2, which stood still", line.mishaps().get(1));
        assertEquals(AxisError.KNIFE_HIT.ordinal(), player.get("knife carriage.Error"));
        player.press(false, 60, AxisName.SPINDLE_LEFT);
        assertEquals(1, line.lathe().wood().unpeeledCount());
    }

    @Test
    void spindlesThatHoldTooLooselySlip() {
        player.charge();
        player.take();
        player.press(true, 5, AxisName.SPINDLE_LEFT, AxisName.SPINDLE_RIGHT);
        player.press(false, 50, AxisName.ROUND_UP_GATE);
        player.move(160, AxisName.KNIFE_CARRIAGE);
        player.run(4);
        player.track(AxisName.KNIFE_CARRIAGE, 0, 3);
        player.until("a mishap", () -> !line.mishaps().isEmpty());
        assertTrue(line.mishaps().get(0).startsWith("spin-out: "), line.mishaps().toString());
        assertEquals(AxisError.SPIN_OUT.ordinal(), player.get("spindle rotation.Error"));
    }

    @Test
    void twoRunsAreTheSameBitForBit() {
        LinePlayer other = new LinePlayer(new Peeler());
        for (LinePlayer one : List.of(player, other)) {
            one.charge();
            one.take();
            one.run(3);
            one.ticks(777);
        }
        for (int i = 0; i < line.outputs().size(); i++) {
            assertEquals(line.output(i), other.line().output(i), line.outputs().get(i));
        }
    }
}
