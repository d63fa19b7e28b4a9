"""Hand shape: a global scale, a length per digit bone and the palm's proportions, kept in a small JSON file."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from spf.errors import HandError
from spf.hand.model import BONES, FINGERS, Hand, Side, assemble_hand, bone_weights, load_hand

__all__ = [
    "SHAPE_PARAMETERS",
    "UNCHANGED",
    "HandShape",
    "percent_of",
    "read_hand_shape",
    "shaped",
    "varied",
    "write_hand_shape",
]

#: What of a shape is estimated; :func:`varied` takes the logarithm of a factor on each.
SHAPE_PARAMETERS = ("scale", *FINGERS, "palm_width", "palm_thickness", "finger_thickness")

#: The change that :func:`varied` leaves a shape as it is with.
UNCHANGED = np.zeros(len(SHAPE_PARAMETERS))
UNCHANGED.flags.writeable = False

_FORMAT = "spf-hand-shape"
_SCALE_RANGE = (0.4, 2.0)
_LENGTH_RANGE = (0.5, 1.8)


class HandShape(NamedTuple):
    """The shape of one person's hand, relative to a mesh.

    Attributes:
        side: ``"left"`` or ``"right"``.
        scale: global scale.
        lengths: 15 factors on the lengths of the digit bones, in the order of ``BONES[1:]``; a bone's skin is
            stretched along the bone with it.
        palm_width, palm_thickness: factors on the palm across the knuckles and from palm to back.
        finger_thickness: factor on the digits' cross-sections.
        mesh: path of a ``.glb``, or "" for the bundled hand.
        lens: factor on the focal lengths that the session states, through which a hand of this shape was found
            (:mod:`spf.lens`); 1 where they were believed.
    """

    side: Side
    scale: float = 1.0
    lengths: tuple[float, ...] = (1.0,) * 15
    palm_width: float = 1.0
    palm_thickness: float = 1.0
    finger_thickness: float = 1.0
    mesh: str = ""
    lens: float = 1.0

    def hand(self, *, free_dip: bool = False) -> Hand:
        """Build the hand of this shape."""
        return shaped(load_hand(self.side, self.mesh or None, free_dip=free_dip), self)

    def to_dict(self) -> dict[str, Any]:
        """Return the shape as a JSON-able mapping, the content of a shape file."""
        content = {"format": _FORMAT, "version": 1, **self._asdict(), "lengths": list(self.lengths)}
        if self.lens == 1.0:
            del content["lens"]  # of most hands, which were found through the stated camera
        return content

    @classmethod
    def from_dict(cls, content: dict[str, Any], source: str = "The hand shape") -> HandShape:
        """Check and build a shape from the content of a shape file.

        Raises:
            HandError: a value is missing or out of range.
        """
        if not isinstance(content, dict) or content.get("format") != _FORMAT or "side" not in content:
            raise HandError(f"{source} is not a hand shape; make one with 'spf calibrate SESSION -o HAND.json'.")
        try:
            values = {name: content[name] for name in cls._fields if name in content}
            shape = cls(**{**values, "lengths": tuple(float(x) for x in content.get("lengths", (1.0,) * 15))})
            numbers = [float(shape.scale), *shape.lengths]
            numbers += [float(shape.palm_width), float(shape.palm_thickness), float(shape.finger_thickness)]
            numbers += [float(shape.lens)]
        except (TypeError, ValueError):
            raise HandError(f"{source} holds something that is not a number; calibrate the hand again.") from None
        ranges = [_SCALE_RANGE] + [_LENGTH_RANGE] * (len(numbers) - 1)
        in_range = all(math.isfinite(x) and low <= x <= high for x, (low, high) in zip(numbers, ranges, strict=True))
        if shape.side not in ("left", "right") or len(shape.lengths) != len(BONES) - 1 or not in_range:
            raise HandError(f"{source} is no human hand (side, scale or a length is out of range); calibrate it again.")
        return shape


def shaped(hand: Hand, shape: HandShape) -> Hand:
    """Return ``hand`` (in its mesh's own size) with a shape applied to its bind pose.

    Each bone stretches its own part of the skin along its axis (−z of its frame) and across it; the joints move with
    the stretched bones. The result is an ordinary hand: no kernel knows of shapes.

    Raises:
        HandError: the shape is for the other side.
    """
    if shape.side != hand.side:
        raise HandError(f"The hand shape is of a {shape.side} hand and the model is a {hand.side} hand.")
    skeleton, vertices_before = hand.skeleton, hand.skin.vertices
    stretch = _stretch(shape)
    bind = np.empty_like(skeleton.bind)
    for bone, parent in enumerate(skeleton.parent):
        rest = skeleton.rest[bone]
        if parent < 0:
            bind[bone] = rest
            continue
        place = stretch[parent] * rest[:, 3]
        bind[bone, :, :3] = bind[parent, :, :3] @ rest[:, :3]
        bind[bone, :, 3] = bind[parent, :, :3] @ place + bind[parent, :, 3]
    vertices = np.zeros_like(vertices_before)
    weights = bone_weights(hand)
    for bone in range(len(BONES)):
        local = vertices_before @ skeleton.inverse_bind[bone, :, :3].T + skeleton.inverse_bind[bone, :, 3]
        moved = (local * stretch[bone]) @ bind[bone, :, :3].T + bind[bone, :, 3]
        vertices += weights[:, bone, None] * moved
    offsets = hand.joint_offset * stretch[hand.joint_bone]
    return assemble_hand(
        hand.side,
        vertices * shape.scale,
        hand.faces,
        weights,
        np.concatenate([bind[:, :, :3], shape.scale * bind[:, :, 3:]], axis=2),
        hand.joint_bone,
        offsets * shape.scale,
        free_dip=hand.free_dip,
    )


def _stretch(shape: HandShape) -> NDArray[np.float64]:
    """(B, 3) factors along each bone's own x, y, z."""
    stretch = np.ones((len(BONES), 3))
    stretch[0] = (shape.palm_width, shape.palm_thickness, 1.0)
    stretch[1:, :2] = shape.finger_thickness
    stretch[1:, 2] = shape.lengths
    return stretch


def lengths_of_digits(factors: tuple[float, float, float, float, float]) -> tuple[float, ...]:
    """Return the 15 bone lengths of one factor a digit, thumb to little."""
    return tuple(float(factor) for factor in factors for _ in range(len(BONES) // len(FINGERS)))


def varied(shape: HandShape, change: NDArray[np.float64]) -> HandShape:
    """Return a shape with a factor on each of its parameters.

    Args:
        shape: to vary.
        change: (P,) logarithms of the factors, in the order of ``SHAPE_PARAMETERS``.
    """
    factors = np.exp(change)
    digits = lengths_of_digits(tuple(factors[1:6]))
    return shape._replace(
        scale=float(shape.scale * factors[0]),
        lengths=tuple(length * factor for length, factor in zip(shape.lengths, digits, strict=True)),
        palm_width=float(shape.palm_width * factors[6]),
        palm_thickness=float(shape.palm_thickness * factors[7]),
        finger_thickness=float(shape.finger_thickness * factors[8]),
    )


#: Part of a hand → places in ``SHAPE_PARAMETERS``.
_PARTS = {
    "size": [0],
    "length of the thumb": [1],
    "length of the fingers": [2, 3, 4, 5],
    "palm": [6, 7],
    "thickness of the digits": [8],
}


def percent_of(changes: NDArray[np.float64]) -> dict[str, NDArray[np.float64]]:
    """Return by how many per cent parts of a hand changed: part → (N,).

    Args:
        changes: (N, P) of :func:`varied`.
    """
    logs = changes.reshape(-1, len(SHAPE_PARAMETERS))
    return {part: 100.0 * np.expm1(logs[:, places].mean(axis=1)) for part, places in _PARTS.items()}


def write_hand_shape(shape: HandShape, path: str | Path) -> None:
    """Write a shape as JSON."""
    Path(path).write_text(json.dumps(shape.to_dict(), indent=2) + "\n", encoding="utf-8")


def read_hand_shape(path: str | Path) -> HandShape:
    """Read a shape written by :func:`write_hand_shape`.

    Raises:
        HandError: the file is missing, torn or no hand shape.
    """
    try:
        content = json.loads(Path(path).read_text(encoding="utf-8"))
    except OSError as error:
        raise HandError(f"The hand shape {path} cannot be read: {error.strerror}.") from None
    except ValueError:
        raise HandError(f"The hand shape {path} is torn or not JSON; calibrate the hand again.") from None
    return HandShape.from_dict(content, f"The file {path}")
