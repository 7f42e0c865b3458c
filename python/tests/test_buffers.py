"""The slots as a buffer, in NumPy."""

import gc
import threading

import numpy
import pytest

import tickbus


def test_numpy_takes_the_slots_without_copying(line):
    values = numpy.asarray(line.slots)
    assert values.dtype == numpy.float64
    assert values.shape == (len(line.signals) + 1,)
    assert values.flags.writeable
    assert numpy.shares_memory(values, numpy.asarray(line.slots))
    values[line["Height"].slot] = 250
    assert line["Height"].value == 250
    line.exchange(0.002)
    assert values[line["Speed"].slot] == 250
    values[line["Start"].slot] = 1
    line.exchange(0.004)
    assert values[line["Run"].edges_slot] == 1


def test_integers_have_a_view_of_their_own(line):
    values = numpy.asarray(line.integer_slots)
    assert values.dtype == numpy.int64
    assert numpy.shares_memory(values, numpy.asarray(line.slots))
    assert line["whole"].is_integer_slot and not line["Parts"].is_integer_slot
    values[line["whole"].slot] = -(2**63) + 1
    values.view(numpy.uint64)[line["natural"].slot] = 2**64 - 1
    line.exchange(0.002)
    assert values[line["whole back"].slot] == -(2**63) + 1
    assert line["natural back"].value == 2**64 - 1


def test_values_of_numpy_can_be_set(line):
    for value in (numpy.bool_(True), numpy.float32(1.0), numpy.int8(1), numpy.float64(1.0)):
        for name in ("Start", "Height", "Parts", "whole", "natural"):
            line[name].value = 0
            line[name].value = value
            assert line[name].value == 1


def test_nan_in_the_slots_is_sent_as_the_fail_safe_value_and_counted(line):
    numpy.asarray(line.slots)[line["Height"].slot] = numpy.nan
    line.exchange(0.002)
    assert line["Speed"].value == 0
    assert line.statistics()["not_a_number"] == "1"


def test_what_the_plc_writes_is_overwritten_by_the_next_tick(line):
    values = numpy.asarray(line.slots)
    values[line["Speed"].slot] = 99
    line.exchange(0.002)
    assert line["Speed"].value == 0


def test_other_kinds_of_buffers_are_there(line):
    view = line.slots
    assert (view.format, view.itemsize, view.ndim, view.readonly, view.nbytes) == ("d", 8, 1, False, 8 * len(view))
    assert view.cast("B").tobytes() == bytes(view)
    assert len(bytearray(view)) == 8 * len(view)


def test_an_array_outlives_its_driver(line_cfg):
    driver = tickbus.open(line_cfg)
    values = numpy.asarray(driver.slots)
    values[1] = 7
    driver.close()
    del driver
    gc.collect()
    values += 1
    assert values[1] == 8


def test_numpy_may_write_from_another_thread_during_ticks(line_cfg):
    with tickbus.open(line_cfg) as line:
        values = numpy.asarray(line.slots)
        stop = threading.Event()

        def scribble():
            random = numpy.random.default_rng(1)
            while not stop.is_set():
                values[:] = random.integers(0, 2**63, values.size).view(numpy.float64)

        thread = threading.Thread(target=scribble)
        thread.start()
        for tick in range(20_000):
            line.exchange(ns=tick * 1000)
        stop.set()
        thread.join()
        assert line.ticks == 20_000


def test_a_driver_without_signals_has_no_slots(tmp_path):
    file = tmp_path / "empty.cfg"
    file.write_text('[driver]\nid = 1\nname = "E"\n[fieldbus]\nkind = "loopback"\nprogram = "mirror"\ninput_bytes = 2\noutput_bytes = 2\n')
    try:
        driver = tickbus.open(file)
    except tickbus.FieldbusError as error:
        pytest.skip(f"there is none: {error}")
    with driver:
        assert numpy.asarray(driver.slots).shape == (0,)
