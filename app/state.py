"""The state of one page: what was chosen, what was tracked, what is shown. It knows no widget and no thread."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import param

from app.lane import Lane, Origin
from app.look import Look
from app.results import Entry, Summary
from spf.errors import SettingError
from spf.initialise import Doubted, Start
from spf.learned.network import available_network
from spf.sessions import Session
from spf.trackers import TRACKERS

__all__ = ["COLOURS", "INITS", "MODES", "State", "shapes_of", "warning_of"]

#: Ways to the first pose, by the words of the page.
INITS = {"Find it automatically": "auto", "Take it from the truth": "truth", "Read a pose file": "file"}
_OWN_SHAPES = {
    "auto": "Calibrate it from the depth",
    "truth": "That of the truth, if it has one",
    "file": "That of the pose file, if it has one",
}

#: What the page shows: one tracker with all its particles, several beside each other, or the method explained.
MODES = {"One tracker": "one", "Compare": "compare", "Help": "help"}

#: Colours of the lanes, after Okabe and Ito: people of every colour vision can tell them apart.
COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7")

_LEAST_ZOOM, _MOST_ZOOM = 0.3, 6.0
_REMEDIES: dict[Doubted, str] = {
    "pose": "Look whether the hand covers the points; if not, start with another seed or from a pose file.",
    "side": "If you know the hand, read it from a hand file and start again.",
}


def shapes_of(init: str) -> dict[str, str]:
    """Return the ways to the hand's shape, by the words of the page, with a way to the first pose."""
    return {_OWN_SHAPES[init]: "depth", "Read a hand file": "file"}


def warning_of(start: Start, remedies: Mapping[Doubted, str] = _REMEDIES) -> str:
    """Return what may be wrong with a start and what to do about it, or "" where all is believed.

    Args:
        start: of a run.
        remedies: what to do about each thing that may be wrong.
    """
    doubt = "" if start.doubted is None else f"{start.doubt} {remedies[start.doubted]}"
    return " ".join(text for text in (doubt, start.remark) if text)


class State(param.Parameterized):
    """One page.

    Views watch its parameters; ``revision`` counts up whenever what was tracked or is shown changes, ``rules`` whenever
    a tracker, a setting or the set of lanes does.
    """

    session: Session | None = param.ClassSelector(class_=Session, doc="what is tracked")
    camera: str = param.String("", doc="camera file that the session was opened with")
    frame: int = param.Integer(0, bounds=(0, None), doc="index of the frame shown")
    origin: Origin | None = param.ClassSelector(class_=Origin, doc="where all lanes begin; None before Start")
    revision: int = param.Integer(0)

    init: str = param.Selector(default="auto", objects=list(INITS.values()))
    pose_file: str = param.String("")
    shape: str = param.Selector(default="depth", objects=["depth", "file"])
    hand_file: str = param.String("")
    seed: int = param.Integer(0, bounds=(0, 2**31 - 1))

    mode: str = param.Selector(default="one", objects=list(MODES.values()))
    lanes: tuple[Lane, ...] = param.ClassSelector(class_=tuple, default=())
    lane: Lane = param.ClassSelector(class_=Lane, doc="the one whose settings are edited, and that is shown alone")
    rules: int = param.Integer(0)
    shelf: int = param.Integer(0, doc="counts up when a run was kept, named or deleted")

    preview: Any = param.Parameter(None, doc="app.preview.Preview of the frame shown, or nothing")
    previewed: int = param.Integer(0, doc="counts up with every preview")
    landscape_of: tuple[int, int] = param.ClassSelector(class_=tuple, default=(0, 1), doc="entries of the pose")

    sending: int = param.Integer(0, doc="counts up when pictures are sent: what changes now goes in the same message")
    sent: int = param.Integer(0, doc="frame of the pictures that were sent last")
    awaited: bool = param.Boolean(False, doc="whether pictures are being drawn that will be sent")
    pictured: int = param.Integer(0, doc="counts up when the browser shows what was asked for")
    playing: bool = param.Boolean(False)
    speed: float = param.Number(0.0, bounds=(0.0, None), doc="of playing tracked frames, 1 as recorded; 0 every frame")
    loop: bool = param.Boolean(False, doc="whether play begins again at the end of what was tracked")
    span: tuple[int, ...] = param.ClassSelector(class_=tuple, default=(), doc="first and last frame played, or nothing")
    task: str = param.String("", doc="what is being done in the background, or nothing")
    share: float = param.Number(0.0, bounds=(0.0, 1.0), doc="of the task that is done")
    left: str = param.String("", doc="how long the task still takes, in words, or nothing")
    preparing: str = param.String("", doc="what the server does before it is quick, or nothing")
    error: str = param.String("")
    warning: str = param.String("")
    answer: str = param.String("", doc="why what the visitor has just asked for is not done, or nothing")

    dark: bool = param.Boolean(False, doc="whether the page is dark")
    with_truth: bool = param.Boolean(True, doc="whether the truth is drawn too")
    with_spread: bool = param.Boolean(False, doc="whether it is drawn how far off each joint may be")
    azimuth: float = param.Number(0.0)
    elevation: float = param.Number(0.0)
    zoom: float = param.Number(1.0)

    def __init__(self, **params: Any) -> None:
        first = Lane(colour=COLOURS[0])
        super().__init__(lanes=(first,), lane=first, **params)
        self.look = Look()
        self._watch_lane(first)

    # ---- lanes

    def _watch_lane(self, lane: Lane) -> None:
        lane.param.watch(self._rules_changed, ["tracker", "preset", "settings"], onlychanged=True)

    def _rules_changed(self, *_events: Any) -> None:
        self.rules += 1

    @property
    def active(self) -> tuple[Lane, ...]:
        """The lanes that are shown, and that a step takes on."""
        return self.lanes if self.mode == "compare" else (self.lane,)

    def add_lane(self) -> None:
        """Add a lane with the first tracker that none has yet; at most as many as there are colours."""
        if len(self.lanes) == len(COLOURS):
            return
        taken = {lane.tracker for lane in self.lanes}
        tracker = next((name for name in TRACKERS if name not in taken), self.lane.tracker)
        colour = next(c for c in COLOURS if c not in {lane.colour for lane in self.lanes})
        lane = Lane(tracker, colour)
        self._watch_lane(lane)
        self.param.update(
            lanes=(*self.lanes, lane), lane=lane, rules=self.rules + 1, revision=self.revision + 1,
        )  # fmt: skip

    def remove_lane(self, lane: Lane) -> None:
        """Remove a lane; two are the least to compare."""
        if len(self.lanes) <= 2:
            return
        left = tuple(other for other in self.lanes if other is not lane)
        chosen = left[0] if self.lane is lane else self.lane
        self.param.update(lanes=left, lane=chosen, rules=self.rules + 1, revision=self.revision + 1)

    def choose(self, lane: Lane) -> None:
        """Edit a lane's settings from now on, and show it when one is shown alone."""
        self.param.update(lane=lane, rules=self.rules + 1, revision=self.revision + 1)

    def show_mode(self, mode: str) -> None:
        """Show one tracker, or compare at least two."""
        if mode == "compare" and len(self.lanes) < 2:
            self.add_lane()
        self.param.update(mode=mode, revision=self.revision + 1)

    def change(self, name: str, value: Any) -> None:
        """Change one setting of the chosen lane from the next step on; one that is out of range is refused and said so."""
        try:
            self.lane.change(name, value)
            self.error = ""
        except SettingError as error:
            self.error = str(error)
            self.rules += 1  # puts the widget back

    # ---- the run

    def load(self, session: Session, camera: str = "") -> None:
        """Show a session from its first frame, with nothing tracked."""
        for lane in self.lanes:
            lane.clear()
        init = "auto" if self.init == "truth" and not session.has_truth else self.init
        self.param.update(
            session=session, camera=camera, frame=0, origin=None, init=init, error="", warning="", playing=False, span=(),
            revision=self.revision + 1,
        )  # fmt: skip

    def begin(self, origin: Origin) -> None:
        """Begin anew; what was tracked from another start is dropped."""
        for lane in self.lanes:
            lane.clear()
        warning = " ".join(text for text in (warning_of(origin.start), available_network()[1]) if text)
        self.param.update(
            origin=origin, frame=origin.start.frame, error="", warning=warning, revision=self.revision + 1
        )  # fmt: skip

    def rewind(self) -> None:
        """Go back to the first frame of the run; what the lanes shown have tracked is dropped."""
        assert self.origin is not None
        for lane in self.active:
            lane.clear()
        self.show(self.origin.start.frame)

    def show(self, frame: int) -> None:
        """Show a frame, and what was tracked in it."""
        self.param.update(frame=frame, revision=self.revision + 1)

    def span_from(self, frame: int) -> None:
        """Play from a frame on, to the end of the range if that comes after it."""
        last = len(self.session) - 1 if self.session is not None else frame
        self.span = (frame, self.span[1] if self.span and self.span[1] >= frame else last)

    def span_to(self, frame: int) -> None:
        """Play to a frame, from the beginning of the range if that comes before it."""
        self.span = (self.span[0] if self.span and self.span[0] <= frame else 0, frame)

    @property
    def busy(self) -> bool:
        """Whether something runs in the background."""
        return bool(self.occupied)

    @property
    def occupied(self) -> str:
        """Why nothing else can begin now, in one sentence; nothing when it can."""
        if self.playing:
            return "Frames are being played: pause first."
        return f"“{self.task}” goes on: wait for its end, or cancel it." if self.task else ""

    @property
    def pictured_frame(self) -> int:
        """The frame that the pictures show while playing, which are drawn while the next one is tracked; else the one shown."""
        return self.sent if self.playing and self.awaited else self.frame

    @property
    def entry(self) -> Entry | None:
        """Everything of the frame shown in the chosen lane, weighed as its settings are now.

        None when it was not tracked or is no longer in memory.
        """
        base = self.lane.entry(self.frame)
        if self.preview is not None and self.preview.base is base and self.preview.settings == self.lane.settings:
            return self.preview.entry  # type: ignore[no-any-return]
        return base

    @property
    def summary(self) -> Summary | None:
        """Of the frame shown in the chosen lane, or None when it was not tracked."""
        return self.lane.summary(self.frame)

    @property
    def last(self) -> int | None:
        """The last frame that every lane shown has tracked; None when there is none."""
        lasts = [lane.results.last for lane in self.active]
        known = [last for last in lasts if last is not None]
        return min(known) if len(known) == len(lasts) else None

    @property
    def is_tracked(self) -> bool:
        """Whether every lane shown has tracked the frame shown."""
        return all(lane.summary(self.frame) is not None for lane in self.active)

    @property
    def is_behind(self) -> bool:
        """Whether the frame shown lies before the last one tracked: the next one is only shown, not tracked."""
        return self.last is not None and self.frame < self.last

    @property
    def next_frame(self) -> int | None:
        """The frame that a step leads to; None before Start and at the end of the session."""
        if self.session is None or self.origin is None:
            return None
        if self.last is None:
            return self.origin.start.frame
        following = (self.frame if self.is_tracked else self.last) + 1
        return following if following < len(self.session) else None

    # ---- the view of the 3-D pictures

    def orbit(self, right: float, up: float, magnify: float) -> None:
        """Move the eye by angles in radians, and magnify by a factor."""
        zoom = min(max(self.zoom * magnify, _LEAST_ZOOM), _MOST_ZOOM)
        self.param.update(azimuth=self.azimuth + right, elevation=self.elevation + up, zoom=zoom)

    def reset_view(self) -> None:
        """Look from where the sensor is."""
        self.param.update(azimuth=0.0, elevation=0.0, zoom=1.0)
        self.look.pan = (0.0, 0.0)
