"""What the present settings make of the frame shown, before anything is tracked again: its samples weighed anew."""

from __future__ import annotations

import asyncio
import math
import time
from concurrent.futures import ThreadPoolExecutor
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from app.results import Entry, seen_again
from app.state import State
from spf.cost.settings import CostSettings
from spf.errors import SpfError
from spf.filters.reweigh import SEEN_AT_ONCE, landscape, reweigh
from spf.frame import Frame
from spf.hand.kinematics import joints_of
from spf.observation import Observation
from spf.settings import Settings

__all__ = ["Landscape", "Preview", "Previewer"]

_CELLS = 19  # of the landscape along each side
_LEAST_REACH = {True: 0.01, False: 0.12}  # m and rad that the landscape shows at least beside the estimate
_ROOM = 1.25  # beyond the samples
_DRAWN = (
    "With weighting laplace the samples are drawn anew around the optima that the settings lead to, so that weights and estimate "
    "are those of a re-run: press This frame again. The cost below is that of the settings as they are now."
)
_PICTURES_FIRST = 0.4  # s that the pictures of a new frame have the machine for themselves


class Landscape(NamedTuple):
    """E over two entries of the pose.

    Attributes:
        entries: indices of the two.
        across: values of each, m or rad.
        cost: (len(across[1]), len(across[0])).
    """

    entries: tuple[int, int]
    across: tuple[NDArray[np.float64], NDArray[np.float64]]
    cost: NDArray[np.float64]


class Preview(NamedTuple):
    """The frame shown, weighed with the present settings of the chosen lane.

    Attributes:
        base: what was tracked.
        settings: that it is weighed with.
        entry: what the settings make of it.
        landscape: of the cost around the estimate; None until it is known, and with another tracker.
        note: what changed, in words.
    """

    base: Entry
    settings: Settings
    entry: Entry
    landscape: Landscape | None
    note: str


class Previewer:
    """Keeps ``state.preview`` up with the settings and the frame: in a thread of its own, the newest wins."""

    def __init__(self, state: State) -> None:
        self._state = state
        self._thread = ThreadPoolExecutor(max_workers=1, thread_name_prefix="spf-preview")
        self._busy = False
        self._shown = -_PICTURES_FIRST  # when a frame was shown, s
        self._observed: tuple[Entry, Observation] | None = None
        state.param.watch(self.request, ["rules", "revision", "playing", "landscape_of"])

    def close(self) -> None:
        """The page is gone."""
        self._thread.shutdown(wait=False, cancel_futures=True)

    def request(self, *events: Any) -> None:
        """Have the frame shown weighed with the present settings, unless it is."""
        state = self._state
        if any(event.name == "revision" for event in events):
            self._shown = time.monotonic()
        base = state.lane.entry(state.frame)
        if state.playing or self._busy or base is None or base.result.info is None or self._is_current(base):
            return
        self._busy = True
        asyncio.get_running_loop().create_task(self._work(base))

    def _is_current(self, base: Entry) -> bool:
        preview, state = self._state.preview, self._state
        if preview is None or preview.base is not base or preview.settings != state.lane.settings:
            return False
        return preview.landscape is None or preview.landscape.entries == state.landscape_of

    async def _work(self, base: Entry) -> None:
        state = self._state
        await asyncio.sleep(self._shown + _PICTURES_FIRST - time.monotonic())
        if state.lane.entry(state.frame) is not base:
            self._busy = False
            self.request()
            return
        assert state.session is not None
        settings, index = state.lane.settings, base.result.index
        try:
            job = _Job(base, settings, state.lane.tracker, state.landscape_of)
            loop, frame = asyncio.get_running_loop(), state.session[index]
            preview, observation = await loop.run_in_executor(self._thread, self._weighed, job, frame)
            state.preview = preview
            state.previewed += 1
            if job.tracker == base.tracking.tracker:  # the landscape takes longer, and comes after the samples
                land = await loop.run_in_executor(self._thread, _around, job, preview.entry, observation)
                state.preview = preview._replace(landscape=land)
        except SpfError as error:
            state.error = str(error)
        finally:
            self._busy = False
        if state.lane.entry(state.frame) is not base or state.lane.settings != settings or (
            state.landscape_of != job.entries
        ):  # fmt: skip
            self.request()

    def _weighed(self, job: _Job, frame: Frame) -> tuple[Preview, Observation]:
        if self._observed is None or self._observed[0] is not job.base:
            self._observed = job.base, seen_again(job.base, frame)
        return _preview(job, self._observed[1]), self._observed[1]


class _Job(NamedTuple):
    base: Entry
    settings: Settings
    tracker: str
    entries: tuple[int, int]


def _preview(job: _Job, observation: Observation) -> Preview:
    base, settings = job.base, job.settings
    info, how = base.result.info, base.shaped
    assert info is not None
    assert isinstance(settings, CostSettings)
    assert isinstance(how.settings, CostSettings)
    note, entry = "", base
    if job.tracker != how.tracker:
        note = "This frame was tracked with another tracker: track it again to see what this one does."
    elif settings != how.settings:
        was, now = how.settings.to_dict(), settings.to_dict()
        changed = {name for name, value in now.items() if value != was[name]}
        called = settings.called()
        later = sorted(called[name] for name in changed - SEEN_AT_ONCE)
        if "weighting" in changed or getattr(settings, "weighting", "") == "laplace":
            note = _DRAWN
        else:
            interval = max(observation.time - base.before.filter.time, 1e-3)
            rng = np.random.default_rng([how.seed, base.result.index])
            weighed = reweigh(
                rng, how.hand, observation, info, how.settings, settings, interval, how.spheres
            )  # fmt: skip
            entry = base._replace(result=base.result._replace(info=weighed, ess=weighed.ess))
            note = _told(base, entry)
            if later:
                note += f" {', '.join(later)}: seen when the frame is tracked again."
    return Preview(base, settings, entry, None, note)


def _told(base: Entry, entry: Entry) -> str:
    was, now, how = base.result.info, entry.result.info, base.shaped
    assert was is not None
    assert now is not None
    apart = joints_of(how.hand, was.estimate, was.reference) - joints_of(how.hand, now.estimate, now.reference)
    return (
        f"This frame with these settings: ESS {was.ess:.1f} → {now.ess:.1f}, weight of optimised samples "
        f"{100 * was.optimised_share:.0f} → {100 * now.optimised_share:.0f} %, cost of the estimate "
        f"{was.estimate_cost:.1f} → {now.estimate_cost:.1f}, which moves by "
        f"{1000 * float(np.linalg.norm(apart, axis=1).mean()):.1f} mm."
    )


def _around(job: _Job, entry: Entry, observation: Observation) -> Landscape:
    """The landscape around the estimate, wide enough for the samples."""
    info, how = entry.result.info, entry.shaped
    assert info is not None
    samples = np.concatenate([info.predicted, info.optimised])
    across = []
    for index in job.entries:
        reach = _ROOM * float(np.abs(samples[:, index] - info.estimate[index]).max())
        reach = max(reach if math.isfinite(reach) else 0.0, _LEAST_REACH[index < 3])
        across.append(info.estimate[index] + np.linspace(-reach, reach, _CELLS))
    rng = np.random.default_rng([how.seed, entry.result.index])
    both = across[0], across[1]
    cost = landscape(rng, how.hand, observation, info, job.settings, job.entries, both, how.spheres)
    return Landscape(job.entries, both, cost)
