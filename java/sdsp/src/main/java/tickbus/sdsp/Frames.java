package tickbus.sdsp;

import java.io.Closeable;
import java.io.EOFException;
import java.io.IOException;
import java.net.SocketAddress;
import java.net.SocketOption;
import java.net.StandardSocketOptions;
import java.net.UnixDomainSocketAddress;
import java.net.UnknownHostException;
import java.nio.ByteBuffer;
import java.nio.ByteOrder;
import java.nio.channels.SocketChannel;
import java.nio.channels.UnresolvedAddressException;
import java.nio.charset.StandardCharsets;
import jdk.net.ExtendedSocketOptions;

/** Frames over a blocking socket. Interrupting a thread that waits for a frame closes the socket. */
final class Frames implements Closeable {
    /** The longest frame, without the four bytes of its length. */
    private static final int LONGEST = 1 << 20;
    private static final int HEADER = 4;

    private final SocketChannel channel;
    private ByteBuffer in = buffer(8192).limit(0);
    private ByteBuffer out = buffer(8192);
    /** The end of the last received frame in the buffer. */
    private int end;

    Frames(SocketAddress address) throws IOException {
        try {
            channel = SocketChannel.open(address);
        } catch (UnresolvedAddressException e) {
            throw new UnknownHostException("unknown host");
        }
        try {
            // A Unix socket has no cable, and sends at once.
            if (!(address instanceof UnixDomainSocketAddress)) {
                channel.setOption(StandardSocketOptions.TCP_NODELAY, true);
                channel.setOption(StandardSocketOptions.SO_KEEPALIVE, true);
                // A server whose cable is pulled is detected after some 40 seconds, not after the system's two hours.
                keepAlive(ExtendedSocketOptions.TCP_KEEPIDLE, 10);
                keepAlive(ExtendedSocketOptions.TCP_KEEPINTERVAL, 10);
                keepAlive(ExtendedSocketOptions.TCP_KEEPCOUNT, 3);
            }
        } catch (IOException e) {
            channel.close();
            throw e;
        }
    }

    private void keepAlive(SocketOption<Integer> option, int value) throws IOException {
        if (channel.supportedOptions().contains(option)) {
            channel.setOption(option, value);
        }
    }

    private static ByteBuffer buffer(int size) {
        // Outside of the heap, where the system reads and writes without a copy.
        return ByteBuffer.allocateDirect(size).order(ByteOrder.LITTLE_ENDIAN);
    }

    /** Begins a frame of this length, which includes its kind; the caller puts the content into the buffer. */
    ByteBuffer begin(int length, byte kind) {
        if (length > LONGEST) {
            throw new IllegalArgumentException("a message of " + length + " bytes is too long, the most is " + LONGEST
                + "; shorten the names of the variables, or make several clients of it");
        }
        if (out.capacity() < HEADER + length) {
            out = buffer(HEADER + length);
        }
        return out.clear().putInt(length).put(kind);
    }

    /** Sends the frame that {@link #begin} began. */
    void send() throws IOException {
        out.flip();
        while (out.hasRemaining()) {
            channel.write(out);
        }
    }

    /** Waits for a frame; it is in the buffer up to {@link #left}, without its length. */
    ByteBuffer receive() throws IOException {
        await(HEADER);
        int length = in.getInt();
        if (length < 1 || length > LONGEST) {
            throw new Violation("sent a frame of " + Integer.toUnsignedString(length) + " bytes, expected 1 to " + LONGEST);
        }
        await(length);
        end = in.position() + length;
        return in;
    }

    /** The number of bytes left in the frame. */
    int left() {
        return end - in.position();
    }

    private void await(int count) throws IOException {
        while (in.remaining() < count) {
            in.compact();
            if (in.capacity() < count) {
                in = buffer(HEADER + count).put(in.flip());
            }
            int read = channel.read(in);
            in.flip();
            if (read < 0) {
                throw new EOFException("it closed the connection");
            }
        }
    }

    /** Checks that this many bytes of the frame are left. */
    void expect(int count) throws Violation {
        if (left() < count) {
            throw new Violation("sent a message that is too short");
        }
    }

    /** Reads a text of this many bytes. */
    String text(int bytes) throws Violation {
        expect(bytes);
        byte[] text = new byte[bytes];
        in.get(text);
        return new String(text, StandardCharsets.UTF_8);
    }

    @Override
    public void close() throws IOException {
        channel.close();
    }

    /** A protocol violation by the server, as the continuation of "it …". */
    static final class Violation extends IOException {
        private static final long serialVersionUID = 1L;

        Violation(String what) {
            super(what);
        }
    }
}
