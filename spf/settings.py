"""Settings: declared once, with range, unit and meaning; read by the CLI, the dashboard's sliders, presets and reports.

A tracker's settings are one frozen dataclass, composed by inheritance from the groups that its parts declare
(cost, SMD, filter), so that every name is unique and ``--set k=3`` needs no prefix.
"""

from __future__ import annotations

import dataclasses
import math
import numbers
from collections.abc import Mapping
from typing import Any, NamedTuple, Self

from spf.errors import SettingError

__all__ = ["SettingInfo", "Settings", "setting"]


class SettingInfo(NamedTuple):
    """What is known of a setting besides its value.

    Attributes:
        name: field name, as in ``--set name=value``.
        kind: ``int``, ``float``, ``bool`` or ``str``.
        default: value when nothing is said.
        low, high: inclusive range of a number, None otherwise.
        choices: the allowed values of a ``str``, else ().
        unit: SI unit or "".
        symbol: the paper's symbol or "".
        meaning: one line.
        group: heading under which it is shown.
    """

    name: str
    kind: type
    default: Any
    low: float | None
    high: float | None
    choices: tuple[str, ...]
    unit: str
    symbol: str
    meaning: str
    group: str

    @property
    def called(self) -> str:
        """What a sentence calls it: the paper's symbol where there is one, else its name in words."""
        return self.symbol or self.name.replace("_", " ")


def setting(
    default: Any,
    meaning: str,
    *,
    group: str,
    low: float | None = None,
    high: float | None = None,
    choices: tuple[str, ...] = (),
    unit: str = "",
    symbol: str = "",
) -> Any:
    """Declare a setting as a dataclass field; its metadata is what :meth:`Settings.describe` returns."""
    info = {
        "meaning": meaning,
        "group": group,
        "low": low,
        "high": high,
        "choices": choices,
        "unit": unit,
        "symbol": symbol,
    }
    return dataclasses.field(default=default, metadata=info)


@dataclasses.dataclass(frozen=True)
class Settings:
    """Base of all settings: validates on construction.

    Raises:
        SettingError: a value has the wrong type, is not finite or is outside its range.
    """

    def __post_init__(self) -> None:
        for info in self.describe():
            value = getattr(self, info.name)
            _validate(info, value)
            # One type per setting (4, not 4.0 or numpy's 4), so that a manifest reads back as it was written.
            object.__setattr__(self, info.name, info.kind(value))

    @classmethod
    def describe(cls) -> tuple[SettingInfo, ...]:
        """Return what is declared about every setting, in the order of declaration."""
        return tuple(
            SettingInfo(name=field.name, kind=type(field.default), default=field.default, **field.metadata)
            for field in dataclasses.fields(cls)
        )

    @classmethod
    def called(cls) -> dict[str, str]:
        """Return name → what a sentence calls the setting."""
        return {info.name: info.called for info in cls.describe()}

    def to_dict(self) -> dict[str, Any]:
        """Return name → value, ready for JSON."""
        return dataclasses.asdict(self)

    def replace(self, **changes: Any) -> Self:
        """Return a copy with some values changed.

        Raises:
            SettingError: a name is unknown or a value is out of range.
        """
        known = {info.name for info in self.describe()}
        for name in changes:
            if name not in known:
                raise SettingError(f"There is no setting '{name}'; the settings are {', '.join(sorted(known))}.")
        return dataclasses.replace(self, **changes)

    def with_text(self, assignments: Mapping[str, str]) -> Self:
        """Return a copy with values given as text, as on the command line (``{"k": "3"}``).

        Raises:
            SettingError: a name is unknown, or a text is not a value of the setting's type and range.
        """
        infos = {info.name: info for info in self.describe()}
        return self.replace(
            **{name: _parse(infos[name], text) if name in infos else text for name, text in assignments.items()}
        )


def _parse(info: SettingInfo, text: str) -> Any:
    if info.kind is bool:
        words = {
            "true": True,
            "yes": True,
            "on": True,
            "1": True,
            "false": False,
            "no": False,
            "off": False,
            "0": False,
        }
        if text.strip().lower() not in words:
            raise SettingError(f"Setting '{info.name}' is a switch: write on or off, not '{text}'.")
        return words[text.strip().lower()]
    if info.kind is str:
        return text.strip()
    try:
        return info.kind(text)
    except ValueError:
        kind = "a whole number" if info.kind is int else "a number"
        raise SettingError(f"Setting '{info.name}' takes {kind}, not '{text}'.") from None


def _validate(info: SettingInfo, value: Any) -> None:
    if info.kind is bool or info.kind is str:
        if not isinstance(value, info.kind):
            raise SettingError(f"Setting '{info.name}' takes a {info.kind.__name__}, not {value!r}.")
        if info.choices and value not in info.choices:
            raise SettingError(f"Setting '{info.name}' is one of {', '.join(info.choices)}, not '{value}'.")
        return
    is_number = isinstance(value, numbers.Real) and not isinstance(value, bool)
    if not is_number or not math.isfinite(value) or (info.kind is int and value != int(value)):
        kind = "a whole number" if info.kind is int else "a finite number"
        raise SettingError(f"Setting '{info.name}' takes {kind}, not {value!r}.")
    if (info.low is not None and value < info.low) or (info.high is not None and value > info.high):
        raise SettingError(f"Setting '{info.name}' ({info.meaning}) is {value:g}, {_range_sentence(info)}.")


def _range_sentence(info: SettingInfo) -> str:
    unit = f" {info.unit}" if info.unit else ""
    if info.high is None:
        return f"and has to be at least {info.low:g}{unit}"
    if info.low is None:
        return f"and has to be at most {info.high:g}{unit}"
    return f"outside its range {info.low:g} to {info.high:g}{unit}"
