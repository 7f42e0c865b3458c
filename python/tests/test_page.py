"""The live page of a simulation in Python."""

import json
import urllib.error
import urllib.request

import pytest

import tickbus


@pytest.fixture
def paged(line_cfg):
    """A driver.cfg whose driver is shown on a page, and edited there."""
    line_cfg.write_text(line_cfg.read_text() + '\n[page]\nlisten = "127.0.0.1:0"\nedit = true\n')
    return line_cfg


def ask(url, path, method="GET", body=None):
    """The answer to a request, with the token of the page."""
    room, token = url.split("/#token=")
    headers = {"Authorization": f"Bearer {token}"}
    request = urllib.request.Request(room + path, method=method, data=body, headers=headers)
    with urllib.request.urlopen(request, timeout=30) as answer:
        return json.load(answer)


def pages(url):
    """The names of the tabs that are pages of their own, without the views of the first one."""
    return [tab["name"] for tab in ask(url, "/tabs") if "#" not in tab["path"]]


def test_a_driver_is_shown_forced_and_edited_on_its_page(paged, capfd):
    with tickbus.open(paged) as driver:
        url = driver.page()
        assert f"tickbus: live page at {url}\n" in capfd.readouterr().err
        assert [tab["path"] for tab in ask(url, "/tabs")] == ["/", "/#signals", "/#line", "/#recording", "/studio"]
        ask(url, "/force/7/Height", "PUT", b"250")
        driver["Height"].value = 100
        for tick in range(1, 4):
            driver.exchange(tick * 0.01)
        # The PLC, which copies the height, sees what is forced.
        assert driver["Speed"].value == pytest.approx(250, abs=0.1)
        state = ask(url, "/studio/state/0")
        assert state["line"]["owner"]["id"] == 7
    with pytest.raises(urllib.error.URLError):
        ask(url, "/tabs")


def test_two_drivers_share_a_page(paged, tmp_path):
    second = tmp_path / "second.cfg"
    second.write_text(paged.read_text().replace("id   = 7", "id   = 8").replace('"Line"', '"Other"'))
    with tickbus.open(paged) as driver, tickbus.open(second) as other:
        assert driver.page() == other.page()
        assert pages(driver.page()) == ["Overview", "Studio: Line", "Studio: Other"]


def test_a_driver_for_this_computer_alone_is_not_shown_beyond_it(paged, tmp_path):
    second = tmp_path / "second.cfg"
    second.write_text(paged.read_text().replace("id   = 7", "id   = 8").replace('"Line"', '"Other"'))
    with tickbus.open(paged, {"page": {"listen": "0.0.0.0:0"}}):
        with pytest.raises(tickbus.FieldbusError, match=r"second\.cfg: \[page\] listens on 127\.0\.0\.1:0 alone.*open this driver first"):
            tickbus.open(second)


def test_a_forked_child_has_its_own_page(paged, python):
    result = python(
        """
import os, sys, urllib.request
import tickbus
line = tickbus.open(sys.argv[1])
url = line.page()
child = os.fork()
if child == 0:
    with tickbus.open(sys.argv[1]) as own:
        assert own.page() != url
        urllib.request.urlopen(own.page(), timeout=30).close()
    os._exit(0)
assert os.waitpid(child, 0)[1] == 0
urllib.request.urlopen(url, timeout=30).close()
line.close()
print("ok")
""",
        paged,
    )
    assert (result.returncode, result.stdout.strip()) == (0, "ok"), result.stderr


def test_rows_of_a_vector_are_not_shown(paged):
    with tickbus.open_vector(paged, 3) as vector:
        assert [driver.page() for driver in vector] == [None] * 3
        with tickbus.open(paged) as driver:
            assert pages(driver.page()) == ["Overview", "Studio"]
            assert vector[0].page() is None


def test_a_driver_without_a_page_has_no_address(line):
    assert line.page() is None
