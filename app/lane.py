"""One tracker with its settings, and what it has tracked: a page shows one of them, or compares several."""

from __future__ import annotations

import dataclasses
import time
from typing import Any, NamedTuple

import param

from app.results import Entry, Results, Summary, same_rules
from spf.errors import StartError
from spf.initialise import Start
from spf.manifest import Plan
from spf.presets import Presets
from spf.settings import Settings
from spf.track import Tracking, TrackState, begin
from spf.trackers import TRACKERS, make_settings

__all__ = ["Folder", "Lane", "Origin"]


_ONE_MOVE = 1.0  # s


class Origin(NamedTuple):
    """Where every lane begins: the first pose and hand, its frame's time in seconds, and the seed."""

    start: Start
    time: float
    seed: int


@dataclasses.dataclass
class Folder:
    """Where a run is kept.

    Attributes:
        run: name on the shelf; nothing before it was kept.
        kept: number of the frame after the last one that is on disk.
        owned: whether this page made it; what was opened is not written to.
    """

    run: str = ""
    kept: int = 0
    owned: bool = True


class Lane(param.Parameterized):
    """A tracker and its run. A tracker or preset that is picked brings its own values along."""

    tracker: str = param.Selector(default="spf", objects=list(TRACKERS))
    preset: str = param.String("default")
    settings: Settings = param.ClassSelector(class_=Settings)

    def __init__(self, tracker: str = "spf", colour: str = "", presets: Presets | None = None) -> None:
        super().__init__(tracker=tracker, settings=make_settings(tracker))
        self._base = self.settings  # the preset's
        self.colour = colour
        self.results = Results()
        self.presets = presets or Presets()
        self._undo: list[Settings] = []
        self._last = ("", 0.0)  # setting that was changed last, and when
        self.folder = Folder()
        self.label = ""  # that a visitor gave the run
        self.reopened: Origin | None = None  # where a run that was read from disk began
        self.param.watch(self._take_preset, ["tracker", "preset"])

    def _take_preset(self, *events: Any) -> None:
        if any(event.name == "tracker" for event in events):
            self._undo.clear()
            if self.preset not in self.presets.names(self.tracker):
                self.preset = "default"  # a saved preset is of one tracker
                return
        else:
            self._undo.append(self.settings)
        self._base = self.presets.settings(self.tracker, self.preset)  # held: its file may be deleted meanwhile
        self.settings = self._base

    # ---- settings

    def change(self, name: str, value: Any) -> None:
        """Change one setting from the next step on.

        Raises:
            SettingError: there is no such setting, or the value is out of range.
        """
        changed = self.settings.replace(**{name: value})
        now = time.monotonic()
        if self._last[0] != name or now - self._last[1] > _ONE_MOVE:  # a slider that is dragged is one change
            self._undo.append(self.settings)
        self._last = name, now
        self.settings = changed

    @property
    def can_undo(self) -> bool:
        """Whether a setting was changed."""
        return bool(self._undo)

    def undo(self) -> None:
        """Take the last change of a setting back."""
        if self._undo:
            self._last = ("", 0.0)
            self.settings = self._undo.pop()

    def back_to_preset(self) -> None:
        """Undo every change of a setting."""
        self._undo.append(self.settings)
        self.settings = self._base

    def without_preset(self) -> None:
        """The preset is deleted: go on with its settings, told as changes of the default ones."""
        settings = self.settings
        self.preset = "default"
        self.settings = settings

    @property
    def differences(self) -> dict[str, tuple[Any, Any]]:
        """Settings that differ from the preset: name → (preset's value, value)."""
        preset = self._base.to_dict()
        return {name: (preset[name], value) for name, value in self.settings.to_dict().items() if value != preset[name]}

    @property
    def title(self) -> str:
        """The tracker, its preset unless that is the default one, and what differs from it."""
        parts = [TRACKERS[self.tracker].title] + ([self.preset] if self.preset != "default" else [])
        called = self.settings.called()
        return " · ".join(parts + [f"{called[name]} {_short(now)}" for name, (_, now) in self.differences.items()])

    # ---- the run

    def take(self, run: str, plan: Plan, results: Results, origin: Origin, label: str) -> None:
        """Show a run that was read from disk; its settings are those that it ended with."""
        ended = results.summaries[-1].tracking
        self.param.update(tracker=ended.tracker, preset="default")
        if plan.preset in self.presets.names(ended.tracker):
            self.preset = plan.preset
        self.settings = ended.settings
        self.results, self.reopened, self.label = results, origin, label
        self.folder = Folder(run, (results.last or 0) + 1, owned=False)

    def clear(self) -> None:
        """Begin another run, with nothing tracked; what was kept of the last one stays where it is."""
        self.results, self.reopened = Results(), None
        self.fork()

    def fork(self) -> None:
        """Go on as another run, which is kept in a folder of its own."""
        self.folder, self.label = Folder(), ""

    @property
    def is_kept(self) -> bool:
        """Whether all that was tracked is on disk."""
        return self.results.last is None or self.folder.kept == self.results.last + 1

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
        origin = self.reopened or origin
        if frame == origin.start.frame:
            return begin(self.tracker, self.settings, origin.start, origin.seed, time=origin.time)
        state, summary = self.results.state(frame - 1), self.results.summary(frame - 1)
        if state is None or summary is None:
            raise StartError(
                f"The particles of frame {frame - 1} are no longer in memory: go on from the last tracked frame, "
                "or restart."
            )
        return summary.tracking._replace(tracker=self.tracker, settings=self.settings), state

    def begins(self, origin: Origin) -> int:
        """Return the first frame that is tracked."""
        return (self.reopened or origin).start.frame

    def way_to(self, frame: int, origin: Origin) -> tuple[int, Tracking, TrackState]:
        """Return where to begin to track a frame again as it was tracked: first frame, how, and the state before it."""
        origin = self.reopened or origin
        for index in range(frame, origin.start.frame, -1):
            state, summary = self.results.state(index - 1), self.results.summary(index)
            if state is not None and summary is not None:
                return index, summary.tracking, state
        first = self.results.summary(origin.start.frame)
        assert first is not None
        how = first.tracking
        _, state = begin(how.tracker, how.settings, origin.start, how.seed, time=origin.time)
        return origin.start.frame, how, state


def _short(value: Any) -> str:
    return f"{value:g}" if isinstance(value, float) else str(value)
