"""Imports FMUs of tickbus with third-party tools: FMPy, libcosim, pathsim-fmi, the FMU Manipulation Toolbox.

    fmi_tools.py TOOL FMU...

The FMU is that of tests/fmi/types.cfg: a PLC that copies every input to the output of the same type. Prints one line.
"""

import ctypes
import os
import sys
import tempfile
from pathlib import Path

# The values to send in three steps, by the names in types.cfg.
VALUES = {
    "bool": [True, False, True],
    "byte": [255, 0, 7],
    "sint": [-128, 127, 0],
    "usint": [255, 1, 2],
    "word": [65535, 0, 258],
    "int": [-32768, 32767, 5],
    "uint": [65535, 0, 6],
    "dword": [4294967295, 0, 7],
    "dint": [-2147483648, 2147483647, 8],
    "udint": [4294967295, 1, 9],
    "real": [1.5, -0.25, 1e30],
    "lword": [2**53, 0, 11],
    "lint": [-(2**53), 2**53, 12],
    "ulint": [2**53, 1, 13],
    "lreal": [0.1, -1e300, 14.0],
    "scaled": [100.0, 0.0, 250.0],
}
STEP = 0.01


def close(a, b, name):
    """True if equal; a REAL and a scaled INT have fewer digits than a double."""
    if name == "scaled":
        return abs(a - b) <= 250.0 / 27648
    if name == "real":
        return a == ctypes.c_float(b).value or a == b
    return a == b


def groups(variables):
    """Variables by type."""
    by_type = {}
    for name, (kind, reference) in variables.items():
        by_type.setdefault(kind, []).append((name, reference))
    return by_type


def fmpy(path):
    import fmpy
    from fmpy import extract, read_model_description
    from fmpy.fmi2 import FMU2Slave
    from fmpy.fmi3 import FMU3Slave
    from fmpy.validation import validate_fmu

    problems = validate_fmu(path)
    assert not problems, problems
    description = read_model_description(path)
    folder = extract(path)
    lines = []
    arguments = {
        "guid": description.guid,
        "modelIdentifier": description.coSimulation.modelIdentifier,
        "unzipDirectory": folder,
        "instanceName": "types",
    }
    is_two = description.fmiVersion == "2.0"
    slave = (FMU2Slave if is_two else FMU3Slave)(**arguments)
    if is_two:
        # FMPy's own callbacks, but for the log.
        from fmpy.fmi2 import defaultCallbacks, fmi2CallbackFunctions, fmi2CallbackLoggerTYPE

        def log(_env, _name, status, category, message):
            lines.append((status, category.decode(), message.decode()))

        callbacks = fmi2CallbackFunctions()
        callbacks.logger = fmi2CallbackLoggerTYPE(log)
        callbacks.allocateMemory = defaultCallbacks.allocateMemory
        callbacks.freeMemory = defaultCallbacks.freeMemory
        slave.instantiate(callbacks=callbacks, loggingOn=True)
        slave.setupExperiment(startTime=0.0)
        slave.enterInitializationMode()
    else:
        def log3(_env, status, category, message):
            lines.append((status, category.decode(), message.decode()))

        slave.instantiate(loggingOn=True, logMessage=log3)
        slave.enterInitializationMode(startTime=0.0)
    slave.exitInitializationMode()
    named = {one.name: (one.type, one.valueReference) for one in description.modelVariables}
    send = groups({name: named[f"{name} <in>"] for name in VALUES})
    come = groups({name: named[f"{name} <out>"] for name in VALUES})
    get = lambda kind, references: getattr(slave, f"get{kind}")(references)
    # The start values, which are the fail-safe ones.
    assert get(*next((kind, [named["lreal <out>"][1]]) for kind in [named["lreal <out>"][0]])) == [-1.5]
    time = 0.0
    for turn in range(3):
        for kind, some in send.items():
            values = [VALUES[name][turn] for name, _ in some]
            getattr(slave, f"set{kind}")([reference for _, reference in some], values)
        # One step is a scan: values sent in a step come back in the next.
        for _ in range(2):
            slave.doStep(time, STEP)
            time += STEP
        for kind, some in come.items():
            found = get(kind, [reference for _, reference in some])
            for (name, _), value in zip(some, found):
                wanted = VALUES[name][turn]
                assert close(value, wanted, name), (name, turn, value, wanted)
    if not is_two:
        # An array, set and got as a whole.
        into, back = named["vector <in>"], named["vector <out>"]
        slave.setInt16([into[1]], [-3, 4])
        for _ in range(2):
            slave.doStep(time, STEP)
            time += STEP
        assert slave.getInt16([back[1]], nValues=2) == [-3, 4]
        assert slave.getInt64([named["bus.state"][1]]) == [2]
        assert slave.getString([named["bus.reason"][1]]) == ["the hosted program is there"]
    edges = named["bool <out>.edges"]
    assert get(edges[0], [edges[1]])[0] in (0, 1)
    status = named["bus.status"]
    assert (slave.getInteger if is_two else slave.getInt64)([status[1]]) == [0]
    assert any("is running" in text for _, category, text in lines if category == "logEvents"), lines
    # Time cannot go back: expect an error, and a sentence in the tool's log.
    lines.clear()
    try:
        slave.doStep(0.0, STEP)
    except Exception:  # noqa: BLE001 - FMPy's own
        pass
    else:
        raise AssertionError("a step back in time was done")
    assert any("time cannot go back" in text for _, _, text in lines), lines
    # Again from the start.
    slave.reset()
    if is_two:
        slave.setupExperiment(startTime=5.0)
        slave.enterInitializationMode()
    else:
        slave.enterInitializationMode(startTime=5.0)
    slave.exitInitializationMode()
    slave.doStep(5.0, STEP)
    slave.terminate()
    slave.freeInstance()
    # Calls it as a user does.
    result = fmpy.simulate_fmu(folder, stop_time=0.5, output_interval=STEP, output=["bus.status"], model_description=description)
    assert result["bus.status"][-1] in (0, 1), result[-1]
    return f"version={description.fmiVersion} variables={len(named)}"


def events(path):
    """An FMU of 3.0 in the event mode: a step ends with the PLC's scan, if the tool allows that, and the clock ticks."""
    import fmpy
    from fmpy import extract, read_model_description
    from fmpy.fmi3 import FMU3Slave

    description = read_model_description(path)
    named = {one.name: one for one in description.modelVariables}
    items = [item.name for item in named["bus.status"].declaredType.items]
    assert items == ["fresh", "unchanged", "stale"], items
    assert named["vector <out>"].shape == (2,), named["vector <out>"]
    assert description.coSimulation.hasEventMode and description.coSimulation.mightReturnEarlyFromDoStep

    def times(**options):
        result = fmpy.simulate_fmu(path, stop_time=0.2, output_interval=0.05, output=["vector <out>", "bus.status"], use_event_mode=True, **options)
        assert result["vector <out>"].shape[1] == 2
        return sorted({round(time, 9) for time in result["time"]})

    regular = [0.0, 0.05, 0.1, 0.15, 0.2]
    assert times() == regular
    # The PLC scans every 10 ms from the end of the first step on.
    assert times(early_return_allowed=True) == [0.0, *(round(0.05 + 0.01 * at, 9) for at in range(16))]
    slave = FMU3Slave(
        guid=description.guid, modelIdentifier=description.coSimulation.modelIdentifier, unzipDirectory=extract(path), instanceName="events"
    )
    slave.instantiate(eventModeUsed=True, earlyReturnAllowed=True)
    slave.enterInitializationMode(startTime=0.0, stopTime=0.2)
    slave.exitInitializationMode()
    clock = [named["bus.cycle"].valueReference]
    ticks, time = 0, 0.0
    ticked = slave.getClock(clock)[0]
    while time < 0.2 - 1e-9:
        again, ends, _, _, has_next, following = slave.updateDiscreteStates()
        assert not again and not ends
        assert slave.getClock(clock) == [False]
        assert not has_next or time < following <= time + STEP + 1e-9, (time, following)
        slave.enterStepMode()
        event, ends, _, reached = slave.doStep(time, min(0.05, 0.2 - time))
        assert not ends and reached > time, (time, reached)
        time = reached
        slave.enterEventMode()
        ticked = slave.getClock(clock)[0]
        assert ticked == event
        ticks += ticked
    assert ticks == 16, ticks
    slave.enterStepMode()
    for length in (STEP, 1.0):
        try:
            slave.doStep(time, length)
        except Exception:  # noqa: BLE001 - FMPy's own
            continue
        raise AssertionError("a step beyond the stop time was done")
    slave.terminate()
    slave.freeInstance()
    return "ticks=16"


def tank(path):
    """The FMU of examples/fmu-tank, which tests this project's import, must also work in other tools."""
    import fmpy
    from fmpy.validation import validate_fmu

    problems = validate_fmu(path)
    assert not problems, problems
    result = fmpy.simulate_fmu(path, stop_time=1, start_values={"valve": True})
    assert abs(result["level"][-1] - 0.52) < 1e-9, result[-1]
    return "level=0.52"


def toolbox(path):
    import subprocess

    tool = Path(sys.executable).with_name("fmutool")
    done = subprocess.run([tool, "-input", path, "-check"], capture_output=True, text=True, check=False)
    told = done.stdout + done.stderr
    assert done.returncode == 0, told
    assert "seems to be compliant" in told and "No semantic error" in told, told
    return "checked"


def cosim(path):
    from libcosimpy.CosimExecution import CosimExecution
    from libcosimpy.CosimManipulator import CosimManipulator
    from libcosimpy.CosimObserver import CosimObserver
    from libcosimpy.CosimSlave import CosimLocalSlave

    slave = CosimLocalSlave(fmu_path=path, instance_name="types")
    execution = CosimExecution.from_step_size(step_size=int(STEP * 1e9))
    index = execution.add_local_slave(local_slave=slave)
    observer = CosimObserver.create_last_value()
    execution.add_observer(observer=observer)
    manipulator = CosimManipulator.create_override()
    execution.add_manipulator(manipulator=manipulator)
    variables = {one.name.decode(): one.reference for one in execution.slave_variables(index)}
    manipulator.slave_real_values(slave_index=index, variable_references=[variables["lreal <in>"]], values=[2.5])
    manipulator.slave_boolean_values(slave_index=index, variable_references=[variables["bool <in>"]], values=[True])
    for _ in range(4):
        execution.step()
    assert observer.last_real_values(slave_index=index, variable_references=[variables["lreal <out>"]])[0] == 2.5
    assert observer.last_boolean_values(slave_index=index, variable_references=[variables["bool <out>"]])[0]
    return "steps=4"


def pathsim(path):
    """Only run by hand: pip install pathsim-fmi==0.1.1, which brings more packages than a test is worth."""
    from fmpy import read_model_description
    from pathsim import Connection, Simulation
    from pathsim.blocks import Constant, Scope
    from pathsim_fmi import CoSimulationFMU

    variables = read_model_description(path).modelVariables
    port = lambda name, causality: [one.name for one in variables if one.causality == causality].index(name)
    unit, source, scope = CoSimulationFMU(path, dt=STEP), Constant(2.5), Scope()
    wires = [
        Connection(source, unit[port("lreal <in>", "input")]),
        Connection(unit[port("lreal <out>", "output")], scope),
    ]
    Simulation([source, unit, scope], wires, dt=STEP).run(10 * STEP)
    _, values = scope.read()
    assert values[0][-1] == 2.5, values
    return "steps=10"


def misuse(path):
    """Calls the functions as no tool should: every call returns, and the process survives."""
    from fmpy import extract, read_model_description

    description = read_model_description(path)
    folder = Path(extract(path))
    library = ctypes.CDLL(str(next(folder.glob("binaries/*/*.so"))))
    is_two = description.fmiVersion == "2.0"
    none, double, size = ctypes.c_void_p(None), ctypes.c_double, ctypes.c_size_t
    uri = folder.joinpath("resources").as_uri().encode()
    if is_two:
        make = library.fmi2Instantiate
        make.restype = ctypes.c_void_p
        right = lambda guid, where: make(b"x", 1, guid, where, None, 0, 0)
        assert make(None, 1, None, None, None, 0, 0) is None
        assert make(b"x", 0, description.guid.encode(), uri, None, 0, 0) is None, "model exchange"
        get, step = library.fmi2GetReal, library.fmi2DoStep
    else:
        make = library.fmi3InstantiateCoSimulation
        make.restype = ctypes.c_void_p
        right = lambda guid, where: make(b"x", guid, where, False, False, False, False, None, size(0), None, None, None)
        assert right(None, None) is None
        get, step = library.fmi3GetFloat64, library.fmi3DoStep
    assert right(b"{another}", uri) is None
    # Every form in which a folder can be given; without any, the library finds its own.
    plain = str(folder / "resources")
    for where in [uri, uri + b"/", uri.replace(b"file:///", b"file:/"), plain.encode(), plain.encode() + b"/", b"file:///nowhere", None]:
        handle = right(description.guid.encode(), where)
        assert handle, where
        free = library.fmi2FreeInstance if is_two else library.fmi3FreeInstance
        free(ctypes.c_void_p(handle))
        free(ctypes.c_void_p(handle))
    handle = ctypes.c_void_p(right(description.guid.encode(), uri))
    value, reference = (double * 1)(), (ctypes.c_uint32 * 1)(4000)
    more = [] if is_two else [size(1)]
    for instance in [none, ctypes.c_void_p(12345), handle]:
        assert get(instance, reference, size(1), value, *more) == 3
        assert get(instance, None, size(1), None, *more) == 3
        assert step(instance, double(0), double(STEP), 1, None, None, None, None) == 3, "before the initialisation"
    lacking = library.fmi2GetFMUstate if is_two else library.fmi3GetFMUState
    assert lacking(handle, None) == 3
    if not is_two:
        # Without the event mode, and before the initialisation.
        flag = (ctypes.c_bool * 1)()
        for call in (library.fmi3EnterEventMode, library.fmi3EnterStepMode, library.fmi3ExitInitializationMode, library.fmi3Terminate):
            assert call(handle) == 3 and call(none) == 3
        assert library.fmi3UpdateDiscreteStates(handle, None, None, None, None, None, None) == 3
        assert library.fmi3GetClock(handle, reference, size(1), flag) == 3
        assert library.fmi3GetClock(handle, None, size(1), None) == 3
        enter = library.fmi3EnterInitializationMode
        never = double(float("nan"))
        assert enter(handle, False, double(0), double(0), True, double(-1)) == 3
        assert enter(handle, False, double(0), never, False, double(0)) == 3
        assert enter(handle, True, never, double(0), True, double(1)) == 0, "a tolerance has no effect"
        assert enter(handle, False, double(0), double(0), False, double(0)) == 3
        assert library.fmi3ExitInitializationMode(handle) == 0
        assert library.fmi3UpdateDiscreteStates(handle, None, None, None, None, None, None) == 3
        # A whole array has two values.
        vector = (ctypes.c_uint32 * 1)(next(one.valueReference for one in description.modelVariables if one.name == "vector <in>"))
        shorts = (ctypes.c_int16 * 3)()
        for count in (0, 1, 2, 3):
            assert library.fmi3SetInt16(handle, vector, size(1), shorts, size(count)) == (0 if count == 2 else 3), count
            assert library.fmi3GetInt16(handle, vector, size(1), shorts, size(count)) == (0 if count == 2 else 3), count
        assert step(handle, double(0), double(STEP), False, None, None, None, None) == 0
        assert step(handle, double(STEP), double(1), False, None, None, None, None) == 3, "beyond the stop time"
        assert library.fmi3Terminate(handle) == 0
        assert library.fmi3Terminate(handle) == 3
    (library.fmi2FreeInstance if is_two else library.fmi3FreeInstance)(handle)
    (library.fmi2FreeInstance if is_two else library.fmi3FreeInstance)(none)
    return "lives"


def rig(path, record):
    """The rig of driver.cfg, its program stepped: the same inputs as in the test in Rust, recorded by the FMU."""
    from fmpy import extract, read_model_description
    from fmpy.fmi2 import FMU2Slave
    from fmpy.fmi3 import FMU3Slave

    description = read_model_description(path)
    named = {one.name: one for one in description.modelVariables}
    is_two = description.fmiVersion == "2.0"
    slave = (FMU2Slave if is_two else FMU3Slave)(
        guid=description.guid, modelIdentifier=description.coSimulation.modelIdentifier, unzipDirectory=extract(path), instanceName="rig"
    )
    slave.instantiate()
    slave.setString([named["record"].valueReference], [record])
    if is_two:
        slave.setupExperiment(startTime=0.0)
        slave.enterInitializationMode()
    else:
        slave.enterInitializationMode(startTime=0.0)
    slave.exitInitializationMode()
    bits = [one.valueReference for one in description.modelVariables if one.causality == "input" and one.type == "Boolean"]
    reals = [one.valueReference for one in description.modelVariables if one.causality == "input" and one.type != "Boolean"]
    random = 1
    for tick in range(2000):
        random = (random * 6364136223846793005 + 1442695040888963407) % 2**64
        word = random >> 32
        slave.setBoolean(bits, [bool(word >> (at % 31) & 1) for at in range(len(bits))])
        (slave.setReal if is_two else slave.setFloat64)(reals, [(word >> (3 * at)) % 1000 / 4 for at in range(len(reals))])
        slave.doStep(tick * 0.002, 0.002)
    slave.terminate()
    slave.freeInstance()
    return "steps=2000"


def rig_in_c(library, config, record):
    """The same with the functions of include/tickbus.h."""
    native = ctypes.CDLL(library)
    native.tb_buffer_of.restype = ctypes.POINTER(ctypes.c_uint64)
    native.tb_last_error.restype = ctypes.c_char_p
    driver = ctypes.c_int64()
    tables = f'[record]\nfile = "{record}"'.encode()
    assert native.tb_open(config.encode(), tables, ctypes.byref(driver)) == 0, native.tb_last_error()

    class Signal(ctypes.Structure):
        _fields_ = [(name, ctypes.c_char_p) for name in ("name", "address", "data_type", "unit", "station")]
        _fields_ += [(name, ctypes.c_int32) for name in ("slot", "edges", "is_written", "kind")]
        _fields_ += [("fail_safe", ctypes.c_uint64)]

    signals = [Signal() for _ in range(native.tb_signal_count(driver))]
    for at, signal in enumerate(signals):
        assert native.tb_signal_at(driver, at, ctypes.byref(signal)) == 0, native.tb_last_error()
    written = [signal for signal in signals if signal.is_written]
    # The head of a tb_buffer of version 2 has 11 words.
    bits = [11 + signal.slot for signal in written if signal.data_type == b"BOOL"]
    reals = [11 + signal.slot for signal in written if signal.data_type != b"BOOL"]
    words = native.tb_buffer_of(driver)
    assert words[0] == 2, f"a buffer of version {words[0]}"
    numbers = ctypes.cast(words, ctypes.POINTER(ctypes.c_double))
    random = 1
    for tick in range(2000):
        random = (random * 6364136223846793005 + 1442695040888963407) % 2**64
        word = random >> 32
        for at, slot in enumerate(bits):
            numbers[slot] = float(word >> (at % 31) & 1)
        for at, slot in enumerate(reals):
            numbers[slot] = (word >> (3 * at)) % 1000 / 4
        words[4] = (tick + 1) * 2_000_000
        assert native.tb_exchange(driver) >= 0, native.tb_last_error()
    assert native.tb_close(driver) == 0
    return "steps=2000"


TOOLS = [fmpy, events, tank, toolbox, cosim, pathsim, misuse, rig, rig_in_c]

if __name__ == "__main__":
    tool, *arguments = sys.argv[1:]
    # FMPy leaves what it extracts, 50 MB each.
    with tempfile.TemporaryDirectory() as folder:
        tempfile.tempdir = os.environ["TMPDIR"] = folder
        print("fmi_tools: ok", {one.__name__: one for one in TOOLS}[tool](*arguments))
