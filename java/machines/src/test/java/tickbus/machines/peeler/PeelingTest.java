package tickbus.machines.peeler;

import static org.junit.jupiter.api.Assertions.assertEquals;
import static org.junit.jupiter.api.Assertions.assertFalse;
import static org.junit.jupiter.api.Assertions.assertTrue;

import org.junit.jupiter.api.Test;
import org.junit.jupiter.params.ParameterizedTest;
import org.junit.jupiter.params.provider.CsvSource;

/** The wood that the knife cuts off a block; none may be lost. */
class PeelingTest {
    private static final double MM3 = 1e9;

    private final Wood wood = new Wood();

    /** Peels to a final radius, a number of revolutions per step. */
    private Peeling peel(Block block, double from, double to, double thickness, double step, boolean belt) {
        Peeling peeling = new Peeling(block, wood);
        on(peeling, from, to, thickness, step, belt);
        return peeling;
    }

    private static void on(Peeling peeling, double from, double to, double thickness, double step, boolean belt) {
        double knife = from;
        while (knife > to) {
            double next = Math.max(to, knife - thickness * step);
            peeling.turn((knife - next) / thickness, knife, next, thickness, belt);
            knife = next;
        }
    }

    private static Block round(double radius) {
        return new Block(1, "round", Profile.circle(radius), Profile.circle(radius));
    }

    private static Block crooked() {
        Profile section = Profile.ellipse(147, 136).bump(200, 12, 4);
        Block block = new Block(2, "crooked", section, section.scale(0.98));
        block.holdAt(true, 3, -4);
        block.holdAt(false, -2, 5);
        return block;
    }

    @ParameterizedTest
    @CsvSource({"1.5, 0.01", "1.5, 0.0123", "3, 0.004", "0.6, 0.037"})
    void aCylinderGivesARibbonOfItsThicknessAndLength(double thickness, double step) {
        Peeling peeling = peel(round(140), 140, 40, thickness, step, true);
        double whole = Math.PI * (140 * 140 - 40 * 40) / thickness / 1000;
        // The first turn is not full, because the spiral begins in it.
        double first = 2 * Math.PI * 140 / 1000;
        assertEquals(whole - first, wood.ribbon(), first + 0.01);
        assertEquals(thickness, wood.veneer() / (wood.ribbon() * Block.LENGTH / 1000) * 1000, thickness * 0.002);
        assertEquals(Math.PI * 140 * 140 * Block.LENGTH / MM3, wood.chucked(), 1e-9);
        assertEquals(wood.chucked(), wood.veneer() + wood.torn() + peeling.volume() / MM3, 1e-9);
        assertEquals(0, wood.chipped());
        assertTrue(peeling.round());
    }

    @Test
    void aBlockThatIsNotRoundGivesTornPiecesUntilItIs() {
        Block block = crooked();
        Peeling peeling = new Peeling(block, wood);
        on(peeling, 160, 136, 3, 0.008, true);
        assertFalse(peeling.round());
        assertEquals(0, wood.ribbon(), "no ribbon before the knife is in the wood all around");
        double torn = wood.torn();
        assertTrue(torn > 0);
        on(peeling, 136, 118, 3, 0.008, true);
        assertTrue(peeling.round());
        assertTrue(wood.ribbon() > 0);
        double tornInAll = wood.torn();
        on(peeling, 118, 40, 1.5, 0.008, true);
        assertEquals(tornInAll, wood.torn(), "once round it stays so");
        assertEquals(wood.chucked(), wood.veneer() + wood.torn() + peeling.volume() / MM3, 1e-9);
        assertEquals(block.volume(Peeling.SLICES) / MM3, wood.chucked(), 1e-5);
    }

    @Test
    void theChipperTakesWhatTheGateSendsIt() {
        Peeling peeling = new Peeling(crooked(), wood);
        on(peeling, 160, 125, 3, 0.008, false);
        assertEquals(0, wood.veneer() + wood.torn());
        double chipped = wood.chipped();
        on(peeling, 125, 40, 1.5, 0.008, true);
        assertEquals(chipped, wood.chipped());
        assertEquals(wood.chucked(), wood.veneer() + wood.torn() + wood.chipped() + peeling.volume() / MM3, 1e-9);
        assertEquals(Math.PI * 41 * 41 * Block.LENGTH / MM3, peeling.volume() / MM3, Math.PI * 3 * 41 * Block.LENGTH / MM3);
        assertTrue(peeling.reach() <= 41.5, "it reaches to " + peeling.reach());
    }

    /** A knot that protrudes makes a hole in the ribbon, and so does a dent deeper than the last cut. */
    @Test
    void aDentEndsTheRibbon() {
        Profile dented = Profile.circle(140).bump(90, 5, -12);
        Peeling peeling = peel(new Block(3, "dented", dented, dented), 140, 131, 1.5, 0.01, true);
        assertFalse(peeling.round());
        on(peeling, 131, 120, 1.5, 0.01, true);
        assertTrue(peeling.round());
    }

    @Test
    void turnedTheOtherWayNothingIsCut() {
        Peeling peeling = new Peeling(round(140), wood);
        double before = peeling.volume();
        peeling.turn(-2, 130, 130, 1.5, true);
        assertEquals(before, peeling.volume());
    }

    @Test
    void howOftenItLooksMakesNoDifference() {
        Peeling fine = peel(crooked(), 160, 40, 1.5, 0.002, true);
        double ribbon = wood.ribbon();
        double volume = fine.volume();
        Peeling coarse = peel(crooked(), 160, 40, 1.5, 0.08, true);
        assertEquals(volume, coarse.volume(), volume * 1e-6);
        assertEquals(ribbon, wood.ribbon() - ribbon, ribbon * 1e-6);
    }
}
