package tickbus.sdsp;

import static org.junit.jupiter.api.Assertions.assertArrayEquals;
import static org.junit.jupiter.api.Assertions.assertEquals;
import static org.junit.jupiter.api.Assertions.assertTrue;

import java.io.IOException;
import java.nio.file.Files;
import java.nio.file.Path;
import java.time.Duration;
import java.util.HexFormat;
import java.util.List;
import java.util.regex.Matcher;
import java.util.regex.Pattern;
import javax.tools.ToolProvider;
import org.junit.jupiter.api.Test;
import org.junit.jupiter.api.Timeout;
import org.junit.jupiter.api.io.TempDir;

/** The examples in the documents are true. */
@Timeout(60)
class DocumentsTest {
    private static String document(String name) throws IOException {
        return Files.readString(Path.of(System.getProperty("tickbus.root"), "docs", name));
    }

    /** The first fenced block in the document with this beginning. */
    private static String block(String name, String begin) throws IOException {
        Matcher block = Pattern.compile("^```\\w*\n(" + Pattern.quote(begin) + ".*?)^```", Pattern.DOTALL | Pattern.MULTILINE)
            .matcher(document(name));
        assertTrue(block.find(), "a block that begins with: " + begin);
        return block.group(1);
    }

    @Test
    void theProgramInTheGuideCompiles(@TempDir Path folder) throws IOException {
        Path source = folder.resolve("Tank.java");
        Files.writeString(source, block("virtual-time.md", "import java"));
        String classPath = System.getProperty("surefire.test.class.path", System.getProperty("java.class.path"));
        int code = ToolProvider.getSystemJavaCompiler().run(null, null, null, "-Xlint:all", "-Werror", "--release", "17",
            "-cp", classPath, "-d", folder.toString(), source.toString());
        assertEquals(0, code);
    }

    /** Writes fixed values, one after another, and asks for step 3 after step 1. */
    private static final class Player implements Participant {
        private final List<Long> values = List.of(0L, -300L);
        private long ran;

        @Override
        public Declaration declare() {
            return Declaration.every("plc", Duration.ofMillis(20), List.of(new Variable("speed", DataType.INT)), List.of("level"));
        }

        @Override
        public void initial(long[] writes) {
            writes[0] = values.get(0);
        }

        @Override
        public void run(long sequence, long nanos, long[] reads, long[] writes) {
            ran = sequence;
            writes[0] = values.get((int) sequence);
        }

        @Override
        public long nextUpdate() {
            return ran == 0 ? AS_DECLARED : 20_000_000;
        }
    }

    @Test
    void theBytesInTheFormatAreThoseOfThisClient() throws Exception {
        play(new Player());
    }

    private static void play(Player client) throws Exception {
        String[] lines = block("sdsp.md", "tank > ").split("\n");
        try (FakeServer server = new FakeServer(s -> {
            for (String line : lines) {
                Matcher part = Pattern.compile(client.declare().name() + " +([<>])((?: [0-9a-f]{2})+).*").matcher(line);
                if (part.matches()) {
                    byte[] bytes = HexFormat.ofDelimiter(" ").parseHex(part.group(2).strip());
                    if (part.group(1).equals(">")) {
                        assertArrayEquals(bytes, s.receiveRaw(bytes.length), line);
                    } else {
                        s.sendRaw(bytes);
                    }
                }
            }
        })) {
            assertEquals(new Outcome(1, 0, 0xe7880c6272ef59bfL), Client.join(server.address(), client));
        }
    }
}
