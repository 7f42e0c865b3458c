package tickbus.machines.cell;

import java.io.IOException;
import java.nio.file.Files;
import java.nio.file.Path;
import java.util.ArrayList;
import java.util.List;
import java.util.stream.Stream;
import tickbus.machines.demo.HtmlPage;

/** The HTML page about the run: the recording's page, with the nets drawn at its end. */
final class CellPage {
    private CellPage() {
    }

    /** Makes the page; returns the error, or null. */
    static String make(CellOptions options, Path page, Path statistics) {
        String trouble = HtmlPage.make(options.plc(), List.of(options.recording().toString(), "--out", page.toString(),
                "--stats", statistics.toString(), "--text", options.report().toString()));
        if (trouble != null) {
            return trouble;
        }
        try {
            String html = Files.readString(page);
            int end = html.lastIndexOf("</main>");
            if (end < 0) {
                return "the page about the run has no place for the nets: no </main> in " + page;
            }
            Files.writeString(page, html.substring(0, end) + drawings(nets(options)) + html.substring(end));
            return null;
        } catch (IOException e) {
            return "the nets could not be put into the page: " + e;
        }
    }

    /** The folder in which the nets' process writes them. */
    static Path nets(CellOptions options) {
        return options.report().toAbsolutePath().resolveSibling("nets");
    }

    private static String drawings(Path folder) throws IOException {
        StringBuilder text = new StringBuilder("<section><h2>The nets at the end</h2>\n");
        List<Path> files = new ArrayList<>();
        try (Stream<Path> all = Files.list(folder)) {
            all.filter(file -> file.toString().endsWith(".svg")).sorted().forEach(files::add);
        }
        for (Path file : files) {
            String name = file.getFileName().toString().replace(".svg", "").replace('-', ' ');
            text.append("<h3>").append(name).append("</h3>\n<div style=\"overflow-x:auto\">").append(Files.readString(file))
                    .append("</div>\n");
        }
        return text.append("</section>\n").toString();
    }
}
