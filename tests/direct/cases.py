"""Bodies, models, terms and random states that the tests of the direct solver share."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from dolfin_tongue.body.body import Body
from dolfin_tongue.body.cells import KINDS
from dolfin_tongue.body.fibres import Fibres, MuscleFibres
from dolfin_tongue.body.state import State
from dolfin_tongue.boundary import Gravity, Skin, SurfaceTension
from dolfin_tongue.constitutive import (
    ActiveMuscles,
    ConstantFibreStress,
    FibreReinforcedTissue,
    MooneyRivlin,
    ReportTissue,
    Viscosity,
)
from dolfin_tongue.control import Constant, SmoothRamp
from dolfin_tongue.direct import DirectSolver, Model
from dolfin_tongue.direct.limits import Limit
from dolfin_tongue.direct.parts import Load
from dolfin_tongue.geometry.simple import block_body, distort
from dolfin_tongue.scene import Scene
from dolfin_tongue.terms.support import Held
from dolfin_tongue.terms.term import Term

CENTIMETRE = 0.01
#: End of most motions, s.
END = 0.03
#: Edges of the block that is dropped, m.
EDGE = 0.02
MUSCLES = {"along": (1.0, 0.2, 0.0), "across": (0.0, 1.0, 1.0)}

#: One instance of every term, with numbers that reach all its branches.
TERMS: list[Term] = [
    ReportTissue(a0=700.0, a1=2.0, a2=5.0),
    FibreReinforcedTissue(muscle="along"),
    MooneyRivlin(),
    MooneyRivlin(c20=0.0, c01=300.0),
    Viscosity(40.0),
    ActiveMuscles({"along": Constant(0.6), "across": SmoothRamp(0.4)}),
    ConstantFibreStress({"along": Constant(0.6), "across": SmoothRamp(0.4)}, max_stress=2e4),
    Gravity((1.0, -2.0, -9.0)),
    SurfaceTension(3.0),
    Skin(20e3, 1e-3),
]


class Shaken(Held):
    """The face x0 moves along z as 1 mm sin(50 t)."""

    def nodes(self, body):
        return body.nodes("x0")

    def displacement(self, points, time):
        return np.tile([0.0, 0.0, 1e-3 * np.sin(50 * time)], (len(points), 1))


def name_of(item: object) -> str:
    """Name of a test case."""
    return type(item).__name__


def random_body(seed: int = 0) -> Body:
    """Block of 12 distorted bricks with two muscles; one muscle leaves cells out."""
    body = block_body((0.03, 0.02, 0.025), (3, 2, 2), muscles=MUSCLES)
    body = distort(body, 0.3, seed)
    corner = np.random.default_rng(seed).uniform(-1e-3, 1e-3, body.points.shape)
    along, across = body.fibres.muscles
    part = MuscleFibres(along.name, along.cells[::2], along.directions[::2], along.density[::2])
    return replace(body, points=body.points + corner, fibres=Fibres((part, across)))


def raised_block(corner: bool, height: float, cells: tuple[int, int, int] = (2, 2, 2)) -> Body:
    """Block at a height above the plane z = 0, on a face or on a corner."""
    body = block_body((EDGE, EDGE, EDGE), cells)
    points = body.points - EDGE / 2
    if corner:  # the rows are an orthonormal basis whose third vector is the diagonal
        turn = np.array([[1.0, -1.0, 0.0], [1.0, 1.0, -2.0], [1.0, 1.0, 1.0]])
        points = points @ (turn / np.linalg.norm(turn, axis=1)[:, None]).T
    points[:, 2] += height - points[:, 2].min()
    return replace(body, points=np.ascontiguousarray(points))


def random_state(points: np.ndarray, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """Displacement of up to 1.5 mm and velocity of up to 0.3 m/s of every node."""
    random = np.random.default_rng(seed + 100)
    return 1.5e-3 * random.uniform(-1, 1, points.shape), 0.3 * random.uniform(-1, 1, points.shape)


def distorted_element(name: str, seed: int = 0) -> np.ndarray:
    """Node positions of one element of about a centimetre, moved at random, shape (k, 3), m."""
    nodes = KINDS[name].nodes
    shift = 0.12 * np.random.default_rng(seed).uniform(-1, 1, nodes.shape)
    return CENTIMETRE * (nodes + shift + [3.0, -2.0, 1.0])


def mixed_body(distortion: float = 0.0) -> Body:
    """A brick, two prisms beside it and a tetrahedron on one of them, in conforming faces."""
    points = np.array(
        [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1],
         [2, 0, 0], [2, 0, 1], [2, 1, 0], [2, 1, 1], [1.6, 1.9, 0.3]], dtype=float)  # fmt: skip
    cells = {
        "hexahedron8": np.array([[0, 1, 2, 3, 4, 5, 6, 7]]),
        "prism6": np.array([[1, 9, 8, 2, 11, 10], [1, 5, 9, 2, 6, 11]]),
        "tetrahedron4": np.array([[2, 11, 10, 12]]),
    }
    shift = distortion * np.random.default_rng(7).uniform(-1, 1, points.shape)
    return body_of(CENTIMETRE * (points + shift), cells)


def body_of(points: np.ndarray, cells: dict[str, np.ndarray]) -> Body:
    """Body of any cells with the two muscles in all of them."""
    fibres = uniform_fibres(sum(map(len, cells.values())))
    return Body(points, cells, density=1000.0, fibres=fibres)


def uniform_fibres(cell_count: int) -> Fibres:
    """The two muscles in all cells."""
    cells = np.arange(cell_count)
    muscles = []
    for name, direction in MUSCLES.items():
        unit = np.array(direction) / np.linalg.norm(direction)
        muscles.append(
            MuscleFibres(name, cells, np.tile(unit, (cell_count, 1)), np.ones(cell_count))
        )
    return Fibres(tuple(muscles))


def body_model(body: Body, *terms: Term, **options) -> Model:
    """Model of terms on a body of any cells."""
    return Model(Scene(body, terms), **options)


def element_body(name: str) -> Body:
    """Body of one distorted element."""
    corners = distorted_element(name)
    return body_of(corners, {name: np.arange(len(corners))[None]})


def element_model(name: str, *terms: Term, **options) -> Model:
    """Model of one distorted element."""
    return body_model(element_body(name), *terms, **options)


def load_of(model: Model) -> np.ndarray:
    """Weights of the nodes, shape (n, 3), N."""
    return sum(part.force for part in model.parts if isinstance(part, Load))


def energy_of(model: Model, time: float, u: np.ndarray, v: np.ndarray) -> float:
    """Energy at some displacement and velocity, J."""
    return model.energy(State(time, u, v, np.zeros(model.body.cell_count)))


def apply_matrices(model: Model, matrices: list[np.ndarray], vector: np.ndarray) -> np.ndarray:
    """Product of element matrices with a nodal vector of shape (n, 3)."""
    out = np.zeros_like(vector)
    for block, part in zip(model.constraints.parts, matrices, strict=True):
        local = vector[block.cells].transpose(0, 2, 1).reshape(len(part), -1)
        image = np.einsum("mij,mj->mi", part, local).reshape(len(part), 3, -1)
        np.add.at(out, block.cells, image.transpose(0, 2, 1))
    return out


def final(scene: Scene, method, end: float = END) -> State:
    """Last state of a march."""
    *_, state = method.solver(scene).march(end)
    return state


def unjudged(solver: DirectSolver, end: float, start: State) -> Iterator[State]:
    """March of Runge-Kutta 4 that is not refused at its beginning, whatever its step."""
    limits = solver.stepper.limits
    solver.stepper.limits = lambda *arguments: Limit(np.inf, "nothing")
    states = solver.march(end, start)
    yield next(states)
    solver.stepper.limits = limits
    yield from states


def relative(value: np.ndarray, reference: np.ndarray) -> float:
    """Largest difference over the largest reference value."""
    return float(np.abs(value - reference).max() / np.abs(reference).max())
