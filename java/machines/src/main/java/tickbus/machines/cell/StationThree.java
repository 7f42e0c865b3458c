package tickbus.machines.cell;

/** Station 3: presses piston and spring, then the head, into the sleeve on the pallet at stop 3. */
final class StationThree {
    private final Counters counters;
    final Feeder parts = new Feeder();
    final Feeder heads = new Feeder();
    final PneumaticCylinder press = new PneumaticCylinder(100_000_000);
    final ReadWriteHead head = new ReadWriteHead();
    private boolean partsReady;
    private boolean headReady;
    /** The gauge beside the press sees a piston, or the head above it, in the piece at the stop. */
    boolean piston;
    boolean closed;
    boolean pressValve;

    StationThree(Counters counters) {
        this.counters = counters;
    }

    void step(Pallet pallet, long nanos) {
        boolean below = partsReady || headReady;
        boolean partsCome = parts.step(nanos);
        boolean headComes = heads.step(nanos);
        if (below && (partsCome || headComes)) {
            counters.wasted++;
        }
        partsReady |= partsCome;
        headReady |= headComes;
        boolean wasDown = press.isForward();
        press.step(pressValve, nanos);
        if (press.isForward() && !wasDown && (partsReady || headReady)) {
            if (pallet == null || pallet.piece == null || pallet.piece.has(partsReady ? Part.PISTON : Part.HEAD)) {
                counters.wasted++;
            } else if (partsReady) {
                pallet.piece.add(Part.PISTON);
                pallet.piece.add(Part.SPRING);
            } else {
                pallet.piece.add(Part.HEAD);
            }
            partsReady = false;
            headReady = false;
        }
        piston = pallet != null && pallet.piece != null && pallet.piece.has(Part.PISTON);
        closed = pallet != null && pallet.piece != null && pallet.piece.has(Part.HEAD);
        head.step(pallet == null ? null : pallet.carrier());
    }
}
