package tickbus.demo.cell;

import java.util.EnumSet;
import java.util.Set;

/** A cylinder in the making. */
public final class Workpiece {
    private final int number;
    private final Colour colour;
    private final Set<Part> parts = EnumSet.of(Part.SLEEVE, Part.PIECE);

    Workpiece(int number, Colour colour) {
        this.number = number;
        this.colour = colour;
    }

    /** Its number, from 1. */
    public int number() {
        return number;
    }

    /** What its sleeve is made of. */
    public Colour colour() {
        return colour;
    }

    /** Whether it has this part. */
    public boolean has(Part part) {
        return parts.contains(part);
    }

    /** Whether it has all but perhaps the cap. */
    public boolean isComplete() {
        return has(Part.PISTON) && has(Part.SPRING) && has(Part.HEAD);
    }

    void add(Part part) {
        parts.add(part);
    }
}
