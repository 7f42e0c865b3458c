"""Many drivers in one call, and resets."""

import threading

import pytest

import tickbus
from tickbus import Status


@pytest.fixture
def lines(line_cfg):
    with tickbus.open_vector(line_cfg, 50) as vector:
        yield vector


def test_each_driver_has_its_own_values_and_its_own_time(lines):
    for tick in range(4):
        for place, line in enumerate(lines):
            line["Parts"].value = place
        assert lines.exchange(ns=[tick * (2_000_000 + place) for place in range(50)]) == 0
    assert [line["Parts back"].value for line in lines] == list(range(50))
    assert list(lines.statuses) == [Status.FRESH] * 50
    assert lines.receive([0.1 + place for place in range(50)]) == 0
    assert lines.send() == 0
    assert [line.ticks for line in lines] == [5] * 50
    assert [line.granted > 0.1 + place for place, line in enumerate(lines)] == [True] * 50
    assert lines.exchange(100) == lines.exchange() == 0


def test_numpy_sees_a_row_for_each_driver_and_copies_nothing(lines):
    numpy = pytest.importorskip("numpy", reason="there is no NumPy")
    values = numpy.asarray(lines.slots)
    whole = numpy.asarray(lines.integer_slots)
    assert values.shape == (50, len(lines[0].slots))
    parts, back, exact = (lines.signal(name).slot for name in ("Parts", "Parts back", "whole"))
    values[:, parts] = numpy.arange(50)
    whole[:, exact] = 2**60 + numpy.arange(50)
    assert lines[7]["Parts"].value == 7
    assert lines[7]["whole"].value == 2**60 + 7
    for time in numpy.arange(3) * 0.01:
        assert lines.exchange(numpy.full(50, time)) == 0
    assert (values[:, back] == numpy.arange(50)).all()
    assert (numpy.asarray(lines.statuses) == 0).all()
    assert lines.exchange(ns=numpy.full(50, 10**9)) == lines.exchange(numpy.float64(2)) == 0
    assert bytes(lines.slots) == values.tobytes()
    assert lines.slots.tolist() == values.tolist()
    lines.close()
    assert values[7, parts] == 7, "the memory stays"


def test_a_driver_that_fails_stops_no_other_one(lines):
    assert lines.exchange(1.0) == 0
    lines[10].close()
    times = [2.0] * 50
    times[20] = 0.5
    assert lines.exchange(times) == 2
    expected = [Status.FRESH] * 50
    expected[10], expected[20] = Status.CLOSED, Status.BUS_FAILED
    assert list(lines.statuses) == expected
    assert lines.reset([place in (10, 20) for place in range(50)]) == 1
    assert lines.statuses[10] == Status.CLOSED and lines.statuses[20] == Status.STALE
    assert lines[21].ticks == 2 and lines[20].ticks == 0
    assert lines.exchange([3.0 if place != 20 else 0.0 for place in range(50)]) == 1


def test_wrong_lists_are_refused(lines, line_cfg):
    for count in (0, -1, 4097):
        with pytest.raises(ValueError, match=f"num_envs is {count}; expected 1 to 4096"):
            tickbus.open_vector(line_cfg, count)
    with pytest.raises(ValueError, match="there are 0 drivers"):
        tickbus.DriverVector([])
    with pytest.raises(ValueError, match="is in the list twice"):
        tickbus.DriverVector([lines[0], lines[1], lines[0]])
    with pytest.raises(TypeError, match="not str"):
        tickbus.DriverVector([lines[0], "line"])
    for call in (lines.exchange, lines.receive):
        with pytest.raises(ValueError, match="there are 49 times; expected one for each of the 50 drivers"):
            call([1.0] * 49)
        with pytest.raises(ValueError, match="there are 51 times"):
            call(ns=[1] * 51)
        with pytest.raises(ValueError, match="is no simulation time"):
            call([float("nan")] * 50)
        with pytest.raises(TypeError):
            call("now")
        with pytest.raises(TypeError, match="not both"):
            call(1.0, ns=1)
        with pytest.raises(TypeError):
            call(object())
    with pytest.raises(ValueError, match="there are 2 places in the mask"):
        lines.reset([True, False])
    assert [line.ticks for line in lines] == [0] * 50


def test_drivers_that_were_opened_one_by_one_tick_together_without_a_common_array(line_cfg):
    with tickbus.DriverVector(tickbus.open(line_cfg) for _ in range(3)) as lines:
        assert lines.exchange(0.0) == 0
        with pytest.raises(TypeError, match="opened one by one"):
            lines.slots
    with tickbus.open_vector(line_cfg, 3) as all_of_them:
        with pytest.raises(TypeError, match="opened one by one"):
            tickbus.DriverVector(list(all_of_them)[::-1]).slots


def test_a_vector_that_cannot_be_opened_leaves_no_driver_open(line_cfg):
    opened = []

    def overlay(place):
        opened.append(place)
        return {"fieldbus": {"kind": "nothing"}} if place == 2 else None

    with pytest.raises(tickbus.FieldbusError, match="nothing"):
        tickbus.open_vector(line_cfg, 4, overlay)
    assert opened == [0, 1, 2]


def test_two_threads_at_once_meet_busy_drivers_and_lose_no_tick(lines):
    done = [0, 0]
    start = threading.Barrier(2)

    def work(number):
        start.wait()
        for _ in range(200):
            done[number] += 50 - lines.exchange()

    threads = [threading.Thread(target=work, args=(number,)) for number in range(2)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert sum(line.ticks for line in lines) == sum(done) > 200 * 50
    assert sum(int(line.statistics()["ticks"]) for line in lines) == sum(done)


def episode(line, ticks=6):
    seen = []
    for tick in range(ticks):
        line["Parts"].value = tick + 1
        line["Start"].value = tick % 2
        line.exchange(tick * 0.002)
        seen.append((line["Parts back"].value, line["Speed"].value, line["Run"].edges, line.granted_ns))
    return seen


def test_a_reset_begins_the_next_episode(line):
    first = episode(line)
    line.inject(kind="stuck", signal="Parts back", value=77)
    line.exchange(1.0)
    for _ in range(3):
        line.reset()
        assert line.ticks == line.sequence == 0
        assert line["Speed"].value == 7.5 and line["Parts"].value == 0
        assert line.statistics()["plc.scans"] == "0"
        assert episode(line) == first
    line.close()
    with pytest.raises(tickbus.FieldbusError) as caught:
        line.reset()
    assert caught.value.status is Status.CLOSED
