"""A sphere to draw, and what to look for in a picture."""

import numpy as np

from spf.render import Mesh, ViewCamera

#: 0.2 m of the world fill the height of a picture, seen from half a metre.
VIEW = ViewCamera((0.0, 0.0, 0.5), distance=0.5, extent=0.2)
SIZE = (160, 120)
METRES_A_PIXEL = VIEW.extent / SIZE[1]


def sphere(centre=(0.0, 0.0, 0.5), radius=0.03, rings=16, **kwargs):
    """A closed sphere of 2·rings segments, faces counter-clockwise seen from outside."""
    segments = 2 * rings
    theta = np.linspace(0, np.pi, rings + 1)[1:-1, None]
    phi = 2 * np.pi * np.arange(segments) / segments
    x, y, z = np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta) + 0 * phi
    vertices = np.concatenate([np.stack([x, y, z], -1).reshape(-1, 3), [[0, 0, 1], [0, 0, -1]]])
    index = np.arange((rings - 1) * segments).reshape(rings - 1, segments)
    after = np.roll(index, -1, axis=1)
    north, south = len(vertices) - 2, len(vertices) - 1
    faces = [np.stack([np.full(segments, north), index[0], after[0]], -1)]
    for k in range(rings - 2):
        faces.append(np.stack([index[k], index[k + 1], after[k + 1]], -1))
        faces.append(np.stack([index[k], after[k + 1], after[k]], -1))
    faces.append(np.stack([np.full(segments, south), after[-1], index[-1]], -1))
    return Mesh(np.asarray(centre) + radius * vertices, np.concatenate(faces), **kwargs)


def drawn(picture, background=(42, 48, 56)):
    """The pixels that differ from the background."""
    return (np.abs(picture.astype(int) - background) > 8).any(axis=-1)


def centre_of(picture):
    """The (x, y) in metres, at the focal plane, of the middle of what is drawn."""
    rows, columns = np.nonzero(drawn(picture))
    height, width = picture.shape[:2]
    return np.array([columns.mean() - (width - 1) / 2, rows.mean() - (height - 1) / 2]) * METRES_A_PIXEL
