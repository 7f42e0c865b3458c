package tickbus.machines.rig;

import controlinterface.ControlInterfaceDeviceDriver;
import controlinterface.Direction;
import controlinterface.HardwareComponent;
import java.io.IOException;
import java.nio.file.Files;
import java.nio.file.Path;
import java.util.ArrayList;
import java.util.HashMap;
import java.util.HashSet;
import java.util.LinkedHashMap;
import java.util.List;
import java.util.Map;
import java.util.Set;
import tickbus.machines.demo.Plc;

/**
 * A driver whose PLC is this class. The PLC homes, runs, aborts, recovers and parks the rig in simulation time, so that the
 * demo's script is tested without any link. It stands in for the rig's program and breaks on demand; docs/ARCHITECTURE.md
 * describes the program's versions. The components are those that the rig's control table names.
 */
class PlcDriver extends ControlInterfaceDeviceDriver {
    static final int ID = 4711;
    private static final Set<String> NUMBERS = Set.of("Phase", "Step", "Cycles", "LA1 position", "LA2 position");
    private static final String[][] STEPS = {
        {},
        {"IM1 index"},
        {"LA1 run", "SC1"},
        {"LA1 run", "LA1 code low"},
        {"IM2 index"},
        {"LA1 run", "LA1 code high", "SC1", "LA2 run", "LA2 up", "SC2", "Lamp"},
        {"LA1 run", "LA1 code high", "LA1 code low", "SC1", "LA2 run", "SC2", "Lamp"},
    };
    private static final Set<String> FAIL_SAFE_ON = Set.of("SC1", "SC2");
    private static final long MILLI = 1_000_000;
    private static final long MAX_AGE = 250 * MILLI;

    private final List<HardwareComponent> components = new ArrayList<>();
    private final Map<String, Double> in = new HashMap<>();
    private final Map<String, Double> out = new LinkedHashMap<>();
    private final Map<String, Double> inAtScan = new HashMap<>();
    private final Map<String, Double> delivered = new HashMap<>();
    final Map<String, Long> rises = new LinkedHashMap<>();
    private long now;
    private long nextScan;
    long scans;
    private int phase;
    private int part;
    private long partSince;
    private int step;
    private int cycles;
    private boolean resume;
    private boolean stopping;
    private long deadSince = Long.MAX_VALUE;
    private boolean stale;
    private boolean killed;
    private final Set<String> pulses = new HashSet<>();
    int exits;

    /** Faults to inject: the simulation time at which the link goes stale, a step that never ends, and so on. */
    long staleFrom = Long.MAX_VALUE;
    long throwFrom = Long.MAX_VALUE;
    int deafStep;
    boolean countless;
    boolean lampDark;
    /** Without a PLC: the cups release; lift 2 continues; the driver keeps reporting fresh data. */
    boolean dropsInOutage;
    boolean creepsInOutage;
    boolean neverStale;
    /** The PLC makes an edge after its last report. */
    boolean edgeAfterDeath;
    /** An edge of this signal is lost at the PLC's end just as it returns. */
    String lostAtReturn;
    /** The PLC counts an edge of this signal that did not happen. */
    String miscounted;

    PlcDriver(Path controlTable) throws IOException {
        Map<String, HardwareComponent> found = new LinkedHashMap<>();
        for (String line : Files.readAllLines(controlTable)) {
            String[] cells = line.split("\\|");
            if (cells.length == 4 && !line.startsWith("#")) {
                component(found, cells[0].strip(), Direction.READ_BY_SIMULATION);
                component(found, cells[3].strip(), Direction.WRITTEN_BY_SIMULATION);
            }
        }
        components.addAll(found.values());
        for (HardwareComponent component : found.values()) {
            boolean read = component.direction() == Direction.READ_BY_SIMULATION;
            (read ? out : in).put(component.name(), 0.0);
            if (component.type().equals("BOOL")) {
                rises.put(component.name(), 0L);
                if (read) {
                    add(component.name() + ".edges", "UDINT");
                }
            }
        }
        add("bus.age", "LREAL");
        add("bus.sequence", "ULINT");
        add("bus.status", "INT");
    }

    private static void component(Map<String, HardwareComponent> found, String cell, Direction direction) {
        if (cell.startsWith(ID + ":")) {
            String name = cell.substring(cell.indexOf(':') + 1);
            String type = NUMBERS.contains(name) ? "INT" : "BOOL";
            found.put(name, new HardwareComponent(name, direction, type, ""));
        }
    }

    private void add(String name, String type) {
        components.add(new HardwareComponent(name, Direction.READ_BY_SIMULATION, type, ""));
    }

    @Override
    public void simulationTime(long nanos) {
        now = nanos;
    }

    @Override
    public void updateComponentValues(double[] value) {
        if (now >= throwFrom) {
            throw new IllegalStateException("the cable is cut");
        }
        stale = now >= staleFrom || now - deadSince > MAX_AGE && !neverStale;
        int index = 0;
        for (HardwareComponent component : components) {
            if (component.direction() == Direction.WRITTEN_BY_SIMULATION) {
                count(component.name(), in, value[index]);
                in.put(component.name(), value[index++]);
            }
        }
        if (now >= nextScan && now < deadSince) {
            nextScan = now + 10 * MILLI;
            scans++;
            scan();
            inAtScan.putAll(in);
        }
        List<Double> inputs = new ArrayList<>();
        for (HardwareComponent component : components) {
            if (component.direction() == Direction.READ_BY_SIMULATION) {
                inputs.add(deliver(component.name()));
            }
        }
        if (!stale) {
            delivered.putAll(out);
        }
        deliverHardwareInputs(inputs.stream().mapToDouble(Double::doubleValue).toArray());
    }

    private void count(String name, Map<String, Double> before, double value) {
        if (rises.containsKey(name) && before.get(name) == 0 && value != 0) {
            rises.merge(name, 1L, Long::sum);
            if (before == in && now > deadSince) {
                pulses.add(name);
            }
        }
    }

    private double deliver(String name) {
        if (name.endsWith(".edges")) {
            if (stale) {
                return 0;
            }
            String signal = name.substring(0, name.length() - ".edges".length());
            return delivered.getOrDefault(signal, 0.0) == 0 && out.get(signal) != 0 ? 1 : 0;
        }
        return switch (name) {
            case "bus.age" -> 0.001;
            case "bus.sequence" -> scans;
            case "bus.status" -> stale ? 2 : 0;
            default -> stale ? failSafe(name) : out.get(name);
        };
    }

    private double failSafe(String name) {
        boolean creeps = creepsInOutage && name.equals("LA2 run");
        return creeps || FAIL_SAFE_ON.contains(name) && !dropsInOutage ? 1 : 0;
    }

    /** The PLC's power switch. */
    final class Power implements Plc {
        @Override
        public boolean restartable() {
            return true;
        }

        @Override
        public void start() {
            deadSince = Long.MAX_VALUE;
            rises.replaceAll((name, count) -> 0L);
            out.replaceAll((name, value) -> 0.0);
            phase = 0;
            step = 0;
            cycles = 0;
            resume = false;
            stopping = false;
            inAtScan.clear();
            // A pulse from the time without a PLC arrives late. The PLC's image starts with all bits off, so a signal that
            // is on counts once.
            pulses.forEach(name -> rises.merge(name, in.get(name) == 0 ? 1L : 0L, Long::sum));
            pulses.clear();
            in.replaceAll((name, value) -> 0.0);
            if (lostAtReturn != null && killed) {
                rises.merge(lostAtReturn, -1L, Long::sum);
            }
            if (miscounted != null) {
                rises.merge(miscounted, 1L, Long::sum);
            }
        }

        @Override
        public void kill() {
            deadSince = now;
            killed = true;
            if (edgeAfterDeath) {
                out.put("Ready lamp", 1.0);
            }
        }

        @Override
        public Counts counts() {
            return Counts.of(statistics(), System.nanoTime());
        }

        @Override
        public List<String> news() {
            return List.of();
        }

        @Override
        public long longestSilenceNanos() {
            return 0;
        }

        @Override
        public String name() {
            return "class " + PlcDriver.class.getSimpleName();
        }

        @Override
        public void check() {
            // This PLC cannot end.
        }

        @Override
        public void close() {
            // Nothing to close.
        }
    }

    private boolean on(String name) {
        return in.get(name) != 0;
    }

    private boolean rose(String name) {
        return on(name) && inAtScan.getOrDefault(name, 0.0) == 0;
    }

    private void set(String name, double value) {
        count(name, out, value);
        out.put(name, value);
    }

    private void only(String... names) {
        Set<String> high = Set.of(names);
        for (String name : out.keySet()) {
            if (!NUMBERS.contains(name) && !name.endsWith("lamp")) {
                boolean dark = lampDark && name.equals("Lamp");
                set(name, high.contains(name) && !dark ? 1 : 0);
            }
        }
    }

    private void enter(int newPhase) {
        phase = newPhase;
        part(0);
        step = newPhase == 3 ? 1 : 0;
        set("Ready lamp", newPhase == 2 ? 1 : 0);
        set("Running lamp", newPhase == 3 ? 1 : 0);
        set("Fault lamp", newPhase == 4 ? 1 : 0);
        set("Parked lamp", newPhase == 7 ? 1 : 0);
    }

    private void part(int newPart) {
        part = newPart;
        partSince = now;
    }

    private boolean waited(long millis) {
        return now - partSince >= millis * MILLI;
    }

    private void scan() {
        switch (phase) {
            case 0 -> {
                only("SC1", "SC2");
                enter(1);
            }
            case 1, 5, 6 -> home();
            case 2 -> {
                only();
                if (rose("Start button")) {
                    enter(3);
                }
            }
            case 3 -> run();
            case 4 -> {
                only();
                if (rose("Reset button")) {
                    resume = true;
                    enter(5);
                }
            }
            default -> only();
        }
        out.put("Phase", (double) phase);
        out.put("Step", (double) step);
        out.put("Cycles", (double) cycles);
    }

    private void run() {
        stopping |= on("Stop button");
        only(STEPS[step]);
        if (on("Not OK")) {
            only();
            enter(4);
        } else if (on("Step " + step + " complete") && step != deafStep) {
            step++;
            if (step == 7) {
                step = 1;
                cycles++;
                if (stopping) {
                    enter(6);
                }
            }
        }
    }

    private void home() {
        switch (part) {
            case 0 -> {
                only(phase == 5 ? new String[] {"Acknowledge", "SC1", "SC2"} : new String[] {"SC1", "SC2"});
                partAfter(waited(100));
            }
            case 1 -> {
                only("LA1 run", "LA1 code low", "LA1 code high", "LA2 run", "SC1", "SC2");
                partAfter(waited(50) && on("LA1 bottom") && on("LA2 bottom"));
            }
            case 2 -> {
                only(on("Homing sensor 1") ? "no jog 1" : "IM1 jog", on("Homing sensor 2") ? "no jog 2" : "IM2 jog");
                partAfter(on("Homing sensor 1") && on("Homing sensor 2"));
            }
            case 3 -> {
                only();
                partAfter(waited(1000));
            }
            case 4 -> {
                only("LA1 run", "SC1");
                partAfter(waited(50) && on("Step 2 complete"));
            }
            case 5 -> {
                only("LA1 run", "LA1 code low", "LA1 code high", "SC1");
                partAfter(waited(50) && on("LA1 bottom"));
            }
            default -> {
                only();
                if (waited(100)) {
                    enter(phase == 6 ? 7 : resume ? 3 : 2);
                    resume = false;
                }
            }
        }
    }

    private void partAfter(boolean over) {
        if (over) {
            part(part + 1);
        }
    }

    @Override
    public List<HardwareComponent> components() {
        return List.copyOf(components);
    }

    @Override
    public int id() {
        return ID;
    }

    @Override
    public String name() {
        return "PLC without a link";
    }

    @Override
    public Map<String, String> statistics() {
        if (countless) {
            return Map.of("plc.scans", String.valueOf(scans));
        }
        Map<String, String> statistics = new LinkedHashMap<>();
        statistics.put("max_age", "250ms");
        statistics.put("plc.scans", String.valueOf(scans));
        rises.forEach((name, count) -> statistics.put("plc.rises." + name, String.valueOf(count)));
        return statistics;
    }

    @Override
    public void exit() {
        exits++;
    }
}
