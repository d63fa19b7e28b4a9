"""A tracker with its settings under a label: what is compared."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from spf.errors import SettingError
from spf.presets import chosen_settings
from spf.settings import Settings
from spf.trackers import TRACKERS

__all__ = ["Contender", "contenders_of"]

_LABEL = re.compile(r"[A-Za-z0-9][A-Za-z0-9_+-]*")


class Contender(NamedTuple):
    """A tracker that takes part.

    Attributes:
        label: name in the comparison.
        tracker: name in the table of trackers.
        preset: that the settings were made from, for people.
        settings: of the tracker.
    """

    label: str
    tracker: str
    preset: str
    settings: Settings

    def to_dict(self) -> dict[str, Any]:
        """Return it ready for JSON."""
        return {**self._asdict(), "settings": self.settings.to_dict()}


def contenders_of(
    names: Sequence[str], presets: Sequence[str] = (), assignments: Mapping[str, str] | None = None
) -> tuple[Contender, ...]:
    """Read who takes part.

    Args:
        names: ``TRACKER`` or ``LABEL=TRACKER`` each, so that one tracker can take part with several settings.
        presets: ``PRESET`` for all or ``LABEL=PRESET`` for one; the later ones win.
        assignments: ``LABEL.NAME`` → value for one, ``NAME`` → value for all that have the setting.

    Raises:
        SettingError: a label, tracker, preset or setting is unknown, a label comes twice, or a value is out of range.
    """
    trackers: dict[str, str] = {}
    for name in names:
        label, _, tracker = name.rpartition("=")
        label = label or tracker
        if label in trackers:
            raise SettingError(f"'{label}' takes part twice: give one a label of its own, as in {label}-2={tracker}.")
        if not _LABEL.fullmatch(label):
            raise SettingError(f"'{label}' is no label: use letters, digits, -, + and _.")
        trackers[label] = tracker
    if not trackers:
        raise SettingError(f"There is nothing to compare; the trackers are {', '.join(TRACKERS)}.")
    chosen = _presets_of(trackers, presets)
    changes = _changes_of(trackers, assignments or {})
    return tuple(
        Contender(label, tracker, *chosen_settings(tracker, chosen[label], changes[label]))
        for label, tracker in trackers.items()
    )


def _presets_of(trackers: Mapping[str, str], presets: Sequence[str]) -> dict[str, str]:
    """Label → preset."""
    chosen = dict.fromkeys(trackers, "default")
    for text in presets:
        label, equals, preset = text.rpartition("=")
        if equals:
            _check_label(label, trackers)
        chosen |= {label: preset} if equals else dict.fromkeys(trackers, preset)
    return chosen


def _changes_of(trackers: Mapping[str, str], assignments: Mapping[str, str]) -> dict[str, dict[str, str]]:
    """Label → name → value; what is said of one label wins over what is said of all."""
    changes: dict[str, dict[str, str]] = {label: {} for label in trackers}
    for target, value in sorted(assignments.items(), key=lambda item: "." in item[0]):
        label, dot, name = target.rpartition(".")
        if dot:
            _check_label(label, trackers)
            changes[label][name] = value
            continue
        takers = [label for label, tracker in trackers.items() if _has(tracker, name)]
        if not takers:
            raise SettingError(f"None of the trackers compared has a setting '{name}'.")
        for label in takers:
            changes[label][name] = value
    return changes


def _check_label(label: str, trackers: Mapping[str, str]) -> None:
    if label not in trackers:
        raise SettingError(f"'{label}' does not take part; those that do are {', '.join(trackers)}.")


def _has(tracker: str, name: str) -> bool:
    return tracker in TRACKERS and name in {info.name for info in TRACKERS[tracker].settings.describe()}
