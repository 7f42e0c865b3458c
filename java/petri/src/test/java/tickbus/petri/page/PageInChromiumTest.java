package tickbus.petri.page;

import static org.junit.jupiter.api.Assertions.assertEquals;
import static org.junit.jupiter.api.Assertions.assertFalse;
import static org.junit.jupiter.api.Assertions.assertTrue;
import static org.junit.jupiter.api.Assumptions.assumeTrue;

import java.net.URI;
import java.nio.file.Path;
import org.junit.jupiter.api.BeforeEach;
import org.junit.jupiter.api.Tag;
import org.junit.jupiter.api.Test;
import org.junit.jupiter.api.io.TempDir;

/** The page in a real browser, with nets that run in this process. Pictures of it are in {@code target/page}. */
@Tag("native")
class PageInChromiumTest {
    private static final Path PICTURES = Path.of("target", "page");
    private static final String START = "document.querySelector('[data-transition=\"0\"]')";

    @TempDir
    Path folder;

    @BeforeEach
    void needsABrowser() {
        assumeTrue(Chromium.isThere(), "there is no chromium or no chromedriver (apt-get install chromium chromium-driver)");
    }

    private static String tokens(int place) {
        return "document.querySelectorAll('[data-place=\"" + place + "\"] .net-dot').length";
    }

    private static String row(int transition, String cell) {
        return "document.querySelectorAll('#transitions tbody tr')[" + transition + "].querySelector('" + cell + "')";
    }

    @Test
    void markingsAreSeenAsTheyChangeByTwoViewersWithWhatHoldsATransitionBack() throws Exception {
        try (Scanning scanning = new Scanning(); NetPage page = NetPage.open("127.0.0.1:0", "The press", scanning.watch);
                Chromium one = new Chromium(1200, 800, folder); Chromium phone = new Chromium(390, 844, folder)) {
            phone.devtools("Emulation.setEmulatedMedia", "{\"features\":[{\"name\":\"prefers-color-scheme\",\"value\":\"dark\"}]}");
            for (Chromium viewer : new Chromium[] {one, phone}) {
                viewer.go(page.address());
                viewer.await("document.getElementById('link').textContent === 'live'");
                viewer.await(START + "?.classList.contains('net-held')");
                assertEquals("The press", viewer.value("document.title"));
                assertEquals("press <1>", viewer.value("document.querySelector('#net-title').textContent"));
                assertEquals("1", viewer.value(tokens(0)));
                assertEquals("7", viewer.value("document.querySelector('[data-place=\"3\"] .net-number').textContent"));
                assertEquals("part there on 0", viewer.value("document.querySelector('.holds-back').textContent"));
                assertEquals("guard on 1", viewer.value("document.querySelector('.holds').textContent"));
                assertEquals("held back", viewer.value(row(0, ".phase") + ".textContent"));
                assertEquals("true", viewer.value("document.documentElement.scrollWidth <= innerWidth"));
                assertEquals("true", viewer.value("document.querySelector('.part').offsetHeight < 40"), "it is not broken in pieces");
            }
            one.shoot(PICTURES.resolve("held.png"));
            scanning.part(true);
            for (Chromium viewer : new Chromium[] {one, phone}) {
                viewer.await("Number(" + row(2, "td:nth-of-type(3)") + ".textContent) > 20");
                viewer.await("document.querySelector('.net-fired')");
                viewer.await("Number(document.querySelector('[data-place=\"3\"] .net-number').textContent) > 27");
                viewer.await(tokens(1) + " === 1");
                viewer.await("document.querySelector('#outputs tbody td').textContent === '1.5'");
            }
            one.shoot(PICTURES.resolve("runs.png"));
            phone.shoot(PICTURES.resolve("phone-dark.png"));
            phone.value("document.querySelector('#lists').scrollIntoView()");
            phone.shoot(PICTURES.resolve("phone-dark-lists.png"));
            scanning.part(false);
            one.await(tokens(1) + " === 0");
            one.await(tokens(2) + " === 1");
            one.await("document.querySelector('.holds-back')?.textContent.trim() === 'a condition in code'");
            scanning.guard(false);
            scanning.part(true);
            one.await("document.querySelector('.holds-back')?.textContent === 'guard on 0'");
            assertTrue(one.complaints().endsWith("\"value\":[]}"), one.complaints());
            assertTrue(phone.complaints().endsWith("\"value\":[]}"), phone.complaints());
        }
    }

    @Test
    void itIsUsedWithTheKeyboardAndHeldStill() throws Exception {
        try (Scanning scanning = new Scanning(); NetPage page = NetPage.open("127.0.0.1:0", "The press", scanning.watch);
                Chromium viewer = new Chromium(900, 700, folder)) {
            viewer.go(page.address());
            viewer.await(START);
            assertEquals("null", viewer.value(START + ".closest('[role=img]')"), "a picture would hide its buttons");
            viewer.value(START + ".focus()");
            assertEquals("transition start, held back", viewer.value("document.activeElement.getAttribute('aria-label')"));
            viewer.value(START + ".dispatchEvent(new KeyboardEvent('keydown', {key: 'Enter', bubbles: true}))");
            assertEquals("start", viewer.value("document.querySelector('tr.chosen button').textContent"));
            viewer.value(row(1, "button") + ".click()");
            assertEquals("1", viewer.value("document.querySelector('.net-chosen').dataset.transition"));
            String drawing = "document.getElementById('drawing')";
            viewer.await(drawing + ".scrollHeight <= " + drawing + ".clientHeight && " + drawing + ".getBoundingClientRect().bottom <= innerHeight");
            viewer.value("document.getElementById('full').click()");
            assertEquals("true", viewer.value("document.getElementById('full').getAttribute('aria-pressed')"));
            viewer.value("document.getElementById('hold').click()");
            viewer.await("document.getElementById('link').textContent === 'held still'");
            String shown = viewer.value("document.body.dataset.shown");
            String text = viewer.value("document.querySelector('#net-facts').textContent");
            long scans = scanning.scans();
            scanning.part(true);
            viewer.await("(await (await fetch(room.base + '/state')).json()).sets[0].nets[0].scans > " + (scans + 100));
            assertEquals(shown, viewer.value("document.body.dataset.shown"));
            assertEquals(text, viewer.value("document.querySelector('#net-facts').textContent"));
            viewer.value("document.getElementById('hold').click()");
            viewer.await("document.querySelector('#net-facts').textContent !== " + "`" + text + "`");
        }
    }

    @Test
    void aServerThatComesBackIsShownAgainAndOneThatIsGoneOrNetsThatStandStillAreSaidToBeOld() throws Exception {
        try (Scanning scanning = new Scanning(); Chromium viewer = new Chromium(900, 700, folder)) {
            URI address;
            try (NetPage page = NetPage.open("127.0.0.1:0", "First", scanning.watch)) {
                address = page.address();
                viewer.go(address);
                // The page is live before it has a state of the nets.
                viewer.await("document.querySelector('#net-facts').textContent.startsWith('time')");
                scanning.standStill();
                viewer.await("document.querySelector('#net-old').innerText.startsWith('Not scanned for')");
                viewer.shoot(PICTURES.resolve("still.png"));
                scanning.goOn();
                viewer.await("document.querySelector('#net-old').hidden");
            }
            viewer.await("document.getElementById('link').textContent === 'no connection'");
            viewer.await("document.getElementById('age').innerText.startsWith('No connection to the nets')");
            assertEquals("true", viewer.value("document.body.classList.contains('is-old')"));
            viewer.shoot(PICTURES.resolve("old.png"));
            // A restarted program has other nets; this one shows the same nets under another title.
            try (NetPage again = NetPage.open("127.0.0.1:" + address.getPort(), "Second", scanning.watch)) {
                assertEquals(address, again.address());
                viewer.await("document.title === 'Second'");
                viewer.await("document.getElementById('link').textContent === 'live'");
                assertFalse(Boolean.parseBoolean(viewer.value("document.body.classList.contains('is-old')")));
                assertEquals("1", viewer.value("document.querySelectorAll('#choice li').length"));
            }
        }
    }
}
