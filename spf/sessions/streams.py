"""Choosing among the depth streams of one recording."""

from __future__ import annotations

from collections.abc import Mapping

from spf.errors import SessionError

__all__ = ["choose_stream"]


def choose_stream(uri: str, what: str, found: Mapping[str, str], chosen: str) -> str:
    """Return the name of the depth stream to read.

    Args:
        uri: of the recording.
        what: the streams are called, in the plural.
        found: name → what there is to say of it, for all streams with depth.
        chosen: by the user, "" if nothing was.

    Raises:
        SessionError: there are several and none is chosen, or another one is.
    """
    if chosen and chosen in found:
        return chosen
    listed = ", ".join(f"{name} ({remark})" for name, remark in sorted(found.items()))
    if chosen:
        raise SessionError(f"{uri}: {chosen} is none of the {what} with depth, which are: {listed}.")
    if len(found) > 1:
        example = f"{uri}{'&' if '?' in uri else '?'}topic={min(found)}"
        raise SessionError(f"{uri} has several {what} with depth, choose one, as in '{example}': {listed}.")
    return next(iter(found))
