package peers;

import java.io.BufferedReader;
import java.io.IOException;
import java.io.InputStreamReader;
import java.nio.charset.StandardCharsets;

/** Obeys lines from the standard input, and answers each with one line. */
final class Lines {
    /** Handles a request line, given as its words, which tabs separate. */
    interface Command {
        String obey(String[] words) throws Exception;
    }

    private Lines() {}

    /** Says that it is ready, and obeys until the end of the input. */
    static void serve(Command command) throws IOException {
        System.out.println("ready");
        BufferedReader input = new BufferedReader(new InputStreamReader(System.in, StandardCharsets.UTF_8));
        for (String line = input.readLine(); line != null; line = input.readLine()) {
            String answer;
            try {
                answer = command.obey(line.split("\t"));
            } catch (Exception problem) {
                answer = "error " + problem;
            }
            System.out.println(answer.replace('\n', ' '));
        }
    }
}
