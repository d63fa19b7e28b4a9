"""Off-screen three-dimensional pictures: immutable scenes in, pixels out. All of PyVista and VTK is behind this."""

from spf.render.depth_image import Box, Skeleton, box_around, depth_picture
from spf.render.process import UNAVAILABLE, probe_opengl
from spf.render.protocol import OpenGL
from spf.render.renderer import Renderer
from spf.render.scene import Colour, Lines, Mesh, Points, Scene
from spf.render.scenes import particles_scene, reconstruction_scene, trajectories_scene
from spf.render.view import ViewCamera

__all__ = [
    "UNAVAILABLE",
    "Box",
    "Colour",
    "Lines",
    "Mesh",
    "OpenGL",
    "Points",
    "Renderer",
    "Scene",
    "Skeleton",
    "ViewCamera",
    "box_around",
    "depth_picture",
    "particles_scene",
    "probe_opengl",
    "reconstruction_scene",
    "trajectories_scene",
]
