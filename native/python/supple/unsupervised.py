# SPDX-License-Identifier: GPL-3.0-or-later
"""Training to match without a known map, all of it native. Source: the paper, section 4.4."""

import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from . import _native
from .checkpoints import Checkpoint, FoundGuide, digest
from .errors import SuppleError
from .match_model import MatchModel, load_match_model, untrained_match_model
from .matching import TERMS, Epoch, configure, epoch_of, functions_of
from .mesh import PreparedMesh

LARGEST_ROUND_TRIP = 0.06
"""Of a guide, in roots of the area. Wrong maps are found independently of each other and rarely
lead back to where they began."""

_GUIDED_EPOCHS = 5
_GUIDE_COST = 3.5
"""Time to find a guide's two maps, in steps of training."""


@dataclass
class UnsupervisedResult:
    """Networks that match and how they got there.

    Attributes:
        model: the networks.
        history: Epoch of each epoch.
        guides: how many pairs of rough maps were trained on at the start.
        guides_left_out: how many did not lead back to where they began.
    """

    model: MatchModel
    history: list[Epoch]
    guides: int
    guides_left_out: int


def train_unsupervised(
    shapes: Sequence[PreparedMesh],
    groups: Sequence[int],
    *,
    model: str | os.PathLike | MatchModel | None = None,
    config: str = "ljn",
    epochs: int = 20,
    guided_epochs: int | None = None,
    guide_pairs: int = 3,
    functions: int | None = None,
    feature_learning_rate: tuple[float, float] = (1e-3, 1e-4),
    jacobian_learning_rate: tuple[float, float] = (1e-4, 1e-5),
    patience: int = 0,
    seed: int = 0,
    metadata: dict[str, str] | None = None,
    checkpoint: str | os.PathLike | None = None,
    callback: Callable[[Epoch], None] | None = None,
    progress: _native.Progress | None = None,
) -> UnsupervisedResult:
    """Train features, and a local Jacobian network with them, on shapes alone.

    An epoch takes every shape once with another of its group. The same shapes, options and threads
    give the same bytes, however often the training was stopped and went on from its checkpoint.

    Args:
        shapes: meshes that no correspondence is known of.
        groups: one number a shape; only shapes of one group are matched, two or more each.
        model: to start from: name of shipped features, a path or a MatchModel; None for new ones.
        config: the loss, as of Matcher.
        epochs: 1 or more.
        guided_epochs: so many at the start are drawn to rough maps, found first by the shapes alone
            (automatic_map both ways; seconds a pair). None for 5 where model is None, or else 0.
        guide_pairs: rough maps are looked for between each shape and so many others of its group,
            drawn from the seed. Those of round trip LARGEST_ROUND_TRIP or more are left out.
        functions: eigenfunctions of functional maps and of the signal; None for the
            configuration's.
        feature_learning_rate, jacobian_learning_rate: first and last; between them the same factor
            every step.
        patience: end after so many epochs, not counting guided ones, without a smaller mean loss;
            0 for never.
        seed: of new weights and every draw.
        metadata: added to the model's.
        checkpoint: a folder that is written to after every guide and every epoch. What it holds
            already is gone on from.
        callback: called with each new Epoch once it is in the checkpoint, in the calling thread.
        progress: a Progress to watch and cancel, over guides and epochs together.

    Raises:
        SuppleError: bad_option, wrong_shape, model_file, not_finite; bad_checkpoint for one that is
            damaged or of another training.
        Cancelled: if progress was cancelled; the checkpoint keeps every epoch that was finished.
    """
    start = _start(model, config, seed, metadata or {})
    functions = functions_of(config) if functions is None else functions
    if guided_epochs is None:
        guided_epochs = min(_GUIDED_EPOCHS, epochs) if model is None else 0
    options = _native.JointTrainOptions()
    configure(options, config)
    options.epochs = epochs
    options.guided_epochs = guided_epochs
    options.feature_learning_rate = feature_learning_rate
    options.jacobian_learning_rate = jacobian_learning_rate
    options.patience = patience
    options.seed = seed
    meshes = [shape.native for shape in shapes]
    groups = [int(group) for group in groups]

    def trainer_with(guides: Sequence[FoundGuide]) -> _native.JointTrainer:
        pairs = [_native.GuidePair(*guide.pair, *guide.maps) for guide in guides]
        return _native.JointTrainer(meshes, groups, pairs, start.native, options, functions)

    if guided_epochs > 0:
        trainer_with([])  # what is wrong is said before the long search for guides
    kept = None
    if checkpoint is not None:
        settings = {
            "config": config,
            "epochs": epochs,
            "guided epochs": guided_epochs,
            "guide pairs": guide_pairs,
            "functions": functions,
            "feature learning rate": list(feature_learning_rate),
            "jacobian learning rate": list(jacobian_learning_rate),
            "patience": patience,
            "seed": seed,
            "groups": groups,
            "network": _network_digest(start),
            "shapes": [_shape_digest(shape) for shape in shapes],
        }
        kept = Checkpoint(checkpoint, settings)
    state = None if kept is None else kept.state()
    wanted = _guide_pairs(groups, guide_pairs, seed) if guided_epochs > 0 else []
    found = kept.guides() if kept is not None and wanted else []
    parts = _Parts(
        _GUIDE_COST * (len(wanted) - len(found))
        + len(meshes) * (epochs - (0 if state is None else len(state[1])))
    )
    for pair in wanted[len(found) :]:
        found.append(_guide(meshes, pair, functions, progress, parts.next(_GUIDE_COST)))
        if kept is not None:
            kept.keep_guides(found)
    used = [guide for guide in found if guide.maps is not None]
    if wanted and not used:
        raise SuppleError(
            "bad_option",
            f"None of the {len(found)} rough maps between the shapes leads back to where it began, "
            "so there is nothing to guide the first epochs. Look for more of them (guide_pairs), "
            "start from a model, or train without (guided_epochs 0).",
        )
    trainer = trainer_with(used)
    if state is not None:
        trainer.restore(state[0], [_native_epoch(epoch) for epoch in state[1]])
    while not trainer.finished:
        epoch = epoch_of(trainer.epoch(progress, parts.next(len(meshes))))
        if kept is not None:
            kept.keep_state(trainer.state(), [epoch_of(native) for native in trainer.history])
        if callback is not None:
            callback(epoch)
    return UnsupervisedResult(
        MatchModel(trainer.networks(), start.metadata),
        [epoch_of(native) for native in trainer.history],
        len(used),
        len(found) - len(used),
    )


class _Parts:
    """Shares [from, to] of one progress, one after the other; costs in steps of training."""

    def __init__(self, total: float) -> None:
        self._total = max(total, 1.0)
        self._done = 0.0

    def next(self, cost: float) -> list[float]:
        begin, self._done = self._done, self._done + cost
        return [begin / self._total, min(self._done / self._total, 1.0)]


def _start(
    model: str | os.PathLike | MatchModel | None, config: str, seed: int, metadata: dict[str, str]
) -> MatchModel:
    """The networks to start from, with the metadata of what will be trained."""
    if model is None:
        model = untrained_match_model(seed=seed, network="spectral" if config == "ljn" else None)
    elif not isinstance(model, MatchModel):
        model = load_match_model(model)
    start = MatchModel(model.native, {**model.metadata, **metadata})
    taken = sorted(name for name in metadata if start.metadata.get(name) != metadata[name])
    if taken:
        raise SuppleError(
            "bad_option",
            f"The model says '{taken[0]}' itself; give the metadata another name.",
        )
    return start


def _guide_pairs(groups: Sequence[int], count: int, seed: int) -> list[tuple[int, int]]:
    """Pairs that rough maps are looked for between, each once."""
    if count < 1:
        raise SuppleError(
            "bad_option", f"{count} guide pairs a shape are too few; use 1 or more, or no guides."
        )
    pairs = set()
    for i, group in enumerate(groups):
        others = [j for j, other in enumerate(groups) if other == group and j != i]
        drawn = np.random.default_rng([seed, i]).permutation(len(others))[:count]
        pairs |= {(min(i, others[k]), max(i, others[k])) for k in drawn}
    return sorted(pairs)


def _guide(
    meshes: Sequence[_native.PreparedMesh],
    pair: tuple[int, int],
    functions: int,
    progress: _native.Progress | None,
    part: list[float],
) -> FoundGuide:
    first, second = (meshes[i] for i in pair)
    found = _native.guide_maps(first, second, functions, progress, part)
    agrees = found.round_trip < LARGEST_ROUND_TRIP
    return FoundGuide(pair, found.round_trip, tuple(found.maps) if agrees else None)


def _native_epoch(epoch: Epoch) -> _native.JointEpoch:
    terms = [epoch.loss[name] for name in TERMS]
    return _native.JointEpoch(epoch.epoch, epoch.pairs, epoch.guide, epoch.guide_share, terms)


def _network_digest(model: MatchModel) -> str:
    tensors = model.tensors()
    about = " ".join([model.native.input, str(model.native.eigenfunctions), *sorted(tensors)])
    named = np.frombuffer(about.encode(), np.uint8)
    return digest([named, *(tensors[name] for name in sorted(tensors))])


def _shape_digest(shape: PreparedMesh) -> str:
    count = np.array(shape.native.eigenvalues.size)
    return digest([shape.vertices, shape.faces, count])
