package tickbus.petri.page;

import java.util.List;
import tickbus.petri.draw.NetSvg;
import tickbus.petri.net.PetriNet;
import tickbus.petri.net.Transition;
import tickbus.petri.run.Conjunction;
import tickbus.petri.run.NetState;
import tickbus.petri.run.RunningNet;

/** The messages to the page, as docs/petri.md describes them. */
final class Json {
    private final StringBuilder out = new StringBuilder();

    private Json() {
    }

    /** The nets for drawing. */
    static String nets(List<RunningNet> nets) {
        Json json = new Json();
        json.raw("{\"dots\":[");
        int[][] dots = NetSvg.dots();
        for (int i = 0; i < dots.length; i++) {
            json.raw(i == 0 ? "[" : ",[");
            for (int k = 0; k < dots[i].length; k++) {
                json.raw(k == 0 ? "" : ",").raw(Integer.toString(dots[i][k]));
            }
            json.raw("]");
        }
        json.raw("],\"nets\":[");
        for (int i = 0; i < nets.size(); i++) {
            json.raw(i == 0 ? "" : ",").net(nets.get(i));
        }
        return json.raw("]}").out.toString();
    }

    private Json net(RunningNet running) {
        PetriNet net = running.net();
        raw("{\"name\":").text(net.name()).raw(",\"svg\":").text(NetSvg.writeWithoutStyle(net, net.initialMarking()));
        raw(",\"places\":").texts(net.places().stream().map(place -> place.name()).toList());
        raw(",\"inputs\":").texts(running.inputNames()).raw(",\"outputs\":").texts(running.outputNames());
        raw(",\"transitions\":[");
        for (Transition transition : net.transitions()) {
            raw(transition.index() == 0 ? "" : ",").raw("{\"name\":").text(transition.name());
            if (running.condition(transition.index()) instanceof Conjunction parts) {
                raw(",\"parts\":[");
                for (int i = 0; i < parts.parts().size(); i++) {
                    raw(i == 0 ? "" : ",").part(parts.parts().get(i));
                }
                raw("]");
            } else if (running.condition(transition.index()) != null) {
                raw(",\"parts\":[{\"text\":\"a condition in code\"}]");
            }
            raw("}");
        }
        return raw("]}");
    }

    private void part(Conjunction.Part part) {
        raw("{\"text\":").text(part.text());
        if (part.input() != null) {
            raw(",\"input\":").text(part.input());
        }
        if (part.place() != null) {
            raw(",\"net\":").text(part.net()).raw(",\"place\":").text(part.place());
        }
        raw("}");
    }

    /** The part that changes all the time: the scan and its time. */
    static String moment(NetState state) {
        Json json = new Json();
        return json.raw("\"scans\":").raw(Long.toString(state.scans())).raw(",\"us\":")
            .raw(state.scans() == 0 ? "null" : Long.toString(state.nanos() / 1000)).out.toString();
    }

    /** The rest of a state. */
    static String state(RunningNet running, NetState state, String note) {
        Json json = new Json();
        int places = running.net().places().size();
        int transitions = running.net().transitions().size();
        json.raw("\"note\":").text(note).raw(",\"stop\":").text(state.stop().map(stop -> stop.message()).orElse(""));
        json.raw(",\"tokens\":[");
        for (int p = 0; p < places; p++) {
            json.raw(p == 0 ? "" : ",").raw(Integer.toString(state.tokens(p)));
        }
        json.raw("],\"young\":{");
        String comma = "";
        for (int p = 0; p < places; p++) {
            if (state.available(p) != state.tokens(p)) {
                json.raw(comma).raw("\"" + p + "\":").raw(Integer.toString(state.tokens(p) - state.available(p)));
                comma = ",";
            }
        }
        json.raw("},\"phases\":\"");
        for (int t = 0; t < transitions; t++) {
            json.raw(Integer.toString(state.phase(t).ordinal()));
        }
        json.raw("\",\"due\":{");
        comma = "";
        for (int t = 0; t < transitions; t++) {
            if (state.phase(t) == NetState.Phase.DELAYED && state.due(t) != Long.MAX_VALUE) {
                json.raw(comma).raw("\"" + t + "\":").raw(Long.toString(state.due(t) / 1000));
                comma = ",";
            }
        }
        json.raw("},\"failed\":{");
        comma = "";
        for (int t = 0; t < transitions; t++) {
            if (state.failed(t) >= 0) {
                json.raw(comma).raw("\"" + t + "\":").raw(Integer.toString(state.failed(t)));
                comma = ",";
            }
        }
        json.raw("},\"fired\":[");
        for (int t = 0; t < transitions; t++) {
            json.raw(t == 0 ? "" : ",").raw(Long.toString(state.fired(t)));
        }
        json.raw("],\"last\":[");
        for (int t = 0; t < transitions; t++) {
            json.raw(t == 0 ? "" : ",").raw(state.fired(t) == 0 ? "null" : Long.toString(state.lastFired(t) / 1000));
        }
        json.raw("],\"in\":[");
        for (int i = 0; i < running.inputNames().size(); i++) {
            json.raw(i == 0 ? "" : ",").number(state.input(i));
        }
        json.raw("],\"out\":[");
        for (int i = 0; i < running.outputNames().size(); i++) {
            json.raw(i == 0 ? "" : ",").number(state.output(i));
        }
        return json.raw("]").out.toString();
    }

    private Json raw(String json) {
        out.append(json);
        return this;
    }

    private void number(double value) {
        boolean whole = value == Math.rint(value) && Math.abs(value) < 1e15;
        out.append(!Double.isFinite(value) ? "null" : whole ? Long.toString((long) value) : Double.toString(value));
    }

    private Json texts(List<String> all) {
        raw("[");
        for (int i = 0; i < all.size(); i++) {
            raw(i == 0 ? "" : ",").text(all.get(i));
        }
        return raw("]");
    }

    private Json text(String text) {
        out.append('"');
        for (int i = 0; i < text.length(); i++) {
            char c = text.charAt(i);
            if (c == '"' || c == '\\') {
                out.append('\\').append(c);
            } else if (isLone(text, i)) {
                // It would not survive UTF-8.
                out.append('\uFFFD');
            } else if (c < ' ') {
                out.append(String.format("\\u%04x", (int) c));
            } else {
                out.append(c);
            }
        }
        out.append('"');
        return this;
    }

    /** True for half of a character that needs two. */
    private static boolean isLone(String text, int i) {
        char c = text.charAt(i);
        return Character.isHighSurrogate(c) ? i + 1 == text.length() || !Character.isLowSurrogate(text.charAt(i + 1))
            : Character.isLowSurrogate(c) && (i == 0 || !Character.isHighSurrogate(text.charAt(i - 1)));
    }
}
