package tickbus.simulator;

import static org.junit.jupiter.api.Assertions.assertEquals;
import static org.junit.jupiter.api.Assertions.assertNotEquals;
import static org.junit.jupiter.api.Assertions.assertThrows;
import static org.junit.jupiter.api.Assertions.assertTrue;

import java.io.File;
import java.io.IOException;
import java.nio.file.Files;
import java.nio.file.Path;
import java.util.List;
import java.util.Set;
import java.util.jar.JarFile;
import org.junit.jupiter.api.Test;
import org.junit.jupiter.api.io.TempDir;

class MachineFolderTest {
    @TempDir
    Path folder;

    @TempDir
    Path work;

    private String refused(String... taken) {
        return assertThrows(WrongInput.class, () -> MachineFolder.load(folder, Set.of(taken))).getMessage();
    }

    private void press(String jar, String from, String to) throws IOException {
        MachineJar.write(work, folder.resolve(jar), MachineJar.PRESS.replace(from, to));
    }

    @Test
    void eachJarHasItsOwnClasses() throws IOException {
        press("a.jar", "my press", "first");
        press("b.jar", "my press", "second");
        try (MachineFolder machines = MachineFolder.load(folder, Set.of("rig"))) {
            assertEquals(List.of("first", "second"), List.copyOf(machines.machines().keySet()));
            Machine machine = machines.machines().get("second");
            assertNotEquals(machine.getClass(), machines.machines().get("first").getClass());
            machine.input(0, 1);
            machine.step(500_000_000);
            assertEquals(0.5, machine.output(0));
        }
    }

    @Test
    void aFolderWithoutJarsIsTold() {
        assertEquals(folder + ": there is no .jar file in this folder; put the machine's jar there", refused());
    }

    @Test
    void everyBadJarGetsItsSentence() throws IOException {
        press("a.jar", "my press", "rig");
        MachineJar.write(folder.resolve("b.jar"), null, null);
        press("c.jar", "private boolean down;",
                "public Press() { throw new IllegalStateException(\"no licence\"); }\n private boolean down;");
        press("d.jar", "private boolean down;", "public Press(int size) { }\n private boolean down;");
        MachineJar.write(folder.resolve("e.jar"), "mine.Pres\n", null);
        press("f.jar", "return \"my press\"", "return \" \"");
        press("g.jar", "my press", "twice");
        press("h.jar", "my press", "twice");
        Files.writeString(folder.resolve("i.jar"), "this is no jar");
        MachineJar.write(folder.resolve("j.jar"), "tickbus.simulator.TickMode\n", null);
        press("k.jar", "my press", "newer");
        byte[] newer = newer(folder.resolve("k.jar"));
        MachineJar.write(folder.resolve("k.jar"), "mine.Press\n", newer);
        List<String> told = refused("rig", "none").lines().toList();
        List<String> wanted = List.of(
                "a.jar: the name \"rig\" of mine.Press is taken by a machine of the simulator; its method name() must return"
                        + " another one",
                "b.jar: the jar has no machine; it needs a file META-INF/services/tickbus.simulator.Machine with the name of"
                        + " a class that implements tickbus.simulator.Machine",
                "c.jar: the constructor of mine.Press failed: java.lang.IllegalStateException: no licence",
                "d.jar: the machine cannot be loaded: mine.Press Unable to get public no-arg constructor",
                "e.jar: the machine cannot be loaded: Provider mine.Pres not found",
                "f.jar: mine.Press has no name; its method name() must return one",
                "h.jar: the name \"twice\" of mine.Press is taken by g.jar; its method name() must return another one",
                "i.jar: this is no readable jar file: ",
                "j.jar: the machine cannot be loaded: tickbus.simulator.TickMode not a subtype",
                "k.jar: the machine is compiled for a newer Java than this one, ");
        assertEquals(wanted.size(), told.size(), String.join("\n", told));
        for (int i = 0; i < wanted.size(); i++) {
            String line = told.get(i);
            assertTrue(line.startsWith(folder + File.separator + wanted.get(i)), line);
        }
    }

    /** The class of a jar, as if a Java of the far future had compiled it. */
    private static byte[] newer(Path jar) throws IOException {
        try (JarFile file = new JarFile(jar.toFile())) {
            byte[] bytes = file.getInputStream(file.getEntry("mine/Press.class")).readAllBytes();
            bytes[6] = 1;
            return bytes;
        }
    }
}
