package tickbus;

import java.nio.file.Path;

/** {@code EndInATick CFG RECORDING return|exit|hook}: a program that ends with its driver open, while another one ticks. */
final class EndInATick {
    private EndInATick() {
    }

    public static void main(String[] arguments) throws Exception {
        Path cfg = Path.of(arguments[0]);
        Tickbus bus = Tickbus.open(cfg, "[record]\nfile = '" + arguments[1] + "'\n");
        Tickbus busy = Tickbus.open(cfg);
        bus.exchange();
        bus.receive();
        bus.signal("in").set(4711);
        Thread ticks = new Thread(() -> {
            try {
                while (true) {
                    busy.exchange();
                }
            } catch (FieldbusException e) {
                if (e.status() != Status.CLOSED) {
                    throw e;
                }
            }
        });
        ticks.setDaemon(true);
        ticks.start();
        switch (arguments[2]) {
            case "exit" -> System.exit(0);
            case "hook" -> {
                Runtime.getRuntime().addShutdownHook(new Thread(() -> {
                    busy.close();
                    bus.close();
                    System.out.println("closed");
                }));
                System.exit(3);
            }
            default -> { }
        }
    }
}
