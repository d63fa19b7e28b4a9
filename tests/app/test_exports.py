"""A page's run as files, without a browser."""

import re

import pytest

from app.exports import EXPORTS
from app.views.export_card import ExportCard


@pytest.fixture
def card(page, tmp_path, renderer):
    state, controller = page
    return ExportCard(state, controller, renderer, tmp_path)


def kind(ending):
    return next(export for export in EXPORTS if export.ending == ending)


def test_nothing_tracked_is_one_sentence(page, card, act, sample):
    state, controller = page
    act(lambda: controller.open(sample), lambda: card.export(kind(".csv")))
    assert "press Start" in state.error
    assert card.download.handed_over == 0


def test_what_is_tracked_comes_as_a_report_a_table_and_a_picture(page, card, act, sample):
    state, controller = page
    act(lambda: controller.open(sample), controller.start, controller.step, lambda: card.export(kind(".html")))
    assert state.error == ""
    assert card.download.name_of_file == "open-close-spf.html"
    page_text = card.download.content.decode()
    assert "http" not in page_text
    assert "Frames 0 to 1 of 120" in page_text
    assert "panel serve" not in re.sub(r"<details>.*?</details>", "", page_text, flags=re.DOTALL)
    act(lambda: card.export(kind(".csv")))
    assert len(card.download.content.decode().splitlines()) == 3
    act(lambda: card.export(kind(".png")))
    assert card.download.name_of_file == "open-close-spf-frame-1.png"
    assert card.download.content.startswith(b"\x89PNG")
    assert card.download.handed_over == 3
    assert not state.busy


def test_a_film_can_be_cancelled(page, card, act, sample):
    state, controller = page
    act(lambda: controller.open(sample), controller.start, controller.step)
    state.param.watch(lambda event: controller.cancel() if event.new == "Writing the film" else None, "task")
    act(lambda: card.export(kind(".mp4")))
    assert card.download.handed_over == 0
    assert (state.busy, state.error) == (False, "")
