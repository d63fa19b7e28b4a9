"""The hand that a visitor poses over the frame shown: dragged, fitted, measured, undone, and given to a run or a file."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import param

from app.controller import Controller
from app.placed import Placed, with_part
from app.pose_files import file_of, keep_pose
from app.state import State
from spf.errors import HandError, StartError
from spf.frame import Frame
from spf.hand import HandShape, SavedPose
from spf.hand.handles import Stance, dragged, turned_home
from spf.hand.model import Side
from spf.hand.shape import varied
from spf.lens import seen_through
from spf.posing import Explained, calibrated_from, explained, first_stance, fitted_from, open_hand
from spf.prepare import SessionFrames
from spf.progress import Report
from spf.sessions import Session
from spf.sessions.marked import path_of

__all__ = ["Posing"]

_MOST_UNDONE = 100


class Posing(param.Parameterized):
    """What the tab *Pose the hand* shows and does.

    Args:
        controller: of the page; its worker fits and measures.
        folder: of the server's runs; pose files go to ``poses`` in there.
    """

    placed: Placed | None = param.ClassSelector(class_=Placed, doc="the hand, or nothing before it was placed")
    compared: Placed | None = param.ClassSelector(class_=Placed, doc="the hand before its shape was fitted, or nothing")
    explained: Explained | None = param.ClassSelector(
        class_=Explained, doc="how it explains the frame; None: not at all"
    )
    told: str = param.String("", doc="what was done last")

    def __init__(self, controller: Controller, folder: Path) -> None:
        super().__init__()
        self.state: State = controller.state
        self._controller, self._folder = controller, folder
        self._undo: list[Placed] = []
        self._begun: Placed | None = None
        self._held: tuple[Session, int, Frame] | None = None
        self.state.param.watch(self._forget, "session")

    def _forget(self, event: param.parameterized.Event) -> None:
        self._held = None
        if event.old is not None and event.new is not None and path_of(event.old) == path_of(event.new):
            return  # the same recording, with other marks
        self._undo.clear()
        self._begun = None
        self.param.update(placed=None, compared=None, explained=None, told="")

    def frame(self) -> Frame:
        """Return the frame shown, as its session states it.

        Raises:
            StartError: no session is open.
            SessionError: it cannot be read.
        """
        session, index = self.state.session, self.state.frame
        if session is None:
            raise StartError("Choose a session first.")
        if self._held is None or self._held[:2] != (session, index):
            self._held = session, index, session[index]
        return self._held[2]

    def seen(self) -> Frame:
        """Return the frame shown, as the camera that the hand is posed for takes it."""
        return seen_through(self.frame(), 1.0 if self.placed is None else self.placed.shape.lens)

    # ---- a hand to begin with

    @property
    def tracked(self) -> Placed | None:
        """The estimate of the frame shown, if it was tracked and not lost."""
        summary = self.state.summary
        if summary is None or summary.lost:
            return None
        row = next(row for row in self.state.lane.results.rows if row.result.index == summary.frame)
        stance = turned_home(Stance(row.result.pose, row.result.reference))
        return Placed(varied(summary.tracking.start.shape, row.result.shape_change), stance)

    async def begin(self) -> None:
        """Have a hand to pose: the estimate of a tracked frame, else what is suggested for the frame shown."""
        if self.placed is not None or self.state.session is None:
            return
        if self.tracked is not None:
            self.take_tracked()
            return
        frame, shape = self.frame(), self._shape()
        self._place(Placed(shape, open_hand(frame, shape)))
        if not self.state.busy:
            await self.suggest()

    def _shape(self) -> HandShape:
        """The shape known so far: of the hand posed, of the run, of the session's side."""
        if self.placed is not None:
            return self.placed.shape
        state = self.state
        if state.origin is not None:
            return state.origin.start.shape
        side: Side | None = None if state.session is None else state.session.side
        return HandShape(side or "right")

    def take_tracked(self) -> None:
        """Take the estimate of the frame shown."""
        found = self.tracked
        if found is not None:
            self._place(found, "As tracked in this frame.")

    async def suggest(self) -> None:
        """Place the hand where it is likely in the frame shown."""
        if not self._controller.free():
            return
        frame, shape, before = self.frame(), self._shape(), self.placed
        rng = np.random.default_rng([self.state.seed, frame.index])

        async with self._controller.doing("Looking for a hand in this frame"):
            stance = await self._controller.run(lambda _report: first_stance(frame, shape, rng))
            if self.placed is before:  # nobody has dragged it meanwhile
                self._place(Placed(shape, stance), "Placed where a hand is likely.")

    # ---- by hand

    def _place(self, placed: Placed, told: str = "") -> None:
        if self.placed is not None:
            self._remember(self.placed)
        self.param.update(placed=placed, compared=None, told=told, explained=self._explained(placed))

    def _remember(self, placed: Placed) -> None:
        self._undo.append(placed)
        del self._undo[:-_MOST_UNDONE]

    def judge(self) -> None:
        """Say how well the hand explains the frame shown."""
        self.explained = None if self.placed is None else self._explained(self.placed)

    def _explained(self, placed: Placed) -> Explained | None:
        return explained(self.frame(), placed.shape, placed.stance)

    @property
    def can_undo(self) -> bool:
        """Whether there is something to take back."""
        return bool(self._undo)

    def undo(self) -> None:
        """Take the last drag, slider, fit or change of shape back."""
        if self._undo:
            placed = self._undo.pop()
            self.param.update(placed=placed, compared=None, told="Taken back.", explained=self._explained(placed))

    def begin_drag(self) -> None:
        """A drag begins with the hand as it is."""
        self._begun = self.placed

    def drag(self, handle: str, start: Sequence[float], at: Sequence[float]) -> None:
        """A handle was dragged from one pixel to another."""
        begun = self._begun
        if begun is None or self.placed is None:
            return
        if self.placed is begun:
            self._remember(begun)
        frame = self.seen()
        u, v = (round(number) for number in at)
        inside = 0 <= v < frame.depth.shape[0] and 0 <= u < frame.depth.shape[1]
        surface = float(frame.depth[v, u]) if inside else 0.0
        stance = dragged(begun.hand, frame.camera, begun.stance, handle, start, at, surface)
        self.param.update(placed=Placed(begun.shape, stance), told="")

    def push(self, metres: float) -> None:
        """Move the hand away from the camera along the line of sight."""
        if self.placed is None:
            return
        shape, (pose, reference) = self.placed
        camera, moved = self.seen().camera, pose.copy()
        u, v = camera.project(pose[:3])
        moved[:3] = camera.back_project(u, v, max(pose[2] + metres, 0.05))
        self._place(Placed(shape, Stance(moved, reference)))

    def set_entry(self, entry: int, value: float) -> None:
        """Set one entry of the pose, metres or radians, within its limits."""
        if self.placed is None:
            return
        shape, (pose, reference) = self.placed
        changed = pose.copy()
        changed[entry] = value
        self._place(Placed(shape, Stance(self.placed.hand.constrain(changed), reference)))

    def set_shape(self, part: str, value: float) -> None:
        """Set one factor of the hand's shape; one that no hand has is refused and said so."""
        if self.placed is None:
            return
        try:
            self._place(Placed(with_part(self.placed.shape, part, value), self.placed.stance))
        except HandError as error:
            self.state.error = str(error)
            self.param.trigger("placed")  # puts the widget back

    def set_side(self, side: Side) -> None:
        """Take a hand of the other side whose fingers lie where they did: it shows its back where it showed its palm."""
        if self.placed is not None and self.placed.shape.side != side:
            shape, (pose, reference) = self.placed
            mirrored = reference @ np.diag(
                [-1.0, 1.0, -1.0]
            )  # the thumb stays where it is, palm and back change places
            self._place(Placed(shape._replace(side=side), Stance(pose, mirrored)))

    # ---- in the worker

    async def fit(self) -> None:
        """Fit the pose to the frame shown, from where the hand is."""
        await self._work("Fitting the pose", self._fitting)

    async def calibrate(self) -> None:
        """Fit the hand's shape to the frames from the one shown on, from where the hand is."""
        await self._work("Fitting the hand's shape", self._measuring)

    async def _work(self, task: str, make: Callable[[Placed], tuple[Callable[[Report], Placed], str]]) -> None:
        if self.placed is None or not self._controller.free():
            return
        before, was = self.placed, self.explained
        async with self._controller.doing(task):
            work, told = make(before)
            after = await self._controller.run(work)
            if self.placed is not before:
                return  # someone has dragged it meanwhile: that is the newer wish
            self._place(after)
            now = self.explained
            gain = "" if was is None or now is None else f" Golden energy {was.golden:.2f} → {now.golden:.2f}."
            self.param.update(told=told + gain, compared=before if after.shape != before.shape else None)

    def _fitting(self, placed: Placed) -> tuple[Callable[[Report], Placed], str]:
        frame, rng = self.frame(), np.random.default_rng([self.state.seed, self.state.frame])

        def work(report: Report) -> Placed:
            return Placed(placed.shape, fitted_from(frame, placed.shape, placed.stance, rng, report))

        return work, "Fitted to this frame."

    def _measuring(self, placed: Placed) -> tuple[Callable[[Report], Placed], str]:
        session, index = self.state.session, self.state.frame
        assert session is not None
        frames, rng = SessionFrames(session, index), np.random.default_rng([self.state.seed, index])

        def work(report: Report) -> Placed:
            return Placed(*calibrated_from(frames, placed.shape, placed.stance, rng, report))

        return work, "The shape was fitted to the frames from here on; the dashed outline is the hand before."

    # ---- given away

    def saved(self) -> SavedPose:
        """Return the pose for the frame shown, with the hand's shape.

        Raises:
            StartError: there is no hand yet.
        """
        if self.placed is None:
            raise StartError("There is no hand to save yet: place one first.")
        shape, (pose, reference) = self.placed
        return SavedPose(shape.side, pose, reference, self.state.frame, shape)

    def file_of_pose(self) -> tuple[str, bytes]:
        """Return name and content of a file for ``spf track --init FILE``."""
        return file_of(f"{self._name()}-pose", self.saved().to_dict())

    def file_of_hand(self) -> tuple[str, bytes]:
        """Return name and content of a file for ``spf track --hand FILE``."""
        shape = self.saved().shape
        assert shape is not None
        return file_of(f"{self._name()}-hand", shape.to_dict())

    def _name(self) -> str:
        assert self.state.session is not None
        return f"{self.state.session.name}-frame-{self.state.frame}"

    def use(self) -> None:
        """Have Start begin here: keep the pose in a file of its own, and choose that as first pose."""
        try:
            path = keep_pose(self.saved(), self._folder / "poses", self._name())
        except (StartError, HandError) as error:
            self.state.error = str(error)
            return
        self.state.param.update(init="file", pose_file=str(path), shape="depth", error="")
        self.told = f"Start begins at frame {self.state.frame} with this pose and hand ({path.name}): press Start."
