"""The interpreter survives every misuse of a driver."""

import gc
import threading
import warnings

import pytest

import tickbus
from tickbus import Status


def test_after_closing_everything_says_so(line_cfg):
    line = tickbus.open(line_cfg)
    start, run = line["Start"], line["Run"]
    line.close()
    line.close()
    assert line.closed
    assert repr(line) == "<Driver 'Line' (7) closed>"
    calls = [
        line.exchange,
        line.receive,
        line.send,
        line.statistics,
        line.events,
        line.faults,
        lambda: line.inject(kind="stuck", signal="Start"),
        lambda: start.value,
        lambda: setattr(start, "value", 1),
        lambda: run.edges,
    ]
    for call in calls:
        with pytest.raises(tickbus.FieldbusError, match="CLOSED \\(-3\\)") as caught:
            call()
        assert caught.value.status is Status.CLOSED
    assert line["Start"] is start
    assert start.name == "Start"


def test_a_with_statement_closes_even_after_an_exception(line_cfg):
    with pytest.raises(ZeroDivisionError), tickbus.open(line_cfg) as line:
        1 / 0
    assert line.closed


@pytest.mark.parametrize("path", [3, None, 1.5, [], object()])
def test_what_is_no_path_is_refused(path):
    with pytest.raises(TypeError):
        tickbus.open(path)


def test_wrong_types_are_refused(line):
    for call in (lambda: line[3], lambda: line.signal(None), lambda: line.exchange([]), lambda: line.exchange(ns=1.5)):
        with pytest.raises(TypeError):
            call()
    with pytest.raises(AttributeError):
        line["Start"].name = "x"
    with pytest.raises(TypeError):
        tickbus.Signal()


def test_a_driver_that_is_forgotten_is_closed_with_a_warning(line_cfg):
    with pytest.warns(ResourceWarning, match="unclosed driver <Driver 'Line'"):
        tickbus.open(line_cfg)
        gc.collect()


def test_all_places_are_taken_and_come_back(line_cfg):
    drivers = []
    with pytest.raises(tickbus.FieldbusError, match='4096 drivers are open, and that is the most: "Line"') as caught:
        while True:
            drivers.append(tickbus.open(line_cfg))
    assert caught.value.status is Status.TOO_MANY_DRIVERS
    assert len(drivers) == 4096
    for driver in drivers:
        driver.close()
    tickbus.open(line_cfg).close()


def test_two_threads_never_are_in_one_driver_at_once(line_cfg):
    """Each call is done completely or refused; none is done twice or in part."""
    done = [0, 0, 0]
    with tickbus.open(line_cfg) as line:
        start = threading.Barrier(3)

        def work(number):
            start.wait()
            for _ in range(3000):
                try:
                    if number == 2:
                        assert line.statistics()["state"]
                    else:
                        line.exchange()
                    done[number] += 1
                except tickbus.FieldbusError as error:
                    assert error.status is Status.BUSY

        threads = [threading.Thread(target=work, args=(number,)) for number in range(3)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        assert line.statistics()["ticks"] == str(done[0] + done[1])
    assert done[0] + done[1] > 3000


def test_a_thread_may_close_while_another_one_ticks(line_cfg):
    line = tickbus.open(line_cfg)
    seen = []

    def tick():
        try:
            while True:
                line.exchange()
        except tickbus.FieldbusError as error:
            seen.append(error.status)

    thread = threading.Thread(target=tick)
    thread.start()
    while line.ticks < 100:
        pass
    assert line.statistics()["state"]
    line.inject(kind="stuck", signal="Start", value=True, at="1000h").end()
    line.close()
    thread.join(30)
    assert seen == [Status.CLOSED]


def test_a_loop_ends_when_the_run_on_virtual_time_is_over(virtual_run):
    config = virtual_run(1)(1, "device", '[[signal]]\nname = "Start"\naddress = "%IX0.0"\n')
    with tickbus.open(config) as driver:
        turns = 0
        for turn in driver.every("1ms"):
            assert turn.lag >= 0 and not driver.is_over
            driver.exchange(ns=turns * 2_000_000)
            turns += 1
        assert driver.is_over
    # A step of 2 ms for each turn, in 200 ms; the turn at the end of the last one does not take place.
    assert turns == 101


def test_the_lock_is_released_while_a_stepped_bus_waits(virtual_run):
    """In lock-step over virtual time, a tick waits for the other participant, which is a thread of this interpreter."""
    cfg = virtual_run(2)

    def take_part(file, name, ticks):
        with tickbus.open(file) as driver:
            for tick in range(50):
                driver.exchange(ns=(tick + 1) * 2_000_000)
                if driver[name].value:
                    ticks.append(tick)
                if name == "Run":
                    driver["Start"].value = True
                else:
                    driver["Run"].value = driver["Start"].value

    seen = [], []
    machine = threading.Thread(target=take_part, args=(cfg(1, "device"), "Run", seen[0]))
    plc = threading.Thread(target=take_part, args=(cfg(2, "controller"), "Start", seen[1]))
    for thread in (machine, plc):
        thread.start()
    for thread in (machine, plc):
        thread.join(30)
        assert not thread.is_alive()
    assert seen[0] and seen[1]


def test_a_forked_child_leaves_the_driver_alone_and_may_open_its_own(python, line_cfg):
    result = python(
        """
import os, sys, gc, warnings
import tickbus
warnings.simplefilter("error")
line = tickbus.open(sys.argv[1], {"fieldbus": {"kind": "loopback", "program": "mirror"}})
line.exchange()
child = os.fork()
if child == 0:
    try:
        line.exchange()
    except tickbus.FieldbusError as error:
        assert error.status is tickbus.Status.NOT_OPEN and "forked child" in str(error), error
    else:
        os._exit(2)
    assert line.closed
    line.close()
    del line
    gc.collect()
    with tickbus.open(sys.argv[1]) as own:
        own.exchange(0.002)
    sys.exit(0)
assert os.waitpid(child, 0)[1] == 0
assert not line.closed
line.exchange()
line.close()
print("ok")
""",
        line_cfg,
    )
    assert (result.returncode, result.stdout.strip()) == (0, "ok"), result.stderr


def test_the_interpreter_shuts_down_with_drivers_open(python, line_cfg, tmp_path):
    recording = tmp_path / "last.csv"
    result = python(
        """
import sys, threading
import tickbus
line = tickbus.open(sys.argv[1], {"record": {"file": sys.argv[2]}})
free = tickbus.open(sys.argv[1], {"fieldbus": {"kind": "modbus-server", "address": "127.0.0.1:0"}})
signal, slots = line["Parts"], line.slots
line.receive(0.0)
signal.value = 4711
free.exchange()
def tick():
    try:
        while True:
            free.exchange()
    except tickbus.FieldbusError as error:
        assert error.status is tickbus.Status.CLOSED
threading.Thread(target=tick, daemon=True).start()
keep = [line, free, signal, slots]
keep.append(keep)
""",
        line_cfg,
        recording,
    )
    assert result.returncode == 0, result.stderr
    assert "Traceback" not in result.stderr, result.stderr
    assert "4711" in recording.read_text().splitlines()[-1]


def test_ctrl_c_ends_a_simulation_and_closes_its_driver(python, line_cfg):
    result = python(
        """
import os, signal, sys, threading
import tickbus
# A shell that runs the tests in the background ignores SIGINT.
signal.signal(signal.SIGINT, signal.default_int_handler)
threading.Timer(0.3, os.kill, (os.getpid(), signal.SIGINT)).start()
try:
    with tickbus.open(sys.argv[1]) as line:
        while True:
            line.exchange()
except KeyboardInterrupt:
    assert line.closed
    print("interrupted")
""",
        line_cfg,
    )
    assert (result.returncode, result.stdout.strip()) == (0, "interrupted"), result.stderr


def test_multiprocessing_starts_children_of_either_kind(python, line_cfg):
    result = python(
        """
import multiprocessing, sys
import tickbus

line = tickbus.open(sys.argv[1])
with multiprocessing.get_context("fork").Pool(2) as pool:
    assert pool.map(abs, [-1, -2]) == [1, 2]
line.exchange(0.002)
line.close()
print("ok")
""",
        line_cfg,
    )
    assert (result.returncode, result.stdout.strip()) == (0, "ok"), result.stderr


def test_a_signal_ends_a_child_from_its_first_moment(python, line_cfg):
    result = python(
        """
import os, signal, sys, time
import tickbus

line = tickbus.open(sys.argv[1])
for number in [signal.SIGTERM, signal.SIGHUP] * 5:
    child = os.fork()
    if child == 0:
        never, _ = os.pipe()
        os.read(never, 1)
    os.kill(child, number)
    _, status = os.waitpid(child, 0)
    assert os.WTERMSIG(status) == number, status
assert not signal.pthread_sigmask(signal.SIG_BLOCK, [])
line.exchange(0.002)
line.close()
print("ok")
""",
        line_cfg,
    )
    assert (result.returncode, result.stdout.strip()) == (0, "ok"), result.stderr


def test_no_warning_of_a_closed_driver(line_cfg):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        tickbus.open(line_cfg).close()
        gc.collect()
