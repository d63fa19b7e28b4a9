"""The stage: one persistent off-screen PyVista plotter that draws scenes.

Only the renderer's own process imports this: VTK's objects belong to the thread that made them.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pyvista as pv
from numpy.typing import NDArray
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkCommonCore import vtkUnsignedCharArray

from spf.render.actors import Actor, LinesActor, MeshActor, PointsActor, ShellActor, coarsened
from spf.render.scene import Mesh, Scene
from spf.render.surface import blend
from spf.render.view import Placement, ViewCamera

__all__ = ["Stage"]

#: Direction in the eye's frame (x right, y up, z towards the eye) and intensity. The key light comes from above on the
#: left, far enough aside that neighbouring fingers shade differently; the others keep the rest from going black.
LIGHTS = (((-0.9, 0.8, 0.6), 0.80), ((1.0, -0.1, 0.35), 0.22), ((0.0, 0.0, 1.0), 0.25))

#: Height of the picture in which points and lines are as large as the scene says.
REFERENCE_HEIGHT = 480

#: Samples a pixel in a smooth picture.
SAMPLES = 8


class Stage:
    """Owns every VTK object; belongs to the thread that made it."""

    def __init__(self) -> None:
        self._plotter = pv.Plotter(off_screen=True, lighting="none")
        self._window: Any = self._plotter.render_window
        self._plotter.renderer.SetUseOIT(False)  # faces come sorted, blending in order is exact and faster
        self._plotter.renderer.SetAutomaticLightCreation(False)
        for position, intensity in LIGHTS:
            self._plotter.add_light(pv.Light(light_type="camera light", position=position, intensity=intensity))
        self._meshes: list[Actor] = []
        self._shells: list[Actor] = []
        self._points: list[Actor] = []
        self._lines: list[Actor] = []
        self._pixels = vtkUnsignedCharArray()
        self._coarsened: dict[bytes, tuple[NDArray[np.intp], NDArray[np.int32]]] = {}

    def draw(self, scene: Scene, view: ViewCamera, size: tuple[int, int], smooth: bool = False) -> NDArray[np.uint8]:
        """Return the (height, width, 3) RGB picture of a scene.

        Args:
            scene: what to draw.
            view: where from.
            size: width and height in pixels.
            smooth: smooth edges and see-through hands of every face, for stills; takes several times as long.
        """
        placement = view.placement()
        scale = size[1] / REFERENCE_HEIGHT
        meshes = [mesh for mesh in scene.meshes if len(mesh.faces)]  # VTK refuses empty arrays
        seen_through = [mesh if smooth else self._coarse(mesh) for mesh in meshes if 0 < mesh.opacity < 1]
        shells = [blend(seen_through, placement.position)] if seen_through else []
        self._fill(self._meshes, MeshActor, [mesh for mesh in meshes if mesh.opacity == 1], scale)
        self._fill(self._shells, ShellActor, shells, scale)
        self._fill(self._points, PointsActor, [points for points in scene.points if len(points.xyz)], scale)
        self._fill(self._lines, LinesActor, [lines for lines in scene.lines if lines.paths.size], scale)
        self._plotter.renderer.SetBackground(*scene.background)
        if tuple(self._window.GetSize()) != tuple(size):
            self._window.SetSize(*size)
        self._window.SetMultiSamples(SAMPLES if smooth else 0)
        self._aim(placement)
        self._window.Render()  # without it the pixels are those of the picture before
        return self._read()

    def _coarse(self, mesh: Mesh) -> Mesh:
        """Return a mesh with a third of its faces: see-through hands take most of the time of a quick picture."""
        key = mesh.faces.tobytes()
        if key not in self._coarsened:
            self._coarsened[key] = coarsened(mesh)
        kept, faces = self._coarsened[key]
        colour = np.asarray(mesh.colour)
        return replace(
            mesh, vertices=mesh.vertices[kept], faces=faces, colour=colour[kept] if colour.ndim > 1 else colour
        )

    def _fill(self, pool: list[Actor], make: Callable[[pv.Plotter], Actor], items: Sequence[Any], scale: float) -> None:
        while len(pool) < len(items):
            pool.append(make(self._plotter))
        for actor, item in zip(pool, items, strict=False):
            actor.show(item, scale)
        for actor in pool[len(items) :]:
            actor.hide()

    def _aim(self, placement: Placement) -> None:
        camera = self._plotter.renderer.GetActiveCamera()
        camera.SetPosition(*placement.position)
        camera.SetFocalPoint(*placement.focal_point)
        camera.SetViewUp(*placement.up)
        camera.SetViewAngle(math.degrees(placement.view_angle))
        self._plotter.renderer.ResetCameraClippingRange()

    def _read(self) -> NDArray[np.uint8]:
        width, height = self._window.GetSize()
        self._window.GetPixelData(0, 0, width - 1, height - 1, 0, self._pixels, 0)
        bottom_up = vtk_to_numpy(self._pixels).reshape(height, width, 3)
        return np.ascontiguousarray(bottom_up[::-1])
