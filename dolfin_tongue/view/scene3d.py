"""One off-screen VTK scene per series of pictures: a body whose points move between frames."""

from __future__ import annotations

from collections.abc import Sequence
from types import TracebackType
from typing import Any

import numpy as np

from dolfin_tongue.base.arrays import FloatArray
from dolfin_tongue.body.body import Body
from dolfin_tongue.view.camera import Camera
from dolfin_tongue.view.display import ensure_display
from dolfin_tongue.view.palette import EDGES, TISSUE, Colour, Pixels
from dolfin_tongue.view.skin import Skin
from dolfin_tongue.view.walls import Sheet

#: Pictures are drawn so many times larger and then shrunk: smooth lines without multisampling.
OVERSAMPLING = 2

#: Lights as the camera sees them (right, up, towards it): place and strength.
LIGHTS = (((-0.5, 1.2, 1.2), 0.7), ((1.5, 0.2, 1.0), 0.3), ((0.0, -0.3, 1.0), 0.22))

#: Opacity of a wall that turns its free side away from the viewer, and towards it; in between, for
#: the cosine of the angle to the line of sight in this range.
VEIL, SOLID = 0.16, 0.8
FACING = (-0.3, 0.35)


class Stage:
    """A body before a camera on white ground; a context manager that frees VTK's window.

    Parameters
    ----------
    body : the body.
    camera : its `size` is that of the frames, in rendered pixels.
    surface : the surface of the body, if there is one already.
    edge_colour : of the element edges, 0-255.
    edge_width : rendered pixels.
    sheets : parts of walls that are drawn with the body.
    """

    def __init__(
        self,
        body: Body,
        camera: Camera,
        *,
        surface: Skin | None = None,
        edge_colour: Colour = EDGES,
        edge_width: float = 1.6,
        sheets: Sequence[Sheet] = (),
    ):
        ensure_display()
        import pyvista

        self.body, self.camera = body, camera
        self.surface = surface or Skin(body)
        self.plotter: Any = pyvista.Plotter(
            off_screen=True, window_size=camera.size, lighting="none"
        )
        # Drawing larger and shrinking takes its place, at a third of the time in software.
        self.plotter.render_window.SetMultiSamples(0)
        self.plotter.set_background("white")
        self._aim()
        self._skin = self._add_skin()
        self._wires = self._add_wires(edge_colour, edge_width)
        self._walls = [self._add_wall(sheet) + self._add_section(sheet) for sheet in sheets]

    def __enter__(self) -> Stage:
        """Return the stage itself."""
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        """Free VTK's window."""
        self.plotter.close()

    def _aim(self) -> None:
        """Set VTK's camera to ours, and lights that move with it."""
        import pyvista

        camera, eye = self.plotter.camera, self.camera
        _, up, toward = eye.view.axes
        camera.focal_point, camera.up = eye.centre, up
        camera.position = eye.centre + 2 * eye.reach * toward
        camera.parallel_projection = True
        camera.parallel_scale = eye.size[1] / 2 / eye.scale
        camera.clipping_range = eye.reach, 3 * eye.reach
        for place, strength in LIGHTS:
            light = pyvista.Light(position=place, intensity=strength, light_type="camera light")
            self.plotter.add_light(light)

    def _add_skin(self) -> Any:
        """Add the surface; its colours are per point, so that a field can be shown."""
        import pyvista

        faces = np.insert(self.surface.patches, 0, 4, axis=1)
        mesh: Any = pyvista.PolyData(self.surface.points(self.body.points), faces)
        mesh.point_data["colour"] = np.tile(np.array(TISSUE, np.uint8), (mesh.n_points, 1))
        mesh.point_data.active_normals = self.surface.normals(self.body.points)
        self.plotter.add_mesh(
            mesh, scalars="colour", rgb=True, ambient=0.45, diffuse=0.7, specular=0.1,
            specular_power=18, interpolation="Phong", name="skin", copy_mesh=False,
            reset_camera=False, show_scalar_bar=False,
        )  # fmt: skip
        return mesh

    def _add_wires(self, colour: Colour, width: float) -> Any:
        """Add the element edges."""
        import pyvista

        lines = np.insert(self.surface.edges, 0, 2, axis=1)
        mesh = pyvista.PolyData(self.body.points.copy(), lines=lines)
        self.plotter.add_mesh(
            mesh, color=[c / 255 for c in colour], line_width=width, lighting=False,
            name="wires", copy_mesh=False, reset_camera=False,
        )  # fmt: skip
        return mesh

    def _add_wall(self, sheet: Sheet) -> list[Any]:
        """Add a translucent wall, the fainter the more it turns its free side away."""
        import pyvista

        toward = self.camera.view.axes[2]
        # Translucent triangles have to be drawn from back to front; no shift changes their order.
        order = np.argsort(sheet.points[sheet.triangles].mean(axis=1) @ toward)
        faces = np.insert(sheet.triangles[order], 0, 3, axis=1)
        mesh: Any = pyvista.PolyData(sheet.points, faces)
        share = np.clip((sheet.normals @ toward - FACING[0]) / (FACING[1] - FACING[0]), 0, 1)
        share = share**2 * (3 - 2 * share)
        colours = np.empty((len(sheet.points), 4), np.uint8)
        colours[:, :3] = sheet.colour
        colours[:, 3] = np.round(255 * (VEIL + share * (SOLID - VEIL)))
        mesh.point_data["colour"] = colours
        mesh.point_data.active_normals = sheet.normals
        actor = self.plotter.add_mesh(
            mesh, scalars="colour", rgba=True, ambient=0.7, diffuse=0.35, specular=0.1,
            specular_power=18, interpolation="Phong", copy_mesh=False, reset_camera=False,
            show_scalar_bar=False,
        )  # fmt: skip
        return [actor]

    def _add_section(self, sheet: Sheet) -> list[Any]:
        """Add the line of a wall in the midsagittal plane, if it comes there."""
        import pyvista

        segments = sheet.section
        if not len(segments):
            return []
        lines = np.insert(np.arange(2 * len(segments)).reshape(-1, 2), 0, 2, axis=1)
        mesh = pyvista.PolyData(segments.reshape(-1, 3), lines=lines)
        actor = self.plotter.add_mesh(
            mesh, color=[c / 255 for c in sheet.ink], lighting=False,
            line_width=max(3.0, self.camera.size[0] / 260), reset_camera=False,
        )  # fmt: skip
        return [actor]

    def frame(
        self,
        points: FloatArray,
        colours: Pixels | None = None,
        shifts: FloatArray | None = None,
    ) -> Pixels:
        """Draw the body with its nodes elsewhere.

        Parameters
        ----------
        points : ndarray, shape (n, 3), m -- nodes of the deformed body.
        colours : ndarray, shape (points of the surface, 3) -- see `Skin.of_cells`.
        shifts : ndarray, shape (s, 3), m -- translations of the walls; without them no wall is
            drawn.

        Returns
        -------
        ndarray, shape (height, width, 3) -- 0-255.
        """
        self._skin.points = self.surface.points(points)
        self._skin.point_data.active_normals[:] = self.surface.normals(points)
        if colours is not None:
            self._skin.point_data["colour"][:] = colours
        self._skin.Modified()
        # A hair's breadth towards the viewer, so that the surface does not hide its own edges.
        lift = 1.5 / self.camera.scale
        self._wires.points = points + lift * self.camera.view.axes[2]
        for number, actors in enumerate(self._walls):
            for actor in actors:
                actor.visibility = shifts is not None
                actor.position = (0, 0, 0) if shifts is None else shifts[number]
        return self._grab()

    def rods(self, bundles: Sequence[tuple[FloatArray, Colour]], radius: float) -> Pixels:
        """Draw line segments alone, without the body.

        Parameters
        ----------
        bundles : segments of shape (k, 2, 3), m, and their colour.
        radius : of the rods that stand for them, m.
        """
        import pyvista

        body = [self.plotter.actors[name] for name in ("skin", "wires")]
        walls = [actor for actors in self._walls for actor in actors]
        hidden = [actor for actor in (*body, *walls) if actor.visibility]
        rods = []
        for segments, colour in bundles:
            lines = np.insert(np.arange(2 * len(segments)).reshape(-1, 2), 0, 2, axis=1)
            mesh = pyvista.PolyData(segments.reshape(-1, 3), lines=lines)
            rods.append(
                self.plotter.add_mesh(
                    mesh.tube(radius=radius, n_sides=10, capping=True),
                    color=[c / 255 for c in colour],
                    ambient=0.4,
                    diffuse=0.8,
                    reset_camera=False,
                )
            )
        for actor in hidden:
            actor.visibility = False
        pixels = self._grab()
        for actor in hidden:
            actor.visibility = True
        self.plotter.remove_actor(rods)
        return pixels

    def visible(self, points: FloatArray) -> np.ndarray:
        """Whether the last frame shows points (n, 3), m, that lie on the surface; bool, (n,)."""
        from vtkmodules.vtkCommonCore import vtkFloatArray

        data = vtkFloatArray()
        width, height = self.camera.size
        self.plotter.render_window.GetZbufferData(0, 0, width - 1, height - 1, data)
        depth = vtk_to_numpy(data).reshape(height, width)[::-1]
        ahead = (2 * depth - 1) * self.camera.reach
        own = -(points - self.camera.centre) @ self.camera.view.axes[2]
        column, row = np.round(self.camera.project(points)).astype(int).T
        # The farthest of some pixels around: a node on the outline is seen past its own surface.
        reach = range(-3, 4)
        farthest = np.max(
            [
                ahead[np.clip(row + i, 0, height - 1), np.clip(column + j, 0, width - 1)]
                for i in reach
                for j in reach
            ],
            axis=0,
        )
        return own < farthest + 3.0 / self.camera.scale

    def _grab(self) -> Pixels:
        """Render once and read the pixels (a screenshot by PyVista would render twice)."""
        from vtkmodules.vtkCommonCore import vtkUnsignedCharArray

        window = self.plotter.render_window
        width, height = self.camera.size
        window.Render()
        data = vtkUnsignedCharArray()
        window.GetPixelData(0, 0, width - 1, height - 1, 0, data, 0)
        return vtk_to_numpy(data).reshape(height, width, 3)[::-1].copy()


def vtk_to_numpy(data: Any) -> np.ndarray:
    """Values of a VTK array."""
    from vtkmodules.util import numpy_support

    return numpy_support.vtk_to_numpy(data)
