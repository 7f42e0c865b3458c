package tickbus.petri.run;

import java.util.HashMap;
import java.util.List;
import java.util.Map;

/** An array of named values. */
final class Signals {
    private final String kind;
    private final List<String> names;
    private final Map<String, Integer> index = new HashMap<>();
    final double[] values;

    Signals(String kind, List<String> names) {
        this.kind = kind;
        this.names = List.copyOf(names);
        for (String name : names) {
            if (index.put(name, index.size()) != null) {
                throw new IllegalArgumentException(kind + " " + name + " is given twice; expected a name of its own");
            }
        }
        values = new double[names.size()];
    }

    List<String> names() {
        return names;
    }

    int index(String name) {
        Integer found = index.get(name);
        if (found == null) {
            throw new IllegalArgumentException("there is no " + kind + " '" + name + "'; there are " + names);
        }
        return found;
    }
}
