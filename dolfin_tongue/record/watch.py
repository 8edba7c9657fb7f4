"""What a run keeps an eye on: wall times, the largest volume changes, the balance of energy."""

from __future__ import annotations

import time as clock
from collections.abc import Mapping
from dataclasses import dataclass, field
from math import inf
from typing import Any

import numpy as np

from dolfin_tongue.body.state import State
from dolfin_tongue.march.solver import Solver
from dolfin_tongue.record.observe import EnergyAudit
from dolfin_tongue.record.recorder import Recorder
from dolfin_tongue.record.table import contact_columns

#: Wall time between checkpoints, s.
CHECKPOINT_INTERVAL = 2.0


@dataclass
class Watch:
    """Wall times, and the extremes seen."""

    method: str = ""
    set_up: float = 0.0
    start: float = 0.0
    begin: float = field(default_factory=clock.perf_counter)
    observing: float = 0.0
    last_checkpoint: float = -inf  # the first state is worth one
    volume: float = 0.0
    local_volume: float = 0.0
    smallest_ratio: float = 1.0
    balance: float = 0.0

    def start_marching(self, state: State) -> None:
        """End the set-up."""
        now = clock.perf_counter()
        self.set_up, self.begin, self.start = now - self.begin, now, state.time

    def account(self, audit: EnergyAudit) -> dict[str, Any]:
        """Return what a resumed run must know besides the state."""
        extremes = [self.volume, self.local_volume, self.smallest_ratio, self.balance]
        return {"audit": audit.account(), "extremes": extremes, "method": self.method}

    def restore(self, account: Mapping[str, Any]) -> None:
        """Take over the extremes of an earlier run."""
        self.volume, self.local_volume, self.smallest_ratio, self.balance = account["extremes"]

    def observe(self, state: State, solver: Solver, audit: EnergyAudit, recorder: Recorder) -> None:
        """Observe a new state, record it, and write a checkpoint where one is due."""
        begin = clock.perf_counter()
        strain = solver.strain(state)
        ratio = strain.volume_ratio
        volume = float(np.abs(strain.points.on_cells(ratio) - 1).max())
        local, smallest = float(np.abs(ratio - 1).max()), float(ratio.min())
        energies = audit.update(state)
        observed = {
            "max_volume_change": volume,
            "max_local_volume_change": local,
            "smallest_det_F": smallest,
        }
        observed |= energies | contact_columns(solver.contacts(state))
        recorder.record(state, observed, solver.muscles(state))
        self.volume = max(self.volume, volume)
        self.local_volume = max(self.local_volume, local)
        self.smallest_ratio = min(self.smallest_ratio, smallest)
        self.balance = max(self.balance, abs(energies["balance_J"]))
        if clock.perf_counter() - self.last_checkpoint > CHECKPOINT_INTERVAL:
            recorder.checkpoint(state, self.account(audit))
            self.last_checkpoint = clock.perf_counter()
        self.observing += clock.perf_counter() - begin

    def summary(
        self, solver: Solver, audit: EnergyAudit, last: State, status: str
    ) -> dict[str, Any]:
        """Return what came out, and what it cost."""
        solving = clock.perf_counter() - self.begin - self.observing
        simulated = last.time - self.start
        exchanged = audit.exchanged
        return {
            "status": status,
            "time_reached_s": last.time,
            "solver": solver.name,
            "method": self.method,
            "set_up_wall_s": self.set_up,
            "solving_wall_s": solving,
            "observing_wall_s": self.observing,
            "simulated_seconds_per_wall_second": simulated / solving if solving > 0 else None,
            **solver.counts(),
            "max_volume_change": self.volume,
            "max_local_volume_change": self.local_volume,
            "smallest_det_F": self.smallest_ratio,
            "max_balance_error_J": self.balance,
            "exchanged_energy_J": exchanged,
            "balance_error_per_exchanged": self.balance / exchanged if exchanged else 0.0,
        }
