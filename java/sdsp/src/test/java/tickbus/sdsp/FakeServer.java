package tickbus.sdsp;

import java.io.DataInputStream;
import java.io.IOException;
import java.net.InetAddress;
import java.net.InetSocketAddress;
import java.net.ServerSocket;
import java.net.Socket;
import java.net.SocketAddress;
import java.nio.ByteBuffer;
import java.nio.ByteOrder;
import java.util.concurrent.CompletableFuture;

/** The other end of a client; a test's script handles one connection. */
final class FakeServer implements AutoCloseable {
    /** Handles the connection. */
    interface Script {
        void play(FakeServer server) throws Exception;
    }

    private final ServerSocket listener = new ServerSocket(0, 1, InetAddress.getLoopbackAddress());
    private final CompletableFuture<Void> played = new CompletableFuture<>();
    private Socket socket;
    private DataInputStream in;

    FakeServer(Script script) throws IOException {
        Thread thread = new Thread(() -> {
            try (Socket accepted = listener.accept()) {
                socket = accepted;
                socket.setTcpNoDelay(true);
                in = new DataInputStream(socket.getInputStream());
                script.play(this);
                played.complete(null);
            } catch (Throwable e) {
                played.completeExceptionally(e);
            }
        });
        thread.setDaemon(true);
        thread.start();
    }

    SocketAddress address() {
        return new InetSocketAddress(listener.getInetAddress(), listener.getLocalPort());
    }

    /** A buffer in the order of the wire. */
    static ByteBuffer buffer(int size) {
        return ByteBuffer.allocate(size).order(ByteOrder.LITTLE_ENDIAN);
    }

    /** Waits for a frame, without its length. */
    ByteBuffer receive() throws IOException {
        return ByteBuffer.wrap(receiveRaw(Integer.reverseBytes(in.readInt()))).order(ByteOrder.LITTLE_ENDIAN);
    }

    /** Waits for this many bytes. */
    byte[] receiveRaw(int count) throws IOException {
        byte[] bytes = new byte[count];
        in.readFully(bytes);
        return bytes;
    }

    /** Sends raw bytes. */
    void sendRaw(byte... bytes) throws IOException {
        socket.getOutputStream().write(bytes);
    }

    /** Sends a frame with this content. */
    void send(int kind, ByteBuffer content) throws IOException {
        content.flip();
        ByteBuffer frame = buffer(5 + content.remaining());
        frame.putInt(1 + content.remaining()).put((byte) kind).put(content);
        sendRaw(frame.array());
    }

    /** Starts the run of a client that reads this many LREALs, and takes its initial values. */
    ByteBuffer start(int reads) throws IOException {
        sendStart(reads);
        return receive();
    }

    void sendStart(int reads) throws IOException {
        ByteBuffer content = buffer(8 + reads).putLong(1_000_000);
        for (int at = 0; at < reads; at++) {
            content.put((byte) 15);
        }
        send(0x81, content);
    }

    void step(long sequence, long nanos, long... reads) throws IOException {
        ByteBuffer content = buffer(16 + 8 * reads.length).putLong(sequence).putLong(nanos);
        for (long slot : reads) {
            content.putLong(slot);
        }
        send(0x82, content);
    }

    void finish(long steps, long nanos, long hash) throws IOException {
        send(0x83, buffer(24).putLong(steps).putLong(nanos).putLong(hash));
    }

    /** Waits until the script is done, and throws its failure. */
    @Override
    public void close() throws IOException {
        try {
            played.join();
        } finally {
            listener.close();
        }
    }
}
