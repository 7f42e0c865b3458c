package tickbus.petri.net;

import java.util.Arrays;

/** The tokens in the places of a net. Mutable and not thread-safe. */
public final class Marking {
    private final PetriNet net;
    final int[] tokens;

    Marking(PetriNet net, int[] tokens) {
        this.net = net;
        this.tokens = tokens;
    }

    /** The net it belongs to. */
    public PetriNet net() {
        return net;
    }

    /** The tokens in the place with this index. */
    public int get(int place) {
        return tokens[place];
    }

    /** The tokens in the place with this name; an {@link IllegalArgumentException} if there is no such place. */
    public int get(String place) {
        return tokens[net.place(place).index()];
    }

    /** Sets the tokens of a place, from 0 to its capacity; otherwise an {@link IllegalArgumentException}. */
    public void set(int place, int count) {
        net.checkTokens(place, count);
        tokens[place] = count;
    }

    /** A separate marking with the same tokens. */
    public Marking copy() {
        return new Marking(net, tokens.clone());
    }

    /** The tokens in the order of the places. */
    public int[] toArray() {
        return tokens.clone();
    }

    /** True if the other marking has the same tokens in the same net. */
    @Override
    public boolean equals(Object other) {
        return other instanceof Marking that && net == that.net && Arrays.equals(tokens, that.tokens);
    }

    @Override
    public int hashCode() {
        return Arrays.hashCode(tokens);
    }

    /** The marked places, such as {@code {idle, buffer: 3}}. */
    @Override
    public String toString() {
        StringBuilder text = new StringBuilder("{");
        for (int p = 0; p < tokens.length; p++) {
            if (tokens[p] > 0) {
                text.append(text.length() > 1 ? ", " : "").append(net.place(p).name());
                if (tokens[p] > 1) {
                    text.append(": ").append(tokens[p]);
                }
            }
        }
        return text.append('}').toString();
    }
}
