#!/usr/bin/env python3
"""Gymnasium's VectorEnv over many tanks, each with its own PLC in the same process.

    tanks.py [--envs 1024] [--steps 2000] [--seed 1] [--config ../tank.cfg]

The PLC of each tank opens the valve while the level is low. The agent sets how fast the tank is emptied: it earns what it
draws, and an episode ends when the tank runs dry or over. The PLCs run by the simulation's time, so that a step takes as
long as the computer needs, and the same seed gives the same run.
"""

import argparse
import sys
import time
from pathlib import Path

import gymnasium
import numpy as np
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space

import tickbus

HERE = Path(__file__).parent
# The built-in program "mirror" is the PLC: it switches each %Q bit as it finds the %I bit.
PLC = {"fieldbus": {"kind": "loopback", "program": "mirror", "mode": "stepped", "scan": "10ms"}}

STEP = 50_000_000  # ns, of the simulation
INFLOW = 80.0  # mm/s, while the valve is open
OUTFLOW = 100.0  # mm/s, at most
LOW, FULL = 150.0, 500.0  # mm
LONGEST = 1200  # steps of an episode


class TanksVectorEnv(VectorEnv):
    """Observes level (mm) and valve; the action is the outflow, from 0 to 1."""

    metadata = {"autoreset_mode": AutoresetMode.NEXT_STEP}

    def __init__(self, num_envs, config=HERE.parent / "tank.cfg"):
        self.num_envs = num_envs
        self.single_observation_space = gymnasium.spaces.Box(0.0, np.array([FULL, 1.0]), (2,), np.float64)
        self.single_action_space = gymnasium.spaces.Box(0.0, 1.0, (1,), np.float64)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self.plcs = tickbus.open_vector(config, num_envs, PLC)
        values = np.asarray(self.plcs.slots)
        self.valve, self.low, self.level = (values[:, self.plcs.signal(name).slot] for name in ("Valve", "Level low", "Level"))
        self.mm = np.zeros(num_envs)
        self.steps = np.zeros(num_envs, np.int64)
        self.over = np.zeros(num_envs, bool)

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed, options=options)
        self._begin(np.ones(self.num_envs, bool))
        return self._observe(), {}

    def _begin(self, which):
        """Begins the next episode of these tanks, and of their PLCs."""
        if self.plcs.reset(which):
            raise RuntimeError(f"PLCs refused to be reset: {np.unique(self.plcs.statuses)}")
        self.mm[which] = self.np_random.uniform(LOW, FULL - LOW, which.sum())
        self.steps[which] = 0
        self.over[which] = False

    def _observe(self):
        return np.stack([self.mm, self.valve], axis=1)

    def step(self, actions):
        begins = self.over.copy()
        if begins.any():
            self._begin(begins)
        runs = ~begins
        # The PLC of a tank that begins now is at its first scan.
        if self.plcs.receive(ns=self.steps * STEP):
            raise RuntimeError(f"PLCs have failed: {np.unique(self.plcs.statuses)}")
        seconds = STEP / 1e9
        drawn = np.clip(actions[:, 0], 0.0, 1.0) * OUTFLOW * seconds * runs
        self.mm += self.valve * INFLOW * seconds * runs - drawn
        terminated = (self.mm <= 0) | (self.mm >= FULL)
        np.clip(self.mm, 0, FULL, out=self.mm)
        self.low[:] = self.mm < LOW
        self.level[:] = self.mm
        self.plcs.send()
        self.steps += 1
        truncated = self.steps >= LONGEST
        self.over = terminated | truncated
        reward = np.where(terminated, -FULL, drawn)
        return self._observe(), reward, terminated, truncated, {}

    def close_extras(self, **_):
        self.plcs.close()


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--envs", type=int, default=1024)
    parser.add_argument("--steps", type=int, default=2000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--config", default=HERE.parent / "tank.cfg")
    arguments = parser.parse_args()
    envs = TanksVectorEnv(arguments.envs, arguments.config)
    observed, _ = envs.reset(seed=arguments.seed)
    total, episodes = 0.0, 0
    begin = time.perf_counter()
    for _ in range(arguments.steps):
        # An agent of one line: draw more the fuller the tank is.
        actions = (observed[:, :1] / FULL) ** 0.5
        observed, rewards, terminated, truncated, _ = envs.step(actions)
        total += rewards.sum()
        episodes += int((terminated | truncated).sum())
    rate = arguments.envs * arguments.steps / (time.perf_counter() - begin)
    envs.close()
    print(f"tanks: ok envs={arguments.envs} episodes={episodes} reward={total / arguments.envs:.3f} steps_per_s={rate:.0f}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
