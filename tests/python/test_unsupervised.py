# SPDX-License-Identifier: GPL-3.0-or-later
"""Training without labels: what it may not see, and that no stop changes what comes of it."""

import json
import subprocess
import sys
import time
from types import SimpleNamespace

import numpy as np
import pytest
import supple
from supple import SuppleError, unsupervised
from supple.cli import app
from supple.mesh_files import write_mesh
from supple.shape_folders import read_shapes, shuffled
from typer.testing import CliRunner

FUNCTIONS = 20


def small_model(network=None):
    return supple.untrained_match_model(
        inputs=16, outputs=16, width=16, blocks=1, eigenfunctions=32, network=network
    )


def prepared(vertices, faces):
    return supple.PreparedMesh(vertices, faces, eigenfunctions=40, samples=0, cache=False)


@pytest.fixture(scope="module")
def meshes(blob):
    made = [blob(200 + 10 * i, i, 0.2 * i) for i in range(3)]
    return [prepared(one.vertices, one.faces) for one in made]


@pytest.fixture(scope="module")
def model():
    return small_model()


def trained(meshes, model, **options):
    options = {"epochs": 3, "functions": FUNCTIONS, **options}
    return supple.train_unsupervised(meshes, [0] * len(meshes), model=model, **options)


def same(a, b):
    """Whether two networks are the same bit for bit."""
    a, b = a.tensors(), b.tensors()
    return list(a) == list(b) and all(np.array_equal(a[name], b[name]) for name in a)


# --- What training may not see --------------------------------------------------------------------


def test_training_does_not_see_which_vertices_correspond(blob):
    """Shapes with the same vertices at the same numbers, and the same shapes in orders of their
    own, train the same network. Were any number of one mesh compared with another's, shuffling each
    mesh in another way would change all of it."""
    posed = [blob(200, 0, bend) for bend in (0.0, 0.3, 0.6)]
    assert all(np.array_equal(one.faces, posed[0].faces) for one in posed)
    held_out = blob(240, 7, 0.4)
    held_out = prepared(held_out.vertices, held_out.faces)
    start, options = small_model("spectral"), {"feature_learning_rate": (3e-3, 3e-3)}
    random = np.random.default_rng(5)
    in_order = trained([prepared(one.vertices, one.faces) for one in posed], start, **options)
    in_disorder = trained(
        [prepared(*shuffled(one.vertices, one.faces, random)) for one in posed], start, **options
    )
    before, first, second = (
        made.features(held_out).astype(np.float64)
        for made in (start, in_order.model, in_disorder.model)
    )
    learned = np.linalg.norm(first - before)
    assert learned > 0.05 * np.linalg.norm(before)
    assert np.linalg.norm(first - second) < 0.01 * learned
    for a, b in zip(in_order.history, in_disorder.history, strict=True):
        assert a.loss["total"] == pytest.approx(b.loss["total"], rel=1e-3)


def test_shuffled_surfaces_are_the_same_in_another_order(blob):
    one = blob(200, 0)
    vertices, faces = shuffled(one.vertices, one.faces, np.random.default_rng(1))

    def triangles(vertices, faces):
        """Each from its least corner on, which keeps its side; all in one order."""
        corners = [min(np.roll(t, -k, axis=0).tolist() for k in range(3)) for t in vertices[faces]]
        return sorted(corners)

    assert triangles(vertices, faces) == triangles(one.vertices, one.faces)
    assert np.mean(np.all(vertices == one.vertices, axis=1)) < 0.05
    assert np.mean(np.all(faces == one.faces, axis=1)) < 0.05


def write_group(folder, made):
    folder.mkdir(parents=True)
    for i, one in enumerate(made):
        write_mesh(folder / f"{i}.off", one.vertices, one.faces)


def test_folders_are_read_in_orders_of_their_own(blob, tmp_path):
    one = blob(200, 0)
    write_group(tmp_path / "cats", [one, one])
    write_group(tmp_path / "dogs", [one, one])
    (tmp_path / "about.json").write_text("{}")
    shapes = read_shapes(tmp_path, seed=5)
    assert [shape.name for shape in shapes] == [
        "cats/0.off",
        "cats/1.off",
        "dogs/0.off",
        "dogs/1.off",
    ]
    assert [shape.group for shape in shapes] == [0, 0, 1, 1]
    for i, a in enumerate(shapes):
        for b in shapes[:i]:
            assert np.mean(np.all(a.vertices == b.vertices, axis=1)) < 0.05
    again, other = read_shapes(tmp_path, seed=5), read_shapes(tmp_path, seed=6)
    assert all(np.array_equal(a.vertices, b.vertices) for a, b in zip(shapes, again, strict=True))
    assert not np.array_equal(shapes[0].vertices, other[0].vertices)
    flat = read_shapes(tmp_path / "cats")
    assert [(shape.name, shape.group) for shape in flat] == [("0.off", 0), ("1.off", 0)]


@pytest.mark.parametrize(
    ("spoil", "parts"),
    [
        (lambda f: (f / "cats" / "1.off").unlink(), ["cats", "only one mesh", "0.off"]),
        (lambda f: (f / "empty").mkdir(), ["empty", "no meshes"]),
        (lambda f: (f / "cats" / "1.off").write_text("OFF\n1"), ["1.off", "cannot be read"]),
        (lambda f: (f / "cats" / "0.off").rename(f / "0.off"), ["0.off", "beside folders"]),
        (
            lambda f: (f / "cats" / "1.off").write_text("OFF\n1 1 0\n0 0 0\n3 0 1 2\n"),
            ["1.off", "vertices"],
        ),
    ],
)
def test_bad_folders_name_the_file(blob, tmp_path, spoil, parts):
    write_group(tmp_path / "cats", [blob(50, 0)] * 2)
    spoil(tmp_path)
    with pytest.raises(SuppleError) as caught:
        read_shapes(tmp_path)
    assert caught.value.code == "bad_set"
    for part in parts:
        assert part in str(caught.value)


# --- Stopping and going on ------------------------------------------------------------------------

CHILD = """
import sys
import numpy as np
import supple
meshes, start, checkpoint, out = sys.argv[1:]
data = np.load(meshes)
supple.train_unsupervised(
    [
        supple.PreparedMesh(data[f"v{i}"], data[f"f{i}"], eigenfunctions=40, samples=0, cache=False)
        for i in range(2)
    ],
    [0, 0],
    model=start, epochs=5, guided_epochs=2, guide_pairs=1, functions=20, checkpoint=checkpoint,
).model.save(out)
"""
KILLS = 3


def test_killed_training_ends_with_the_same_bytes(blob, tmp_path):
    made = [blob(200 + 10 * i, i, 0.2 * i) for i in range(2)]
    arrays = {f"v{i}": one.vertices for i, one in enumerate(made)}
    np.savez(tmp_path / "meshes.npz", **arrays, **{f"f{i}": b.faces for i, b in enumerate(made)})
    small_model("spectral").save(tmp_path / "start.safetensors")

    def child(name):
        return subprocess.Popen(
            [
                sys.executable,
                "-c",
                CHILD,
                tmp_path / "meshes.npz",
                tmp_path / "start.safetensors",
                tmp_path / name,
                tmp_path / f"{name}.safetensors",
            ]
        )

    def written():
        paths = sorted((tmp_path / "killed").glob("*.safetensors"))
        return [(path.name, path.stat().st_mtime_ns) for path in paths]

    assert child("whole").wait() == 0
    random = np.random.default_rng(2)
    killed = 0
    for _ in range(KILLS):
        # At a random moment after something was kept, so that each try gets further.
        before, process = written(), child("killed")
        while process.poll() is None and written() == before:
            time.sleep(0.001)
        time.sleep(random.uniform(0, 0.1))
        process.kill()
        killed += process.wait() != 0
    assert killed > 0
    assert child("killed").wait() == 0
    whole, resumed = (tmp_path / f"{name}.safetensors" for name in ("whole", "killed"))
    assert whole.read_bytes() == resumed.read_bytes()
    for name in ("state.safetensors", "guides.safetensors"):
        kept = (tmp_path / folder / name for folder in ("whole", "killed"))
        assert len({path.read_bytes() for path in kept}) == 1, name


def test_a_cancelled_run_goes_on_after_its_last_epoch(meshes, model, tmp_path):
    whole = trained(meshes, model)
    progress = supple.Progress()
    seen = []

    def stop(epoch):
        seen.append((epoch, progress.fraction))
        if epoch.epoch == 1:
            progress.cancel()

    with pytest.raises(supple.Cancelled):
        trained(meshes, model, checkpoint=tmp_path, callback=stop, progress=progress)
    assert [epoch for epoch, _ in seen] == whole.history[:2]
    assert [fraction for _, fraction in seen] == pytest.approx([1 / 3, 2 / 3])
    progress = supple.Progress()
    later = []
    resumed = trained(meshes, model, checkpoint=tmp_path, callback=later.append, progress=progress)
    assert later == whole.history[2:]
    assert resumed.history == whole.history
    assert same(resumed.model, whole.model)
    assert progress.fraction == 1
    # A finished one is only read.
    assert same(trained(meshes, model, checkpoint=tmp_path).model, whole.model)


def identity_guides(monkeypatch, round_trip):
    """Guides that take no search: of one mesh, to itself."""
    calls = []

    def found(first, second, functions, progress, part):
        calls.append(part)
        return SimpleNamespace(maps=[np.eye(functions)] * 2, round_trip=round_trip)

    monkeypatch.setattr(unsupervised._native, "guide_maps", found)
    return calls


def test_guides_are_found_once_and_share_the_progress(meshes, model, tmp_path, monkeypatch):
    calls = identity_guides(monkeypatch, 0.01)
    options = {"guided_epochs": 1, "guide_pairs": 2, "epochs": 2, "checkpoint": tmp_path}
    twins = [meshes[0]] * 3  # a pair each way is one
    first = trained(twins, model, **options)
    assert (first.guides, first.guides_left_out, len(calls)) == (3, 0, 3)
    assert first.history[0].guide_share == 1
    assert first.history[1].guide_share == 0
    ends = [0, *(part[1] for part in calls)]
    assert [part[0] for part in calls] == ends[:-1]
    assert 0 < ends[-1] < 1
    (tmp_path / "state.safetensors").unlink()
    again = trained(twins, model, **options)
    assert len(calls) == 3
    assert same(again.model, first.model)


def test_guides_that_do_not_lead_back_are_no_guides(meshes, model, monkeypatch):
    calls = identity_guides(monkeypatch, unsupervised.LARGEST_ROUND_TRIP)
    with pytest.raises(SuppleError, match="None of the 3 rough maps") as caught:
        trained(meshes, model, guided_epochs=1)
    assert caught.value.code == "bad_option"
    # What is wrong otherwise is said before the search.
    calls.clear()
    for wrong in ({"epochs": 0}, {"config": "magic"}, {"functions": 0}, {"guide_pairs": 0}):
        with pytest.raises(SuppleError) as caught:
            trained(meshes, model, **{"guided_epochs": 1, **wrong})
        assert caught.value.code == "bad_option"
    with pytest.raises(SuppleError, match="alone in its group"):
        supple.train_unsupervised(meshes, [0, 0, 1], model=model, guided_epochs=1)
    assert calls == []


def test_another_training_does_not_go_on(meshes, model, tmp_path):
    trained(meshes, model, epochs=1, checkpoint=tmp_path)
    kept = (tmp_path / "state.safetensors").read_bytes()
    other_model = supple.untrained_match_model(
        seed=9, inputs=16, outputs=16, width=16, blocks=1, eigenfunctions=32, network=None
    )
    for changed, part in (
        ({"epochs": 2}, "epochs: 1 there, 2 here"),
        ({"config": "ulrssm"}, "config: ljn there, ulrssm here"),
        ({"feature_learning_rate": (1e-3, 5e-4)}, "feature learning rate: [0.001, 0.0001] there"),
        ({"meshes": meshes[:2]}, "shapes: 3 there, 2 here"),
        ({"meshes": [*meshes[:2], meshes[0]]}, "shapes: number 2 is another"),
        ({"model": other_model}, "network: another"),
    ):
        options = {"meshes": meshes, "model": model, "epochs": 1, "checkpoint": tmp_path, **changed}
        with pytest.raises(SuppleError) as caught:
            trained(**options)
        assert caught.value.code == "bad_checkpoint"
        assert part in str(caught.value)
        assert "another folder" in str(caught.value)
    assert (tmp_path / "state.safetensors").read_bytes() == kept


def test_damaged_checkpoints_are_refused(meshes, model, tmp_path):
    trained(meshes, model, epochs=1, checkpoint=tmp_path)
    path = tmp_path / "state.safetensors"
    whole = path.read_bytes()
    flipped = bytearray(whole)
    flipped[-100] ^= 1
    for damaged in (whole[: len(whole) // 2], b"", bytes(flipped), whole[:50] + whole[58:]):
        path.write_bytes(damaged)
        with pytest.raises(SuppleError, match="damaged") as caught:
            trained(meshes, model, epochs=1, checkpoint=tmp_path)
        assert caught.value.code == "bad_checkpoint"
        assert str(tmp_path) in str(caught.value)
    path.write_bytes(whole)
    trained(meshes, model, epochs=1, checkpoint=tmp_path)


def test_metadata_is_kept_and_cannot_lie(meshes, model, tmp_path):
    made = trained(meshes, model, epochs=1, metadata={"licence": "CC0-1.0"})
    made.model.save(tmp_path / "a.safetensors")
    made.model.save(tmp_path / "b.safetensors")
    assert (tmp_path / "a.safetensors").read_bytes() == (tmp_path / "b.safetensors").read_bytes()
    assert supple.load_match_model(tmp_path / "a.safetensors").metadata["licence"] == "CC0-1.0"
    with pytest.raises(SuppleError, match="'width'"):
        trained(meshes, model, metadata={"width": "3"})


# --- supple train unsupervised --------------------------------------------------------------------


def test_the_command_writes_network_history_and_curve(blob, tmp_path):
    write_group(tmp_path / "shapes", [blob(200 + 10 * i, i, 0.2 * i) for i in range(2)])
    start, out = tmp_path / "start.safetensors", tmp_path / "made" / "net.safetensors"
    small_model().save(start)

    def run(*more):
        arguments = ["train", "unsupervised", tmp_path / "shapes", "--out", out, "--start", start]
        arguments += ["--epochs", 2, "--functions", FUNCTIONS, "--config", "without_ljn", *more]
        return CliRunner().invoke(app, [str(argument) for argument in arguments])

    result = run("--about", "licence=CC0-1.0", "--about", "training_data=a=b")
    assert result.exit_code == 0, (result.output, result.exc_info)
    metadata = supple.load_match_model(out).metadata
    assert metadata["licence"] == "CC0-1.0"
    assert metadata["training_data"] == "a=b"
    metrics = json.loads((out.parent / "net.metrics.json").read_text())
    assert metrics["shapes"] == ["0.off", "1.off"]
    assert metrics["metadata"] == metadata
    curve = (out.parent / "net.loss.csv").read_text().splitlines()
    assert len(curve) == 1 + len(metrics["epochs"]) == 3
    column = curve[0].split(",").index("total")
    assert float(curve[2].split(",")[column]) == metrics["epochs"][1]["loss"]["total"]
    # It is finished: the same command only writes again; other options need another folder.
    kept = out.read_bytes()
    out.unlink()
    assert run("--about", "licence=CC0-1.0", "--about", "training_data=a=b").exit_code == 0
    assert out.read_bytes() == kept
    for more, part in (
        (["--seed", 1], "of another training"),
        (["--about", "licence"], "KEY=VALUE"),
        (["--start", "nothing"], "no network 'nothing'"),
    ):
        result = run(*more)
        assert result.exit_code == 1
        assert part in " ".join(result.output.split())
    assert run("--config", "magic").exit_code == 2
    # What a network was trained on before stays said.
    other = tmp_path / "other.safetensors"
    assert run("--start", out, "--out", other, "--about", "training_data=c").exit_code == 0
    metadata = supple.load_match_model(other).metadata
    assert metadata["training_data"] == "a=b; then c"
    once = "unsupervised, without_ljn, 2 epochs"
    assert metadata["training"] == f"{once}; then {once}"
