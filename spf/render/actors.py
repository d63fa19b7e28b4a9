"""VTK actors that stay alive between pictures and take new arrays in place.

Only the renderer's own process imports this: VTK's objects belong to the thread that made them.
"""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np
import pyvista as pv
from numpy.typing import NDArray

from spf.render.scene import Lines, Mesh, Points
from spf.render.surface import Shell, vertex_normals

__all__ = ["Actor", "LinesActor", "MeshActor", "PointsActor", "ShellActor", "coarsened"]

_FEWER = 0.67  # share of a mesh's faces that a coarse one does without


class Actor(Protocol):
    """Shows one item of a scene, and later another of its kind."""

    def show(self, item: Any, scale: float) -> None:
        """Take the arrays of an item and be visible; what is measured in pixels is ``scale`` times as large."""

    def hide(self) -> None:
        """Be invisible until the next item."""


class _Painted:
    """Geometry whose vertices are painted with the colours given, never through a colour map, and its actor."""

    def __init__(self, plotter: pv.Plotter) -> None:
        self.data = pv.PolyData()
        mapper = pv.DataSetMapper(self.data)
        mapper.SetColorModeToDirectScalars()
        mapper.SetScalarModeToUsePointData()
        self.actor = pv.Actor(mapper=mapper)
        plotter.add_actor(self.actor, reset_camera=False, render=False)

    def hide(self) -> None:
        """Be invisible until the next item."""
        self.actor.visibility = False

    def _paint(self, vertices: NDArray[Any], colours: NDArray[np.uint8]) -> None:
        self.data.points = vertices
        self.data.point_data["colours"] = colours
        self.data.point_data.active_scalars_name = "colours"
        self.actor.visibility = True


class MeshActor(_Painted):
    """A solid, smoothly shaded mesh."""

    def __init__(self, plotter: pv.Plotter) -> None:
        super().__init__(plotter)
        self._faces = np.zeros((0, 3), np.int32)
        prop = self.actor.prop
        prop.interpolation = "Phong"
        prop.culling = "back"
        prop.ambient, prop.diffuse, prop.specular, prop.specular_power = 0.12, 0.9, 0.15, 25

    def show(self, item: Mesh, scale: float) -> None:
        """Take the arrays of a mesh and be visible."""
        if not np.array_equal(self._faces, item.faces):
            self.data.SetPolys(_cells(item.faces))
            self._faces = item.faces
        self._paint(item.vertices, np.broadcast_to(np.asarray(item.colour), item.vertices.shape))
        normals: NDArray[Any] = vertex_normals(item.vertices, item.faces)
        self.data.point_data.active_normals = normals


class ShellActor(_Painted):
    """All see-through meshes at once; their faces come sorted, so they are new in every picture."""

    def __init__(self, plotter: pv.Plotter) -> None:
        super().__init__(plotter)
        self.actor.prop.lighting = False
        self.actor.ForceTranslucentOn()

    def show(self, item: Shell, scale: float) -> None:
        """Take the arrays of a shell and be visible."""
        self.data.SetPolys(_cells(item.faces))
        self._paint(item.vertices, item.rgba)


class PointsActor(_Painted):
    """A cloud of points."""

    def __init__(self, plotter: pv.Plotter) -> None:
        super().__init__(plotter)
        self._count = 0
        self.actor.prop.style = "points"

    def show(self, item: Points, scale: float) -> None:
        """Take the arrays of a cloud and be visible."""
        if self._count != len(item.xyz):
            self._count = len(item.xyz)
            self.data.SetVerts(_cells(np.arange(self._count)[:, None]))
        self._paint(item.xyz, np.broadcast_to(np.asarray(item.colour), item.xyz.shape))
        prop = self.actor.prop
        prop.point_size = max(1.0, item.size * scale)
        prop.lighting = item.ball
        prop.render_points_as_spheres = item.ball


class LinesActor(_Painted):
    """Paths of equal length."""

    def __init__(self, plotter: pv.Plotter) -> None:
        super().__init__(plotter)
        self._shape = (0, 0)
        self.actor.prop.lighting = False

    def show(self, item: Lines, scale: float) -> None:
        """Take the arrays of some paths and be visible."""
        count, length, _ = item.paths.shape
        if self._shape != (count, length):
            self._shape = (count, length)
            self.data.SetLines(_cells(np.arange(count * length).reshape(count, length)))
        colours = np.broadcast_to(np.asarray(item.colour), item.paths.shape)
        self._paint(item.paths.reshape(-1, 3), colours.reshape(-1, 3))
        self.actor.prop.line_width = max(1.0, item.width * scale)


def coarsened(mesh: Mesh) -> tuple[NDArray[np.intp], NDArray[np.int32]]:
    """Return which vertices a coarser mesh keeps, (K,), and its faces among them, (F, 3); they fit it in any pose."""
    full = pv.PolyData.from_regular_faces(mesh.vertices.astype(float), mesh.faces.astype(int))
    full.point_data["kept"] = np.arange(len(mesh.vertices))
    coarse = full.decimate_pro(_FEWER, preserve_topology=True)
    return np.asarray(coarse.point_data["kept"], np.intp), coarse.regular_faces.astype(np.int32)


def _cells(indices: NDArray[Any]) -> pv.CellArray:
    """Return (cells, vertices a cell) indices as VTK's cells."""
    return pv.CellArray.from_regular_cells(indices)
