"""The plan of a line of the storm, drawn from its seed: bus, ends, driver.cfg, and the misfortunes with their times."""

import random
from dataclasses import dataclass, field

DEVICE, CONTROLLER = 0, 1
ROLES = ("device", "controller")
# Stamps of no life, and their other values.
FAIL_SAFE, FAIL_SAFE_WHOLE, FAIL_SAFE_REAL = 2989, -7, 2.5
SECOND = 1_000_000_000
MS = 1_000_000

BUSES = ("socket", "on change", "modbus", "modbus rtu", "s7", "opcua", "dispatcher")
# The command sends back the values that it reads: "mirror" as device, "plc mirror" as controller.
PROGRAMS = ("c", "python", "java", "fmu", "command")


@dataclass
class Event:
    at: float
    what: str
    end: int
    span: float

    def __str__(self):
        where = "" if self.what in ("cut", "dispatcher killed", "dispatcher stopped") else f" {ROLES[self.end]}"
        return f"{self.at:.2f}s {self.what}{where} {self.span:.2f}s"


@dataclass
class End:
    program: str
    period: int
    halves: bool
    pulse_every: int
    pause_at: int = 0
    pause: int = 0


@dataclass
class Plan:
    seed: str
    bus: str
    controller_serves: bool
    stations: int
    cycle: int
    max_age: int
    writers: int
    ends: list
    records: list
    small_disk: bool
    span: float
    events: list = field(default_factory=list)

    @property
    def asks(self):
        """True if one end asks and the other answers."""
        return self.bus in ("modbus", "modbus rtu", "s7", "opcua")

    def server(self):
        """The end that listens; None with a dispatcher between them."""
        return None if self.bus == "dispatcher" else int(self.controller_serves)

    def watchdog(self, end):
        """The time without a tick after which an end's peer gets fail-safe values; None for never. A device's must be configured."""
        return max(self.max_age, 10 * self.cycle, 250 * MS) if end == CONTROLLER else None

    def names(self):
        """The labels for the table of combinations."""
        names = [f"{self.ends[0].program}-{self.ends[1].program}", self.bus]
        return names + sorted({event.what for event in self.events})

    def __str__(self):
        ends = ", ".join(
            f"{role} {end.program} every {end.period / MS:g} ms{' in halves' if end.halves else ''}" for role, end in zip(ROLES, self.ends)
        )
        listens = "" if self.server() is None else f", {ROLES[self.server()]} listens"
        events = "; ".join(map(str, self.events)) or "nothing happens"
        pauses = "".join(
            f"; {role} pauses {end.pause / MS:g} ms in tick {end.pause_at}" for role, end in zip(ROLES, self.ends) if end.pause
        )
        return (
            f"{self.seed}: {self.bus}{listens}, {self.stations} stations, cycle {self.cycle // MS} ms, max_age {self.max_age // MS} ms; "
            f"{ends}{'; records' if any(self.records) else ''}{' on a small disk' if self.small_disk else ''}; {events}{pauses}"
        )


def draw(seed, programs, buses, without_opcua, has_network):
    """The line of a seed, using what this machine has."""
    of = random.Random(seed)
    bus = of.choice([bus for bus in BUSES if bus in buses])
    cycle = of.choice([5, 10, 20]) * MS
    if bus == "opcua":
        cycle = max(cycle, 20 * MS)
    max_age = of.choice([250, 400, 800]) * MS
    both = [of.choice([program for program in PROGRAMS if program in programs]) for _ in ROLES]
    if both == ["command", "command"] or bus == "dispatcher" and "command" in both:
        both[of.randrange(2)] = "c"
        both = ["c" if program == "command" and bus == "dispatcher" else program for program in both]
    if bus == "opcua" and set(both) & set(without_opcua):
        bus = "socket"
    ends = []
    for program in both:
        period = of.choice([3, 5, 10, 20]) * MS
        ends.append(End(program, period, of.random() < 0.5, 1 + 900 * MS // period))
    can_have_stations = bus in ("socket", "on change")
    plan = Plan(
        seed=seed,
        bus=bus,
        controller_serves=of.random() < 0.5,
        stations=of.choice([1, 2, 3]) if can_have_stations else 1,
        cycle=cycle,
        max_age=max_age,
        writers=of.choice([0, 1]),
        ends=ends,
        records=[of.random() < 0.4 and end.program not in ("fmu", "command") for end in ends],
        small_disk=of.random() < 0.5,
        span=of.choice([8.0, 12.0, 16.0]),
    )
    # Each line draws the kinds of misfortunes that can happen.
    kinds = ["stopped", "killed", "terminated", "cut", "second", "paused"]
    kinds += ["dispatcher killed", "dispatcher stopped"] if bus == "dispatcher" else []
    exist = [kind for kind in kinds if of.random() < 0.5]
    for _ in range(of.choice([0, 1, 2, 2, 3, 4, 6])):
        what, end, at = of.choice(exist or ["stopped"]), of.randrange(2), of.uniform(0, plan.span)
        span = of.choice([of.uniform(0.02, 0.4), of.uniform(0.2, 3)])
        if what == "paused":
            if ends[end].program != "command":
                ends[end].pause_at, ends[end].pause = int((at + 3) * SECOND / ends[end].period), int(span * SECOND)
        elif what != "cut" or has_network:
            plan.events.append(Event(at, what, end, span))
    plan.events.sort(key=lambda event: event.at)
    return plan


def driver_cfg(plan, end, address, recording):
    """The driver.cfg of an end."""
    role = ROLES[end]
    lines = [f'[driver]\nid = {end + 1}\nname = "{role}"', f'[fieldbus]\nrole = "{role}"']
    lines += fieldbus(plan, end, address)
    lines += [f'cycle = "{plan.cycle}ns"\nmax_age = "{plan.max_age}ns"\nreconnect = ["100ms"]']
    if recording:
        lines += [f'[record]\nfile = "{recording}"']
    if plan.stations > 1:
        lines += [f'[[station]]\nname = "s{station}"' for station in range(plan.stations)]
    lines += [signals(plan, station, area) for station in range(plan.stations) for area in "QI"]
    return "\n".join(lines) + "\n"


def fieldbus(plan, end, address):
    serves = plan.server() == end
    lines = [f'address = "{address}"']
    if plan.bus in ("socket", "on change"):
        lines += ['kind = "socket"', f'role_tcp = "{"listen" if serves else "connect"}"']
        lines += ['send = "on-change"'] if plan.bus == "on change" else []
    elif plan.bus in ("modbus", "modbus rtu", "s7"):
        lines += [f'kind = "{plan.bus.split()[0]}-{"server" if serves else "client"}"']
        lines += ['framing = "rtu"'] if plan.bus == "modbus rtu" else []
        if serves and plan.writers:
            lines += [f"writers = {plan.writers}"]
        if not serves:
            lines += [f'write_to = "tickbus {ROLES[1 - end]}"']
    elif plan.bus == "opcua" and serves:
        # Clients write changed values only: of two clients, each would leave the other one's values beside its own.
        lines += ['kind = "opcua-server"', 'security = "None"', "anonymous = true", "writers = 1"]
    elif plan.bus == "opcua":
        lines = [f'kind = "opcua-client"\nurl = "opc.tcp://{address}"\nsecurity = "None"']
        lines += [f'write_to = "urn:tickbus:{ROLES[1 - end]} tickbus"']
    else:
        lines += [f'kind = "dispatcher"\nname = "{ROLES[end].upper()}"']
    return lines


def patch():
    """The dispatcher's patch: everything that an end reads, from what the other one writes. It is there from the start, since
    the dispatcher makes requested connections one after another. Digital and analog channels are counted separately."""
    channels = [("I1", "Q1"), ("I2", "Q2"), ("AI1", "AQ1"), ("AI2", "AQ2"), ("AI3", "AQ3")]
    pairs = [(role.upper(), other.upper()) for role, other in (ROLES, ROLES[::-1])]
    lines = [f'"{end}:{own}" = "{other}:{its}"' for end, other in pairs for own, its in channels]
    return "\n".join(["[patch]", *lines]) + "\n"


def signals(plan, station, area):
    of = f'station = "s{station}"\n' if plan.stations > 1 else ""
    return "\n".join(
        f'[[signal]]\nname = "{name}{area}{station}"\naddress = "%{area}{place}"\n{of}{rest}'
        for name, place, rest in (
            ("stamp", "L0", f'type = "LWORD"\nfail_safe = {FAIL_SAFE}'),
            ("pulse", "X8.0", 'latch = "rising"\nfail_safe = false'),
            ("level", "X8.1", "fail_safe = false"),
            ("whole", "W10", f'type = "INT"\norder = "DCBA"\nfail_safe = {FAIL_SAFE_WHOLE}'),
            ("real", "D12", f'type = "REAL"\nscale = {{ raw = [0, 100], value = [0.0, 50.0] }}\nfail_safe = {FAIL_SAFE_REAL}'),
        )
    )
