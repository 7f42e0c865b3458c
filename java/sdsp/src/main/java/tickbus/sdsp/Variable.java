package tickbus.sdsp;

/**
 * A variable that one client writes and all clients can read.
 *
 * @param name the variable's name, which no other variable of the run has: 1 to 255 bytes in UTF-8
 * @param type the type of its values
 */
public record Variable(String name, DataType type) {
}
