package tickbus.sdsp;

/**
 * A variable that all clients may read and one writes.
 *
 * @param name its name, which no other variable of the run has: 1 to 255 bytes in UTF-8
 * @param type the type of its values
 */
public record Variable(String name, DataType type) {
}
