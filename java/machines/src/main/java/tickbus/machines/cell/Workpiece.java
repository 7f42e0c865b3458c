package tickbus.machines.cell;

import java.util.EnumSet;
import java.util.Set;

/** A cylinder in production. */
public final class Workpiece {
    private final int number;
    private final Colour colour;
    private final Set<Part> parts = EnumSet.of(Part.SLEEVE, Part.PIECE);

    private final long begunNanos;
    private long deliveredNanos;

    Workpiece(int number, Colour colour, long nanos) {
        begunNanos = nanos;
        this.number = number;
        this.colour = colour;
    }

    /** The piece's number, from 1. */
    public int number() {
        return number;
    }

    /** The material of the piece's sleeve. */
    public Colour colour() {
        return colour;
    }

    /** When its sleeve came out of the magazine, in nanoseconds of the cell's time. */
    public long begunNanos() {
        return begunNanos;
    }

    /** When it came out of the cell; 0 before that. */
    public long deliveredNanos() {
        return deliveredNanos;
    }

    void deliver(long nanos) {
        deliveredNanos = nanos;
    }

    /** True if the piece has this part. */
    public boolean has(Part part) {
        return parts.contains(part);
    }

    /** True if the piece has all parts, not counting the cap. */
    public boolean isComplete() {
        return has(Part.PISTON) && has(Part.SPRING) && has(Part.HEAD);
    }

    void add(Part part) {
        parts.add(part);
    }
}
