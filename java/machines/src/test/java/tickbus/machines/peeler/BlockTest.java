package tickbus.machines.peeler;

import static org.junit.jupiter.api.Assertions.assertEquals;
import static org.junit.jupiter.api.Assertions.assertFalse;
import static org.junit.jupiter.api.Assertions.assertTrue;

import org.junit.jupiter.api.Test;

/** Shapes of blocks. */
class BlockTest {
    private static Block of(Profile profile) {
        return new Block(1, "test", profile, profile);
    }

    @Test
    void areasAreThoseOfGeometry() {
        assertEquals(Math.PI * 140 * 140, Profile.circle(140).area(), 1e-6);
        assertEquals(Math.PI * 150 * 130, Profile.ellipse(150, 130).area(), 1e-3);
        double bump = Profile.circle(100).bump(90, 10, 5).area() - Profile.circle(100).area();
        // A low bump of the form h exp(-(x/w)²) has the area h w √π along its arc.
        assertEquals(5 * Math.toRadians(10) * 100 * Math.sqrt(Math.PI), bump, bump * 0.03);
        assertEquals(Math.PI * 150 * 130 * Block.LENGTH, of(Profile.ellipse(150, 130)).volume(9), 1);
    }

    @Test
    void aBlockInAVTouchesItWhereItsReachSaysSo() {
        Block round = of(Profile.circle(140));
        assertEquals(140 * Math.sqrt(2), round.lyingHeight(true), 0.01);
        assertEquals(0, round.lyingAside(true), 1e-9);
        assertEquals(140 * (1 + Math.sqrt(2)), round.lyingTop(true), 0.01);
        Block oval = of(Profile.ellipse(150, 130));
        assertEquals(Math.sqrt(150 * 150 + 130 * 130), oval.lyingHeight(true), 0.01);
        assertEquals(oval.lyingHeight(true) + 130, oval.lyingTop(true), 0.01);
        Block bumpy = of(Profile.circle(140).bump(-45, 10, 6));
        assertTrue(bumpy.lyingAside(true) < -4, "a bump on the right pushes it to the left");
    }

    @Test
    void aroundAnotherAxisItIsTheSameWood() {
        Profile profile = Profile.ellipse(147, 136).bump(200, 12, 4);
        Profile moved = profile.around(6, -9);
        assertEquals(profile.area(), moved.area(), profile.area() * 1e-4);
        assertEquals(141, Profile.ellipse(147, 136).around(6, 0).radius(0), 1e-6);
        assertEquals(153, Profile.ellipse(147, 136).around(6, 0).radius(Profile.SECTORS / 2), 1e-6);
        Profile back = moved.around(-6, 9);
        for (int i = 0; i < Profile.SECTORS; i++) {
            assertEquals(profile.radius(i), back.radius(i), 0.02);
        }
    }

    @Test
    void aTipMeetsWoodOnlyWhereThereIsSome() {
        Block block = of(Profile.circle(140));
        assertTrue(block.isHitAt(true, 0, 0));
        assertTrue(block.isHitAt(true, 40, 40));
        assertFalse(block.isHitAt(true, 140, 0));
        assertFalse(block.isHitAt(false, 0, -200));
    }

    @Test
    void holdersAddUp() {
        Block block = of(Profile.circle(140));
        block.holdAt(true, 3, 4);
        assertEquals(5, block.eccentricity(true), 1e-12);
        block.shift(true, -3, 0);
        assertEquals(4, block.eccentricity(true), 1e-12);
        assertEquals(0, block.eccentricity(false));
    }
}
