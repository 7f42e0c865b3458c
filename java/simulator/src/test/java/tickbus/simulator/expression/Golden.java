package tickbus.simulator.expression;

import java.io.IOException;
import java.io.InputStream;
import java.nio.charset.StandardCharsets;
import java.util.Arrays;
import java.util.List;

/** An expression of {@code expressions.txt} with its results. */
record Golden(String text, double[] results) {
    static final String NAMES = "abcijkxyz";

    /** The sets of inputs, in the order of {@link #NAMES}. */
    static final double[][] INPUTS = {
        {1, 0, 1, 7, -3, 2, 2.5, -0.75, 100},
        {0, 0, 1, -8, 5, 0, 0, 3.5, -2},
        {1, 1, 0, 0, 1, 1, -2.5, -2.5, 0.5}};

    static List<Golden> all() throws IOException {
        try (InputStream file = Golden.class.getResourceAsStream("expressions.txt")) {
            return new String(file.readAllBytes(), StandardCharsets.UTF_8).lines().filter(line -> !line.startsWith("#"))
                    .map(Golden::of).toList();
        }
    }

    private static Golden of(String line) {
        String[] parts = line.split(" \\| ");
        return new Golden(parts[0], Arrays.stream(parts).skip(1).mapToDouble(Double::parseDouble).toArray());
    }

    static Type type(int index) {
        return index < 3 ? Type.BOOL : index < 6 ? Type.LINT : Type.LREAL;
    }

    /** The names of the file, each with its type. */
    static final class Inputs implements Names {
        @Override
        public int index(String name) {
            int index = name.length() == 1 ? NAMES.indexOf(name) : -1;
            if (index < 0) {
                throw new IllegalArgumentException("there is no \"" + name + "\"");
            }
            return index;
        }

        @Override
        public Type type(int index) {
            return Golden.type(index);
        }

        @Override
        public Type used(int index) {
            throw new IllegalStateException("every name has a type");
        }

        @Override
        public void use(int index, Type type) {
            throw new IllegalStateException("every name has a type");
        }
    }
}
