package tickbus.machines.peeler;

/** Blocks from the cross-cut saw: four shapes in rotation. */
final class BlockSupply {
    private int made;
    private final int most;

    /** A supply of at most this many blocks. */
    BlockSupply(int most) {
        this.most = most;
    }

    boolean hasNext() {
        return made < most;
    }

    Block next() {
        made++;
        return switch (made % 4) {
            case 1 -> new Block(made, "cylinder", Profile.circle(140), Profile.circle(140));
            case 2 -> oval(made);
            case 3 -> dented(made);
            default -> new Block(made, "cone", Profile.circle(134), Profile.circle(142));
        };
    }

    private static Block oval(int number) {
        Profile section = Profile.ellipse(147, 136).bump(200, 12, 4);
        return new Block(number, "oval with a bump, thinner at its right end", section, section.scale(0.98));
    }

    private static Block dented(int number) {
        Profile section = Profile.ellipse(140, 144).bump(20, 15, -6);
        return new Block(number, "oval with a dent and a knot", section, section.bump(290, 8, 5));
    }
}
