# SPDX-License-Identifier: GPL-3.0-or-later
"""`supple match` and `supple evaluate match`, on a blob and a copy of it in another pose,
triangulation, order and place."""

import _thread
import json
import signal
import time
from dataclasses import replace

import numpy as np
import pytest
import supple
from supple import evaluation
from supple.cli import app
from supple.cli.console import watched
from supple.match_sets import read_match_set
from supple.mesh_files import read_mesh, write_mesh
from typer.testing import CliRunner

SIZE = 300
EDGE = 100 / np.sqrt(SIZE)  # in the units of the geodesic error (two faces a vertex)


def run(*arguments):
    return CliRunner().invoke(app, [str(argument) for argument in arguments])


@pytest.fixture(scope="module")
def pair(blob):
    return blob(SIZE, 0), blob(SIZE + 20, 1, 0.1)


@pytest.fixture(scope="module")
def folder(pair, tmp_path_factory):
    """A set to match, with small untrained features beside it. A blob has no mirror image; its
    other side stands for it."""
    root = tmp_path_factory.mktemp("set")
    for part in ("shapes", "corres"):
        (root / part).mkdir()
    for name, one in zip("ab", pair, strict=True):
        write_mesh(root / "shapes" / f"{name}.off", one.vertices, one.faces)
    truth = pair[0].nearest(pair[1])
    opposite = np.argmin(pair[0].directions @ pair[1].directions.T, axis=1)
    np.savetxt(root / "corres" / "a.vts", np.arange(SIZE) + 1, fmt="%d")
    np.savetxt(root / "corres" / "b.vts", truth + 1, fmt="%d")
    np.savetxt(root / "corres" / "b.mirror.vts", opposite + 1, fmt="%d")
    (root / "pairs.txt").write_text("a b\n")
    supple.untrained_match_model(inputs=16, outputs=16, width=16, blocks=1, eigenfunctions=32).save(
        root / "features.safetensors"
    )
    return root


def matched(folder, out, *more):
    shapes = folder / "shapes"
    model = ["--model", folder / "features.safetensors", "--epochs", 1]
    return run("match", shapes / "a.off", shapes / "b.off", "--out", out, *model, *more)


def test_match_writes_map_deformation_network_and_report(folder, pair, tmp_path):
    names = ("a_to_b.map", "laid.obj", "adapted.safetensors", "report.json")
    out, laid, network, report = (tmp_path / "made" / name for name in names)
    more = ["--deformed", laid, "--save-model", network, "--report", report]
    result = matched(folder, out, *more)
    assert result.exit_code == 0, (result.output, result.exc_info)
    found = np.loadtxt(out, dtype=int) - 1
    assert len(found) == SIZE
    # Untrained features say little; the map is the one that needs none, refined.
    target = supple.Mesh(pair[1].vertices, pair[1].faces)
    assert supple.geodesic_errors(target, pair[0].nearest(pair[1]), found)[0].mean < 2 * EDGE
    content = json.loads(report.read_text())
    assert content["automatic"] is True
    assert [epoch["epoch"] for epoch in content["epochs"]] == [0]
    assert np.isfinite(content["epochs"][0]["loss"]["total"])
    assert 0 < content["score"]["value"] <= 1
    assert content["seconds"] > 0
    vertices, faces = read_mesh(laid)
    assert np.array_equal(faces, pair[0].faces)
    away = np.linalg.norm(vertices - pair[1].vertices[found], axis=1)
    assert np.median(away) < 0.1 * np.ptp(pair[1].vertices)
    # What it adapted to is kept.
    before = supple.load_match_model(folder / "features.safetensors").tensors()
    after = supple.load_match_model(network).tensors()
    assert any(not np.array_equal(before[name], after[name]) for name in before)


def test_match_without_another_map_takes_what_the_features_say(folder, tmp_path):
    out, report = tmp_path / "out.map", tmp_path / "report.json"
    result = matched(
        folder, out, "--no-automatic", "--config", "cdfm", "--epochs", 0, "--report", report
    )
    assert result.exit_code == 0, (result.output, result.exc_info)
    content = json.loads(report.read_text())
    assert content["automatic"] is False
    assert content["epochs"] == []
    assert content["config"] == "cdfm"


def test_match_says_what_is_wrong(folder, tmp_path):
    out = tmp_path / "out.map"
    (tmp_path / "bad.off").write_text("OFF\n3")
    shapes = folder / "shapes"
    for arguments, part in (
        ([shapes / "a.off", shapes / "c.off"], "no file"),
        ([shapes / "a.off", tmp_path / "bad.off"], "cannot be read"),
        ([shapes / "a.off", shapes / "b.off", "--model", "nothing"], "no network 'nothing'"),
    ):
        model = ["--model", folder / "features.safetensors"]
        result = run("match", *model, *arguments, "--out", out)
        assert result.exit_code == 1
        assert part in " ".join(result.output.split())
    assert matched(folder, out, "--config", "magic").exit_code == 2
    assert not out.exists()


def test_the_report_has_the_rows_and_columns(folder, tmp_path):
    path = tmp_path / "report.json"
    model = ["--model", folder / "features.safetensors", "--epochs", 1]
    result = run("evaluate", "match", folder, "--report", path, *model)
    assert result.exit_code == 0, (result.output, result.exc_info)
    report = json.loads(path.read_text())
    assert report["pairs"] == 1
    assert report["epochs"] == 1
    names = ["automatic", "features", "without_ljn", "no_network", "ljn"]
    assert list(report["rows"]) == names
    for name, row in report["rows"].items():
        for column in (*evaluation.COLUMNS, evaluation.SECONDS, "flipped"):
            assert np.isfinite(row[column]), (name, column)
            assert row[column] == report["measured"]["a b"][name][column]
    right = report["rows"]["automatic"]
    assert right["geodesic"] < 2 * EDGE
    assert right["flipped"] == 0
    table = path.with_suffix(".md").read_text()
    assert "| without_ljn |" in table
    assert "flipped" in table
    assert "change" not in table


def test_flips_are_counted_where_their_truth_is_known(folder, pair):
    match_set = read_match_set(folder, refine=False)
    truth, shape = match_set.shapes["b"].template, match_set.shapes["b"]
    maps = {"right": truth, "wrong": shape.mirror}
    chosen = [
        evaluation.Method(name, lambda s, t, found=found: lambda _: found, refines=False)
        for name, found in maps.items()
    ]
    with_truth = evaluation.Evaluation(match_set, chosen, cache=False).run()
    assert with_truth["rows"]["right"]["flipped"] == 0
    assert with_truth["rows"]["right"]["geodesic"] == 0
    assert with_truth["rows"]["wrong"]["flipped"] == 1
    assert "initial" not in with_truth["rows"]
    match_set.shapes["b"] = replace(shape, mirror=None)
    without = evaluation.Evaluation(match_set, chosen, cache=False).run()
    assert "flipped" not in without["rows"]["wrong"]
    # The means of a row are over the pairs that have it.
    both = [made["measured"]["a b"] for made in (with_truth, without)]
    made = evaluation.summary(both)
    assert made["rows"]["wrong"]["flipped"] == 1
    assert made["pairs"] == 2


def test_what_rows_share_is_done_once_a_pair_and_counts_for_each(folder):
    match_set = read_match_set(folder, refine=False)
    begun = []

    def begin(source, target):
        begun.append((source, target))
        time.sleep(0.02)
        return match_set.shapes["b"].template

    chosen = [
        evaluation.Method(name, lambda s, t, found: lambda _: found, refines=False, shared=begin)
        for name in ("one", "other")
    ]
    made = evaluation.Evaluation(match_set, chosen, cache=False).run()
    assert len(begun) == 1
    for row in made["rows"].values():
        assert row["geodesic"] == 0
        assert row[evaluation.SECONDS] >= 0.02


def test_unknown_losses_are_named(folder):
    model = ["--model", folder / "features.safetensors"]
    result = run("evaluate", "match", folder, *model, "--configs", "ljn,magic")
    assert result.exit_code == 1
    assert "'magic' is no way to match" in " ".join(result.output.split())


def test_ctrl_c_cancels_and_waits_for_what_was_started():
    ended = []

    def work(progress):
        _thread.interrupt_main()
        for _ in range(10_000):  # not for ever, should nobody cancel
            time.sleep(0.001)
            if progress.cancelled:
                break
        time.sleep(0.1)  # the way back from the last thing that cannot be stopped
        ended.append(progress.cancelled)

    # Started in the background, a shell has it ignored.
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        with pytest.raises(KeyboardInterrupt):
            watched("working", work)
    finally:
        signal.signal(signal.SIGINT, before)
    assert ended == [True]
