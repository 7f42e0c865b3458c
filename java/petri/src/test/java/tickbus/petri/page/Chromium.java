package tickbus.petri.page;

import static org.junit.jupiter.api.Assertions.assertTrue;
import static org.junit.jupiter.api.Assertions.fail;

import java.io.BufferedReader;
import java.io.IOException;
import java.io.InputStreamReader;
import java.net.URI;
import java.net.URLDecoder;
import java.net.http.HttpClient;
import java.net.http.HttpRequest;
import java.net.http.HttpResponse;
import java.nio.charset.StandardCharsets;
import java.nio.file.Files;
import java.nio.file.Path;
import java.util.Base64;
import java.util.regex.Matcher;
import java.util.regex.Pattern;

/** A headless Chromium, controlled by the W3C WebDriver protocol through chromedriver. */
final class Chromium implements AutoCloseable {
    private final HttpClient http = HttpClient.newHttpClient();
    private final Process driver;
    private final String base;

    /** True if chromedriver and a Chromium for it are installed. */
    static boolean isThere() {
        return isOnPath("chromedriver") && (isOnPath("chromium") || isOnPath("google-chrome"));
    }

    private static boolean isOnPath(String command) {
        String path = System.getenv("PATH");
        for (String folder : path == null ? new String[0] : path.split(java.io.File.pathSeparator)) {
            if (Files.isExecutable(Path.of(folder, command))) {
                return true;
            }
        }
        return false;
    }

    /** The port that chromedriver prints, or {@code null} if it ends before. */
    private static String portOf(Process driver) throws IOException {
        var lines = new BufferedReader(new InputStreamReader(driver.getInputStream(), StandardCharsets.UTF_8));
        Pattern started = Pattern.compile("started successfully on port (\\d+)");
        for (String line = lines.readLine(); line != null; line = lines.readLine()) {
            Matcher found = started.matcher(line);
            if (found.find()) {
                return found.group(1);
            }
        }
        return null;
    }

    /** Starts a browser with a window of this many CSS pixels; {@code folder} gets its files. */
    Chromium(int width, int height, Path folder) throws IOException, InterruptedException {
        ProcessBuilder builder = new ProcessBuilder("chromedriver", "--port=0").redirectError(ProcessBuilder.Redirect.DISCARD);
        builder.environment().put("TMPDIR", folder.toString());
        Process started = builder.start();
        String port = portOf(started);
        // Chromedriver looks for a port that is free for IPv4, and ends if another program meanwhile has it on IPv6.
        for (int attempt = 1; port == null && attempt < 5; attempt++) {
            started = builder.start();
            port = portOf(started);
        }
        assertTrue(port != null, "chromedriver tells its port");
        driver = started;
        String answer = call("POST", "http://127.0.0.1:" + port + "/session", "{\"capabilities\":{\"alwaysMatch\":{"
            + "\"goog:chromeOptions\":{\"args\":[\"--headless=new\",\"--no-sandbox\",\"--disable-dev-shm-usage\","
            + "\"--force-device-scale-factor=1\",\"--window-size=" + width + "," + height + "\"]},"
            + "\"goog:loggingPrefs\":{\"browser\":\"ALL\"},\"timeouts\":{\"script\":120000,\"pageLoad\":120000}}}}");
        Matcher session = Pattern.compile("\"sessionId\":\"([^\"]+)\"").matcher(answer);
        assertTrue(session.find(), answer);
        base = "http://127.0.0.1:" + port + "/session/" + session.group(1);
        devtools("Emulation.setDeviceMetricsOverride", "{\"width\":" + width + ",\"height\":" + height
            + ",\"deviceScaleFactor\":1,\"mobile\":" + (width < 640) + "}");
    }

    private String call(String method, String uri, String body) throws IOException, InterruptedException {
        HttpRequest request = HttpRequest.newBuilder(URI.create(uri)).header("Content-Type", "application/json")
            .method(method, body == null ? HttpRequest.BodyPublishers.noBody() : HttpRequest.BodyPublishers.ofString(body)).build();
        HttpResponse<String> answer = http.send(request, HttpResponse.BodyHandlers.ofString());
        if (answer.statusCode() != 200) {
            fail(body + ": " + answer.body());
        }
        return answer.body();
    }

    private static String quoted(String text) {
        return '"' + text.replace("\\", "\\\\").replace("\"", "\\\"").replace("\n", "\\n") + '"';
    }

    void devtools(String command, String parameters) throws IOException, InterruptedException {
        call("POST", base + "/goog/cdp/execute", "{\"cmd\":" + quoted(command) + ",\"params\":" + parameters + "}");
    }

    void go(URI address) throws IOException, InterruptedException {
        call("POST", base + "/url", "{\"url\":" + quoted(address.toString()) + "}");
    }

    /** The value of an expression in the page, as text. */
    String value(String expression) throws IOException, InterruptedException {
        return run("return encodeURIComponent(String(" + expression + "));");
    }

    /** Waits until an expression in the page is true. */
    void await(String condition) throws IOException, InterruptedException {
        run("const begun = Date.now(); while (!(" + condition + ")) { if (Date.now() - begun > 60000) throw new Error("
            + "document.body.innerText); await new Promise((go) => setTimeout(go, 20)); } return '';");
    }

    private String run(String body) throws IOException, InterruptedException {
        String script = "const done = arguments[arguments.length - 1]; (async () => {" + body
            + "})().then((value) => done('=' + value), (error) => done('!' + encodeURIComponent(error)));";
        String answer = call("POST", base + "/execute/async", "{\"script\":" + quoted(script) + ",\"args\":[]}");
        Matcher value = Pattern.compile("\\{\"value\":\"([=!])([^\"]*)\"}").matcher(answer);
        assertTrue(value.matches(), answer);
        String text = URLDecoder.decode(value.group(2), StandardCharsets.UTF_8);
        if (value.group(1).equals("!")) {
            fail(body + ": " + text);
        }
        return text;
    }

    /** The page's log. */
    String complaints() throws IOException, InterruptedException {
        return call("POST", base + "/se/log", "{\"type\":\"browser\"}");
    }

    /** Saves a picture of the window, as PNG. */
    void shoot(Path file) throws IOException, InterruptedException {
        String answer = call("GET", base + "/screenshot", null);
        Matcher picture = Pattern.compile("\"value\":\"([^\"]+)\"").matcher(answer);
        assertTrue(picture.find());
        Files.createDirectories(file.getParent());
        Files.write(file, Base64.getDecoder().decode(picture.group(1)));
    }

    @Override
    public void close() {
        try {
            call("DELETE", base, null);
        } catch (IOException | InterruptedException e) {
            // The driver ends anyway.
        }
        driver.destroy();
    }
}
