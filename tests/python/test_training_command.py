# SPDX-License-Identifier: GPL-3.0-or-later
"""The training command from its options to the files it writes, on small meshes and one epoch."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

pytest.importorskip("anny", reason="anny is not installed; pip install ./training")
pytest.importorskip("igl", reason="libigl is not installed; pip install ./training")

import supple
import typer
from supple_training import pairs as pair_store
from supple_training import train
from typer.testing import CliRunner

FIXTURE = Path(__file__).parents[1] / "meshes" / "held_out_bodies.npz"


@pytest.fixture
def app(monkeypatch) -> typer.Typer:
    """The command, measuring on the small pairs of the fixture rather than on new ones."""
    monkeypatch.setattr(train, "pairs_with_progress", lambda *_, **__: pair_store.load(FIXTURE)[:2])
    app = typer.Typer()
    app.command()(train.main)
    return app


@pytest.mark.parametrize("signal", ["rotation", "spectral"])
def test_weights_metrics_and_loss_curve_are_written(app, tmp_path, signal):
    out = tmp_path / "net.safetensors"
    done = CliRunner().invoke(app, [signal, "--out", str(out), "--epochs", "1", "--seed", "3"])
    assert done.exit_code == 0, done.output
    assert "s a step" in done.output
    assert "no network" in done.output

    model = supple.load_model(out)
    assert model.signal == signal
    assert model.metadata["seed"] == "3"
    assert model.metadata["licence"] == "GPL-3.0-or-later"
    assert model.metadata["version"] == supple.__version__
    assert "CC0" in model.metadata["training_data"]
    assert ("edits" in model.metadata["training"]) == (signal == "rotation")

    metrics = json.loads(out.with_suffix(".metrics.json").read_text())
    rows = metrics["held_out"]["rows"]
    assert rows["network"].keys() == rows["no_network"].keys()
    assert all(value > 0 for value in rows["network"].values())
    assert metrics["seconds_per_step"] > 0
    assert len(metrics["epoch_loss"]["loss"]) == 1
    assert out.with_suffix(".loss.png").read_bytes().startswith(b"\x89PNG")


def test_one_seed_gives_one_network(app, tmp_path):
    for name in ("one", "two"):
        out = tmp_path / f"{name}.safetensors"
        done = CliRunner().invoke(app, ["spectral", "--out", str(out), "--epochs", "1"])
        assert done.exit_code == 0, done.output
    one, two = (supple.load_model(tmp_path / f"{name}.safetensors") for name in ("one", "two"))
    for name, value in one.tensors().items():
        assert (value == two.tensors()[name]).all(), name


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["rotation", "--out", "net.bin"], "must end in .safetensors"),
        (["rotation", "--out", "nowhere/net.safetensors"], "does not exist"),
        (["rotation", "--out", "net.safetensors", "--data", "none.npz"], "none.npz"),
        (["twist", "--out", "net.safetensors"], "twist"),
    ],
)
def test_bad_options_are_refused_before_any_work(app, tmp_path, monkeypatch, arguments, message):
    monkeypatch.chdir(tmp_path)
    done = CliRunner().invoke(app, arguments)
    assert done.exit_code == 2
    assert message in done.output
    assert list(tmp_path.iterdir()) == []
