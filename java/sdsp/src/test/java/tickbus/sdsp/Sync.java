package tickbus.sdsp;

import java.io.BufferedReader;
import java.io.File;
import java.io.IOException;
import java.net.InetSocketAddress;
import java.net.SocketAddress;
import java.net.UnixDomainSocketAddress;
import java.nio.file.Files;
import java.nio.file.Path;
import java.util.ArrayList;
import java.util.List;
import java.util.concurrent.CompletableFuture;
import java.util.concurrent.CompletionException;

/** {@code tickbus sync} on its own port. */
final class Sync implements AutoCloseable {
    private final Process process;
    private final BufferedReader out;
    private final SocketAddress address;

    /**
     * Starts the command in a folder, with the text of its file and further arguments; there it listens on port 20060, or at
     * a Unix socket.
     */
    Sync(Path folder, String run, String... arguments) throws IOException {
        Path file = Files.writeString(folder.resolve("run.toml"), run.replace(":20060", ":0"));
        String command = File.separatorChar == '\\' ? "tickbus.exe" : "tickbus";
        List<String> words = new ArrayList<>(List.of(
            Path.of(System.getProperty("tickbus.native.dir"), command).toString(), "sync", file.toString()));
        words.addAll(List.of(arguments));
        process = new ProcessBuilder(words).redirectError(ProcessBuilder.Redirect.INHERIT).start();
        out = process.inputReader();
        String line = await("sync: listening on ");
        int unix = line.indexOf("unix:");
        address = unix >= 0 ? UnixDomainSocketAddress.of(line.substring(unix + "unix:".length()))
            : new InetSocketAddress("127.0.0.1", Integer.parseInt(line.substring(line.lastIndexOf(':') + 1)));
    }

    /** The address on which it listens. */
    SocketAddress address() {
        return address;
    }

    /** The TCP port on which it listens. */
    int port() {
        return ((InetSocketAddress) address).getPort();
    }

    /** Waits for an output line with this beginning. */
    String await(String begin) throws IOException {
        StringBuilder all = new StringBuilder();
        for (String line = out.readLine(); line != null; line = out.readLine()) {
            if (line.startsWith(begin)) {
                return line;
            }
            all.append(line).append('\n');
        }
        throw new AssertionError("no line that begins with \"" + begin + "\" in:\n" + all);
    }

    /** Takes part in a separate thread. */
    CompletableFuture<Outcome> join(Participant participant) {
        return CompletableFuture.supplyAsync(() -> {
            try {
                return Client.join(address, participant);
            } catch (EndedException e) {
                throw new CompletionException(e);
            }
        }, task -> new Thread(task).start());
    }

    @Override
    public void close() {
        process.destroy();
    }
}
