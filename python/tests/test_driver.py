"""A driver, tested through its signals."""

import math
from pathlib import Path

import pytest

import tickbus
from tickbus import Status

from conftest import SIGNALS, root


def test_a_value_that_is_set_comes_back_from_the_plc(line):
    start, run, height, speed = (line[name] for name in ("Start", "Run", "Height", "Speed"))
    start.value = True
    height.value = 250
    assert line.exchange(0.002) is Status.FRESH
    assert run.value is True
    assert speed.value == 250.0
    assert isinstance(speed.value, float)
    assert run.edges == 1
    line.exchange(0.004)
    assert run.edges == 0


def test_receive_and_send_answer_within_the_tick(line):
    line.receive(0.0)
    line["Start"].value = True
    line.send()
    assert line["Run"].value is False
    line.receive(0.002)
    assert line["Run"].value is True
    assert line.ticks == 2


def test_integers_are_integers(line):
    line["Parts"].value = 65535
    line["whole"].value = -(2**63)
    line["natural"].value = 2**64 - 1
    line.exchange(0.002)
    assert line["Parts back"].value == 65535
    assert type(line["Parts back"].value) is int
    assert line["whole back"].value == -(2**63)
    assert line["natural back"].value == 2**64 - 1


@pytest.mark.parametrize(
    ("name", "value", "sent"),
    [
        ("Parts", 1.5, 2),
        ("Parts", -3, 0),
        ("Parts", 1e9, 65535),
        ("whole", 2.5, 3),
        ("whole", -2.5, -3),
        ("whole", 2**70, 2**63 - 1),
        ("whole", -1e30, -(2**63)),
        ("natural", -5, 0),
        ("natural", 1e30, 2**64 - 1),
    ],
)
def test_what_does_not_fit_is_sent_as_the_nearest_value(line, name, value, sent):
    line[name].value = value
    line.exchange(0.002)
    assert line[f"{name} back"].value == sent


def test_a_bool_takes_any_number(line):
    for value, on in ((2, True), (0.0, False), (-1, True), (False, False)):
        line["Start"].value = value
        assert line["Start"].value is on


@pytest.mark.parametrize("value", ["1", None, b"1", [1], object(), 1j])
@pytest.mark.parametrize("name", ["Start", "Height", "Parts", "whole", "natural"])
def test_what_is_no_number_is_refused_by_its_type(line, name, value):
    with pytest.raises(TypeError, match=f"signal '{name}' cannot be set to a value of type {type(value).__name__}"):
        line[name].value = value


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
@pytest.mark.parametrize("name", ["Start", "Height", "Parts", "whole"])
def test_what_is_not_finite_is_refused(line, name, value):
    with pytest.raises(ValueError, match="a finite number is needed"):
        line[name].value = value


def test_what_the_plc_writes_cannot_be_set(line):
    with pytest.raises(AttributeError, match="'Run' at %QX0.0 is written by the other end"):
        line["Run"].value = True


def test_edges_that_nobody_counts_are_told(line):
    assert not hasattr(line["Start"], "edges")
    with pytest.raises(AttributeError, match="counts no edges; add `latch = \"rising\"`"):
        _ = line["Speed"].edges


def test_a_misspelt_name_is_answered_with_the_nearest_one(line):
    with pytest.raises(KeyError, match="driver 'Line' has no signal 'Hieght'; did you mean 'Height'\\?") as caught:
        line["Hieght"]
    assert isinstance(caught.value, tickbus.FieldbusError)
    assert caught.value.status is Status.BAD_ARGUMENT
    assert "Height" in line
    assert "Hieght" not in line
    assert 3 not in line


def test_a_signal_is_one_object_and_knows_what_it_is(line):
    height = line["Height"]
    assert line.signal("Height") is height
    assert line.signals[1] is height
    assert (height.name, height.address, height.type, height.unit, height.station) == ("Height", "%IW2", "INT", "mm", "")
    assert (height.slot, height.edges_slot, height.is_written, height.is_integer_slot) == (1, None, True, False)
    assert line["Run"].edges_slot == len(line.signals)
    assert repr(height) == "<Signal 'Height' %IW2 INT>"
    with pytest.raises(TypeError, match="ask for its .value"):
        bool(height)


def test_the_driver_knows_its_name_time_and_age(line):
    assert (line.id, line.name, line.is_stepped, line.closed) == (7, "Line", True, False)
    assert line.age == math.inf
    line.exchange(ns=4_000_000)
    assert line.age == 0.0
    assert line.granted_ns == 6_000_000
    assert line.granted == 0.006
    assert (line.sequence, line.ticks) == (1, 1)
    assert repr(line) == "<Driver 'Line' (7)>"


def test_time_is_in_seconds_or_in_nanoseconds(line):
    with pytest.raises(TypeError, match="not both"):
        line.exchange(1.0, ns=1)
    for wrong in (math.nan, math.inf, 1e300):
        with pytest.raises(ValueError, match="is no simulation time"):
            line.exchange(wrong)
    with pytest.raises(TypeError):
        line.exchange("soon")
    with pytest.raises(OverflowError):
        line.exchange(ns=2**63)


def test_time_that_goes_back_fails_with_the_reason(line):
    line.exchange(1.0)
    with pytest.raises(tickbus.FieldbusError, match="BUS_FAILED \\(-5\\)") as caught:
        line.exchange(0.5)
    assert caught.value.status is Status.BUS_FAILED
    assert caught.value.code == -5


def test_mistakes_of_the_file_are_told_at_line_and_column(tmp_path):
    file = tmp_path / "wrong.cfg"
    file.write_text('[driver]\nid = 1\nnaem = "x"\n[fieldbus]\nkind = "loopback"\n' + SIGNALS)
    with pytest.raises(tickbus.FieldbusError) as caught:
        tickbus.open(file)
    assert caught.value.status is Status.BAD_CONFIG
    assert f"{file}:3:1: " in str(caught.value)
    with pytest.raises(tickbus.FieldbusError, match="nowhere.cfg"):
        tickbus.open(tmp_path / "nowhere.cfg")


def test_an_overlay_takes_the_place_of_tables(line_cfg, tmp_path):
    overlays = (
        {"fieldbus": {"kind": "loopback", "program": "mirror", "program_options": {}}, "record": {"file": tmp_path / "a.vcd"}},
        f'[fieldbus]\nkind = "loopback"\nprogram = "mirror"\n[record]\nfile = "{tmp_path}/b.vcd"\n',
    )
    for overlay in overlays:
        with tickbus.open(str(line_cfg), overlay) as line:
            assert not line.is_stepped
            line.exchange()
    assert (tmp_path / "a.vcd").stat().st_size > 0
    assert (tmp_path / "b.vcd").stat().st_size > 0


@pytest.mark.parametrize(
    ("overlay", "told"),
    [
        (3, "tables are a text in TOML or a mapping, not int"),
        ({"fieldbus": "loopback"}, "a table of driver.cfg is a mapping, or a list of them, not str"),
        ({"fieldbus": {"kind": object()}}, "cannot stand in a driver.cfg"),
        ({"fieldbus": {3: "x"}}, "a key of driver.cfg is a text, not 3"),
    ],
)
def test_an_overlay_that_is_none_says_so(line_cfg, overlay, told):
    with pytest.raises(TypeError, match=told):
        tickbus.open(line_cfg, overlay)


def test_mistakes_of_an_overlay_have_their_lines(line_cfg):
    with pytest.raises(tickbus.FieldbusError, match=r":2:\d+: .*lopback"):
        tickbus.open(line_cfg, {"fieldbus": {"kind": "lopback"}})


def test_statistics_are_a_dictionary(line):
    line.exchange(0.002)
    statistics = line.statistics()
    assert statistics["ticks"] == "1"
    assert statistics["state"] == "running"


def test_a_fault_is_injected_and_ended(line):
    line["Start"].value = True
    line.exchange(0.002)
    with line.inject(kind="stuck", signal="Start", value=False) as stuck:
        assert (stuck.id, stuck.kind, stuck.state, stuck.begun) == (1, "stuck", "waiting", 0)
        line.exchange(0.004)
        assert stuck.is_active and stuck.begun == 1
        assert line["Run"].value is False
    line.exchange(0.006)
    assert stuck.state == "over"
    assert line["Run"].value is True
    assert [fault.name for fault in line.faults()] == [stuck.name]


def test_a_fault_may_have_any_name_that_driver_cfg_allows(line):
    name = "Bruch\u2028im Kabel"
    with line.inject(kind="stuck", signal="Start", value=True, name=name) as fault:
        line.exchange(0.002)
        assert fault.is_active
    assert [fault.name for fault in line.faults()] == [name]


def test_keys_that_are_words_of_python_take_an_underscore(line):
    fault = line.inject(kind="stuck", signal="Start", value=True, at="4ms", for_="2ms")
    states = [(line.exchange(ns=tick * 2_000_000), fault.is_active)[1] for tick in range(6)]
    assert states == [False, False, True, False, False, False]


def test_mistakes_of_a_fault_are_told(line):
    with pytest.raises(tickbus.FieldbusError, match="did you mean \"stuck\"") as caught:
        line.inject(kind="stcuk", signal="Start")
    assert caught.value.status is Status.BAD_ARGUMENT
    with pytest.raises(TypeError, match="a fault is a text in TOML, or keys"):
        line.inject(3)


def test_a_fault_of_the_model_is_told_in_the_tick_in_which_it_begins_and_ends(line):
    line.declare_faults(["leak", "wear"])
    line.inject(kind="model", name="wear", value=0.4, tick=2, ticks=2)
    leak = line.inject(kind="model", name="leak")
    seen = []
    for tick in range(1, 6):
        line.receive(ns=tick * 2_000_000)
        seen.append(line.model_faults())
        line.send()
        if tick == 4:
            leak.end()
    assert seen == [[("leak", 1.0)], [("wear", 0.4)], [], [("wear", 0.0)], [("leak", 0.0)]]


def test_a_fault_that_the_model_does_not_have_is_a_mistake_with_the_nearest_name(line):
    with pytest.raises(tickbus.FieldbusError, match="let the simulation declare it before its first tick") as caught:
        line.inject(kind="model", name="leak")
    assert caught.value.status is Status.BAD_ARGUMENT
    line.inject(kind="stuck", signal="Start", name="leak")
    line.declare_faults(["leak"])
    with pytest.raises(tickbus.FieldbusError, match='no fault "leek"; did you mean "leak"?'):
        line.inject(kind="model", name="leek")
    with pytest.raises(tickbus.FieldbusError, match="give each a name of its own"):
        line.declare_faults(["leak", "leak"])
    with pytest.raises(TypeError, match="a list of names, not one text"):
        line.declare_faults("leak")


def test_a_recording_makes_a_page(line_cfg, tmp_path):
    recording = tmp_path / "run.vcd"
    with tickbus.open(line_cfg, {"record": {"file": recording}}) as line:
        for tick in range(100):
            line["Start"].value = tick % 2
            line.exchange(ns=tick * 2_000_000)
        statistics = line.statistics()
    page = tickbus.report(recording, "A line", statistics, {"Why": "to look at it"})
    assert page == recording.with_suffix(".html")
    assert "to look at it" in page.read_text()
    with pytest.raises(tickbus.FieldbusError, match="nothing.vcd") as caught:
        tickbus.report(tmp_path / "nothing.vcd")
    assert caught.value.status is Status.BAD_ARGUMENT


def test_the_last_values_are_recorded_when_the_driver_closes(line_cfg, tmp_path):
    recording = tmp_path / "run.csv"
    with tickbus.open(line_cfg, {"record": {"file": recording}}) as line:
        line.receive(0.0)
        line["Parts"].value = 4711
    assert "4711" in recording.read_text().splitlines()[-1]


def test_the_statuses_are_those_of_the_one_table():
    from tickbus import _native

    table = [(code, name) for code, name, _text, _remedy in _native.STATUS_TABLE]
    assert [(status.value, status.name) for status in Status] == table
    assert Status.STALE.remedy.startswith("check that the PLC runs")
    assert Status.STALE.text.startswith("nothing has come from the PLC")


def test_an_exception_survives_pickling():
    import pickle

    error = pickle.loads(pickle.dumps(tickbus.FieldbusError(-4, "a mistake")))
    assert (error.status, str(error)) == (Status.BAD_CONFIG, "a mistake")


def test_events_are_told_one_by_one(tmp_path):
    from pymodbus.client import ModbusTcpClient

    file = tmp_path / "modbus.cfg"
    bus = '[driver]\nid = 1\nname = "Server"\n[fieldbus]\nkind = "modbus-server"\naddress = "127.0.0.1:0"\nevents = true\n'
    file.write_text(bus + SIGNALS)
    with tickbus.open(file) as server:
        events = []
        while "address" not in (statistics := server.statistics()):
            pass
        host, port = statistics["address"].rsplit(":", 1)
        with ModbusTcpClient(host, port=int(port)) as client:
            for value in (True, False, True):
                client.write_coil(0, value)
            client.write_register(2, 99)
        for _ in range(1000):
            server.exchange()
            events += server.events()
        events = [event for event in events if event.signal.name in ("Run", "Parts back")]
        assert [(event.signal.name, event.value) for event in events] == [
            ("Run", True),
            ("Run", False),
            ("Run", True),
            ("Parts back", 99),
        ]
        assert events[0].signal is server["Run"]
        assert events == sorted(events, key=lambda event: event.time_ns)
        # Two rising edges came; the value is the level.
        assert server["Run"].value is True




def test_the_tank_of_the_manual_runs(tmp_path, monkeypatch):
    program = root("docs", "python.md").read_text().split("```python\n")[1].split("```")[0]
    config = root("README.md").read_text().split("```toml\n")[1].split("```")[0]
    (tmp_path / "tank.cfg").write_text(config.replace("[fieldbus]", '[fieldbus]\nmode    = "stepped"'))
    monkeypatch.chdir(tmp_path)
    found = {}
    exec(program, found)
    # The mirror opens the valve below 150 mm, a scan later, so the level stays there.
    assert 145 < found["mm"] < 155


def test_a_loop_keeps_to_the_clock_and_leaves_out_what_it_missed():
    now = [1000]
    turns = tickbus._driver._turns(10, lambda: now[0], lambda seconds: now.__setitem__(0, now[0] + round(seconds * 1e9)))
    seen = []
    for late in (0, 13, 0, 37, 0):
        turn = next(turns)
        seen.append((round(turn.time * 1e9), round(turn.lag * 1e9), turn.missed))
        now[0] += late
    assert seen == [(0, 0, 0), (10, 0, 0), (23 - 3, 3, 0), (30, 0, 0), (60, 7, 2)]


def test_a_driver_has_the_names_of_its_signals(line):
    assert list(line) == [signal.name for signal in line.signals]
    assert len(line) == len(line.signals)
    assert bool(line)


def test_a_missing_file_is_a_file_not_found_error(tmp_path):
    with pytest.raises(FileNotFoundError, match=r"no such\.cfg") as caught:
        tickbus.open(tmp_path / "no such.cfg")
    assert caught.value.status is Status.BAD_CONFIG


def test_an_integer_beyond_a_float_is_a_value_error(line):
    with pytest.raises(ValueError, match="beyond the range of a float"):
        line["Height"].value = 10**400
