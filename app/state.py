"""The state of one page: what was chosen, what was tracked, what is shown. It knows no widget and no thread."""

from __future__ import annotations

from typing import Any, NamedTuple

import param

from app.results import Entry, Results, Summary, same_rules
from spf.errors import SettingError
from spf.initialise import Start
from spf.sessions import Session
from spf.settings import Settings
from spf.track import Tracking, TrackState
from spf.trackers import PRESETS, TRACKERS, make_settings

__all__ = ["INITS", "Origin", "State"]

#: Ways to the first pose and to the hand's shape, by the words of the page.
INITS = {"Find it automatically": "auto", "Take it from the truth": "truth", "Read a pose file": "file"}
SHAPES = {"Calibrate it from the depth": "depth", "Read a hand file": "file"}

_LEAST_ZOOM, _MOST_ZOOM = 0.3, 6.0


class Origin(NamedTuple):
    """Where a run begins: its start, and the tracker's state before the first frame."""

    start: Start
    tracking: Tracking
    state: TrackState


class State(param.Parameterized):
    """One page. Views watch its parameters; ``revision`` counts up whenever what was tracked changes."""

    session: Session | None = param.ClassSelector(class_=Session, doc="what is tracked")
    frame: int = param.Integer(0, bounds=(0, None), doc="index of the frame shown")
    origin: Origin | None = param.ClassSelector(class_=Origin, doc="where the run begins; None before Start")
    revision: int = param.Integer(0)

    init: str = param.Selector(default="auto", objects=list(INITS.values()))
    pose_file: str = param.String("")
    shape: str = param.Selector(default="depth", objects=list(SHAPES.values()))
    hand_file: str = param.String("")
    seed: int = param.Integer(0, bounds=(0, 2**31 - 1))

    tracker: str = param.Selector(default="spf", objects=list(TRACKERS))
    preset: str = param.Selector(default="default", objects=list(PRESETS))
    settings: Settings = param.ClassSelector(class_=Settings, default=make_settings("spf"))

    playing: bool = param.Boolean(False)
    task: str = param.String("", doc="what is being done in the background, or nothing")
    share: float = param.Number(0.0, bounds=(0.0, 1.0), doc="of the task that is done")
    error: str = param.String("")
    warning: str = param.String("")

    with_truth: bool = param.Boolean(True, doc="whether the truth is drawn too")
    azimuth: float = param.Number(0.0)
    elevation: float = param.Number(0.0)
    zoom: float = param.Number(1.0)

    def __init__(self, **params: Any) -> None:
        super().__init__(**params)
        self.results = Results()
        # A tracker or preset that was picked brings its own values along.
        self.param.watch(self._take_preset, ["tracker", "preset"])

    def _take_preset(self, *_events: Any) -> None:
        self.settings = make_settings(self.tracker, self.preset)

    # ---- settings

    def change(self, name: str, value: Any) -> None:
        """Change one setting from the next step on; a value that is out of range is refused and said so."""
        try:
            self.param.update(settings=self.settings.replace(**{name: value}), error="")
        except SettingError as error:
            self.error = str(error)
            self.param.trigger("settings")  # puts the widget back

    @property
    def differences(self) -> dict[str, tuple[Any, Any]]:
        """Settings that differ from the preset: name → (preset's value, value)."""
        preset = make_settings(self.tracker, self.preset).to_dict()
        return {name: (preset[name], value) for name, value in self.settings.to_dict().items() if value != preset[name]}

    def back_to_preset(self) -> None:
        """Undo every change of a setting."""
        self._take_preset()

    # ---- the run

    def load(self, session: Session) -> None:
        """Show a session from its first frame, with nothing tracked."""
        self.results = Results()
        init = "auto" if self.init == "truth" and not session.has_truth else self.init
        self.param.update(
            session=session, frame=0, origin=None, init=init, error="", warning="", playing=False,
            revision=self.revision + 1,
        )  # fmt: skip

    def begin(self, origin: Origin) -> None:
        """Begin a run; what the last one tracked is dropped."""
        self.results = Results()
        self.param.update(
            origin=origin, frame=origin.start.frame, error="", warning=origin.start.doubt, revision=self.revision + 1
        )

    def show(self, frame: int) -> None:
        """Show a frame, and what was tracked in it."""
        self.param.update(frame=frame, revision=self.revision + 1)

    @property
    def busy(self) -> bool:
        """Whether something runs in the background."""
        return bool(self.task) or self.playing

    @property
    def entry(self) -> Entry | None:
        """Everything of the frame shown, or None when it was not tracked or is no longer in memory."""
        return self.results.entry(self.frame)

    @property
    def summary(self) -> Summary | None:
        """Of the frame shown, or None when it was not tracked."""
        return self.results.summary(self.frame)

    @property
    def next_frame(self) -> int | None:
        """Return the frame that a step leads to; None before Start and at the end of the session."""
        if self.session is None or self.origin is None:
            return None
        last = self.results.last
        if last is None:
            return self.origin.start.frame
        following = (self.frame if self.summary is not None else last) + 1
        return following if following < len(self.session) else None

    def is_current(self, frame: int) -> bool:
        """Tell whether a frame's stored result is what a step with the present settings may show again."""
        entry = self.results.entry(frame)
        return entry is not None and same_rules(entry.tracking, self.tracker, self.settings)

    @property
    def loss(self) -> str:
        """Return one sentence while the hand is lost in the frame shown, else nothing."""
        since = self.results.lost_since(self.frame)
        return "" if since is None else f"Hand lost at frame {since}: searching"

    # ---- the view of the 3-D pictures

    def orbit(self, right: float, up: float, magnify: float) -> None:
        """Move the eye by angles in radians, and magnify by a factor."""
        zoom = min(max(self.zoom * magnify, _LEAST_ZOOM), _MOST_ZOOM)
        self.param.update(azimuth=self.azimuth + right, elevation=self.elevation + up, zoom=zoom)

    def reset_view(self) -> None:
        """Look from where the sensor is."""
        self.param.update(azimuth=0.0, elevation=0.0, zoom=1.0)
