"""Training, as far as a few steps show it; skipped without torch."""

from __future__ import annotations

import hashlib
from dataclasses import replace

import numpy as np
import pytest

torch = pytest.importorskip("torch", reason="torch is not installed (dependency group 'train')")

from spf.errors import SpfError  # noqa: E402
from spf.hand.model import load_hand  # noqa: E402
from spf.learned import layout  # noqa: E402
from spf.learned.guesses import Cubes, decode  # noqa: E402
from spf.learned.network import load_network  # noqa: E402
from spf.training.export import export_network  # noqa: E402
from spf.training.generator import Generator  # noqa: E402
from spf.training.network import HandNetwork, loss_of, rotation_of  # noqa: E402
from spf.training.train import Plan, Trainer, batches, begun, tensors  # noqa: E402

PLAN = Plan(samples=6400, batch=32, shapes=4)


@pytest.fixture(scope="module")
def generator() -> Generator:
    return Generator(1, 4)


def perfect_outputs(batch):
    """What a network that knows the answer would say, in its second hypothesis, and where it would look."""
    raw = torch.zeros(len(batch.crops), layout.HYPOTHESES, layout.NUMBERS)
    raw[..., layout.ROTATION] = torch.tensor([1.0, 0, 0, 0, 1.0, 0])
    raw[..., layout.LOG_SPREADS] = -5.0
    shown = batch.points.copy()
    shown[..., :2] /= 1.0 + shown[..., 2:] * batch.perspectives[:, None, None]
    raw[:, 1, layout.POINTS] = torch.from_numpy(shown.reshape(-1, 66))
    columns = np.concatenate([batch.rotations[:, :, 0], batch.rotations[:, :, 1]], axis=1)
    raw[:, 1, layout.ROTATION] = torch.from_numpy(columns)
    raw[:, 1, layout.ANGLES] = torch.from_numpy(batch.angles)
    raw[:, 1, layout.LOG_SIZE] = torch.from_numpy(batch.log_sizes)
    raw[:, 1, layout.LOGIT] = 9.0
    sides = torch.stack([torch.from_numpy(batch.present), torch.from_numpy(batch.right)], dim=1) * 18.0 - 9.0
    places = torch.from_numpy(shown[:, None, :, :2]).expand(-1, layout.HYPOTHESES, -1, -1)
    return torch.cat([raw.flatten(1), sides], dim=1), places


def test_the_loss_is_least_at_the_truth(generator):
    batch = generator.batch(0, 64)
    _, *truth = tensors(batch)
    perfect = loss_of(*perfect_outputs(batch), tuple(truth))
    assert float(perfect["best"]) < 1e-4
    assert float(perfect["top"]) < 1e-4
    assert float(perfect["angles"]) == 0.0
    outputs, places = perfect_outputs(batch)
    spoilt = outputs + 0.05 * torch.randn(64, layout.OUTPUTS, generator=torch.manual_seed(0))
    assert float(loss_of(spoilt, places, tuple(truth))["loss"]) > float(perfect["loss"]) + 0.5


def test_training_and_use_read_the_numbers_alike(generator):
    batch = generator.batch(2, 8, left_share=0.0)
    cubes = Cubes(np.zeros((8, 3)), np.ones(8), np.tile(np.eye(3), (8, 1, 1)), batch.perspectives.astype(float))
    groups = decode(perfect_outputs(batch)[0].double().numpy(), "right", np.zeros(8), cubes)
    best = [max(group, key=lambda guess: guess.log_weight) for group in groups]
    np.testing.assert_allclose([g.joints for g in best], batch.points[:, :21], atol=1e-5)
    # hands of other shapes than the bundled one are placed by the fit to their joints
    np.testing.assert_allclose([g.reference for g in best], batch.rotations, atol=0.15)
    np.testing.assert_allclose([g.pose[list(layout.ARTICULATED)] for g in best], batch.angles, atol=1e-5)
    np.testing.assert_allclose([g.pose[:3] for g in best], batch.points[:, 21], atol=0.03)
    np.testing.assert_allclose([np.log(g.scale * load_hand("right").length) for g in best], batch.log_sizes, atol=1e-5)


def test_rotations_come_out_orthonormal():
    turned = rotation_of(torch.randn(50, 6, generator=torch.manual_seed(1)))
    torch.testing.assert_close(turned @ turned.mT, torch.eye(3).expand(50, 3, 3), atol=1e-5, rtol=0.0)
    torch.testing.assert_close(torch.linalg.det(turned), torch.ones(50), atol=1e-5, rtol=0.0)


def test_a_few_steps_reduce_the_loss(generator):
    trainer, batch = Trainer(PLAN), tensors(generator.batch(0, 32))
    losses = [float(trainer.learn(batch)["loss"]) for _ in range(25)]
    assert np.mean(losses[-3:]) < 0.8 * np.mean(losses[:3])


def test_a_resumed_training_takes_the_same_steps(generator, tmp_path):
    def learn(trainer, steps):
        ready = batches(generator, trainer.step, PLAN.batch)
        return [float(trainer.learn(next(ready))["loss"]) for _ in range(steps)]

    whole = learn(Trainer(PLAN), 6)
    first = Trainer(PLAN)
    learn(first, 3)
    first.save(tmp_path / "checkpoint.pt")
    resumed = Trainer.load(tmp_path / "checkpoint.pt")
    assert resumed.step == 3
    np.testing.assert_allclose(learn(resumed, 3), whole[3:], rtol=1e-5)


def test_the_exported_network_says_the_same(generator, tmp_path):
    trainer = Trainer(PLAN)
    trainer.learn(tensors(generator.batch(0, 32)))
    network = load_network(export_network(trainer.averaged, tmp_path, {"seed": 0}))
    crops = generator.batch(1, 5).crops
    trainer.averaged.eval()
    with torch.no_grad():
        expected = trainer.averaged(torch.from_numpy(crops)[:, None]).numpy()
    np.testing.assert_allclose(network.outputs(crops), expected, atol=1e-4)
    assert network.about["seed"] == 0


def test_a_training_that_begins_with_an_exported_network_answers_as_that(generator, tmp_path):
    first = Trainer(PLAN)
    for number in range(3):  # so that its norms have something to fold
        first.learn(tensors(generator.batch(number, 32)))
    path = export_network(first.network, tmp_path, {})
    second = begun(replace(PLAN, seed=9), path)
    assert second.plan.begun_from == hashlib.sha256(path.read_bytes()).hexdigest()
    crops = tensors(generator.batch(5, 16))[0]
    for one in (first.network, second.network, second.averaged):
        one.eval()
    with torch.no_grad():
        expected = first.network(crops)
        torch.testing.assert_close(second.network(crops), expected, atol=1e-3, rtol=1e-3)
        torch.testing.assert_close(second.averaged(crops), expected, atol=1e-3, rtol=1e-3)


def test_a_training_cannot_begin_with_another_network(tmp_path):
    path = export_network(HandNetwork(whole=100), tmp_path, {})
    with pytest.raises(SpfError, match="another network"):
        begun(PLAN, path)
