package tickbus.demo.cell;

import java.util.Optional;

/**
 * A read/write head for code carriers, with its reader's process data: the record of the carrier in front of it, and a
 * command that writes another one.
 */
public final class ReadWriteHead {
    private static final long WRITING_NANOS = 40_000_000;

    private CodeCarrier carrier;
    private long writingNanos;
    private long clockNanos;
    private boolean done;
    boolean write;
    int newKind;
    int newContents;

    ReadWriteHead() {
    }

    /** The carrier in front of it; empty if there is none. */
    public Optional<CodeCarrier> carrier() {
        return Optional.ofNullable(carrier);
    }

    void step(CodeCarrier inFront, long nanos) {
        clockNanos += nanos;
        carrier = inFront;
        writingNanos = write && inFront != null ? writingNanos + nanos : 0;
        if (!write) {
            done = false;
        } else if (!done && writingNanos >= WRITING_NANOS) {
            carrier.write(0, new PalletRecord(clockNanos / 1_000_000_000, newKind, newContents).toBytes());
            done = true;
        }
    }

    boolean seesCarrier() {
        return carrier != null;
    }

    /** The command is executed; until it is taken away. */
    boolean isDone() {
        return done;
    }

    /** The code of the kind; 0 without a carrier. */
    int kind() {
        return carrier == null ? 0 : carrier.at(PalletRecord.KIND);
    }

    /** The bits of the parts; 0 without a carrier. */
    int contents() {
        int contents = 0;
        for (int i = 0; carrier != null && i < PalletRecord.BYTES - PalletRecord.KIND - 1; i++) {
            contents |= carrier.at(PalletRecord.KIND + 1 + i) << i;
        }
        return contents;
    }
}
