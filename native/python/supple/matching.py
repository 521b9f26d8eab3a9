# SPDX-License-Identifier: GPL-3.0-or-later
"""Matching two meshes with no map at all. Source: the paper, section 4.4; docs/method.md."""

import os
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from . import _native, arrays
from .errors import SuppleError
from .initial_maps import InitialMap, MapScore
from .initial_maps import _result as _initial_map
from .match_model import MatchModel, load_match_model
from .mesh import Note
from .refining import Meshlike, RefineResult, _prepared, refine_result

TERMS = (
    "orthogonality",
    "coupling",
    "bijectivity",
    "fit",
    "smoothness",
    "determinant",
    "total",
)
"""Of the unsupervised loss, before weighting, and their weighted sum."""

CONFIGURATIONS = ("ljn", "without_ljn", "ulrssm", "cdfm")

EPOCHS: int = _native.MatchOptions().training.epochs
"""Of adaptation to a pair, by default."""


@dataclass(frozen=True)
class Epoch:
    """Means over the pairs of one epoch of unsupervised training.

    Attributes:
        epoch: from 0.
        pairs: how many.
        loss: the terms by name (TERMS).
        guide, guide_share: how far soft maps are from the guides, and the share of that in what is
            minimised; 0 without guides.
    """

    epoch: int
    pairs: int
    loss: dict[str, float]
    guide: float = 0.0
    guide_share: float = 0.0

    @property
    def minimised(self) -> float:
        """The guide's share and what is left to the loss: what a curve should show."""
        return self.loss["total"] + self.guide_share * self.guide


def epoch_of(native: _native.JointEpoch) -> Epoch:
    terms = dict(zip(TERMS, native.terms, strict=True))
    return Epoch(native.epoch, native.pairs, terms, native.guide, native.guide_share)


@dataclass
class MatchResult:
    """A map of n source vertices to a target, found from the shapes alone.

    Attributes:
        refined: RefineResult: point_map, surface_map, recovered (the source laid onto the target),
            confidence, ...
        initial: InitialMap: the map that was refined, with its plausibility and notes.
        automatic: it came from automatic_map, whose maps bore refining better than the features'.
        history: Epoch of each epoch of adaptation to the pair.
        notes: where the two meshes differ in what a map can't respect; "not_adapted" where they are
            too large for it.
    """

    refined: RefineResult
    initial: InitialMap
    automatic: bool
    history: list[Epoch]
    notes: list[Note]

    @property
    def point_map(self) -> NDArray[np.int32]:
        """(n,) the target vertex of each source vertex."""
        return self.refined.point_map

    @property
    def score(self) -> MapScore:
        """Of the map that was refined."""
        return self.initial.score


class Matcher:
    """One pair of meshes, to be matched with `run`; `match` does it in one call.

    Args:
        source, target: a PreparedMesh or (vertices, faces) each.
        model: name of shipped features, a path or a MatchModel.
        config: what the networks are adapted by: "ljn", the paper's loss; "without_ljn", the same
            without the deformation's part; "ulrssm" (Cao et al. 2023) or "cdfm" (Sun et al. 2023).
            All but "ljn" also refine without the network.
        epochs: of adaptation to the pair, two steps each; 0 for the features as they are.
        automatic: also look for a map without features, from both sides; where it bears refining
            better it guides the adaptation. In the end all are refined, and the most confident is
            returned.
        seed: of the order of steps.
        progress: a Progress to watch and cancel.

    Raises:
        SuppleError: bad_option, model_file, and those of PreparedMesh.
        Cancelled: if progress was cancelled.
    """

    def __init__(
        self,
        source: Meshlike,
        target: Meshlike,
        *,
        model: str | os.PathLike | MatchModel = "features",
        config: str = "ljn",
        epochs: int = EPOCHS,
        automatic: bool = True,
        seed: int = 0,
        progress: _native.Progress | None = None,
    ) -> None:
        if not isinstance(model, MatchModel):
            model = load_match_model(model)
        self.source = _prepared(source, "source", progress)
        self.target = _prepared(target, "target", progress)
        options = _native.MatchOptions()
        configure(options.training, config)
        options.training.epochs = arrays.whole(epochs, "epochs")
        options.training.seed = arrays.whole(seed, "seed")
        options.automatic = automatic
        self._metadata = model.metadata
        options.functions = functions_of(config)
        self._native = _native.Matcher(
            self.source.native,
            self.target.native,
            _adapted_by(model.native, config),
            options,
            progress,
        )
        self.epochs = epochs
        self.notes = [Note(note.code, note.count, note.message) for note in self._native.notes]

    @property
    def history(self) -> list[Epoch]:
        """Every epoch of adaptation so far."""
        return [epoch_of(native) for native in self._native.history]

    @property
    def model(self) -> MatchModel:
        """The networks as adapted so far."""
        return MatchModel(self._native.networks(), self._metadata)

    def features_map(self, *, progress: _native.Progress | None = None) -> InitialMap:
        """What the features say now: a preview, not refined.

        Raises:
            Cancelled: if progress was cancelled.
        """
        return _initial_map(self._native.features_map(progress))

    def adapt(
        self,
        *,
        callback: Callable[[Epoch], None] | None = None,
        progress: _native.Progress | None = None,
    ) -> None:
        """Adapt to the pair, if that is not done yet; arguments and errors are those of run."""
        self._native.adapt(_watch(callback), progress)

    def run(
        self,
        *,
        callback: Callable[[Epoch], None] | None = None,
        progress: _native.Progress | None = None,
    ) -> MatchResult:
        """Adapt to the pair, then refine the maps found, and return the most confident.

        Goes on where a cancelled run left off. The native work runs without the GIL.

        Args:
            callback: called with each epoch of adaptation, in the calling thread; may ask for
                features_map.
            progress: a Progress to watch and cancel.

        Raises:
            SuppleError: not_finite.
            Cancelled: if progress was cancelled.
        """
        native = self._native.run(_watch(callback), progress)
        refined = refine_result(native.refined, backward=False, notes=self.notes)
        return MatchResult(
            refined, _initial_map(native.initial), native.automatic, self.history, list(self.notes)
        )


def _watch(
    callback: Callable[[Epoch], None] | None,
) -> Callable[[_native.JointEpoch], None] | None:
    return None if callback is None else lambda native: callback(epoch_of(native))


def match(
    source: Meshlike,
    target: Meshlike,
    *,
    callback: Callable[[Epoch], None] | None = None,
    progress: _native.Progress | None = None,
    **options: object,
) -> MatchResult:
    """Prepare, adapt, match and refine in one call; the options are those of Matcher."""
    matcher = Matcher(source, target, progress=progress, **options)
    return matcher.run(callback=callback, progress=progress)


def configure(training: _native.JointTrainOptions, config: str) -> None:
    """Sets the losses of a configuration. Raises SuppleError: bad_option."""
    if config not in CONFIGURATIONS:
        raise SuppleError(
            "bad_option",
            f"'{config}' is no configuration. Use {', '.join(CONFIGURATIONS)}.",
        )
    loss = training.loss
    if config != "ljn":
        loss.jacobian_weights = [0.0, 0.0, 0.0]
    if config in ("ulrssm", "cdfm"):
        loss.bijectivity = 1.0
    if config == "cdfm":
        loss.smooth_features = True
        loss.temperature = 1.0 / 50.0
        training.first_temperature = 1.0
    training.loss = loss


def functions_of(config: str) -> int:
    """Eigenfunctions of a configuration's functional maps, as published."""
    return 50 if config == "cdfm" else 80


def _adapted_by(native: _native.MatchNetworks, config: str) -> _native.MatchNetworks:
    """The networks that a configuration has: all but "ljn" are without the second one."""
    if config == "ljn":
        return native
    tensors = native.tensors()
    return _native.MatchNetworks(native.input, native.sizes, native.eigenfunctions, tensors, None)
