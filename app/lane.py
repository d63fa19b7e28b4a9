"""One tracker with its settings, and what it has tracked: a page shows one of them, or compares several."""

from __future__ import annotations

from typing import Any, NamedTuple

import param

from app.results import Entry, Results, Summary, same_rules
from spf.errors import StartError
from spf.initialise import Start
from spf.settings import Settings
from spf.track import Tracking, TrackState, begin
from spf.trackers import PRESETS, TRACKERS, make_settings

__all__ = ["Lane", "Origin"]


class Origin(NamedTuple):
    """Where every lane begins: the first pose and hand, its frame's time in seconds, and the seed."""

    start: Start
    time: float
    seed: int


class Lane(param.Parameterized):
    """A tracker and its run. A tracker or preset that is picked brings its own values along."""

    tracker: str = param.Selector(default="spf", objects=list(TRACKERS))
    preset: str = param.Selector(default="default", objects=list(PRESETS))
    settings: Settings = param.ClassSelector(class_=Settings)

    def __init__(self, tracker: str = "spf", colour: str = "") -> None:
        super().__init__(tracker=tracker, settings=make_settings(tracker))
        self.colour = colour
        self.results = Results()
        self.param.watch(self._take_preset, ["tracker", "preset"])

    def _take_preset(self, *_events: Any) -> None:
        self.settings = make_settings(self.tracker, self.preset)

    # ---- settings

    def change(self, name: str, value: Any) -> None:
        """Change one setting from the next step on.

        Raises:
            SettingError: there is no such setting, or the value is out of range.
        """
        self.settings = self.settings.replace(**{name: value})

    def back_to_preset(self) -> None:
        """Undo every change of a setting."""
        self._take_preset()

    @property
    def differences(self) -> dict[str, tuple[Any, Any]]:
        """Settings that differ from the preset: name → (preset's value, value)."""
        preset = make_settings(self.tracker, self.preset).to_dict()
        return {name: (preset[name], value) for name, value in self.settings.to_dict().items() if value != preset[name]}

    @property
    def title(self) -> str:
        """The tracker, its preset unless that is the default one, and what differs from it."""
        parts = [TRACKERS[self.tracker].title] + ([self.preset] if self.preset != "default" else [])
        return " · ".join(parts + [f"{name} {_short(now)}" for name, (_, now) in self.differences.items()])

    # ---- the run

    def clear(self) -> None:
        """Drop what was tracked."""
        self.results = Results()

    def entry(self, frame: int) -> Entry | None:
        """Return everything of a frame, or None when it was not tracked or is no longer in memory."""
        return self.results.entry(frame)

    def summary(self, frame: int) -> Summary | None:
        """Return a frame's summary, or None when it was not tracked."""
        return self.results.summary(frame)

    @property
    def is_mixed(self) -> bool:
        """Whether some of what was tracked was tracked with other settings than the present ones."""
        return any(not same_rules(s.tracking, self.tracker, self.settings) for s in self.results.summaries)

    def loss(self, frame: int) -> str:
        """Return a few words while the hand is lost in a frame, else nothing."""
        since = self.results.lost_since(frame)
        return "" if since is None else f"Hand lost at frame {since}, searching"

    def before(self, frame: int, origin: Origin) -> tuple[Tracking, TrackState]:
        """Return how a frame is to be tracked now, and the tracker's state before it.

        Raises:
            StartError: the frame before it was not tracked, or is no longer in memory.
        """
        if frame == origin.start.frame:
            return begin(self.tracker, self.settings, origin.start, origin.seed, time=origin.time)
        entry = self.results.entry(frame - 1)
        if entry is None:
            raise StartError(
                f"The particles of frame {frame - 1} are no longer in memory: go on from the last tracked frame, "
                "or restart."
            )
        return entry.tracking._replace(tracker=self.tracker, settings=self.settings), entry.state


def _short(value: Any) -> str:
    return f"{value:g}" if isinstance(value, float) else str(value)
