package peers;

import java.util.List;
import java.util.Queue;
import java.util.concurrent.ConcurrentLinkedQueue;
import java.util.stream.Collectors;
import org.eclipse.milo.opcua.sdk.client.OpcUaClient;
import org.eclipse.milo.opcua.sdk.client.subscriptions.OpcUaMonitoredItem;
import org.eclipse.milo.opcua.sdk.client.subscriptions.OpcUaSubscription;
import org.eclipse.milo.opcua.stack.core.NodeIds;
import org.eclipse.milo.opcua.stack.core.types.builtin.DataValue;
import org.eclipse.milo.opcua.stack.core.types.builtin.NodeId;
import org.eclipse.milo.opcua.stack.core.types.builtin.Variant;
import org.eclipse.milo.opcua.stack.core.types.enumerated.TimestampsToReturn;
import org.eclipse.milo.opcua.stack.core.types.structured.ServerStatusDataType;

/**
 * A client of Eclipse Milo. Its argument is the URL of a server without protection; it obeys, words apart by tabs:
 *
 * <pre>
 * read NODE...               the values, apart by tabs; the status where one is not good
 * write NODE TYPE VALUE      the status; TYPE is Boolean, Int16, Int32, Float or Double
 * subscribe NODE             nothing; its values are kept from now on
 * changes                    the values that came since the last time, apart by tabs
 * status                     by how many milliseconds the server's own clock goes behind this one
 * </pre>
 */
public final class MiloClient {
    private MiloClient() {}

    public static void main(String[] arguments) throws Exception {
        OpcUaClient client = OpcUaClient.create(arguments[0]).connect();
        Queue<String> changes = new ConcurrentLinkedQueue<>();
        Lines.serve(words -> switch (words[0]) {
            case "read" -> read(client, words);
            case "write" -> write(client, words);
            case "subscribe" -> subscribe(client, words[1], changes);
            case "changes" -> taken(changes);
            case "status" -> lag(client);
            default -> "what is " + words[0] + "?";
        });
        client.disconnect();
        System.exit(0);
    }

    private static String read(OpcUaClient client, String[] words) throws Exception {
        List<NodeId> nodes = List.of(words).subList(1, words.length).stream().map(NodeId::parse).toList();
        return client.readValues(0, TimestampsToReturn.Both, nodes).stream()
                .map(MiloClient::shown)
                .collect(Collectors.joining("\t"));
    }

    private static String shown(DataValue value) {
        boolean good = value.getStatusCode() == null || value.getStatusCode().isGood();
        return good ? String.valueOf(value.getValue().getValue()) : value.getStatusCode().toString();
    }

    private static String write(OpcUaClient client, String[] words) throws Exception {
        Object value = switch (words[2]) {
            case "Boolean" -> Boolean.valueOf(words[3]);
            case "Int16" -> Short.valueOf(words[3]);
            case "Int32" -> Integer.valueOf(words[3]);
            case "Float" -> Float.valueOf(words[3]);
            default -> Double.valueOf(words[3]);
        };
        var written = List.of(DataValue.valueOnly(new Variant(value)));
        return client.writeValues(List.of(NodeId.parse(words[1])), written).get(0).isGood() ? "good" : "bad";
    }

    private static String subscribe(OpcUaClient client, String node, Queue<String> changes) throws Exception {
        OpcUaSubscription subscription = new OpcUaSubscription(client, 50.0);
        subscription.create();
        OpcUaMonitoredItem item = OpcUaMonitoredItem.newDataItem(NodeId.parse(node));
        item.setDataValueListener((from, value) -> changes.add(shown(value)));
        subscription.addMonitoredItem(item);
        subscription.synchronizeMonitoredItems();
        return "subscribed";
    }

    private static String taken(Queue<String> changes) {
        StringBuilder answer = new StringBuilder();
        for (String change = changes.poll(); change != null; change = changes.poll()) {
            answer.append(answer.isEmpty() ? "" : "\t").append(change);
        }
        return answer.toString();
    }

    private static String lag(OpcUaClient client) throws Exception {
        DataValue value = client.readValue(0, TimestampsToReturn.Both, NodeIds.Server_ServerStatus);
        var structure =
                (org.eclipse.milo.opcua.stack.core.types.builtin.ExtensionObject) value.getValue().getValue();
        var status = (ServerStatusDataType) structure.decode(client.getStaticEncodingContext());
        return String.valueOf(System.currentTimeMillis() - status.getCurrentTime().getJavaTime());
    }
}
