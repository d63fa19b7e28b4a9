"""Presets: the built-in ones of the table of trackers, and those that people saved as files."""

from __future__ import annotations

import json
import os
import re
from collections.abc import Mapping
from pathlib import Path

from spf.errors import SettingError
from spf.settings import Settings
from spf.trackers import PRESETS, TRACKERS, make_settings

__all__ = ["Presets", "chosen_settings"]

_FORMAT = "spf-preset"
_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9 _-]{0,59}")


class Presets:
    """Presets by name.

    Args:
        folder: of the saved ones; ``SPF_PRESETS``, or ``presets`` in the working directory, when it is not given.
    """

    def __init__(self, folder: Path | None = None) -> None:
        self.folder = Path(os.environ.get("SPF_PRESETS", "presets")) if folder is None else folder

    def names(self, tracker: str) -> list[str]:
        """Return the built-in presets, then those saved for a tracker."""
        return [*PRESETS, *sorted(path.name.removesuffix(f".{tracker}.json") for path in self._files(tracker))]

    def _files(self, tracker: str) -> list[Path]:
        return list(self.folder.glob(f"*.{tracker}.json")) if self.folder.is_dir() else []

    def settings(self, tracker: str, name: str) -> Settings:
        """Return a preset's settings.

        Raises:
            SettingError: there is no such preset, or its file is damaged or of another version.
        """
        if name in PRESETS:
            return make_settings(tracker, name)
        path = self._path(tracker, name)
        if not path.is_file():
            raise SettingError(
                f"There is no preset '{name}' for the tracker {tracker}; there are {', '.join(self.names(tracker))}."
            )
        return read_preset(tracker, path)

    def _path(self, tracker: str, name: str) -> Path:
        if not _NAME.fullmatch(name):
            raise SettingError("A preset is named with letters, digits, spaces, - and _ (60 at most).")
        return self.folder / f"{name}.{tracker}.json"

    def save(self, tracker: str, name: str, settings: Settings) -> None:
        """Save settings as a preset.

        Raises:
            SettingError: the name is taken or cannot be a file's, or the file cannot be written.
        """
        path = self._path(tracker, name)
        if name in PRESETS or path.exists():
            raise SettingError(f"There is a preset '{name}' already: choose another name.")
        content = {"format": _FORMAT, "version": 1, "tracker": tracker, "settings": settings.to_dict()}
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            with path.open("x", encoding="utf-8") as file:
                json.dump(content, file, indent=2)
        except OSError as error:
            raise SettingError(
                f"The preset cannot be saved in {self.folder} ({error.strerror}): make it writable."
            ) from None

    def delete(self, tracker: str, name: str) -> None:
        """Delete a saved preset.

        Raises:
            SettingError: it is a built-in one, there is none of this name, or its file cannot be deleted.
        """
        if name in PRESETS:
            raise SettingError(f"The preset '{name}' is built in: only saved ones can be deleted.")
        path = self._path(tracker, name)
        try:
            path.unlink()
        except OSError as error:
            raise SettingError(f"The preset {path} cannot be deleted: {error.strerror}.") from None


def read_preset(tracker: str, path: Path) -> Settings:
    """Return the settings of a preset file.

    Raises:
        SettingError: it is missing, damaged, of another version or of another tracker.
    """
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
        of = content["tracker"]
        if content["format"] != _FORMAT or of not in TRACKERS:
            raise KeyError("format")
        if of != tracker:
            raise SettingError(f"it is of the tracker {of}, not of {tracker}.")
        return TRACKERS[tracker].settings().replace(**content["settings"])
    except OSError as error:
        raise SettingError(f"The preset {path} cannot be read: {error.strerror}.") from None
    except SettingError as error:
        raise SettingError(f"The preset {path} does not fit: {error}") from None
    except (ValueError, KeyError, TypeError):
        raise SettingError(f"The preset {path} is damaged: save it again.") from None


def chosen_settings(
    tracker: str, preset: str = "default", changes: Mapping[str, str] | None = None
) -> tuple[str, Settings]:
    """Return the name of a preset and a tracker's settings: those of the preset, then changes given as text.

    Args:
        tracker: name of a tracker.
        preset: a built-in one, one saved in the folder ``SPF_PRESETS``, or a preset file.
        changes: setting → value.

    Raises:
        SettingError: there is no such tracker, preset or setting, the preset does not fit, or a value is out of range.
    """
    if preset in PRESETS or tracker not in TRACKERS:
        return preset, make_settings(tracker, preset, changes)
    if preset.endswith(".json"):
        path = Path(preset)
        return path.name.removesuffix(".json").removesuffix(f".{tracker}"), read_preset(tracker, path).with_text(
            changes or {}
        )
    return preset, Presets().settings(tracker, preset).with_text(changes or {})
