package tickbus.cell;

import java.time.LocalDateTime;
import java.util.function.Supplier;
import java.util.function.UnaryOperator;
import tickbus.identification.IdentificationHead;
import tickbus.identification.PalletRecord;

/**
 * The head of a station, as its net uses it. The net begins to read or to write, and waits in a place until the answer is
 * there. The net retries after a failure, and counts the retry by {@link #again}, which throws after too many.
 */
final class StationHead {
    /** The most attempts at one read or write. */
    static final int ATTEMPTS = 5;

    /** The wait for a carrier that is not seen yet: the sensor of its pallet is on another line, which can be faster. */
    private static final long ARRIVAL_NANOS = 100_000_000;

    /** The line to the reader is down after this time without an answer. The reader's own time-out is much shorter. */
    static final long PATIENCE_NANOS = 10_000_000_000L;

    private enum State { IDLE, WANTED, ASKED, DONE, FAILED }

    private final String name;
    private final IdentificationHead head;
    private final Supplier<LocalDateTime> clock;
    private State state = State.IDLE;
    private boolean writing;
    /** True if the current command reads, perhaps to write after that. */
    private boolean reading;
    private UnaryOperator<PalletRecord> toWrite;
    /** True if a record has been read since the program began. */
    private boolean known;
    private PalletRecord record = PalletRecord.BLANK;
    private RuntimeException trouble;
    private long now;
    private long since;
    private int failures;
    private int allFailures;

    /**
     * A head.
     *
     * @param name of the station, for messages
     * @param head null for a net that is analysed, and does not run
     * @param clock gives the time for records
     */
    StationHead(String name, IdentificationHead head, Supplier<LocalDateTime> clock) {
        this.name = name;
        this.head = head;
        this.clock = clock;
    }

    /** Begins to read the record of the pallet. */
    void read() {
        writing = false;
        reading = true;
        begin();
    }

    /** Begins to write a record, with the current time. */
    void write(PalletRecord wanted) {
        writing = true;
        reading = false;
        toWrite = record -> wanted;
        begin();
    }

    /** Begins to write a changed record, with the current time; reads it first if it has not been read since the start. */
    void change(UnaryOperator<PalletRecord> to) {
        writing = true;
        reading = !known;
        toWrite = to;
        begin();
    }

    private void begin() {
        state = State.WANTED;
        since = now;
    }

    /** Forgets the answer, when the net leaves the place in which it waited. */
    void rest() {
        state = State.IDLE;
    }

    /** True if the read or write is done; {@link #record} then has the data read. */
    boolean isDone() {
        complain();
        return state == State.DONE;
    }

    /** True if the read or write has failed. */
    boolean hasFailed() {
        complain();
        return state == State.FAILED;
    }

    private void complain() {
        if (trouble != null) {
            throw trouble;
        }
    }

    /** The record read last. */
    PalletRecord record() {
        return record;
    }

    /** How often a read or write failed. */
    int failures() {
        return allFailures;
    }

    /**
     * Counts a retry. Writing twice does no harm: the net holds the pallet at its stop.
     *
     * @throws IllegalStateException after too many attempts
     */
    void again() {
        failures++;
        allFailures++;
        if (failures == ATTEMPTS) {
            throw new IllegalStateException(name + " has not " + (writing ? "written" : "read") + " its carrier in " + ATTEMPTS
                + " attempts; " + cause());
        }
    }

    private String cause() {
        return switch (head.status()) {
            case IdentificationHead.NO_CARRIER -> "the reader says that there is none (status 03): see whether the "
                + "pallet stands at its stop, and has its carrier";
            case IdentificationHead.NO_ANSWER -> "the reader did not answer (FF): see whether it is on, and its cable";
            default -> String.format("the reader's status is %02X, see docs/identification.md", head.status());
        };
    }

    /** Before the exchange of the line: begins what the net has requested. */
    void ask(long nanos) {
        now = nanos;
        if (state == State.WANTED && head.isDone() && (head.isPresent() || nanos - since >= ARRIVAL_NANOS)) {
            state = State.ASKED;
            if (reading) {
                head.readPallet();
            } else {
                head.writePallet(toWrite.apply(record).at(clock.get()));
            }
        }
    }

    /** After the exchange: takes the answer. */
    void take() {
        if (state == State.ASKED && head.isDone()) {
            int status = head.status();
            state = status == IdentificationHead.DONE || status == IdentificationHead.BATTERY_LOW ? State.DONE : State.FAILED;
            if (state == State.DONE) {
                failures = 0;
                takeRecord();
                if (reading && writing) {
                    reading = false;
                    begin();
                }
            }
        } else if ((state == State.ASKED || state == State.WANTED) && now - since >= PATIENCE_NANOS) {
            trouble = new IllegalStateException(name + " has had no answer for " + PATIENCE_NANOS / 1_000_000_000
                + " s, and the line to the reader is down; see whether the reader is on, and its cable");
        }
    }

    private void takeRecord() {
        if (reading) {
            try {
                record = head.pallet();
                known = true;
            } catch (IllegalArgumentException e) {
                trouble = new IllegalStateException(name + ": " + e.getMessage(), e);
            }
        }
    }
}
