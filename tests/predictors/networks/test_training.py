from __future__ import annotations

import logging
import math
import warnings

import numpy as np
import pytest
import torch

from shipbench.errors import WorkError
from shipbench.predictors._features import InputFeatures, dead_reckoning
from shipbench.predictors.networks.stacked import (
    Scaler,
    StackedLinear,
    StackedMLP,
    generators,
    hold_error,
    padded,
    shares_of,
    trapezoid_pose,
    with_valid,
)
from shipbench.predictors.networks.training import (
    BestWeights,
    Chunk,
    Recipe,
    StackedTask,
    clip_members,
    epochs_of_samples,
    train,
)
from shipbench.signals import COMMANDS, PSI, U, V


class Line(StackedTask):
    """Fits y = slope x per member; the scores come from a list, or are the distance from the true slope."""

    def __init__(self, slopes, scores=None, epochs=5):
        super().__init__()
        self.members, self.epochs = len(slopes), epochs
        self.slope = torch.nn.Parameter(torch.zeros(self.members))
        self.true, self.fixed, self.asked = torch.tensor(slopes), scores, 0

    def chunks(self):
        x = torch.linspace(-1, 1, 8)
        for _ in range(self.epochs):
            yield Chunk([x] * 20, torch.ones(self.members, dtype=torch.bool))

    def losses(self, minibatch):
        return ((self.slope - self.true)[:, None] * minibatch).square().mean(1)

    def scores(self):
        self.asked += 1
        return (self.slope - self.true).abs() if self.fixed is None else torch.tensor(self.fixed[self.asked - 1])


def test_a_stacked_layer_starts_as_torch_linear_does_with_the_same_seed():
    seeds = [3, 8]
    layer = StackedLinear(11, 100, generators(seeds))
    x = torch.randn(2, 5, 11, generator=torch.Generator().manual_seed(0))
    for m, seed in enumerate(seeds):
        torch.manual_seed(seed)
        plain = torch.nn.Linear(11, 100)
        torch.testing.assert_close(layer.weight[m].T, plain.weight, rtol=1e-6, atol=0)
        torch.testing.assert_close(layer.bias[m, 0], plain.bias, rtol=1e-6, atol=0)
        torch.testing.assert_close(layer(x)[m], plain(x[m]), rtol=1e-5, atol=1e-6)


def test_a_zeroed_last_layer_gives_exactly_zero():
    net = StackedMLP([7, 16, 3], generators([0, 1]), torch.tanh, zero_last=True)
    assert torch.equal(net(torch.ones(2, 4, 7)), torch.zeros(2, 4, 3))


def test_the_scaler_standardises_each_member_by_its_own_samples():
    samples = [torch.tensor([[1.0, 5.0], [3.0, 5.0]]), torch.tensor([[10.0, 5.0], [30.0, 5.0]])]
    scaler = Scaler.fit(samples)
    z = scaler(torch.stack(samples))
    torch.testing.assert_close(z[..., 0], torch.tensor([[-1.0, 1.0], [-1.0, 1.0]]))
    assert torch.equal(scaler.std[:, 0, 1], torch.ones(2)), "a constant channel keeps scale 1"
    torch.testing.assert_close(scaler.inverse(z), torch.stack(samples))


def test_every_epoch_shows_every_sample_and_members_do_not_disturb_each_other():
    alone = list(epochs_of_samples([7], 3, 2, generators([5])))
    together = list(epochs_of_samples([7, 10], 3, 2, generators([5, 6])))
    first = torch.cat([index[:, 0] for index, _ in together])[:6]
    assert torch.equal(first, torch.cat([index[:, 0] for index, _ in alone])), "the same order beside another member"
    for epoch in first.view(2, 9):
        assert set(epoch.tolist()) == set(range(7))
    assert sum(int(ended[0]) for _, ended in together) == 2
    assert sum(int(ended[1]) for _, ended in together) == 2


def test_early_stopping_is_per_member_and_keeps_the_best_weights():
    task = Line([1.0, 2.0])
    watch = BestWeights(task, patience=2, min_delta=0.1)
    everyone = torch.tensor([True, True])
    path = [[1.0, 1.0], [0.95, 0.5], [0.97, 0.2], [0.1, 0.1]]
    for i, scores in enumerate(path):
        with torch.no_grad():
            task.slope.fill_(float(i))
        watch.update(task, torch.tensor(scores), everyone)
    # Member 0 never fell by 0.1 within two validations: it stopped before the 0.1 and keeps its lowest score before.
    assert watch.stopped.tolist() == [True, False]
    assert watch.best["slope"].tolist() == [1.0, 3.0]
    assert watch.validations.tolist() == [3, 4]


def test_only_members_whose_epoch_ended_are_counted():
    watch = BestWeights(Line([1.0, 2.0]), patience=1, min_delta=0.0)
    watch.update(Line([1.0, 2.0]), torch.tensor([1.0, 1.0]), torch.tensor([True, False]))
    assert watch.validations.tolist() == [1, 0]
    assert watch.score[1] == math.inf


def test_training_stops_when_the_last_member_has_stopped_and_restores_its_best():
    task = Line([1.0, -1.0], scores=[[1.0, 3.0], [2.0, 2.0], [2.0, 1.0], [2.0, 2.0], [2.0, 2.0], [0.0, 0.0]], epochs=50)
    watch = train(task, Recipe(lr=1e-2, patience=2))
    assert task.asked == 5
    assert watch.score.tolist() == [1.0, 1.0]
    assert abs(task.slope[0]) < abs(task.slope[1]), "member 0 went back to its first epoch, member 1 to its third"


def test_training_is_quiet_writes_nothing_and_leaves_the_global_state(tmp_path, monkeypatch, capfd):
    monkeypatch.chdir(tmp_path)
    before, level, threads = (
        torch.random.get_rng_state(),
        logging.getLogger("lightning.pytorch").level,
        torch.get_num_threads(),
    )
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        task = Line([1.0])
        train(task, Recipe(lr=5e-2, chunks=5, lr_end=0.01, threads=1))
    out, err = capfd.readouterr()
    assert (out, err) == ("", "")
    assert not list(tmp_path.iterdir())
    assert torch.equal(before, torch.random.get_rng_state())
    assert logging.getLogger("lightning.pytorch").level == level
    assert torch.get_num_threads() == threads
    assert abs(task.slope[0].item() - 1.0) < 0.05


def test_a_member_without_a_finite_score_is_a_failure():
    with pytest.raises(WorkError, match=r"members \[1\]"):
        train(Line([1.0, 1.0], scores=[[1.0, math.nan]], epochs=1), Recipe())


def test_clipping_is_per_member_and_drops_gradients_that_are_not_finite():
    p = torch.nn.Parameter(torch.zeros(3, 2))
    p.grad = torch.tensor([[3.0, 4.0], [0.3, 0.4], [math.nan, 1.0]])
    clip_members(iter([p]), 1.0)
    torch.testing.assert_close(p.grad, torch.tensor([[0.6, 0.8], [0.3, 0.4], [0.0, 0.0]]))


def test_a_tenth_of_the_runs_is_set_aside_when_no_validation_is_given(harbour):
    kept, aside = with_valid(harbour, None, seed=1)
    again = with_valid(harbour, None, seed=1)[1]
    assert (len(kept), len(aside)) == (14, 2)
    assert {r.id for r in kept.runs} | {r.id for r in aside.runs} == {r.id for r in harbour.runs}
    assert [r.id for r in again.runs] == [r.id for r in aside.runs]
    single = harbour.subset([0])
    assert with_valid(single, None, seed=0) == (single, single)


def test_padding_weighs_every_run_of_a_member_alike():
    index, weight = padded([2, 3])
    assert index.tolist() == [[0, 1, 0], [2, 3, 4]]
    torch.testing.assert_close(weight.sum(1), torch.ones(2))
    assert weight[0, 2] == 0


def test_shares_add_up_to_the_total():
    for total in (1, 2, 7, 40):
        assert sum(shares_of(total, [0.4, 0.25, 0.3, 0.05])) == total


def test_dead_reckoning_is_the_papers_equation_10():
    s0 = torch.zeros(1, 10, dtype=torch.float64)
    s0[0, PSI] = 0.3
    y = torch.zeros(1, 2, 7, dtype=torch.float64)
    y[0, :, 0], y[0, :, 1], y[0, :, 2] = torch.tensor([2.0, 3.0]), torch.tensor([0.5, -0.5]), torch.tensor([0.1, 0.2])
    pose = dead_reckoning(s0, y, 2.0)[0]
    x1 = 2 * (2 * math.cos(0.3) - 0.5 * math.sin(0.3))
    x2 = x1 + 2 * (3 * math.cos(0.5) + 0.5 * math.sin(0.5))  # the heading before the step: 0.3 + 2 * 0.1
    np.testing.assert_allclose(pose[:, 0], [x1, x2])
    np.testing.assert_allclose(pose[:, 2], [0.5, 0.9])


def test_the_trapezoidal_pose_follows_the_simulator_closely(harbour):
    batch = harbour.batch()
    truth = torch.as_tensor(batch.truth)
    error = trapezoid_pose(torch.as_tensor(batch.s0), truth[..., U:], 1.0) - truth[..., :3]
    assert error[..., :2].abs().max() < 0.2
    assert error[..., 2].abs().max() < 2e-3


def test_keeping_the_velocities_of_a_steady_ship_errs_nowhere():
    S = torch.zeros(2, 6, 10, dtype=torch.float64)
    S[..., U] = 3.0
    S[..., 0] = 3.0 * torch.arange(6)
    S[1, 1:, V] = 0.4
    size = hold_error(S, (1, 1), 1.0, 5)
    assert size[0].max() == 1e-6
    assert size[1, 1] == pytest.approx(0.4)


def test_wind_reaches_the_network_in_the_ships_frame():
    features = InputFeatures((*COMMANDS, "wind_speed", "wind_from", "depth"))
    held = torch.tensor([[1.0, 2.0, 3.0, 4.0, 10.0, 0.5, 20.0]])
    seen = features(held, torch.tensor([0.5]))
    torch.testing.assert_close(seen, torch.tensor([[1.0, 2.0, 3.0, 4.0, 20.0, 10.0, 0.0]]))
    turned = held + torch.tensor([0, 0, 0, 0, 0, 1.0, 0])
    torch.testing.assert_close(features(turned, torch.tensor([1.5])), seen)
