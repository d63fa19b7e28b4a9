"""What the filter thinks in the frame shown: particles in two entries of the pose, their numbers, their descents."""

from __future__ import annotations

import panel as pn

from app.state import State
from app.views.coordinates import Coordinates
from app.views.descents import Descents
from app.views.grid import card, cards
from app.views.particle_table import ParticleTable
from app.views.particles import Particles
from app.views.plots import CALM, heading
from app.views.samples import SamplesOverFrames
from app.views.scene_tab import scene_card
from app.views.shape_over_frames import ShapeOverFrames
from app.views.step_sizes import StepSizes
from app.views.winners import Winners
from spf.render import Renderer

__all__ = ["Thinking"]

_PLANE_HEIGHT, _TABLE_HEIGHT, _DESCENT_HEIGHT, _FRAMES_HEIGHT = 440, 240, 440, 200


class Thinking:
    """The tab."""

    def __init__(self, state: State, renderer: Renderer) -> None:
        particles = Particles(state)
        plane, table = Coordinates(state, particles), ParticleTable(state, particles)
        descents, steps = Descents(state), StepSizes(state)
        samples, winners, shape = SamplesOverFrames(state), Winners(state), ShapeOverFrames(state)
        self.pictures, scene = scene_card(state, renderer, "particles", _PLANE_HEIGHT)
        words = heading("Particles of this frame", ("", CALM, "pick rows or markers to see only those in the pictures"))
        self.panel = cards(
            card(pn.Column(plane.tools, plane.pane, sizing_mode="stretch_both", margin=0), plane.heading, _PLANE_HEIGHT,
                 least_width=420),
            scene,
            card(table.pane, words, _TABLE_HEIGHT, least_width=900),
            card(descents.pane, descents.heading, _DESCENT_HEIGHT, least_width=420),
            card(steps.pane, steps.heading, _DESCENT_HEIGHT, least_width=420),
            card(samples.pane, samples.heading, _FRAMES_HEIGHT, least_width=420),
            card(winners.pane, winners.heading, _FRAMES_HEIGHT, least_width=420),
            card(shape.pane, shape.heading, _FRAMES_HEIGHT, least_width=420),
        )  # fmt: skip
        for follower in (particles, plane, table, descents, steps, samples, winners, shape):
            follower.draw()
