"""Presets: the built-in ones of the table of trackers, and those that visitors saved as files."""

from __future__ import annotations

import json
import os
import re
from pathlib import Path

from spf.errors import SettingError
from spf.settings import Settings
from spf.trackers import PRESETS, TRACKERS, make_settings

__all__ = ["Presets"]

_FORMAT = "spf-preset"


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
        path = self.folder / f"{name}.{tracker}.json"
        try:
            content = json.loads(path.read_text(encoding="utf-8"))
            if content["format"] != _FORMAT or content["tracker"] != tracker:
                raise KeyError("format")
            return TRACKERS[tracker].settings().replace(**content["settings"])
        except OSError:
            raise SettingError(
                f"There is no preset '{name}' for this tracker in {self.folder}: choose another."
            ) from None
        except (ValueError, KeyError, TypeError) as error:
            if isinstance(error, SettingError):
                raise SettingError(f"The preset {path} does not fit: {error}") from None
            raise SettingError(f"The preset {path} is damaged: save it again.") from None

    def save(self, tracker: str, name: str, settings: Settings) -> None:
        """Save settings as a preset.

        Raises:
            SettingError: the name is taken or cannot be a file's, or the file cannot be written.
        """
        if not re.fullmatch(r"[A-Za-z0-9][A-Za-z0-9 _-]{0,59}", name):
            raise SettingError("Name the preset with letters, digits, spaces, - and _ (60 at most).")
        path = self.folder / f"{name}.{tracker}.json"
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
