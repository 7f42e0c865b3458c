package tickbus.junit;

import java.lang.reflect.Constructor;
import java.lang.reflect.InvocationTargetException;
import java.lang.reflect.Modifier;
import java.nio.file.Path;
import java.util.Map;
import java.util.Optional;
import org.junit.jupiter.api.extension.ExtensionConfigurationException;
import org.junit.jupiter.api.extension.ExtensionContext;
import org.opentest4j.AssertionFailedError;
import tickbus.FieldbusException;
import tickbus.Tickbus;

/** Everything that a test runs on: the line with the program at its other end, the machine, the PLC under test. */
final class Bench {
    private final Tickbus bus;
    private final Plc plc;
    private final Machine machine;
    private final Keep keep;

    private Bench(Tickbus bus, Plc plc, Machine machine, Keep keep) {
        this.bus = bus;
        this.plc = plc;
        this.machine = machine;
        this.keep = keep;
    }

    static Bench open(Setup setup, ExtensionContext context) {
        long step = setup.stepNanos();
        Machine machine = setup.machine() == Machine.class ? null : make(setup.machine());
        Keep keep = Keep.of(setup.recording(), context);
        Tickbus bus = setup.open(keep.table());
        try {
            Plc plc = new Plc(bus, step);
            if (machine != null) {
                plc.connect(machine);
            }
            return new Bench(bus, plc, machine, keep);
        } catch (RuntimeException | Error e) {
            bus.close();
            throw e;
        }
    }

    private static Machine make(Class<? extends Machine> type) {
        boolean inner = type.isMemberClass() && !Modifier.isStatic(type.getModifiers());
        Constructor<? extends Machine> constructor;
        try {
            constructor = type.getDeclaredConstructor();
            constructor.setAccessible(true);
        } catch (NoSuchMethodException e) {
            String name = type.getSimpleName();
            throw new ExtensionConfigurationException("@PlcTest(machine = " + name + ".class): "
                + (inner ? "an inner class needs its outer object; make it static"
                    : "it has no constructor without parameters; give it one")
                + ", or leave machine out and connect one in the test: plc.connect(new " + name + "(…))", e);
        }
        try {
            return constructor.newInstance();
        } catch (InvocationTargetException e) {
            throw new ExtensionConfigurationException("@PlcTest(machine = " + type.getSimpleName()
                + ".class): its constructor failed: " + e.getCause(), e.getCause());
        } catch (ReflectiveOperationException e) {
            throw new ExtensionConfigurationException("@PlcTest(machine = " + type.getSimpleName()
                + ".class): no machine can be made of it: " + e, e);
        }
    }

    Tickbus bus() {
        return bus;
    }

    /** The page about the recording, should the test fail. */
    Optional<Path> page() {
        return keep.page();
    }

    Plc plc() {
        return plc;
    }

    Machine machine() {
        return machine;
    }

    /** Ends the test's run; if it failed, keeps the recording and reports the state. */
    void close(ExtensionContext context) {
        Throwable failure = context.getExecutionException().orElse(null);
        AssertionFailedError unfinished = failure == null ? plc.unfinished() : null;
        Map<String, String> statistics;
        // After a defect in the library there are no statistics, but the driver must be closed anyway.
        try (bus) {
            statistics = bus.statistics();
        } catch (FieldbusException e) {
            statistics = Map.of("reason", e.getMessage());
        }
        String kept = keep.finish(failure != null ? failure : unfinished, statistics, context);
        if (failure != null) {
            failure.addSuppressed(new Note("the test stood at " + plc.where() + kept));
        } else if (unfinished != null) {
            throw unfinished;
        }
    }

    /** The state of a test when it failed; shown in the stack trace, but not itself a failure. */
    private static final class Note extends RuntimeException {
        private static final long serialVersionUID = 1L;

        Note(String text) {
            super(text, null, false, false);
        }

        @Override
        public String toString() {
            return getMessage();
        }
    }
}
