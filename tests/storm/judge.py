"""Judges a line of the storm: by the stamps that each end wrote and saw, and by the line's misfortunes."""

from bisect import bisect_left, bisect_right
from dataclasses import dataclass, field

from plan import CONTROLLER, DEVICE, FAIL_SAFE, FAIL_SAFE_REAL, FAIL_SAFE_WHOLE, MS, ROLES, SECOND

STALE = 2


@dataclass(eq=False)
class Life:
    """A process of an end, from its start to its death."""

    end: int
    number: int
    ticks: list = field(default_factory=list)
    # When it is killed, or asked to end; None while it lives.
    ended: int | None = None
    # True if it was asked to end, and has closed.
    closed: bool = False
    # The times in which it was suspended, or cut off.
    downs: list = field(default_factory=list)
    is_second: bool = False
    # When its process was started.
    born: int = 0
    # The number of misfortunes that suspend it now.
    suspended: int = 0


@dataclass(eq=False)
class Tick:
    number: int
    began: int
    received: int
    ended: int
    status: int
    age: int
    sequence: int
    stations: list


def read(path, stations):
    """The ticks of a life. A killed process can leave an incomplete last line."""
    ticks = []
    try:
        lines = path.read_text().splitlines()
    except FileNotFoundError:
        return ticks
    for line in lines:
        words = line.split()
        if len(words) != 7 + 5 * stations:
            break
        shown = [words[7 + 5 * at : 12 + 5 * at] for at in range(stations)]
        shown = [(int(stamp), int(level), int(edges), float(whole), float(real)) for stamp, level, edges, whole, real in shown]
        ticks.append(Tick(*map(int, words[:7]), shown))
    return ticks


def beside(stamp):
    """The values beside a stamp, which are derived from it."""
    mixed = stamp * 0x9E3779B97F4A7C15 & 0xFFFFFFFFFFFFFFFF
    signed = [(mixed >> shift & 0xFFFF ^ 0x8000) - 0x8000 for shift in (32, 16)]
    return mixed >> 63, float(signed[0]), signed[1] / 2


def recording(path, life_of, plan, end):
    """Compares a recording in CSV with the end that made it: the rows must be the ticks, every missing one must be counted, and
    none may be cut; only a killed process may leave the last one incomplete."""
    lines = path.read_text().splitlines(keepends=True)
    if len(lines) < 2:
        return []
    names = lines[0].rstrip().split(",")
    own, other = "IQ"[end], "QI"[end]
    life, before, findings = None, None, []
    for at, line in enumerate(lines[1:], 2):
        row = dict(zip(names, line.rstrip("\n").split(",")))
        if not line.endswith("\n") or len(row) != len(names):
            if at < len(lines) or not (life and life.ended and not life.closed):
                findings.append(f"recording: {path.name} line {at} is cut: {line!r}")
            break
        tick, dropped = int(row["bus.tick"]), int(row["bus.dropped"])
        life = life or life_of(int(row[f"stamp{own}0"]) >> 48)
        if life is None:
            return [f"recording: {path.name} begins with a stamp that nobody wrote"]
        if before and tick - before[0] - 1 != dropped - before[1]:
            findings.append(f"recording: {path.name} line {at}: tick {tick} after {before[0]}, dropped {dropped} after {before[1]}")
        before = tick, dropped
        if tick > len(life.ticks):
            continue
        seen = life.ticks[tick - 1]
        for station, (stamp, level, edges, whole, real) in enumerate(seen.stations):
            written = life.number << 48 | (end == DEVICE) << 44 | station << 40 | tick
            expected = {f"stamp{own}{station}": written, f"stamp{other}{station}": stamp, f"level{other}{station}": level}
            expected |= {f"pulse{other}{station}.edges": edges, f"whole{other}{station}": whole, f"real{other}{station}": real}
            # A stamp has more digits than a double.
            wrong = {name: row[name] for name, value in expected.items() if (int if "stamp" in name else float)(row[name]) != value}
            if wrong or int(row["bus.status"]) != seen.status:
                findings.append(f"recording: {path.name} line {at}: {wrong or row['bus.status']}, and the end had {seen}")
    if not findings and life.closed and not plan.small_disk and before[0] < len(life.ticks) - 1:
        findings.append(f"recording: {path.name} ends with tick {before[0]}, and its driver was closed after tick {len(life.ticks)}")
    return findings[:5]


class Judge:
    """Judges all lives of a line."""

    def __init__(self, plan, lives, stalls):
        self.plan, self.lives, self.stalls = plan, lives, stalls
        self.findings = []
        self.judged = {"values": 0, "pulses": 0, "ages": 0}
        self.ended = {life: [tick.ended for tick in life.ticks] for life in lives}

    def finding(self, promise, reader, tick, what):
        self.findings.append(f"{promise}: {ROLES[reader.end]} life {reader.number} tick {tick.number} at {tick.began}: {what}")

    def writers(self, reader):
        """The lives whose values a reader can see, and the area in their stamps. The command sends back the values that it
        reads, so its peer sees its own again."""
        other = 1 - reader.end
        of = reader.end if self.plan.ends[other].program == "command" else other
        return [life for life in self.lives if life.end == of], int(of == DEVICE)

    def slack(self, since, until):
        """The time that the line and the threads of both ends add to an age."""
        periods = sum(end.period for end in self.plan.ends)
        return 60 * MS + 6 * self.plan.cycle + 2 * periods + 2 * self.stalls.longest(since - SECOND, until)

    def allowed(self):
        """The greatest error of an age that is too small, as docs/ARCHITECTURE.md states it."""
        return max(self.plan.max_age // 2, 2 * MS)

    def judge(self):
        for reader in self.lives:
            self.reader(reader)
        for end in (DEVICE, CONTROLLER):
            self.pulses(end)
        return self.findings

    def reader(self, reader):
        writers, area = self.writers(reader)
        if not writers:
            return
        by_number = {life.number: life for life in writers}
        newest, sequence, edges = {}, 0, 0
        for tick in reader.ticks:
            is_stale = tick.status == STALE
            if tick.status < 0 or tick.status > STALE:
                self.finding("failed", reader, tick, f"status {tick.status}")
            if not is_stale and tick.age > self.plan.max_age:
                self.finding("stale", reader, tick, f"age {tick.age} ns, and not stale")
            if tick.status == 0 and tick.sequence <= sequence:
                self.finding("fresh", reader, tick, "without a new cycle")
            sequence = tick.sequence if not is_stale else sequence
            first = None
            for station, (stamp, level, count, whole, real) in enumerate(tick.stations):
                if is_stale and count:
                    self.finding("stale edges", reader, tick, f"station {station} has {count}")
                if stamp == FAIL_SAFE:
                    if (level, whole, real) != (0, FAIL_SAFE_WHOLE, FAIL_SAFE_REAL):
                        self.finding("torn", reader, tick, f"station {station}: {(level, whole, real)} beside the fail-safe stamp")
                    life, number = 0, 0
                else:
                    if is_stale:
                        self.finding("stale values", reader, tick, f"station {station} shows {stamp:#x}")
                    life, number = self.stamp(reader, tick, station, (stamp, level, whole, real), by_number, area)
                    if number < newest.get((station, life), 0) and not self.are_two_that_bring_back(1 - reader.end, tick.began):
                        self.finding("order", reader, tick, f"station {station}: {number} of life {life} after {newest[station, life]}")
                    newest[station, life] = number
                if first not in (None, (life, number)):
                    self.finding("torn", reader, tick, f"station {station} has {(life, number)}, station 0 {first}")
                first = (life, number) if first is None else first
                self.judged["values"] += 1
            if not is_stale:
                self.age(reader, tick, writers)
                if first != (0, 0):
                    self.old_as_young(reader, tick, by_number, first)
                    self.farewell(reader, tick, by_number.get(first[0]))
            edges += sum(station[2] for station in tick.stations)
        self.edges(reader, writers, edges)

    def stamp(self, reader, tick, station, shown, by_number, area):
        stamp, level, whole, real = shown
        number, life = stamp & 0xFF_FFFF_FFFF, by_number.get(stamp >> 48)
        has_written = False
        if life is not None and stamp >> 44 & 15 == area and stamp >> 40 & 15 == station:
            # A killed process can have sent one more tick than it has logged.
            last = life.ticks[-1] if life.ticks else None
            known = life.ticks[number - 1] if last and 0 < number <= last.number else None
            noted = known.began if known else last.ended if last else 0
            has_written = number <= (last.number if last else 0) + 1 and noted <= tick.ended
        if not has_written:
            self.finding("invented", reader, tick, f"station {station} shows {stamp:#x}, which nobody had written")
            return 0, 0
        if (level, whole, real) != beside(stamp):
            self.finding("torn", reader, tick, f"station {station}: {(level, whole, real)} beside {stamp:#x}, which has {beside(stamp)}")
        return life.number, number

    def are_two_that_bring_back(self, end, at):
        """True if two processes of the command send back the same values: then one can be behind the other. Values sent before
        a cut can arrive after it."""
        if self.plan.ends[end].program != "command":
            return False
        second = [life for life in self.lives if life.end == end and life.is_second]
        return any(life.born <= at and (life.ended is None or at <= life.ended + 5 * SECOND) for life in second)

    def down_since(self, lives, at):
        """Since when all lives of an end have been dead, suspended or cut off; None if one is not, or has just come back."""
        since = None
        for life in lives:
            spans = life.downs + ([(life.ended, None)] if life.ended else [])
            begins = [begin for begin, end in spans if begin <= at and (end is None or at <= end)]
            if life.born > at:
                continue
            if not begins:
                return None
            since = max(since or 0, min(begins))
        return since

    def age(self, reader, tick, writers):
        """A peer that cannot send is at least that old, and after `max_age` its values no longer count."""
        peers = [life for life in self.lives if life.end == 1 - reader.end]
        since = self.down_since(peers, tick.began)
        if since is None:
            return
        self.judged["ages"] += 1
        # The last data of a process that was killed while the network was cut arrive when TCP sends them again.
        ended = [(life.ended, self.arrived(life, tick)) for life in peers if life.ended]
        truth = tick.began - max([since, *(arrived for at, arrived in ended if arrived > at)])
        allowed = self.allowed() + self.slack(since, tick.began)
        if self.plan.bus == "dispatcher":
            # The dispatcher lives, and reports a lost source after the time that its `max_age` promises.
            allowed += self.plan.max_age
            if truth <= self.plan.max_age + allowed or all(station[0] == FAIL_SAFE for station in tick.stations):
                return
        if truth > tick.age + allowed:
            self.finding("age", reader, tick, f"told {tick.age} ns, and its peer has been down for {truth} ns")

    def old_as_young(self, reader, tick, by_number, first):
        """Valid values are not older than their age, and the time on the way."""
        life = by_number[first[0]]
        is_back = self.plan.ends[1 - reader.end].program == "command"
        heard = tick.began - tick.age - self.allowed() - self.slack(tick.began - tick.age - 2 * SECOND, tick.began)
        if is_back or self.plan.bus == "dispatcher":
            heard -= self.plan.max_age + self.allowed()
        # What its process could not send while it was suspended, killed or cut off; or the one that sends back what it gets.
        involved = [other for other in self.lives if is_back or other.end == reader.end]
        spans = life.downs + [down for other in involved for down in other.downs]
        for begin, end in spans:
            if begin - SECOND <= tick.began and (end is None or heard <= end + SECOND):
                heard = min(heard, begin - SECOND)
        others = [other for other in by_number.values() if other is not life]
        if any(other.ticks and other.ticks[0].began <= tick.began and other.ticks[-1].ended >= heard for other in others):
            return
        least = bisect_left(self.ended[life], heard)
        if first[1] < least:
            written = life.ticks[first[1] - 1].ended if first[1] else 0
            self.finding("old as young", reader, tick, f"tick {first[1]} of life {life.number}, {tick.began - written} ns old, with age {tick.age}")

    def farewell(self, reader, tick, life):
        """A controller that has closed leaves its outputs off; and a simulation that hangs has a watchdog."""
        if life is None or self.plan.ends[1 - reader.end].program == "command":
            return
        slack = self.slack(tick.began - 2 * SECOND, tick.began) + self.plan.max_age
        if life.closed and life.end == CONTROLLER and tick.began > self.arrived(life, tick) + slack:
            self.finding("left on", reader, tick, f"life {life.number} closed {tick.began - life.ended} ns ago")
        watchdog = self.plan.watchdog(life.end)
        last = bisect_right(self.ended[life], tick.began) - 1
        if watchdog is None or last < 0 or life.ticks[last] is life.ticks[-1]:
            return
        silent = tick.began - self.ended[life][last]
        is_ticking = last + 1 < len(life.ticks) and life.ticks[last + 1].began <= tick.began
        if not is_ticking and silent > watchdog + slack + self.allowed():
            self.finding("left on", reader, tick, f"life {life.number} has not ticked for {silent} ns")

    @staticmethod
    def arrived(life, tick):
        """When all data of a life have arrived: TCP resends data from a cut network, after up to the duration of the cut."""
        cuts = [(begin, end or tick.began) for begin, end in life.downs]
        return max([life.ended, *(2 * end - begin for begin, end in cuts if begin <= life.ended < end)])

    def edges(self, reader, writers, seen):
        """A reader never sees more edges than were written while it was there, or just before."""
        if not reader.ticks:
            return
        since, until = reader.ticks[0].began - 3 * SECOND, reader.ticks[-1].ended
        pulses = 0
        for life in writers:
            every = self.plan.ends[life.end].pulse_every
            known = [tick for tick in life.ticks if tick.number % every == 0 and since <= tick.ended and tick.began <= until]
            # One pulse that a killed process has not logged.
            pulses += len(known) + 1
        if seen > pulses * self.plan.stations:
            self.finding("edges", reader, reader.ticks[-1], f"{seen} seen, and {pulses} pulses written to each of {self.plan.stations} stations")

    def pulses(self, end):
        """While both ends are well, the reader sees each pulse of `end` once."""
        for writer in self.lives:
            if writer.end != end or writer.is_second:
                continue
            every = self.plan.ends[end].pulse_every
            back = self.plan.ends[1 - end].program == "command"
            for tick in writer.ticks:
                if tick.number % every:
                    continue
                since, until = tick.began - SECOND, tick.ended + SECOND
                reader_end = end if back else 1 - end
                readers = [life for life in self.lives if life.end == reader_end and life.ticks]
                readers = [life for life in readers if life.ticks[0].began <= since and life.ticks[-1].ended >= until]
                if len(readers) == 1 and self.is_well(since, until) and self.is_steady(readers[0], writer, since, until):
                    self.pulse(readers[0], writer, tick)

    def is_well(self, since, until):
        """True if neither end had a misfortune around a span, and the machine had time."""
        for life in self.lives:
            begins = life.ticks[0].began if life.ticks else life.born
            spans = [*life.downs, (life.born, begins)] + ([(life.ended, life.ended)] if life.ended else [])
            if any(begin <= until and (end is None or end + SECOND >= since) for begin, end in spans):
                return False
            if life.is_second and life.born <= until and (life.ended is None or life.ended >= since - SECOND):
                return False
        return self.stalls.longest(since, until) == 0

    def is_steady(self, reader, writer, since, until):
        """True if the reader had fresh data all the time, and both ticked."""
        for life in (reader, writer):
            times = [since, *(tick.began for tick in life.ticks if since <= tick.began <= until), until]
            if any(after - before > 150 * MS for before, after in zip(times, times[1:])):
                return False
        return all(tick.status != STALE and tick.age <= self.plan.max_age // 2 for tick in reader.ticks if since <= tick.began <= until)

    def pulse(self, reader, writer, tick):
        self.judged["pulses"] += 1
        # Pulses are 0.9 s apart.
        until = tick.ended + 800 * MS
        for station in range(self.plan.stations):
            seen = sum(each.stations[station][2] for each in reader.ticks if tick.began - 50 * MS <= each.ended and each.began <= until)
            if seen != 1:
                self.finding("pulses", reader, tick, f"of life {writer.number}: station {station} saw {seen} edges within 0.8 s")
