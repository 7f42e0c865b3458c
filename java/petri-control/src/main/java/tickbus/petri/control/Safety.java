package tickbus.petri.control;

import java.util.List;
import tickbus.Signal;

/** Keeps outputs at their fail-safe values while an input is on, and afterwards until another input turns on. */
final class Safety {
    private final Latch latch;
    private final Signal[] outputs;
    private final double[] failSafe;
    private int input = -1;
    private boolean whileOn;
    private int rearm;
    private String whileNote;
    private String untilNote;
    private boolean holding;
    private String note = "";

    /** The outputs have their fail-safe values now. */
    Safety(Latch latch, List<Signal> outputs) {
        this.latch = latch;
        this.outputs = outputs.toArray(Signal[]::new);
        failSafe = outputs.stream().mapToDouble(Signal::get).toArray();
    }

    void bind(int at, boolean on, String name, int rearmAt, String rearmName) {
        if (input >= 0) {
            throw new IllegalStateException(whileNote + " already; expected one such input");
        }
        input = at;
        whileOn = on;
        rearm = rearmAt;
        whileNote = "the outputs are fail-safe while '" + name + "' is " + (on ? "on" : "off");
        untilNote = "the outputs are fail-safe until '" + rearmName + "' goes on";
    }

    /** Holds from the beginning, as an earlier control did. */
    void hold() {
        holding = true;
    }

    boolean isHolding() {
        return holding;
    }

    /** Evaluates the latched inputs; while it holds, sets the outputs to fail-safe. Rearm counts from the next scan on. */
    boolean holds() {
        if (input < 0) {
            return false;
        }
        boolean asks = latch.now[input] != 0 == whileOn;
        if (!asks && !holding) {
            return false;
        }
        holding = asks || latch.now[rearm] == 0 || latch.before[rearm] != 0;
        note = asks ? whileNote : untilNote;
        for (int i = 0; i < outputs.length; i++) {
            outputs[i].set(failSafe[i]);
        }
        return true;
    }

    String note() {
        return note;
    }
}
