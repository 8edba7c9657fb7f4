"""What depends on time: when it is not smooth, and what it remembers of the motion.

Everything in a scene that may depend on time is `Timed`: terms, supports, controls, motions, forces
on bones. What is made of others names them as its `parts`; break points, jumps and memories then
follow from theirs.

A memory is a mapping from names to arrays (or to memories of parts). It changes when a step has
been accepted and at no other time, so that a step that is tried and rejected leaves no trace; it is
part of a `State`, saved with it, and taken up again by a run that resumes.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, TypeAlias

from dolfin_tongue.body.body import Body
from dolfin_tongue.body.state import NOTHING, State

#: Arrays, or memories of parts, by name.
Memory: TypeAlias = Mapping[str, Any]


@dataclass(frozen=True, eq=False)
class Instant:
    """A time with the memory that goes with it.

    Parameters
    ----------
    time : s.
    memory : of the last accepted state.
    """

    time: float
    memory: Memory = field(default_factory=lambda: NOTHING)

    def of(self, part: str) -> Instant:
        """Return the instant as a part sees it: with its own memory."""
        return Instant(self.time, self.memory.get(part, NOTHING)) if self.memory else self


class Timed:
    """Base of what may depend on time; by default it is smooth and remembers nothing."""

    @property
    def parts(self) -> Mapping[str, Timed]:
        """What it is made of that depends on time, by name."""
        return {}

    @property
    def breakpoints(self) -> tuple[float, ...]:
        """Times (s) of kinks and jumps; steps end there."""
        return tuple(time for part in self.parts.values() for time in part.breakpoints)

    @property
    def jumps(self) -> tuple[float, ...]:
        """Those of the break points at which it jumps, s."""
        return tuple(time for part in self.parts.values() for time in part.jumps)

    def begin(self, body: Body, state: State) -> Memory:
        """Memory at the beginning of a motion; empty if it remembers nothing."""
        memories = {name: part.begin(body, state) for name, part in self.parts.items()}
        return {name: memory for name, memory in memories.items() if memory}

    def advance(self, memory: Memory, body: Body, first: State, last: State) -> Memory:
        """Memory after a step that has been accepted.

        Parameters
        ----------
        memory : before it; not to be changed.
        body : the tissue at rest.
        first, last : begin and end of the step.
        """
        return {
            name: self.parts[name].advance(part, body, first, last) for name, part in memory.items()
        }
