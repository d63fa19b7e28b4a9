"""Say how good a network is: ``python -m spf.training.evaluate [NETWORK.onnx] [--recording FOLDER …]``.

On samples never trained on (other hands, other scenes), in millimetres of a hand of the bundled mesh's size; and, single
frame by single frame, on recordings with truth whose joints are defined in :mod:`spf.joint_definitions`.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from spf.frame import Frame
from spf.hand.kinematics import angles_of, joints_of, pose_hand
from spf.hand.model import MIRROR, load_hand
from spf.joint_definitions import corrected_joints, offsets_of
from spf.learned import layout
from spf.learned.guesses import Cubes, Guess, decode, search_hand, side_evidence
from spf.learned.network import Network, load_network
from spf.segmentation import find_regions
from spf.sessions import open_session
from spf.synthetic.trajectory import PALM_TO_SENSOR
from spf.training.generator import Batch, Generator

__all__ = ["evaluate_recording", "evaluate_synthetic", "main"]

Array = NDArray[np.float64]

_HELD_OUT_SEED, _HELD_OUT_SHAPES = 7_000_000, 80


def evaluate_synthetic(network: Network, samples: int = 2000, seed: int = _HELD_OUT_SEED) -> dict[str, float]:
    """Measure on held-out samples.

    Returns:
        median joint errors, mm, of the most probable and of the best hypothesis (both as predicted and posed), of the
        palm's centre, of the palm's rotation in degrees, of the size in per cent; the error of the most probable by view,
        and of hands that are as near to the cube's centre and size as when they are tracked; and how often side (by all
        that is known, by the output alone) and presence are right, a hand is seen where none is, and one that is there missed.
    """
    batch = Generator(seed, _HELD_OUT_SHAPES).batch(0, samples, left_share=0.5)
    straight, mirrored = network.outputs(batch.crops), network.outputs(batch.crops[:, :, ::-1])
    seen = straight[:, layout.PRESENT] > 0.0
    there, right = batch.present > 0.5, batch.right > 0.5
    sides = side_evidence(np.stack([straight, mirrored]))
    logits = straight[:, layout.RIGHT] - mirrored[:, layout.RIGHT]
    rows = _sample_errors(batch, np.where(right[:, None], straight, mirrored))
    medians = {name: float(np.median(values[there])) for name, values in rows.items()}
    facing = (batch.rotations @ PALM_TO_SENSOR.T[:, 2])[:, 2]  # 1: the palm's side is seen
    kinds = {
        "palm": facing > 0.5,
        "edge": np.abs(facing) <= 0.5,
        "back": facing < -0.5,
        "tracked": (np.linalg.norm(batch.points[:, :21].mean(axis=1), axis=1) < 0.12)
        & (np.abs(batch.log_sizes + np.log(layout.EXTENT_PER_LENGTH)) < 0.15),
    }
    by_kind = {
        f"top_joints_{kind}_mm": float(np.median(rows["top_joints_mm"][there & of])) for kind, of in kinds.items()
    }
    return (
        medians
        | by_kind
        | {
            "right_side": float(np.mean((sides[0] > sides[1])[there] == right[there])),
            "right_side_by_output": float(np.mean((logits > 0.0)[there] == right[there])),
            "right_presence": float(np.mean(seen == there)),
            "seen_where_none_is": float(np.mean(seen[~there])),
            "missed": float(np.mean(~seen[there])),
        }
    )


def _sample_errors(batch: Batch, numbers: Array) -> dict[str, Array]:
    """Errors (N,) of samples whose numbers are of the crops in which their hands are right ones."""
    n, length = len(numbers), load_hand("right").length
    units = 1e3 * length * np.exp(-batch.log_sizes)  # sides of the cube to mm of the bundled hand
    truths = batch.points * np.where(batch.right[:, None, None] > 0.5, 1.0, MIRROR)
    cubes = Cubes(np.zeros((n, 3)), np.ones(n), np.tile(np.eye(3), (n, 1, 1)), batch.perspectives.astype(np.float64))
    rows = []
    for unit, truth, turn, log_size, group in zip(
        units, truths, batch.rotations, batch.log_sizes, decode(numbers, "right", np.zeros(n), cubes), strict=True
    ):
        found = sorted(group, key=lambda guess: -guess.log_weight)
        predicted = [unit * float(np.linalg.norm(g.joints - truth[:21], axis=1).mean()) for g in found]
        posed = [unit * float(np.linalg.norm(_posed_joints(g) - truth[:21], axis=1).mean()) for g in found]
        rows.append(
            {
                "top_joints_mm": predicted[0],
                "best_joints_mm": min(predicted),
                "top_posed_mm": posed[0],
                "best_posed_mm": min(posed),
                "palm_mm": unit * float(np.linalg.norm(found[0].pose[:3] - truth[21])),
                "rotation_degrees": float(np.degrees(np.linalg.norm(angles_of(found[0].reference @ turn.T)))),
                "size_per_cent": 100.0 * abs(float(np.log(found[0].scale * length) - log_size)),
            }
        )
    return {name: np.array([row[name] for row in rows]) for name in rows[0]}


def _posed_joints(guess: Guess) -> Array:
    return joints_of(load_hand(guess.side).scaled(guess.scale), guess.pose, guess.reference)


def evaluate_recording(network: Network, folder: Path, step: int = 5) -> dict[str, float]:
    """Measure on every ``step``-th frame of a recording of a right hand, each for itself, at unknown size and side."""
    session = open_session(folder)
    offsets = offsets_of(session.format)
    if offsets is None:
        raise SystemExit(f"What the joints of {session.format} mean is not known; see spf/joint_definitions.py.")
    rows = [_frame_errors(network, session[index], offsets) for index in range(0, len(session), step)]
    kept = [row for row in rows if row]
    return {name: float(np.median([row[name] for row in kept])) for name in kept[0] if name != "right_side"} | {
        "right_side": float(np.mean([row["right_side"] for row in kept])),
        "frames": float(len(kept)),
    }


def _frame_errors(network: Network, frame: Frame, offsets: Array) -> dict[str, float]:
    regions = find_regions(frame, most=1)
    if not regions or frame.truth is None:
        return {}
    found = search_hand(network, frame.depth, frame.camera, regions[0].centre)
    right = [guess for guess in found if guess.side == "right"]
    errors = [_recording_error(guess, frame.truth.joints, offsets) for guess in right]
    return {
        "top_posed_mm": errors[0],
        "best_posed_mm": min(errors),
        "scale": right[0].scale,
        "right_side": float(found[0].side == "right"),
    }


def _recording_error(guess: Guess, truth: Array, offsets: Array) -> float:
    hand = load_hand(guess.side).scaled(guess.scale)
    joints = corrected_joints(hand, pose_hand(hand, guess.pose, guess.reference), offsets)
    return 1e3 * float(np.nanmean(np.linalg.norm(joints - truth, axis=1)))


def main() -> None:
    """Run the command."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument(
        "network", nargs="?", type=Path, help="an .onnx file; the one that comes with the project if none"
    )
    parser.add_argument("--samples", type=int, default=2000)
    parser.add_argument("--recording", type=Path, action="append", default=[])
    options = parser.parse_args()
    network = load_network(options.network)
    report: dict[str, Any] = {"samples_seen": network.about.get("samples_seen")}
    report["synthetic"] = evaluate_synthetic(network, options.samples)
    for folder in options.recording:
        report[folder.name] = evaluate_recording(network, folder)
    print(json.dumps({k: _rounded(v) for k, v in report.items()}, indent=2))


def _rounded(value: Any) -> Any:
    return {k: round(v, 3) for k, v in value.items()} if isinstance(value, dict) else value


if __name__ == "__main__":
    main()
