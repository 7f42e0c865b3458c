package tickbus.simulator;

import static org.junit.jupiter.api.Assertions.assertEquals;
import static org.junit.jupiter.api.Assertions.assertThrows;
import static org.junit.jupiter.api.Assertions.assertTrue;

import java.io.IOException;
import java.nio.file.Files;
import java.nio.file.Path;
import java.util.Set;
import org.junit.jupiter.api.BeforeEach;
import org.junit.jupiter.api.Test;
import org.junit.jupiter.api.io.TempDir;
import org.junit.jupiter.params.ParameterizedTest;
import org.junit.jupiter.params.provider.CsvSource;

/** Scanning folders of drivers that are compiled into jars on the spot. */
class DeviceDriverFolderTest {
    @TempDir
    Path folder;

    @TempDir
    Path work;

    @BeforeEach
    void forgetLog() {
        System.clearProperty(DriverJar.LOG);
    }

    private void cfg(String file, String content) throws IOException {
        Files.writeString(folder.resolve(file), content);
    }

    private String wrong() {
        return assertThrows(WrongInput.class, () -> DeviceDriverFolder.scan(folder).open()).getMessage();
    }

    private static String log() {
        return System.getProperty(DriverJar.LOG, "");
    }

    @Test
    void everyCfgIsADriverInTheOrderOfNames() throws IOException {
        DriverJar.write(work, folder.resolve("driver.jar"), "drivers.Good", "drivers.Good");
        cfg("b.cfg", "[driver]\nid = 2\n");
        cfg("a.cfg", "# the first\n[other]\nid = 5\n[ driver ] # mine\nname = \"x\"\n  id=1_0 # ten\n");
        cfg("notes.txt", "no driver");
        DeviceDriverFolder found = DeviceDriverFolder.scan(folder);
        assertEquals(Set.of(2, 10), found.configurations().keySet());
        assertEquals("", log(), "nothing is opened by scanning");
        try (DriverSet drivers = found.open()) {
            assertEquals("open a.cfg,open b.cfg,", log());
            assertEquals("driver 10  good", drivers.list().lines().findFirst().orElseThrow());
            assertTrue(drivers.list().contains("  10:level   REAL  mm    destination, written by the simulation\n"),
                    drivers.list());
            assertTrue(drivers.list().contains("  10:lamp    BOOL        source, read by the simulation\n"),
                    drivers.list());
        }
        assertEquals("open a.cfg,open b.cfg,exit a.cfg,exit b.cfg,", log());
    }

    @Test
    void aClassThatCanDescribeItsDriversIsNotOpenedToList() throws IOException {
        DriverJar.write(work, folder.resolve("driver.jar"), "drivers.Shy", "drivers.Good", "drivers.Shy");
        cfg("a.cfg", "[driver]\nid = 1\n");
        try (DriverSet drivers = DeviceDriverFolder.scan(folder).look()) {
            assertEquals("look ", log());
            assertTrue(drivers.list().contains("  1:level"), drivers.list());
        }
        cfg("a.cfg", "[driver]\nid = 1\n# fail");
        DriverFailure failure = assertThrows(DriverFailure.class, () -> DeviceDriverFolder.scan(folder).look());
        assertTrue(failure.getCause().getMessage().contains("the card is missing"), failure.toString());
    }

    @Test
    void theClassMayBeInAnotherJarThanItsName() throws IOException {
        DriverJar.write(work, folder.resolve("classes.jar"), null, "drivers.Good");
        DriverJar.write(work, folder.resolve("name.jar"), "drivers.Good");
        cfg("a.cfg", "[driver]\nid = 1\n");
        DeviceDriverFolder.scan(folder).open().close();
        assertEquals("open a.cfg,exit a.cfg,", log());
    }

    @Test
    void aMissingFolderJarOrCfgIsTold() throws IOException {
        assertTrue(assertThrows(WrongInput.class, () -> DeviceDriverFolder.scan(folder.resolve("no"))).getMessage()
                .contains("there is no such folder"));
        assertTrue(wrong().contains("there is no .jar file"));
        DriverJar.write(work, folder.resolve("driver.jar"), "drivers.Good", "drivers.Good");
        assertTrue(wrong().contains("there is no .cfg file"));
    }

    @Test
    void twoFilesWithOneIdAreToldBeforeAnythingIsOpened() throws IOException {
        DriverJar.write(work, folder.resolve("driver.jar"), "drivers.Good", "drivers.Good");
        cfg("left.cfg", "[driver]\nid = 4711\n");
        cfg("right.cfg", "[driver]\nid = 4_711\n");
        String told = wrong();
        assertTrue(told.contains("left.cfg and right.cfg") && told.contains("the same id 4711"), told);
        assertEquals("", log());
    }

    @Test
    void aCfgOfAnotherSystemsEditorHasItsId() throws IOException {
        DriverJar.write(work, folder.resolve("driver.jar"), "drivers.Good", "drivers.Good");
        cfg("a.cfg", "\uFEFF[driver]\r\nid = 7\r\n");
        assertEquals(Set.of(7), DeviceDriverFolder.scan(folder).configurations().keySet());
    }

    @ParameterizedTest
    @CsvSource({"'', there is no id", "'id = 5', there is no id", "'[driver]\nid = \"5\"', there is no id",
        "'[driver]\n[fieldbus]\nid = 5', there is no id", "'[driver]\nid = 5000000000', does not fit into 32 bits"})
    void aCfgWithoutAnIdIsTold(String content, String what) throws IOException {
        DriverJar.write(work, folder.resolve("driver.jar"), "drivers.Good", "drivers.Good");
        cfg("a.cfg", content);
        String told = wrong();
        assertTrue(told.contains("a.cfg") && told.contains(what), told);
    }

    @Test
    void jarsThatNameNoClassOrTwoAreTold() throws IOException {
        cfg("a.cfg", "[driver]\nid = 1\n");
        DriverJar.write(work, folder.resolve("plain.jar"), null, "drivers.Good");
        String told = wrong();
        assertTrue(told.contains("Device-Driver-Class") && told.contains("looked into plain.jar"), told);
        DriverJar.write(work, folder.resolve("one.jar"), "drivers.Good");
        DriverJar.write(work, folder.resolve("two.jar"), "drivers.Bad");
        told = wrong();
        assertTrue(told.contains("one.jar names the driver class drivers.Good and two.jar names drivers.Bad"), told);
        Files.writeString(folder.resolve("one.jar"), "this is text");
        assertTrue(wrong().contains("one.jar: this is no readable jar file"));
    }

    @ParameterizedTest
    @CsvSource({"drivers.Missing, no jar in the folder has the class drivers.Missing",
        "drivers.Unrelated, does not extend controlinterface.ControlInterfaceDeviceDriver",
        "drivers.Shapeless, is abstract", "drivers.NoPath, has no public constructor that takes a java.nio.file.Path"})
    void aClassOfTheWrongKindIsTold(String name, String what) throws IOException {
        DriverJar.write(work, folder.resolve("driver.jar"), name, "drivers.Good", "drivers.Unrelated",
                "drivers.Shapeless", "drivers.NoPath");
        cfg("a.cfg", "[driver]\nid = 1\n");
        assertTrue(wrong().contains(what), wrong());
    }

    @Test
    void aDriverMustAgreeAboutItsId() throws IOException {
        DriverJar.write(work, folder.resolve("driver.jar"), "drivers.Good", "drivers.Good");
        cfg("a.cfg", "[driver]\nid = 7\n");
        assertTrue(wrong().contains("its driver says that it has the id 1, but the simulator reads 7"), wrong());
    }

    @Test
    void ifOneDriverFailsToOpenTheOthersAreClosed() throws IOException {
        DriverJar.write(work, folder.resolve("driver.jar"), "drivers.Good", "drivers.Good");
        cfg("a.cfg", "[driver]\nid = 1\n");
        cfg("b.cfg", "[driver]\nid = 2\n# fail\n");
        DriverFailure failure = assertThrows(DriverFailure.class, () -> DeviceDriverFolder.scan(folder).open());
        assertEquals("the driver of b.cfg failed to open: the card is missing", failure.getMessage());
        assertEquals("open a.cfg,exit a.cfg,", log());
    }
}
