package tickbus.sdsp;

import java.io.IOException;
import java.net.SocketAddress;
import java.nio.ByteBuffer;
import java.nio.channels.ClosedByInterruptException;
import java.nio.charset.StandardCharsets;
import java.util.Arrays;
import tickbus.sdsp.EndedException.Cause;

/** Lets a {@link Participant} take part in a run over TCP or a Unix socket. */
public final class Client {
    private static final byte[] MAGIC = {'S', 'D', 'S', 'P'};
    private static final short VERSION = 4;

    private static final byte JOIN = 0x01;
    private static final byte DONE = 0x02;
    private static final byte GIVE_UP = 0x03;
    private static final byte DONE_UNTIL = 0x04;
    private static final byte AT = 0x05;
    private static final byte SAVED = 0x08;
    private static final byte START = (byte) 0x81;
    private static final byte STEP = (byte) 0x82;
    private static final byte FINISHED = (byte) 0x83;
    private static final byte ENDED = (byte) 0x84;
    private static final byte WAITING = (byte) 0x85;
    private static final byte MEET = (byte) 0x86;
    private static final byte SAVE = (byte) 0x89;
    private static final byte RESTORE = (byte) 0x8A;

    private static final int LONGEST_NAME = 255;
    private static final int LONGEST_REASON = 4096;
    private static final int LONGEST_STATE = 500_000;
    private static final Cause[] CAUSES = Cause.values();

    private final Frames frames;
    private final Participant participant;
    private final long[] reads;
    private final long[] writes;
    /** The last step that ran; 0 is the initial write, and -1 before that. */
    private long ran = -1;
    /** The virtual time of one step of the server, in nanoseconds. */
    private long serverStep;
    /** Why the participant cannot continue. */
    private Throwable failure;

    private Client(Frames frames, Participant participant, Declaration declaration) {
        this.frames = frames;
        this.participant = participant;
        reads = new long[declaration.reads().size()];
        writes = new long[declaration.writes().size()];
    }

    /**
     * Takes part in the run of the server at an address, until its end. Blocks the thread; interrupting the thread leaves
     * the run.
     *
     * @param address the server's address: an {@link java.net.InetSocketAddress}, or a
     * {@link java.net.UnixDomainSocketAddress} with the path that the server prints behind {@code unix:}
     * @param participant runs in each step
     * @return how the run ended
     * @throws EndedException if no server answers, it refuses this client, or the run was broken off
     * @throws IllegalArgumentException if a name of the declaration is empty or longer than 255 bytes, or all names together
     * take more than a mebibyte
     */
    public static Outcome join(SocketAddress address, Participant participant) throws EndedException {
        Declaration declaration = participant.declare();
        int size = size(declaration);
        Client client = null;
        try (Frames frames = new Frames(address)) {
            client = new Client(frames, participant, declaration);
            client.join(declaration, size);
            return client.run();
        } catch (ClosedByInterruptException e) {
            throw ended(client, Cause.STOPPED, "this client was interrupted", e);
        } catch (Frames.Violation e) {
            throw ended(client, Cause.PROTOCOL, "the server violates the protocol: it " + e.getMessage(), e);
        } catch (IOException e) {
            throw ended(client, Cause.LOST, client == null
                ? "no server can be reached at " + address + " (" + e.getMessage() + "); start it first, or correct the address"
                : "the server was lost: " + e.getMessage(), e);
        }
    }

    private static EndedException ended(Client client, Cause cause, String reason, IOException e) {
        EndedException ended = new EndedException(cause, null, reason, client == null ? 0 : Math.max(client.ran - 1, 0));
        ended.initCause(e);
        return ended;
    }

    /** The size of a join message without its kind. */
    private static int size(Declaration declaration) {
        long size = MAGIC.length + Short.BYTES + Integer.BYTES + Long.BYTES + 2 * Short.BYTES + name(declaration.name()).length + 1;
        for (Variable variable : declaration.writes()) {
            size += 2 + name(variable.name()).length;
        }
        for (String read : declaration.reads()) {
            size += 1 + name(read).length;
        }
        return (int) size;
    }

    private static byte[] name(String name) {
        byte[] bytes = name.getBytes(StandardCharsets.UTF_8);
        if (bytes.length == 0 || bytes.length > LONGEST_NAME) {
            throw new IllegalArgumentException(
                "the name \"" + name + "\" has " + bytes.length + " bytes; a name has 1 to " + LONGEST_NAME);
        }
        return bytes;
    }

    private static void putName(ByteBuffer out, String name) {
        byte[] bytes = name(name);
        out.put((byte) bytes.length).put(bytes);
    }

    private void join(Declaration declaration, int size) throws IOException {
        ByteBuffer out = frames.begin(1 + size, JOIN);
        out.put(MAGIC).putShort(VERSION).putInt(declaration.multiple()).putLong(declaration.intervalNanos());
        putName(out, declaration.name());
        out.putShort((short) declaration.writes().size());
        for (Variable variable : declaration.writes()) {
            out.put(variable.type().code());
            putName(out, variable.name());
        }
        out.putShort((short) declaration.reads().size());
        for (String read : declaration.reads()) {
            putName(out, read);
        }
        frames.send();
    }

    private Outcome run() throws IOException, EndedException {
        try {
            while (true) {
                ByteBuffer in = frames.receive();
                byte kind = in.get();
                switch (kind) {
                    case START -> start(in);
                    case STEP -> step(in);
                    case FINISHED -> {
                        frames.expect(3 * Long.BYTES);
                        return new Outcome(in.getLong(), in.getLong(), in.getLong());
                    }
                    case MEET -> {
                        frames.expect(Long.BYTES);
                        // This client cannot exchange values with others: its address is empty.
                        frames.begin(1 + Long.BYTES, AT).putLong(in.getLong());
                        sendIfPossible();
                    }
                    case SAVE -> save(in);
                    case RESTORE -> restore(in);
                    case WAITING -> waiting(frames.text(frames.left()));
                    case ENDED -> throw ended(in);
                    default -> throw new Frames.Violation(String.format("sent a message of the unknown kind 0x%02X", kind));
                }
            }
        } catch (Frames.Violation e) {
            giveUp("the server violates the protocol: it " + e.getMessage());
            throw e;
        }
    }

    private void waiting(String forWhom) throws IOException {
        if (failure != null) {
            return;
        }
        try {
            participant.waiting(forWhom);
        } catch (Throwable e) {
            failed(e);
        }
    }

    private void start(ByteBuffer in) throws IOException {
        frames.expect(Long.BYTES);
        serverStep = in.getLong();
        if (ran >= 0) {
            throw new Frames.Violation("started twice");
        }
        if (serverStep <= 0) {
            throw new Frames.Violation("starts a run with steps of " + serverStep + " ns");
        }
        // The types of the variables that the participant reads, which it knows.
        expectValues(frames.left());
        in.position(in.position() + frames.left());
        try {
            participant.initial(writes);
        } catch (Throwable e) {
            failed(e);
            return;
        }
        done(0);
    }

    private void step(ByteBuffer in) throws IOException {
        frames.expect(2 * Long.BYTES);
        long sequence = in.getLong();
        long nanos = in.getLong();
        if (ran < 0 || sequence <= ran || failure != null) {
            throw new Frames.Violation("asked for step " + sequence + " out of order");
        }
        expectValues(frames.left() / Long.BYTES);
        for (int at = 0; at < reads.length; at++) {
            reads[at] = in.getLong();
        }
        if (frames.left() > 0) {
            throw new Frames.Violation("sent a message that ends within a value");
        }
        try {
            participant.run(sequence, nanos, reads, writes);
        } catch (Throwable e) {
            failed(e);
            return;
        }
        done(sequence);
    }

    private void save(ByteBuffer in) throws IOException {
        frames.expect(Long.BYTES);
        long sequence = in.getLong();
        byte[] state;
        boolean hasState = false;
        try {
            state = participant.save();
            hasState = state.length <= LONGEST_STATE;
            if (!hasState) {
                state = reason("its state has " + state.length + " bytes, " + LONGEST_STATE + " at most");
            }
        } catch (Exception e) {
            state = reason(text(e));
        } catch (Error e) {
            failed(e);
            return;
        }
        frames.begin(2 + Long.BYTES + state.length, SAVED).putLong(sequence).put((byte) (hasState ? 1 : 0)).put(state);
        sendIfPossible();
    }

    private void restore(ByteBuffer in) throws IOException {
        frames.expect(Long.BYTES + Short.BYTES);
        long sequence = in.getLong();
        int count = Short.toUnsignedInt(in.getShort());
        if (ran != 0 || count != writes.length) {
            throw new Frames.Violation("restores another state");
        }
        frames.expect(count * Long.BYTES);
        for (int at = 0; at < count; at++) {
            writes[at] = in.getLong();
        }
        byte[] state = new byte[frames.left()];
        in.get(state);
        try {
            participant.restore(state);
        } catch (Throwable e) {
            failed(e);
            return;
        }
        ran = sequence;
        ByteBuffer out = frames.begin(1 + Long.BYTES * (1 + count), DONE).putLong(sequence);
        for (long slot : writes) {
            out.putLong(slot);
        }
        sendIfPossible();
    }

    private static String text(Throwable e) {
        return e.getMessage() == null ? e.toString() : e.getMessage();
    }

    /** The participant cannot continue: everyone gets its reason. An error of the virtual machine is thrown to the caller. */
    private void failed(Throwable e) throws IOException {
        failure = e;
        // The server answers with the end.
        giveUp(text(e));
        if (e instanceof Error error) {
            throw error;
        }
    }

    private void expectValues(int count) throws Frames.Violation {
        if (count != reads.length) {
            throw new Frames.Violation("sent " + count + " values, expected " + reads.length);
        }
    }

    private void done(long sequence) throws IOException {
        long nanos;
        try {
            nanos = participant.nextUpdate();
        } catch (Throwable e) {
            failed(e);
            return;
        }
        ran = sequence;
        boolean asks = nanos != Participant.AS_DECLARED;
        ByteBuffer out = frames.begin(1 + Long.BYTES * ((asks ? 2 : 1) + writes.length), asks ? DONE_UNTIL : DONE);
        out.putLong(sequence);
        if (asks) {
            // The first step at or after this time; step 1 is at time 0.
            out.putLong(nanos <= 0 ? 1 : (nanos - 1) / serverStep + 2);
        }
        for (long slot : writes) {
            out.putLong(slot);
        }
        sendIfPossible();
    }

    /** If this fails, the server may have sent its reason before: the next receive returns it, or reports a lost connection. */
    private void sendIfPossible() throws IOException {
        try {
            frames.send();
        } catch (ClosedByInterruptException e) {
            throw e;
        } catch (IOException e) {
            // See above.
        }
    }

    private void giveUp(String reason) throws IOException {
        byte[] text = reason(reason);
        frames.begin(1 + text.length, GIVE_UP).put(text);
        sendIfPossible();
    }

    /** A reason as it is sent: a long one is cut. */
    private static byte[] reason(String reason) {
        byte[] text = reason.getBytes(StandardCharsets.UTF_8);
        int length = Math.min(text.length, LONGEST_REASON);
        while (length < text.length && (text[length] & 0xC0) == 0x80) {
            // Do not cut within a character.
            length--;
        }
        return Arrays.copyOf(text, length);
    }

    private EndedException ended(ByteBuffer in) throws Frames.Violation {
        frames.expect(1 + Long.BYTES + 1);
        int code = in.get();
        if (code < 1 || code > CAUSES.length) {
            throw new Frames.Violation("sent the unknown cause " + code);
        }
        long steps = in.getLong();
        String client = frames.text(Byte.toUnsignedInt(in.get()));
        String reason = frames.text(frames.left());
        EndedException ended = new EndedException(CAUSES[code - 1], client.isEmpty() ? null : client, reason, steps);
        if (failure != null) {
            ended.initCause(failure);
        }
        return ended;
    }
}
