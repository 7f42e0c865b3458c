package tickbus.simulator.demo;

import controlinterface.ControlInterfaceDeviceDriver;
import controlinterface.Direction;
import controlinterface.HardwareComponent;
import java.io.IOException;
import java.nio.file.Files;
import java.nio.file.Path;
import java.util.ArrayList;
import java.util.HashMap;
import java.util.LinkedHashMap;
import java.util.List;
import java.util.Map;
import java.util.Set;

/**
 * A driver whose PLC is this class: it homes, runs, aborts, recovers and parks the rig on simulation time,
 * so that the demo's script is tested without any link. Its components are those that the rig's control
 * table names.
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
    private static final long MILLI = 1_000_000;

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
    int exits;

    /** What is broken: after how much simulation time the link goes stale, a step that never ends, and so on. */
    long staleFrom = Long.MAX_VALUE;
    long throwFrom = Long.MAX_VALUE;
    int deafStep;
    boolean countless;
    boolean lampDark;

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
        int index = 0;
        for (HardwareComponent component : components) {
            if (component.direction() == Direction.WRITTEN_BY_SIMULATION) {
                count(component.name(), in, value[index]);
                in.put(component.name(), value[index++]);
            }
        }
        if (now >= nextScan) {
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
        delivered.putAll(out);
        deliverHardwareInputs(inputs.stream().mapToDouble(Double::doubleValue).toArray());
    }

    private void count(String name, Map<String, Double> before, double value) {
        if (rises.containsKey(name) && before.get(name) == 0 && value != 0) {
            rises.merge(name, 1L, Long::sum);
        }
    }

    private double deliver(String name) {
        if (name.endsWith(".edges")) {
            String signal = name.substring(0, name.length() - ".edges".length());
            return delivered.getOrDefault(signal, 0.0) == 0 && out.get(signal) != 0 ? 1 : 0;
        }
        return switch (name) {
            case "bus.age" -> 0.001;
            case "bus.sequence" -> scans;
            case "bus.status" -> now >= staleFrom ? 2 : 0;
            default -> out.get(name);
        };
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
            case 0 -> enter(1);
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
                only(phase == 5 ? new String[] {"Acknowledge"} : new String[0]);
                if (waited(100)) {
                    part(1);
                }
            }
            case 1 -> {
                only("LA1 run", "LA1 code low", "LA1 code high", "LA2 run");
                if (waited(50) && on("LA1 bottom") && on("LA2 bottom")) {
                    part(2);
                }
            }
            case 2 -> {
                only(on("Homing sensor 1") ? "no jog 1" : "IM1 jog", on("Homing sensor 2") ? "no jog 2" : "IM2 jog");
                if (on("Homing sensor 1") && on("Homing sensor 2")) {
                    part(3);
                }
            }
            default -> {
                only();
                if (waited(1000)) {
                    enter(phase == 6 ? 7 : resume ? 3 : 2);
                    resume = false;
                }
            }
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
        statistics.put("plc.scans", String.valueOf(scans));
        rises.forEach((name, count) -> statistics.put("plc.rises." + name, String.valueOf(count)));
        return statistics;
    }

    @Override
    public void exit() {
        exits++;
    }
}
