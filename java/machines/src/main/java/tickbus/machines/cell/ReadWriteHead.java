package tickbus.machines.cell;

import java.util.Optional;

/**
 * A read/write head for code carriers: lends the carrier in front of it to the reader, and takes over the data that the
 * reader reports for it.
 *
 * <p>The reader has a carrier from when it reports it until it reports none; data written in between belong to that carrier,
 * even if its pallet has left meanwhile. The next carrier is shown only then.
 */
public final class ReadWriteHead {
    private CodeCarrier inFront;
    private CodeCarrier lent;
    /** Set by the reader: it has a carrier, and these are its data. */
    boolean taken;
    final long[] holds = new long[CodeCarrier.WORDS];

    ReadWriteHead() {
    }

    /** The carrier in front of the head; empty without one. */
    public Optional<CodeCarrier> carrier() {
        return Optional.ofNullable(inFront);
    }

    void step(CodeCarrier now) {
        inFront = now;
        if (lent != null && taken) {
            for (int i = 0; i < holds.length; i++) {
                lent.word(i, holds[i]);
            }
        }
        if (!taken) {
            lent = now;
        }
    }

    /** True if a carrier is there for the reader. */
    boolean showsCarrier() {
        return lent != null && lent == inFront;
    }

    /** Four octets of the carrier in front, the first one in the highest byte; 0 without a carrier. */
    long brings(int word) {
        return lent == null ? 0 : lent.word(word);
    }
}
