package tickbus.junit;

import static org.junit.jupiter.api.Assertions.assertTrue;

import java.io.IOException;
import java.nio.file.Files;
import java.nio.file.Path;
import org.junit.jupiter.api.Test;

/** The example of docs/testing.md must be the test that runs here, word for word. */
class DocumentationTest {
    @Test
    void theExampleOfTheDocumentationIsTheTestThatRuns() throws IOException {
        Path root = Path.of(System.getProperty("tickbus.root"));
        String source = Files.readString(root.resolve("java/junit/src/test/java/example/CellTest.java"))
            .replace("package example;\n\n", "").replace("import org.junit.jupiter.api.Tag;\n", "")
            .replace("@Tag(\"native\")\n", "").replace("../../driver.cfg", "driver.cfg");
        assertTrue(Files.readString(root.resolve("docs/testing.md")).contains("```java\n" + source + "```\n"), source);
    }
}
