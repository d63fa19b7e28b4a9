"""Give every tracker about the same time per frame, by the one setting that its time grows with."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from spf.compare.contender import Contender
from spf.compare.workers import Tick, Workers, seconds_per_frame
from spf.initialise import Start
from spf.manifest import Plan
from spf.settings import SettingInfo
from spf.trackers import TRACKERS, make_settings

__all__ = ["FRAMES", "Share", "choose", "equalise", "reference"]

FRAMES = 8  # tracked to measure a setting
_TRIES = 5
_NEAR = 0.1  # relative difference from the target that is near enough


class Share(NamedTuple):
    """The time that a tracker was given.

    Attributes:
        setting, value: what was chosen.
        seconds: that a frame takes with it, measured.
    """

    setting: str
    value: int
    seconds: float


def reference() -> Contender:
    """The tracker whose time all are given: the Smart Particle Filter with its defaults, N = 4."""
    return Contender("spf", "spf", "default", make_settings("spf", changes={"n": "4"}))


def choose(info: SettingInfo, value: int, target: float, measure: Callable[[int], float]) -> tuple[int, float]:
    """Choose a setting such that a frame takes a given time, which grows about linearly with the setting.

    Args:
        info: its range.
        value: where to begin.
        target: s.
        measure: value → s.

    Returns:
        (the value among those measured whose time is nearest to the target, its time).
    """
    assert info.low is not None
    assert info.high is not None
    times: dict[int, float] = {}
    for _ in range(_TRIES):
        if value in times:
            break
        times[value] = measure(value)
        if abs(times[value] - target) <= _NEAR * target:
            break
        value = int(min(max(round(_extrapolated(times, target)), info.low), info.high))
    best = min(times, key=lambda tried: abs(times[tried] - target))
    return best, times[best]


def _extrapolated(times: dict[int, float], target: float) -> float:
    """Value to try next: where the line through the last two times (through zero for one) reaches the target.

    Between two times on both sides of the target it is half-way from that line's value to the middle: the line alone would
    close in from one side only where time is no straight line.
    """
    under = {value: seconds for value, seconds in times.items() if seconds < target}
    over = {value: seconds for value, seconds in times.items() if seconds >= target}
    if under and over:
        low, high = max(under, key=under.__getitem__), min(over, key=over.__getitem__)
        line = low + (target - under[low]) / (over[high] - under[low]) * (high - low)
        return 0.5 * line + 0.25 * (low + high)
    *before, (value, seconds) = times.items()
    if not before or before[-1][1] == seconds:
        return value * target / seconds
    other, other_seconds = before[-1]
    slope = (seconds - other_seconds) / (value - other)
    return value + (target - seconds) / slope if slope > 0 else value * target / seconds


def share_of_time(uri: str, camera: Path | None, plan: Plan, target: float) -> Share:
    """Choose the setting of a plan's tracker that its time grows with, in a worker."""
    name = TRACKERS[plan.tracker].cost
    info = next(info for info in plan.settings.describe() if info.name == name)

    def measure(value: int) -> float:
        return seconds_per_frame(uri, camera, plan._replace(settings=plan.settings.replace(**{name: value})))

    return Share(name, *choose(info, getattr(plan.settings, name), target, measure))


def equalise(
    workers: Workers,
    contenders: Sequence[Contender],
    uri: str,
    camera: Path | None,
    start: Start,
    last: int,
    tick: Tick,
) -> tuple[tuple[Contender, ...], dict[str, Any]]:
    """Give the contenders the time per frame of the reference.

    Args:
        workers: to measure in.
        contenders: who takes part.
        uri, camera: of the session.
        start: to measure from.
        last: frame that none is tracked from on.
        tick: called meanwhile.

    Returns:
        (the contenders with the settings chosen, what was measured, ready for JSON).
    """
    frames = start.frame, min(start.frame + FRAMES, last)

    def plan(contender: Contender) -> Plan:
        return Plan(contender.tracker, contender.preset, contender.settings, 0, "shared", *frames, start)

    standard = reference()
    ((_, target),) = workers.map(seconds_per_frame, [(uri, camera, plan(standard))], tick)
    others = [contender for contender in contenders if contender.settings != standard.settings]
    arguments = [(uri, camera, plan(contender), target) for contender in others]
    shares = {others[index].label: share for index, share in workers.map(share_of_time, arguments, tick)}
    chosen = tuple(
        contender._replace(settings=contender.settings.replace(**{share.setting: share.value}))
        if (share := shares.get(contender.label)) is not None
        else contender
        for contender in contenders
    )
    told = {label: share._asdict() for label, share in shares.items()}
    return chosen, {"target_seconds": target, "frames": list(frames), "of": standard.to_dict(), "chosen": told}
