"""The joints that a visitor marks in the frame shown: placed on the picture, nudged, hidden, taken to the next frame, kept."""

from __future__ import annotations

import math

import param

from app.controller import Controller
from app.placing import Placing, depth_beneath, followed, mark_at, skin_offsets
from app.state import State
from spf.errors import SessionError, SpfError
from spf.frame import JOINT_NAMES, Frame
from spf.sessions import Mark, Marks, Session, marks_in
from spf.sessions.marked import keep_frame, path_of
from spf.sessions.marks import marks_file, marks_to_csv, marks_to_json
from spf.sessions.mcap_marks import embed_marks

__all__ = ["Marking"]

_MOST_UNDONE = 200


class Marking(param.Parameterized):
    """What the tab *Mark joints* shows and does. Every change is kept beside the session at once.

    Args:
        controller: of the page.
    """

    joints: dict[str, Placing] = param.Dict(default={}, doc="of the frame shown")
    chosen: str = param.Selector(default=JOINT_NAMES[0], objects=list(JOINT_NAMES), doc="the joint placed by a click")
    told: str = param.String("", doc="what was done last")

    def __init__(self, controller: Controller) -> None:
        super().__init__()
        self.state: State = controller.state
        self._controller = controller
        self._undo: list[tuple[int, dict[str, Placing], str]] = []
        self._of: tuple[Session | None, int] = (None, 0)  # session and frame that `joints` is of
        self.state.param.watch(self.follow, ["session", "frame"])
        self.follow()

    def follow(self, *_events: object) -> None:
        """Show the marks of the frame shown."""
        state = self.state
        if self._of == (state.session, state.frame):
            return
        if self._of[0] is None or state.session is None or path_of(self._of[0]) != path_of(state.session):
            self._undo.clear()
        self._of = state.session, state.frame
        kept = {} if state.session is None else marks_in(state.session).get(state.frame, {})
        self.param.update(joints={name: Placing(mark) for name, mark in kept.items()}, told="")

    @property
    def session(self) -> Session:
        """The session shown.

        Raises:
            SessionError: there is none.
        """
        if self.state.session is None:
            raise SessionError("Choose a session first.")
        return self.state.session

    @property
    def marks(self) -> Marks:
        """All marks of the session."""
        return {} if self.state.session is None else marks_in(self.state.session)

    def frame(self) -> Frame:
        """Return the frame shown."""
        return self.session[self.state.frame]

    # ---- one joint

    def choose(self, joint: str) -> None:
        """Choose the joint that keys and the next click act on."""
        self.chosen = joint

    def place(self, u: float, v: float, joint: str = "", *, onward: bool = True) -> None:
        """Mark a joint (the chosen one) at a pixel: behind the surface seen there by its offset.

        One that has a depth keeps it where no surface is seen.
        """
        name, frame = joint or self.chosen, self.frame()
        before = self.joints.get(name)
        surface, offset = depth_beneath(frame, u, v), self.offset_of(name)
        if surface > 0:
            depth = surface + offset
        elif before is not None and before.mark.point is not None:
            depth, offset = before.mark.point[2], math.nan
        else:
            self.told = "There is no depth at this place: click beside it, then move the joint with the arrow keys."
            return
        self._set(name, Placing(mark_at(frame, u, v, depth, offset)))
        if onward and not joint:
            self._choose_next()

    def offset_of(self, joint: str) -> float:
        """Return by how much a joint is put behind the surface seen: as it was last, else as on the bundled hand; m."""
        placing = self.joints.get(joint)
        if placing is not None and not math.isnan(placing.mark.offset):
            return placing.mark.offset
        return skin_offsets()[joint]

    def pixel_of(self, joint: str) -> tuple[float, float] | None:
        """Return where a joint is seen; None for one that is hidden or not marked."""
        placing = self.joints.get(joint)
        if placing is None or placing.mark.point is None:
            return None
        u, v = self.session.camera.project(placing.mark.point)
        return float(u), float(v)

    def nudge(self, right: float, down: float) -> None:
        """Move the chosen joint by pixels, over the surface."""
        at = self.pixel_of(self.chosen)
        if at is not None:
            self.place(at[0] + right, at[1] + down, self.chosen)

    def set_offset(self, offset: float) -> None:
        """Put the chosen joint this far behind the surface seen at its pixel, m."""
        at = self.pixel_of(self.chosen)
        if at is None:
            return
        surface = depth_beneath(self.frame(), *at)
        if surface > 0:
            self._set(self.chosen, Placing(mark_at(self.frame(), *at, surface + offset, offset)))

    def deepen(self, metres: float) -> None:
        """Put the chosen joint farther behind the surface; one whose surface is not known just farther away."""
        placing = self.joints[self.chosen]
        assert placing.mark.point is not None
        if math.isnan(placing.mark.offset):
            self.set_depth(placing.mark.point[2] + metres)
        else:
            self.set_offset(placing.mark.offset + metres)

    def set_depth(self, depth: float) -> None:
        """Put the chosen joint at a depth, m; how far that is behind a surface then is not said."""
        at = self.pixel_of(self.chosen)
        if at is not None and depth > 0:
            self._set(self.chosen, Placing(mark_at(self.frame(), *at, depth, math.nan)))

    def hide(self) -> None:
        """Say that the chosen joint cannot be seen in this frame."""
        self._set(self.chosen, Placing(Mark(None)))
        self._choose_next()

    def unset(self) -> None:
        """Take the mark of the chosen joint away."""
        if self.chosen in self.joints:
            self._change({name: placing for name, placing in self.joints.items() if name != self.chosen})

    def unset_all(self) -> None:
        """Take all marks of this frame away."""
        if self.joints:
            self._change({})

    def confirm(self) -> None:
        """Keep what was suggested, as it is: somebody has looked at it."""
        self._change({name: Placing(placing.mark) for name, placing in self.joints.items()})

    def _choose_next(self) -> None:
        following = JOINT_NAMES[JOINT_NAMES.index(self.chosen) :] + JOINT_NAMES
        self.chosen = next(
            (name for name in following if name not in self.joints or self.joints[name].suggested), self.chosen
        )

    def _set(self, joint: str, placing: Placing) -> None:
        self._change({**self.joints, joint: placing})

    # ---- kept

    def _change(self, joints: dict[str, Placing]) -> None:
        self._undo.append((self.state.frame, self.joints, self.chosen))
        del self._undo[:-_MOST_UNDONE]
        self._keep(joints)

    def _keep(self, joints: dict[str, Placing]) -> None:
        """Show joints, and keep those that are no mere suggestion beside the session."""
        index, session = self.state.frame, self.session
        self.param.update(joints=joints, told="")
        own = {name: placing.mark for name, placing in joints.items() if not placing.suggested}
        if own == self.marks.get(index, {}):
            return
        try:
            self._controller.allowed(str(marks_file(path_of(session))))
            kept = keep_frame(session, index, own)
        except SpfError as error:
            self.state.error = str(error)
            return
        self._of = kept, index  # the same recording: nothing that was tracked is dropped
        self.state.session = kept
        frame = kept[index]
        for lane in self.state.lanes:
            lane.results.remeasure(frame)
        self.state.show(index)

    @property
    def can_undo(self) -> bool:
        """Whether there is something to take back."""
        return bool(self._undo)

    def undo(self) -> None:
        """Take the last change back, in the frame that it was made in."""
        if self._undo:
            frame, joints, chosen = self._undo.pop()
            if frame != self.state.frame:
                self._controller.look(frame)
            self.chosen = chosen
            self._keep(joints)

    def onward(self) -> None:
        """Show the next frame; where it has no marks, these are its first guess, each on the surface under it if that is near."""
        before, index = dict(self.joints), self.state.frame
        if index + 1 >= len(self.session):
            self.told = "This is the last frame."
            return
        self._controller.look(index + 1)
        if not self.joints and before:
            frame = self.frame()
            guessed = {name: Placing(followed(frame, placing.mark), True) for name, placing in before.items()}
            self.param.update(
                joints=guessed,
                told="Taken over from the frame before: move each to its place, or keep them as they are.",
            )
            self._choose_next()

    # ---- given away

    @property
    def is_native(self) -> bool:
        """Whether the session's own file can hold marks."""
        return self.state.session is not None and self.state.session.format == "mcap"

    async def embed(self) -> None:
        """Put all marks into the session's own file, in place of the file beside it."""
        if not self._controller.free():
            return
        session, marks = self.session, self.marks
        path, size = path_of(session), (session.camera.width, session.camera.height)
        async with self._controller.doing("Writing the marks into the session"):
            self._controller.allowed(str(path))
            content = marks_to_json(marks, len(session), size)

            def work(_report: object) -> None:
                embed_marks(path, content)
                marks_file(path).unlink(missing_ok=True)

            await self._controller.run(work)
            self.told = f"The marks are in {path.name}; all that was recorded is as it was."

    def file_of_marks(self) -> tuple[str, bytes]:
        """Return name and content of a CSV file with all marks.

        Raises:
            SpfError: there is none.
        """
        if not self.marks:
            raise SpfError("No joint is marked yet: choose one and click on the picture.")
        return f"{self.session.name}-marks.csv", marks_to_csv(self.marks).encode()
