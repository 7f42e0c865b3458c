package peers;

import java.util.concurrent.TimeUnit;
import org.apache.plc4x.java.api.PlcConnection;
import org.apache.plc4x.java.api.PlcDriverManager;
import org.apache.plc4x.java.api.messages.PlcReadResponse;
import org.apache.plc4x.java.api.messages.PlcWriteRequest;
import org.apache.plc4x.java.api.types.PlcResponseCode;

/**
 * A client of Apache PLC4X. Its argument is a connection string of PLC4X; it obeys, words apart by tabs:
 *
 * <pre>
 * read ADDRESS...            the values, apart by tabs; or the response code where one is not OK
 * write ADDRESS VALUE        the response code
 * </pre>
 */
public final class Plc4xClient {
    private static final long LIMIT_S = 10;

    private Plc4xClient() {}

    public static void main(String[] arguments) throws Exception {
        try (PlcConnection connection =
                PlcDriverManager.getDefault().getConnectionManager().getConnection(arguments[0])) {
            Lines.serve(words -> switch (words[0]) {
                case "read" -> read(connection, words);
                case "write" -> write(connection, words[1], words[2]);
                default -> "what is " + words[0] + "?";
            });
        }
        // Some of its drivers leave threads behind.
        System.exit(0);
    }

    private static String read(PlcConnection connection, String[] words) throws Exception {
        var request = connection.readRequestBuilder();
        for (int tag = 1; tag < words.length; tag++) {
            request.addTagAddress("tag" + tag, words[tag]);
        }
        PlcReadResponse response = request.build().execute().get(LIMIT_S, TimeUnit.SECONDS);
        StringBuilder answer = new StringBuilder();
        for (int tag = 1; tag < words.length; tag++) {
            PlcResponseCode code = response.getResponseCode("tag" + tag);
            answer.append(tag == 1 ? "" : "\t")
                    .append(code == PlcResponseCode.OK ? response.getObject("tag" + tag) : code);
        }
        return answer.toString();
    }

    private static String write(PlcConnection connection, String address, String value) throws Exception {
        PlcWriteRequest request =
                connection.writeRequestBuilder().addTagAddress("tag", address, value).build();
        return request.execute().get(LIMIT_S, TimeUnit.SECONDS).getResponseCode("tag").toString();
    }
}
