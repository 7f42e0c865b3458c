package peers;

import java.util.List;
import java.util.Map;
import java.util.Set;
import java.util.TreeMap;
import org.eclipse.milo.opcua.sdk.core.AccessLevel;
import org.eclipse.milo.opcua.sdk.core.Reference;
import org.eclipse.milo.opcua.sdk.server.EndpointConfig;
import org.eclipse.milo.opcua.sdk.server.ManagedNamespaceWithLifecycle;
import org.eclipse.milo.opcua.sdk.server.OpcUaServer;
import org.eclipse.milo.opcua.sdk.server.OpcUaServerConfig;
import org.eclipse.milo.opcua.sdk.server.items.DataItem;
import org.eclipse.milo.opcua.sdk.server.items.MonitoredItem;
import org.eclipse.milo.opcua.sdk.server.nodes.UaVariableNode;
import org.eclipse.milo.opcua.sdk.server.util.SubscriptionModel;
import org.eclipse.milo.opcua.stack.core.NodeIds;
import org.eclipse.milo.opcua.stack.core.security.DefaultCertificateManager;
import org.eclipse.milo.opcua.stack.core.security.MemoryCertificateQuarantine;
import org.eclipse.milo.opcua.stack.core.transport.TransportProfile;
import org.eclipse.milo.opcua.stack.core.types.builtin.DataValue;
import org.eclipse.milo.opcua.stack.core.types.builtin.LocalizedText;
import org.eclipse.milo.opcua.stack.core.types.builtin.NodeId;
import org.eclipse.milo.opcua.stack.core.types.builtin.Variant;
import org.eclipse.milo.opcua.stack.transport.server.tcp.OpcTcpServerTransport;
import org.eclipse.milo.opcua.stack.transport.server.tcp.OpcTcpServerTransportConfig;

/**
 * A server of Eclipse Milo, without protection. Its arguments are the port and the nodes, each NAME:TYPE:VALUE with TYPE
 * Boolean, Int16, Int32, Float or Double; they are ns=2;s=NAME. It obeys, words apart by tabs:
 *
 * <pre>
 * get NAME                   the value
 * set NAME VALUE             "set"
 * written                    the names of the nodes that clients wrote, in order of their names, and how often: NAME=N
 * </pre>
 */
public final class MiloServer {
    private static final String URI = "urn:test:milo";

    private MiloServer() {}

    public static void main(String[] arguments) throws Exception {
        EndpointConfig endpoint = EndpointConfig.newBuilder()
                .setTransportProfile(TransportProfile.TCP_UASC_UABINARY)
                .setBindAddress("127.0.0.1")
                .setBindPort(Integer.parseInt(arguments[0]))
                .setHostname("127.0.0.1")
                .build();
        OpcUaServerConfig config = OpcUaServerConfig.builder()
                .setApplicationName(LocalizedText.english("Milo"))
                .setApplicationUri(URI)
                .setProductUri(URI)
                .setEndpoints(Set.of(endpoint))
                .setCertificateManager(new DefaultCertificateManager(new MemoryCertificateQuarantine()))
                .build();
        OpcUaServer server =
                new OpcUaServer(config, profile -> new OpcTcpServerTransport(OpcTcpServerTransportConfig.newBuilder().build()));
        Plc plc = new Plc(server, List.of(arguments).subList(1, arguments.length));
        plc.startup();
        server.startup().get();
        Lines.serve(words -> switch (words[0]) {
            case "get" -> String.valueOf(plc.nodes.get(words[1]).getValue().getValue().getValue());
            case "set" -> plc.set(words[1], words[2]);
            case "written" -> plc.written();
            default -> "what is " + words[0] + "?";
        });
        System.exit(0);
    }

    /** The namespace of the PLC. */
    private static final class Plc extends ManagedNamespaceWithLifecycle {
        private final Map<String, UaVariableNode> nodes = new TreeMap<>();
        private final Map<String, Integer> writes = new TreeMap<>();
        private final SubscriptionModel subscriptions;

        Plc(OpcUaServer server, List<String> declared) {
            super(server, URI + ":plc");
            subscriptions = new SubscriptionModel(server, this);
            getLifecycleManager().addLifecycle(subscriptions);
            getLifecycleManager().addStartupTask(() -> declared.forEach(this::add));
        }

        private void add(String declared) {
            String[] parts = declared.split(":");
            String name = parts[0];
            NodeId type = switch (parts[1]) {
                case "Boolean" -> NodeIds.Boolean;
                case "Int16" -> NodeIds.Int16;
                case "Int32" -> NodeIds.Int32;
                case "Float" -> NodeIds.Float;
                default -> NodeIds.Double;
            };
            UaVariableNode node = new UaVariableNode.UaVariableNodeBuilder(getNodeContext())
                    .setNodeId(newNodeId(name))
                    .setBrowseName(newQualifiedName(name))
                    .setDisplayName(LocalizedText.english(name))
                    .setDataType(type)
                    .setTypeDefinition(NodeIds.BaseDataVariableType)
                    .setAccessLevel(AccessLevel.READ_WRITE)
                    .setUserAccessLevel(AccessLevel.READ_WRITE)
                    .build();
            node.setValue(new DataValue(new Variant(parsed(type, parts[2]))));
            node.addReference(new Reference(
                    node.getNodeId(), NodeIds.HasComponent, NodeIds.ObjectsFolder.expanded(), false));
            getNodeManager().addNode(node);
            nodes.put(name, node);
        }

        private static Object parsed(NodeId type, String text) {
            if (type.equals(NodeIds.Boolean)) {
                return Boolean.valueOf(text);
            } else if (type.equals(NodeIds.Int16)) {
                return Short.valueOf(text);
            } else if (type.equals(NodeIds.Int32)) {
                return Integer.valueOf(text);
            } else if (type.equals(NodeIds.Float)) {
                return Float.valueOf(text);
            }
            return Double.valueOf(text);
        }

        String set(String name, String value) {
            UaVariableNode node = nodes.get(name);
            node.setValue(new DataValue(new Variant(parsed(node.getDataType(), value))));
            return "set";
        }

        synchronized String written() {
            return writes.toString();
        }

        @Override
        public List<org.eclipse.milo.opcua.stack.core.types.builtin.StatusCode> write(
                org.eclipse.milo.opcua.sdk.server.AddressSpace.WriteContext context,
                List<org.eclipse.milo.opcua.stack.core.types.structured.WriteValue> values) {
            synchronized (this) {
                values.forEach(value -> writes.merge(value.getNodeId().getIdentifier().toString(), 1, Integer::sum));
            }
            return super.write(context, values);
        }

        @Override
        public void onDataItemsCreated(List<DataItem> items) {
            subscriptions.onDataItemsCreated(items);
        }

        @Override
        public void onDataItemsModified(List<DataItem> items) {
            subscriptions.onDataItemsModified(items);
        }

        @Override
        public void onDataItemsDeleted(List<DataItem> items) {
            subscriptions.onDataItemsDeleted(items);
        }

        @Override
        public void onMonitoringModeChanged(List<MonitoredItem> items) {
            subscriptions.onMonitoringModeChanged(items);
        }
    }
}
