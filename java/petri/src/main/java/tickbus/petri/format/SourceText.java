package tickbus.petri.format;

import java.io.IOException;
import java.nio.ByteBuffer;
import java.nio.charset.CharacterCodingException;
import java.nio.charset.Charset;
import java.nio.charset.StandardCharsets;
import java.nio.file.Files;
import java.nio.file.Path;
import tickbus.petri.net.NetException;

/** The text of a file, and its name in messages. */
record SourceText(String source, String text) {
    /** Reads UTF-8, or else Windows-1252, which HPSim wrote. */
    static SourceText read(Path file) throws IOException {
        byte[] bytes = Files.readAllBytes(file);
        String text;
        try {
            text = StandardCharsets.UTF_8.newDecoder().decode(ByteBuffer.wrap(bytes)).toString();
        } catch (CharacterCodingException notUtf8) {
            text = new String(bytes, Charset.forName("windows-1252"));
        }
        return new SourceText(file.toString(), text);
    }

    String[] lines() {
        return text.split("\r\n|\r|\n", -1);
    }

    NetException mistake(int line, String element, String message) {
        return new NetException(source, line, element, message);
    }

    /** A whole number from {@code least}; anything else is a mistake in {@code element}. */
    int number(int line, String element, String what, String digits, int least) {
        long value;
        try {
            value = Long.parseLong(digits.strip());
        } catch (NumberFormatException wrong) {
            throw mistake(line, element, what + " '" + shortened(digits) + "'; expected a whole number");
        }
        if (value < least || value > Integer.MAX_VALUE) {
            throw mistake(line, element, what + " " + value + "; expected " + least + " to " + Integer.MAX_VALUE);
        }
        return (int) value;
    }

    /** At most 40 characters for a message, without control characters, which a terminal would execute. */
    static String shortened(String text) {
        return (text.length() > 40 ? text.substring(0, 40) + "…" : text).replaceAll("\\p{Cntrl}", "\uFFFD");
    }
}
