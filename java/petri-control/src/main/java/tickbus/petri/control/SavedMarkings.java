package tickbus.petri.control;

import java.io.IOException;
import java.io.UncheckedIOException;
import java.nio.file.Path;
import java.util.ArrayList;
import java.util.List;
import tickbus.Signal;
import tickbus.petri.format.MarkingFile;
import tickbus.petri.net.Marking;
import tickbus.petri.net.PetriNet;
import tickbus.petri.run.Coordinator;

/** The file with a controller's markings, and the number of the last save, which the machine also gets. */
final class SavedMarkings {
    /** Carries the number in the file, and whether an emergency stop held the outputs. */
    private static final PetriNet NUMBER = PetriNet.named("number of the markings").place("number").place("stopped").build();

    private final Coordinator[] order;
    private Path file;
    private Signal output;
    private int number;
    /** True if the marking has changed since the last save. */
    private boolean unsaved = true;
    private boolean stopped;

    SavedMarkings(Coordinator[] order) {
        this.order = order;
    }

    void keep(Path in) {
        file = in;
    }

    void number(Signal to, int first) {
        output = to;
        number = first;
    }

    int number() {
        return number;
    }

    void read(Path from) throws IOException {
        List<PetriNet> nets = new ArrayList<>();
        for (Coordinator one : order) {
            nets.add(one.net());
        }
        if (output != null) {
            nets.add(NUMBER);
        }
        List<Marking> markings = MarkingFile.read(from, nets);
        for (int i = 0; i < order.length; i++) {
            order[i].resume(markings.get(i));
        }
        if (output != null) {
            number = markings.get(order.length).get(0);
            stopped = markings.get(order.length).get(1) > 0;
        }
    }

    /** True if an emergency stop held the outputs, and nobody has pressed Rearm since. */
    boolean isStopped() {
        return stopped;
    }

    void stopped(boolean now) {
        unsaved |= output != null && now != stopped;
        stopped = now;
    }

    /** Saves the markings if a transition has fired since the last save, and lets the machine know the number of the save. */
    void save(int fired) {
        unsaved |= fired > 0;
        if (file == null || !unsaved) {
            return;
        }
        List<Marking> markings = new ArrayList<>();
        for (Coordinator one : order) {
            markings.add(one.marking());
        }
        if (output != null) {
            number = number == Integer.MAX_VALUE ? 1 : number + 1;
            markings.add(NUMBER.marking(new int[] {number, stopped ? 1 : 0}));
        }
        try {
            MarkingFile.write(file, markings);
        } catch (IOException e) {
            throw new UncheckedIOException("the markings cannot be saved in " + file + ": " + e, e);
        }
        if (output != null) {
            output.set(number);
        }
        unsaved = false;
    }
}
