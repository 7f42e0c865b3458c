"""Judges the storm's judge: a line in which all is well breaks no promise, and each way to break one is found."""

import copy
import unittest

from judge import Judge, Life, Tick, beside
from plan import FAIL_SAFE, FAIL_SAFE_REAL, FAIL_SAFE_WHOLE, MS, SECOND, draw

NOTHING = (FAIL_SAFE, 0, 0, FAIL_SAFE_WHOLE, FAIL_SAFE_REAL)


class NoStalls:
    @staticmethod
    def longest(_since, _until):
        return 0


def stamped(life, area, tick, edges):
    stamp = life << 48 | area << 44 | tick
    level, whole, real = beside(stamp)
    return stamp, level, edges, whole, real


class TheJudge(unittest.TestCase):
    def setUp(self):
        self.plan = draw("a quiet line", ("c",), ("socket",), (), False)
        self.plan.stations, self.plan.max_age, self.plan.cycle = 1, 400 * MS, 10 * MS
        for end in self.plan.ends:
            end.program, end.period, end.pulse_every, end.pause = "c", 10 * MS, 100, 0
        self.device, self.controller = Life(0, 1), Life(1, 2)
        for tick in range(1, 1500):
            began = 100 * SECOND + tick * 10 * MS
            for life, other, area in ((self.device, 2, 0), (self.controller, 1, 1)):
                edges = int(tick > 2 and (tick - 1) % 100 == 0)
                shown = stamped(other, area, tick - 1, edges) if tick > 1 else NOTHING
                life.ticks.append(Tick(tick, began, began, began + MS, 0 if tick > 1 else 2, 5 * MS, tick - 1, [shown]))

    def found(self):
        findings = Judge(self.plan, [self.device, self.controller], NoStalls).judge()
        return {finding.split(":")[0] for finding in findings}

    def show(self, tick, *shown):
        self.device.ticks[tick].stations = [shown]

    def test_a_quiet_line_breaks_no_promise(self):
        judge = Judge(self.plan, [self.device, self.controller], NoStalls)
        self.assertEqual(judge.judge(), [])
        self.assertGreater(judge.judged["pulses"], 15)

    def test_what_nobody_wrote_is_found(self):
        self.show(500, *stamped(7, 0, 400, 0))
        self.assertIn("invented", self.found())
        self.show(500, *stamped(2, 0, 900, 0))
        self.assertIn("invented", self.found())

    def test_two_ticks_in_one_are_found(self):
        stamp, level, *others = stamped(2, 0, 500, 0)
        self.show(500, stamp, 1 - level, *others)
        self.assertIn("torn", self.found())

    def test_old_values_with_a_young_age_are_found(self):
        self.show(500, *stamped(2, 0, 440, 0))
        self.assertIn("order", self.found())
        self.assertIn("old as young", self.found())

    def test_a_peer_that_is_dead_and_counts_is_found(self):
        self.controller.ticks = self.controller.ticks[:700]
        self.controller.ended = self.controller.ticks[-1].ended
        for tick in self.device.ticks[700:]:
            tick.stations = [stamped(2, 0, 700, 0)]
        self.assertIn("age", self.found())

        # Its last data can have waited in a network that was cut when it was killed.
        ended = self.controller.ended
        self.controller.downs = [(ended - SECOND // 10, ended + 10 * SECOND)]
        self.assertNotIn("age", self.found())

    def test_outputs_that_are_left_on_are_found(self):
        self.controller.ticks = self.controller.ticks[:700]
        self.controller.ended, self.controller.closed = self.controller.ticks[-1].ended, True
        for tick in self.device.ticks[700:]:
            tick.stations = [stamped(2, 0, 700, 0)]
        self.assertIn("left on", self.found())
        # Its last data can have waited in a network that was cut when it closed, but no longer.
        ended = self.controller.ended
        for after, is_found in ((6 * SECOND, False), (SECOND, True)):
            self.controller.downs = [(ended - SECOND, ended + after)]
            self.assertEqual("left on" in self.found(), is_found, after)

    def test_pulses_that_are_lost_and_invented_are_found(self):
        well = copy.deepcopy(self.device.ticks)
        self.show(600, *stamped(2, 0, 600, 0))
        self.assertEqual(self.found(), {"pulses"})
        self.device.ticks = well
        self.show(650, *stamped(2, 0, 650, 1))
        self.assertEqual(self.found(), {"pulses"})
        for tick in range(700, 720):
            self.show(tick, *stamped(2, 0, tick, 3))
        self.assertEqual(self.found(), {"pulses", "edges"})

    def test_stale_values_and_edges_are_found(self):
        self.device.ticks[500].status = 2
        self.assertIn("stale values", self.found())
        self.show(500, *NOTHING[:2], 1, *NOTHING[3:])
        self.assertIn("stale edges", self.found())


if __name__ == "__main__":
    unittest.main()
