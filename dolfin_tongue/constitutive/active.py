"""Active stress of muscles: slots of fibres, stretch and rate dependence, activation (31)-(34)."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np

from dolfin_tongue.base.arrays import FloatArray
from dolfin_tongue.base.errors import BadScene
from dolfin_tongue.body.body import Body
from dolfin_tongue.body.fibres import Slots
from dolfin_tongue.body.regions import CellValues, by_muscle, on_slots
from dolfin_tongue.constitutive.fibre_stress import FibreStress, component
from dolfin_tongue.terms.mobilisation import StressMobilisation

Resolve = Callable[[CellValues], Any]


@dataclass(frozen=True)
class SlotLaw:
    """One class of law on the fibre slots that use it.

    Parameters
    ----------
    law : one of the laws; its numbers are those of `numbers`.
    numbers : its numbers on the slots, by name.
    mask : ndarray, shape (m, s) -- 1 where the law counts.
    """

    law: StressMobilisation
    numbers: Mapping[str, CellValues]
    mask: FloatArray

    @property
    def on_arrays(self) -> StressMobilisation:
        """Return the law with arrays over slots as numbers."""
        arrays = {name: values.array for name, values in self.numbers.items()}
        self.law.require_order(arrays["y0"], arrays["y1"])
        return self.law.bound(arrays)

    def resolved(self, resolve: Resolve) -> dict[str, Any]:
        """Return the numbers resolved, with what follows from them where it is known."""
        if any(values.shares for values in self.numbers.values()):
            return {name: resolve(values) for name, values in self.numbers.items()}
        known = self.on_arrays.all_numbers
        return {name: resolve(CellValues(np.asarray(x))) for name, x in known.items()}


@dataclass(frozen=True)
class ActiveMuscles(FibreStress):
    """Active stress of muscles (31)-(34), (73).

    S = sum_m tau_m J / stretch^2 N x N, made deviatoric by (36), with
    tau = max_stress density activation f(stretch) g(stretch rate). `max_stress` is the Cauchy
    stress at full activation, optimal length and fast lengthening.

    Parameters
    ----------
    activation, max_stress : see `FibreStress`.
    law : the two factors f and g; one for all muscles, or a mapping from muscles (and
        ``"elsewhere"``) to laws.
    """

    law: StressMobilisation | Mapping[str, StressMobilisation] = field(
        default_factory=StressMobilisation
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        laws = self.law.values() if isinstance(self.law, Mapping) else (self.law,)
        for law in laws:
            if not isinstance(law, StressMobilisation):
                raise BadScene(
                    f"ActiveMuscles.law must be StressMobilisation(...), or map muscles to such "
                    f"laws, not {law!r}"
                )

    def check(self, body: Body) -> None:
        """Refuse unknown muscles, and numbers that do not fit the body."""
        super().check(body)
        for part in self.laws(self.slots(body), body):
            part.on_arrays  # noqa: B018 (its check)

    def laws(self, slots: Slots, body: Body) -> list[SlotLaw]:
        """Laws on the slots, one for each class of law."""
        chosen = by_muscle(self.law, self.names)
        result = []
        for kind in dict.fromkeys(type(law) for law in chosen):
            own = [i for i, law in enumerate(chosen) if type(law) is kind]
            first = chosen[own[0]]
            numbers = {}
            for name in first.numbers:
                given = [law if type(law) is kind else first for law in chosen]
                values = [law.numbers[name] for law in given]
                if len({id(law) for law in chosen}) == 1:
                    values = by_muscle(values[0], self.names)
                numbers[name] = on_slots(f"{kind.__name__}.{name}", values, slots, body)
            result.append(SlotLaw(first, numbers, np.isin(slots.muscle, own).astype(float)))
        return result

    def factors(
        self, resolve: Resolve, slots: Slots, body: Body
    ) -> Callable[[int, Any, Any, Any], Any]:
        """f(stretch) g(stretch rate) of a slot."""
        laws = self.laws(slots, body)
        known = [part.resolved(resolve) for part in laws]
        masks = [resolve(CellValues(part.mask[:, None])) for part in laws] if len(laws) > 1 else []

        def factor(slot: int, stretch: Any, rate: Any, ratio: Any) -> Any:
            del ratio
            total = 0.0
            for number, (part, numbers) in enumerate(zip(laws, known, strict=True)):
                own = part.law.bound({name: component(x, slot) for name, x in numbers.items()})
                value = own.length_factor(stretch) * own.rate_factor(rate)
                total += component(masks[number], slot) * value if masks else value
            return total

        return factor


@dataclass(frozen=True)
class ConstantFibreStress(FibreStress):
    """Constant second Piola-Kirchhoff stress along the fibres, S = T N x N with its spherical part.

    The active law of other programs (FEBio's prescribed active contraction), for comparisons:
    T = max_stress density activation depends neither on the stretch nor on its rate, and the Cauchy
    stress T stretch^2 / J n x n grows with the stretch.
    """

    deviatoric: ClassVar[bool] = False

    def factors(
        self, resolve: Resolve, slots: Slots, body: Body
    ) -> Callable[[int, Any, Any, Any], Any]:
        """stretch^2 / J: S over max_stress times activation is 1."""
        del resolve, slots, body
        return lambda slot, stretch, rate, ratio: stretch**2 / ratio
