package tickbus.junit;

import static org.junit.jupiter.api.Assertions.assertTrue;

import java.io.IOException;
import java.nio.file.Files;
import java.nio.file.Path;
import org.junit.jupiter.params.ParameterizedTest;
import org.junit.jupiter.params.provider.ValueSource;

/** The examples of docs/testing.md and docs/sweeps.md must be the tests that run here, word for word. */
class DocumentationTest {
    @ParameterizedTest
    @ValueSource(strings = {"CellTest", "CellSweepTest"})
    void theExampleOfTheDocumentationIsTheTestThatRuns(String example) throws IOException {
        Path root = Path.of(System.getProperty("tickbus.root"));
        String source = Files.readString(root.resolve("java/junit/src/test/java/example/" + example + ".java"))
            .replace("package example;\n\n", "").replace("import org.junit.jupiter.api.Tag;\n", "")
            .replace("@Tag(\"native\")\n", "").replace("../../driver.cfg", "driver.cfg");
        String docs = Files.readString(root.resolve("docs/testing.md")) + Files.readString(root.resolve("docs/sweeps.md"));
        assertTrue(docs.contains("```java\n" + source + "```\n"), source);
    }
}
