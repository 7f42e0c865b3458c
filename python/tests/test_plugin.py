"""The plug-in for pytest, tested by pytest itself: tests that pass, and tests that fail, with their messages."""

from pathlib import Path

import pytest

from conftest import root

CONFIG = """
[driver]
id   = 7
name = "Line"

[fieldbus]
kind    = "loopback"
program = "mirror"
scan    = "2ms"

[[signal]]
name    = "Start"
address = "%IX0.0"

[[signal]]
name    = "Height"
address = "%IW2"
type    = "INT"
unit    = "mm"

[[signal]]
name    = "Run"
address = "%QX0.0"

[[signal]]
name    = "Speed"
address = "%QW2"
type    = "INT"
unit    = "mm/s"
"""

HEAD = """
import pytest
from tickbus.testing import above, below, falls, is_, minutes, ms, near, nothing_swallowed, off, on, rises, s, ticks, when

pytestmark = pytest.mark.plc(config="line.cfg", step="2ms")
"""

GREEN = """
class Lift:
    height = 0

    def connect(self, plc):
        plc.set("Height", 100)
        self.height = 100

    def step(self, plc, time):
        self.height += 1 if plc.is_on("Run") else 0
        plc.set("Height", self.height)


def test_every_test_begins_at_tick_null(plc):
    assert plc.ticks == 0 and plc.time == 0 and not plc.is_on("Start")
    plc.set("Start", True).tick()
    plc.expect(on("Run"))


def test_again_at_tick_null(plc):
    assert plc.ticks == 0 and plc.time_ns == 0
    plc.expect(off("Start").and_(off("Run")))


@pytest.mark.parametrize("value", [-300, 7, 32767])
def test_values_come_back(plc, value):
    plc.set("Height", value)
    assert plc.await_(is_("Speed", value)).within(3) == 1
    plc.expect(near("Speed", value + 0.5, 0.5))


def test_durations_are_whole_ticks(plc):
    assert plc.run("3ms").ticks == 2 and plc.run(4, ms).ticks == 4 and plc.tick(0).ticks == 4
    assert plc.time == 0.008 and plc.run(0.01, s).ticks == 9 and plc.run(3, ticks).ticks == 12


def test_limits_are_ticks_or_time(plc):
    for limit in ((3,), (3, ticks), ("6ms",), (6, ms), (0.006, s), (0.0001, minutes)):
        plc.set("Start", not plc.is_on("Start"))
        assert plc.await_(on("Run") if plc.is_on("Start") else off("Run")).within(*limit) == 1


def test_forced_signals_stay_what_the_machine_says(plc):
    plc.connect(Lift())
    plc.force("Height", 5).tick(10)
    plc.expect(is_("Height", 5) & is_("Speed", 5))
    plc.force("Height", 6).tick()
    plc.expect(is_("Speed", 6))
    plc.release("Height").tick()
    plc.expect(is_("Speed", 100))


def test_pressed_buttons_are_released(plc):
    plc.press("Start")
    plc.expect(on("Run"))
    plc.await_(off("Run")).within(2)
    assert plc.ticks == 101 and plc.rises("Run") == 1 and plc.falls("Run") == 1 and plc.falls("Start") == 1


def test_faults_are_injected_and_ended(plc):
    plc.set("Start", True).tick()
    wire = plc.inject(kind="stuck", signal="Start", value=False)
    plc.await_(off("Run")).within(3)
    assert wire.is_active and len(plc.faults()) == 1
    wire.end()
    plc.await_(on("Run")).within(3)


class LeakingLift(Lift):
    faults = ["leak"]
    leak = 0.0

    def fault(self, name, value):
        assert name == "leak"
        self.leak = value

    def step(self, plc, time):
        super().step(plc, time)
        plc.set("Height", self.height - 50 * self.leak)


def test_a_machine_has_faults_by_name(plc):
    plc.connect(LeakingLift()).tick()
    leak = plc.inject(kind="model", name="leak", value=0.4)
    plc.tick().expect(is_("Height", 100))
    plc.tick().expect(is_("Height", 80))
    leak.end()
    plc.tick(2).expect(is_("Height", 100))
    with pytest.raises(Exception, match='did you mean "leak"'):
        plc.inject(kind="model", name="leck")
    with pytest.raises(ValueError, match='two faults of the machines are called "leak"'):
        plc.connect(LeakingLift())
    leaking = LeakingLift()
    leaking.faults = "leak"
    with pytest.raises(TypeError, match="a list of names, not one text"):
        plc.connect(leaking)


def test_conditions_join(plc):
    plc.expect(on("Run").or_(off("Run")))
    plc.expect(~on("Run") & above("Speed", -1) & below("Speed", 1))
    plc.expect(off("Run")).during("20ms").expect(off("Start")).during(5)
    assert plc.ticks == 15


def test_edges_count_from_where_the_wait_begins(plc):
    plc.set("Start", True).tick().set("Start", False)
    assert plc.await_(falls("Run")).within(2) == 1
    plc.set("Start", True)
    assert plc.await_(rises("Run").or_(when("never", lambda: False))).within(2) == 1


@pytest.mark.plc(step="5ms", machine=Lift)
def test_a_mark_adds_to_that_of_the_module(plc, machine):
    assert plc.step_ns == 5_000_000 and isinstance(machine, Lift)
    plc.force("Start", True).tick(11)
    # The first exchange delivers Run, so the lift has taken ten steps with it.
    assert machine.height == 110


@pytest.mark.plc(program="mirror", scan="10ms")
def test_changes_that_the_program_sees_are_not_swallowed(plc):
    plc.always(nothing_swallowed()).set("Start", True).run("10ms").set("Start", False).run("20ms")
    plc.expect(nothing_swallowed("Start", "Run"))


@pytest.mark.plc("socket.cfg", program="mirror", scan="2ms")
class TestSocket:
    def test_the_plants_own_bus_does_not_matter(self, plc):
        plc.set("Start", True).tick()
        plc.expect(on("Run"))
"""

# The failure message of a test, by the test's body.
RED = [
    (
        'plc.set("Height", 2).tick(3); plc.set("Height", 3).tick(2); plc.await_(above("Speed", 3)).within("40ms")',
        "tick 25 (50ms): 'Speed' is 3 mm/s, expected above 3 within 20 ticks (40ms) of tick 5\n"
        "*last changes of 'Speed' (%QW2): 0 mm/s → 2 mm/s at tick 1 (2ms) → 3 mm/s at tick 4 (8ms)",
    ),
    ('plc.expect(on("Run"))', "tick 0 (0s): 'Run' is off, expected on"),
    (
        'plc.set("Start", True); plc.expect(off("Run")).during("1s")',
        "tick 1 (2ms): 'Run' is on, expected off for 500 ticks (1s) from tick 0",
    ),
    (
        'plc.never(on("Run")); plc.tick(3).press("Start")',
        "tick 4 (8ms): 'Run' is on, expected not on at every tick since tick 0",
    ),
    (
        'plc.set("Start", True).tick(); plc.await_(rises("Run")).within(5)',
        "tick 6 (12ms): 'Run' is on without one, expected a rising edge within 5 ticks (10ms) of tick 1",
    ),
    (
        'plc.await_(off("Run").and_(is_("Speed", 4))).within(1)',
        "tick 1 (2ms): 'Speed' is 0 mm/s, expected 4 within 1 tick (2ms) of tick 0",
    ),
    (
        'plc.await_(when("the cow is in the barn", lambda: False)).within(2)',
        'tick 2 (4ms): "the cow is in the barn" is false, expected true within 2 ticks (4ms) of tick 0',
    ),
    ("plc.tick(12); raise AssertionError('of its own')", "of its own\n*the test stood at tick 12 (24ms); recording: *.vcd; report: *.html"),
    ('plc.expect(nothing_swallowed("Strat"))', "driver 'Line' has no signal 'Strat'; did you mean 'Start'?"),
    ('plc.expect(on("Rnu"))', "driver 'Line' has no signal 'Rnu'; did you mean 'Run'?"),
    ('plc.set("Run", True)', "signal 'Run' at %QX0.0 is written by the other end"),
    ('plc.await_(on("Run")).within(0)', "a limit of 0 ticks; give it a whole number, at least 1, or use expect"),
    ('plc.await_(on("Run")).within("1ms")', "a limit of 1ms is shorter than one tick of 2ms"),
    ('plc.expect(off("Run")).during(0.5)', "a span of 0.5 ticks; give it a whole number, at least 0"),
    ('plc.expect(off("Run")).during(-5)', "a span of -5 ticks; give it a whole number, at least 0"),
    ("plc.tick(-1)", "-1 ticks; time does not run backwards"),
    ("plc.connect(lambda same, time: same.tick()).tick()", "a machine must not let time pass in its own step"),
    ("plc.connect(3)", "3 is no machine: it has no method step"),
    ('plc.run("soon")', '"soon" is no duration'),
    ("plc.run(3)", "3 of what? Write a duration"),
    ('plc.run("3s", ms)', '"3s" has its unit already'),
    ('assert on("Run")', "a condition is neither true nor false by itself"),
    ('near("Speed", 1, -1)', "a tolerance of -1; expected 0 or more"),
]

# Marks with mistakes.
WRONG = [
    ('step="0s"', 'step = "0s": a tick takes more than no time'),
    ('config="lien.cfg"', "there is none of the files *lien.cfg"),
    ('program="rigg"', 'there is no program "rigg"; did you mean "rig"?'),
    ('confg="line.cfg"', "@pytest.mark.plc has no 'confg'; it has config, program"),
    ('recording="maybe"', "recording='maybe'; expected one of 'on failure', 'always', 'never'"),
    ('scan="2ms"', "options and scan are of a program; name it"),
    ('config="socket.cfg"', 'the bus "socket" of the driver.cfg has no mode; name a PLC program'),
]


@pytest.fixture
def tests(pytester: pytest.Pytester) -> pytest.Pytester:
    """A folder of tests."""
    pytester.path.joinpath("line.cfg").write_text(CONFIG)
    socket = CONFIG.replace('"loopback"\nprogram = "mirror"\nscan    = "2ms"', '"socket"\naddress = "127.0.0.1:0"\ncycle   = "2ms"')
    pytester.path.joinpath("socket.cfg").write_text(socket)
    return pytester


def test_tests_with_all_words_of_the_kit_pass(tests):
    tests.makepyfile(HEAD + GREEN)
    tests.runpytest_inprocess("--strict-markers").assert_outcomes(passed=16)
    assert not tests.path.joinpath("tickbus-reports").exists()


def test_failures_say_what_happened(tests):
    tests.makepyfile(HEAD + "".join(f"\ndef test_{number}(plc):\n    {body}\n" for number, (body, _) in enumerate(RED)))
    result = tests.runpytest_inprocess()
    result.assert_outcomes(failed=len(RED))
    result.stdout.fnmatch_lines([f"E *{line.lstrip('*')}*" for _, told in RED for line in told.split("\n")])


SWALLOWED = (
    'E *: tick {}: expected nothing swallowed: "Start" changed and changed back once between two scans of 10ms; the PLC saw none of'
    ' it: set latch = "rising" for it, or tick slower (count_swallowed = false turns this message off); the first at tick 5 (10ms)'
)


def test_what_was_swallowed_is_named_with_the_steps_and_the_cure(tests):
    mark = '\n\n@pytest.mark.plc(program="mirror", scan="10ms")\n'
    pulse = 'plc.tick(3).set("Start", True).tick().set("Start", False)'
    tests.makepyfile(
        f"{HEAD}{mark}def test_expected(plc):\n    {pulse}.tick(2).expect(nothing_swallowed())\n"
        f"{mark}def test_always(plc):\n    plc.always(nothing_swallowed())\n    {pulse}.tick(9)\n"
    )
    result = tests.runpytest_inprocess()
    result.assert_outcomes(failed=2)
    for tick in ("6 (12ms)", "5 (10ms)"):
        result.stdout.fnmatch_lines([SWALLOWED.format(tick)])


def test_wrong_marks_are_told(tests):
    bodies = (f"\n@pytest.mark.plc({mark})\ndef test_{number}(plc):\n    pass\n" for number, (mark, _) in enumerate(WRONG))
    tests.makepyfile(HEAD + "".join(bodies))
    result = tests.runpytest_inprocess()
    result.assert_outcomes(errors=len(WRONG))
    result.stdout.fnmatch_lines([f"E *{told}*" for _, told in WRONG])


def test_without_a_mark_it_says_what_to_write(tests):
    tests.makepyfile("def test(plc):\n    pass\n")
    result = tests.runpytest_inprocess()
    result.assert_outcomes(errors=1)
    result.stdout.fnmatch_lines(['E *needs a driver.cfg; write @pytest.mark.plc(config="driver.cfg"*'])


def test_a_wait_without_a_limit_fails_the_test(tests):
    tests.makepyfile(HEAD + '\ndef test(plc):\n    plc.await_(on("Run"))\n')
    result = tests.runpytest_inprocess()
    result.assert_outcomes(passed=1, errors=1)
    result.stdout.fnmatch_lines(["E *await_('Run' on) was given no limit, so that it never waited; add .within*"])


def test_a_failed_test_leaves_its_recording_and_a_good_one_none(tests):
    body = "\ndef test_good(plc):\n    plc.tick(3)\n\n\ndef test_bad(plc):\n    plc.tick(12)\n    assert plc.ticks == 13\n"
    name = tests.makepyfile(HEAD + body).stem
    tests.runpytest_inprocess("--tickbus-reports", "kept").assert_outcomes(passed=1, failed=1)
    kept = sorted(file.name for file in tests.path.joinpath("kept").iterdir())
    assert kept == [f"{name}.py.test_bad.html", f"{name}.py.test_bad.vcd"]
    recording, page = (tests.path.joinpath("kept", f"{name}.py.test_bad.{kind}").read_text() for kind in ("vcd", "html"))
    assert "#24" in recording, "the last tick"
    assert "assert 12 == 13" in page


def test_a_recording_is_kept_always_or_never_where_asked(tests):
    body = '\n@pytest.mark.plc(recording="always")\ndef test_good(plc):\n    plc.tick(3)\n'
    body += '\n\n@pytest.mark.plc(recording="never")\ndef test_bad(plc):\n    plc.tick(2)\n    assert False\n'
    tests.makepyfile(HEAD + body)
    result = tests.runpytest_inprocess()
    result.assert_outcomes(passed=1, failed=1)
    result.stdout.fnmatch_lines(["E *the test stood at tick 2 (4ms)"])
    kept = [file.name for file in tests.path.joinpath("tickbus-reports").iterdir()]
    assert len(kept) == 2 and all("test_good" in name for name in kept)


def test_another_process_of_the_run_may_remove_the_empty_folder(tests, monkeypatch):
    touch, removed = Path.touch, []

    def late(path):
        if not removed:
            removed.append(path.parent)
            path.parent.rmdir()
        touch(path)

    monkeypatch.setattr(Path, "touch", late)
    tests.makepyfile(HEAD + "\ndef test(plc):\n    plc.tick()\n")
    tests.runpytest_inprocess().assert_outcomes(passed=1)
    assert removed


def test_names_may_be_longer_than_those_of_files(tests):
    bodies = (f"\n\ndef test_{'x' * 300}_{number}(plc):\n    assert False\n" for number in range(2))
    tests.makepyfile(HEAD + "".join(bodies))
    tests.runpytest_inprocess().assert_outcomes(failed=2)
    assert len(list(tests.path.joinpath("tickbus-reports").glob("*.vcd"))) == 2


def test_a_test_that_passes_leaves_nothing_of_an_earlier_run_that_failed(tests):
    for body, outcome in [("assert plc.ticks", "failed"), ("assert not plc.ticks", "passed")]:
        tests.makepyfile(f"{HEAD}\ndef test(plc):\n    {body}\n")
        tests.runpytest_inprocess().assert_outcomes(**{outcome: 1})
        assert tests.path.joinpath("tickbus-reports").exists() == (outcome == "failed")


def test_a_driver_cfg_with_mistakes_leaves_nothing(tests):
    tests.path.joinpath("line.cfg").write_text("[driver]\n")
    tests.makepyfile(HEAD + "\ndef test(plc):\n    pass\n")
    tests.runpytest_inprocess().assert_outcomes(errors=1)
    assert not tests.path.joinpath("tickbus-reports").exists()


def test_a_machine_that_is_not_there_is_told(tests):
    tests.makepyfile(HEAD + "\ndef test(machine):\n    pass\n")
    result = tests.runpytest_inprocess()
    result.stdout.fnmatch_lines(["E *the test's mark plc names no machine; write machine=*"])


# The sweep of tests/it/sweep.rs.
SWEEP = """
from tickbus.testing import sweep

class Alarm:
    falls = 0
    due = float("inf")

    def step(self, plc, time):
        if plc.falls("Run") > self.falls:
            self.falls, self.due = plc.falls("Run"), time + 0.0039
        if time >= self.due:
            self.due = float("inf")
            plc.set("Height", 99)


@pytest.mark.plc(program="mirror", scan="2ms", machine=Alarm, recording="never")
@sweep(
    signals=["Start", "Height"],
    kinds=["stuck-on", "stuck-off", {"kind": "late", "by": "6ms"}, "frozen", "line-down", {"kind": "noise", "amplitude": 200, "chance": 0.5}],
    moments={"at rest": "not Run", "runs": "Run", "moves": "Speed == 5"},
    told="Speed == 99",
    never="Speed < 0",
    within="100ms",
    tolerance="4ms",
)
def test_rises(plc):
    plc.tick(5).set("Start", True).tick(10).expect(on("Run"))
    plc.set("Height", 5).tick(10).set("Height", 6).tick(10)
"""


def test_each_fault_at_each_moment_is_a_test_with_the_verdict_that_a_test_file_gives(tests):
    name = tests.makepyfile(HEAD + SWEEP).stem
    result = tests.runpytest_inprocess()
    result.assert_outcomes(passed=14, failed=11)
    result.stdout.fnmatch_lines(
        [
            "E *continues differently: \"Run\" is on after 2ms already, without the fault after 12ms*",
            "E *stands still: \"Speed\" stays 5 mm/s, 6 mm/s without the fault*",
            f"*sweep {name}.test_rises*",
            "stuck-off     at rest runs    moves",
            "Start         DIFFERS 8ms     8ms",
            "Height        NEVER   NEVER   NEVER",
            "sweep: runs=24 told=*",
            f"FAILED {name}.py::test_rises[[]Start stuck-on @ at rest[]]*",
        ],
        consecutive=False,
    )
    result = tests.runpytest_inprocess("-k", "frozen and moves", "-v")
    result.assert_outcomes(failed=1, deselected=24)
    result.stdout.fnmatch_lines([f"{name}.py::test_rises[[]Height frozen @ moves[]] FAILED*"])


def test_the_page_of_a_sweep_opens_the_recordings_of_the_runs_that_failed(tests):
    name = tests.makepyfile(HEAD + SWEEP.replace(', recording="never"', "")).stem
    result = tests.runpytest_inprocess("-k", "frozen", "--tickbus-reports", "kept")
    result.stdout.fnmatch_lines([f"page: *{name}.test_rises.html"])
    kept = tests.path.joinpath("kept")
    page = kept.joinpath(f"{name}.test_rises.html").read_text()
    (report,) = kept.glob("*frozen*moves*.html")
    assert f'href="{report.name}" title="stands still: ' in page
    assert f'data-again="pytest &quot;{name}.py::test_rises&quot; --tickbus-only &quot;{{}}&quot;"' in page

    # The page goes when nothing fails any more.
    tests.runpytest_inprocess("-k", "late", "--tickbus-reports", "kept").assert_outcomes(passed=6, deselected=19)
    assert not kept.joinpath(f"{name}.test_rises.html").exists()


def test_one_run_is_made_by_its_name_and_several_by_a_part_of_it(tests):
    moments = SWEEP.replace('"moves"', '"fährt"')
    tests.makepyfile(HEAD + moments)
    tests.runpytest_inprocess("--tickbus-only", "Height frozen @ fährt").assert_outcomes(passed=1, failed=1)
    tests.runpytest_inprocess("--tickbus-only", "Height frozen").assert_outcomes(passed=1, failed=3)
    result = tests.runpytest_inprocess("--tickbus-only", "forzen")
    result.stdout.fnmatch_lines(['*no run of the sweep *.test_rises has "forzen" in its name; the first one is "Start stuck-on @ at rest"*'])
    result.assert_outcomes(failed=1)


def test_the_faults_of_a_machine_are_in_its_sweep(tests):
    faults = 'class Alarm:\n    faults = ["wire"]\n\n    def fault(self, name, value):\n        self.due = 0.0 if value else float("inf")\n\n'
    kinds = SWEEP[SWEEP.index("kinds=") : SWEEP.index("    moments=")]
    model = SWEEP.replace("class Alarm:\n", faults)
    tests.makepyfile(HEAD + model.replace(kinds, 'kinds=["model"],\n'))
    result = tests.runpytest_inprocess()
    result.assert_outcomes(passed=4)
    result.stdout.fnmatch_lines(["wire  4ms     4ms     4ms", "sweep: runs=3 told=3 *"])
    tests.makepyfile(HEAD + model.replace(kinds, 'kinds=[{"kind": "model", "name": "wier"}],\n'))
    tests.runpytest_inprocess().stdout.fnmatch_lines(['*the model has no fault "wier"; did you mean "wire"?*'])


def test_a_scenario_in_a_class_is_prepared_by_its_own_method(tests):
    head, scenario = SWEEP.split("@pytest.mark.plc", 1)
    scenario = "@pytest.mark.plc" + scenario.replace("(plc):", "(self, plc):").replace('"Start", True', '"Start", self.on')
    prepare = "class TestLift:\n    def setup_method(self, method):\n        self.on = True\n\n"
    tests.makepyfile(HEAD + head + prepare + "".join(f"    {line}\n" for line in scenario.splitlines()))
    tests.runpytest_inprocess().assert_outcomes(passed=14, failed=11)


def test_a_scenario_may_fail_and_skip_itself(tests):
    for end, outcome in [("pytest.fail", "failed"), ("pytest.skip", "skipped")]:
        own = f'plc.is_on("Run") or {end}("it stands")\n    plc.set("Height", 5)'
        tests.makepyfile(HEAD + SWEEP.replace('plc.set("Height", 5)', own))
        result = tests.runpytest_inprocess()
        result.stdout.fnmatch_lines(["Start         STILL   8ms     8ms", "sweep: runs=24 *"])
        result.stdout.no_fnmatch_line("*it stands*")
        # Without a fault as well.
        tests.makepyfile(HEAD + SWEEP.replace('plc.set("Height", 5)', f'{end}("it stands")'))
        tests.runpytest_inprocess().assert_outcomes(**{outcome: 1})


def test_the_expectations_of_a_scenario_do_not_count_under_a_fault(tests):
    own = 'assert plc.is_on("Run"), "it runs"\n    plc.set("Height", 5).await_(is_("Speed", 5)).within(10)\n    plc.tick(8)'
    tests.makepyfile(HEAD + SWEEP.replace('plc.set("Height", 5).tick(10)', own + "\n    plc"))
    result = tests.runpytest_inprocess()
    # An assertion of its own that fails ends its actions: without a Run, the lift stays where it is.
    result.stdout.fnmatch_lines(["Start         STILL   8ms     8ms", "sweep: runs=24 *"])
    result.stdout.no_fnmatch_line("E *it runs")


def test_accepted_verdicts_pass_and_any_other_fails(tests):
    name = tests.makepyfile(HEAD + SWEEP).stem
    file = tests.path.joinpath("accepted", f"{name}.test_rises.toml")
    result = tests.runpytest_inprocess("--tickbus-accept", "-k", "frozen")
    result.stdout.fnmatch_lines(["*21 of 24 runs were not made or could not be judged, so nothing was accepted*"])
    assert result.ret == 1 and not file.exists()
    result = tests.runpytest_inprocess("--tickbus-accept")
    result.assert_outcomes(passed=25)
    result.stdout.fnmatch_lines([f"accepted: {file}"])
    tests.runpytest_inprocess().assert_outcomes(passed=25)
    file.write_text(file.read_text().replace('"still   still   still"', '"still   told    still"', 1))
    result = tests.runpytest_inprocess()
    result.assert_outcomes(passed=24, failed=1)
    result.stdout.fnmatch_lines(["E *stands still: *", "E *accepted: told"])


USED = "@pytest.fixture(autouse=True)\ndef ready(plc):\n    plc.tick(3)\n\n\nclass Alarm:"


@pytest.mark.parametrize(
    "old, new, told",
    [
        ('["Start", "Height"]', '["Strat"]', 'there is no signal "Strat"; did you mean "Start"?'),
        ('"frozen", "line', '"forzen", "line', '"forzen"*did you mean "frozen"?'),
        ('"Speed == 5"', '"Speed == 7"', 'the moment "moves" never comes in the scenario, which lasts 70ms without a fault; let'),
        ('told="Speed == 99"', 'told="Speed == 6"', '"Speed == 6" holds without a fault, so it tells nothing; write'),
        ('expect(on("Run"))', 'expect(off("Run"))', "the scenario fails without a fault, so nothing was judged: tick 15 (30ms): 'Run'"),
        ("machine=Alarm", "machine=Alarm()", "each run of a sweep has a new machine: name its class"),
        ("class Alarm:", USED, "the fixture ready is no part of a scenario that is swept; do its work in the test"),
        ("test_rises(plc)", "test_rises(plc, tmp_path)", "a scenario that is swept takes plc and machine alone, and not tmp_path"),
    ],
)
def test_what_is_wrong_with_a_sweep_is_told(tests, old, new, told):
    assert old in SWEEP
    tests.makepyfile(HEAD + SWEEP.replace(old, new))
    result = tests.runpytest_inprocess()
    result.assert_outcomes(failed=1)
    result.stdout.fnmatch_lines([f"*{told}*"])


def test_the_tests_of_the_manual_pass(pytester):
    blocks = [block for page in ("python.md", "sweeps.md") for block in root("docs", page).read_text().split("```python\n")]
    (tests,) = (block.split("```")[0] for block in blocks if "import pytest" in block)
    (sweep,) = (block.split("```")[0] for block in blocks if "import sweep" in block)
    pytester.path.joinpath("driver.cfg").write_text(root("driver.cfg").read_text())
    pytester.makepyfile(tests)
    pytester.runpytest_inprocess().assert_outcomes(passed=2)
    name = pytester.makepyfile(tests + sweep).stem
    result = pytester.runpytest_inprocess("--tickbus-accept")
    assert result.ret == 0
    result.stdout.fnmatch_lines(["sweep: runs=* wrong=0 *", f"accepted: *{name}.test_a_run_begins.toml"])
