# SPDX-License-Identifier: GPL-3.0-or-later
"""Matching by learned features that adapt to the pair, and what is shown meanwhile."""

import json
import threading
import time

import bodies
import bpy
import learned
import numpy as np
import pairs
import pytest
import refusing


@pytest.fixture
def supple(addon):
    return addon("native").supple()


@pytest.fixture
def model(supple, tmp_path):
    return learned.save(supple, tmp_path / "small.safetensors")


@pytest.fixture
def small_pair():
    return learned.triangle_pair()


def pose(scan):
    for vertex in scan.data.vertices:
        vertex.co.x += 0.3 * np.sin(1.5 * vertex.co.z)
    scan.matrix_world = bodies.rigid_motion()
    scan.scale = (1.7, 1.7, 1.7)


def test_a_posed_and_moved_copy_is_found(pair, model):
    body, scan, _ = pair
    pose(scan)
    rest = bodies.rest(scan).tobytes()
    bpy.context.scene.supple_match.start = "UVS"
    assert learned.find(body, scan, model, epochs=2) == {"FINISHED"}
    assert pairs.error(pair) < 0.05
    assert scan.supple_map.source == body and scan.supple_map.confidence > 0.8
    assert bodies.rest(scan).tobytes() == rest
    assert bpy.context.scene.supple_match.start == "UVS"
    assert bpy.ops.supple.match_show() == {"FINISHED"}
    colours = [pairs.attribute(obj, "Supple Match") for obj in (body, scan)]
    assert np.abs(colours[1] - colours[0][pair[2]]).mean() < 0.05


def test_features_are_a_start_and_need_no_refining(small_pair, model):
    body, scan, _ = small_pair
    pairs.choose(body, scan, "FEATURES", model=model, epochs=0, refine=False)
    assert bpy.ops.supple.match() == {"FINISHED"}
    assert pairs.error(small_pair) < 1e-3
    assert set(pairs.attribute(scan, "Supple Confidence")) == {np.float32(1)}


def test_it_is_said_when_the_features_were_not_what_was_taken(
    addon, small_pair, model, monkeypatch
):
    body, scan, _ = small_pair
    features = addon("match_features")
    found = features.match

    def without(*arguments):
        result = found(*arguments)
        result.automatic = True
        return result

    monkeypatch.setattr(features, "match", without)
    assert learned.find(body, scan, model, epochs=0) == {"FINISHED"}
    assert addon("match").WITHOUT_FEATURES in scan.supple_map.notes


def test_adapting_is_what_finds_the_partners(addon, supple, small_pair, tmp_path):
    body, scan, order = small_pair
    model = learned.save(supple, tmp_path / "larger.safetensors", **learned.LARGER)
    stages = addon("stages").Stages()
    stages.learning.is_previewed = True
    rest, errors = bodies.rest(body), []
    for epochs in (1, 10):
        addon("api").find_correspondence(body, scan, epochs=epochs, model=model, stages=stages)
        found = stages.learning.take()
        errors.append(np.linalg.norm(rest[found] - rest[order], axis=1).mean())
    assert errors[1] < 0.5 * errors[0]
    losses = stages.learning.losses
    assert stages.learning.epochs == len(losses) == 10
    assert losses[-1] < losses[0]
    assert pairs.error(small_pair) < 0.01


JOB = """
[input]
blend = "scene.blend"
[match]
source = "Body"
targets = ["Scan", "Other"]
start = "features"
epochs = 1
model = "small.safetensors"
transfer = ["weights"]
[output]
blend = "carried.blend"
report = "report.json"
"""


@pytest.fixture
def many(small_pair):
    """A body with a vertex group, and two copies in other orders, by name."""
    body, _, order = small_pair
    bodies.add_group(body, "part", range(20))
    return {"Scan": order, "Other": pairs.add_shuffled(body, "Other", seed=8)[1]}


def check_many(many):
    for name, order in many.items():
        obj = bpy.data.objects[name]
        assert obj.supple_map.source == bpy.data.objects["Body"]
        names, weights = pairs.weights(obj)
        assert names == ["part"]
        assert np.mean((weights[:, 0] > 0.5) == (order < 20)) > 0.9  # all but some of its rim


def test_to_many_targets(many, model):
    pairs.choose(bpy.data.objects["Body"], None, "FEATURES", model=model, epochs=1)
    bpy.context.scene.supple_match.transfer = {"WEIGHTS"}
    assert bpy.ops.supple.match_transfer_many() == {"FINISHED"}
    check_many(many)


def test_a_job_to_many_targets(addon, many, model, tmp_path):
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "scene.blend"))
    bpy.ops.wm.read_homefile(use_empty=True)
    (tmp_path / "job.toml").write_text(JOB)
    assert addon("job").main([str(tmp_path / "job.toml")]) == 0
    report = json.loads((tmp_path / "report.json").read_text())
    assert report["start"] == "features" and list(report["targets"]) == ["Scan", "Other"]
    assert report["targets"]["Other"]["confidence"] > 0.8
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "carried.blend"))
    check_many(many)


def test_cancelled_from_another_thread(addon, small_pair, model):
    body, scan, _ = small_pair
    before = pairs.everything()
    stages = addon("stages").Stages()

    def cancel():
        while not stages.learning.losses:
            time.sleep(0.001)
        stages.cancel()

    threading.Thread(target=cancel, daemon=True).start()
    with pytest.raises(addon("api").CancelledError):
        addon("api").find_correspondence(body, scan, epochs=100000, model=model, stages=stages)
    assert pairs.everything() == before


def test_undo_takes_back_all_of_it(small_pair, model):
    body, scan, _ = small_pair
    bpy.context.view_layer.update()
    pairs.choose(body, scan, "FEATURES", model=model, epochs=1)
    bpy.ops.ed.undo_push(message="Before")
    before = pairs.everything()
    bpy.ops.supple.find_correspondence()
    bpy.ops.ed.undo_push(message="Found")
    assert "Supple Match Face" in bpy.data.objects["Scan"].data.attributes
    bpy.ops.ed.undo()
    after = pairs.everything()
    assert {k: v for k, v in after.items() if k != "panel"} == {
        k: v for k, v in before.items() if k != "panel"
    }


def test_what_can_not_be_done_is_told(addon, small_pair, tmp_path):
    body, scan, _ = small_pair
    api = addon("api")

    def refuse(model, message, **settings):
        learned.choose(body, scan, model, **settings)
        refusing.refuse(bpy.ops.supple.find_correspondence, message)

    refuse("nowhere", r"Scan: There is no network 'nowhere'.*\.safetensors")
    (tmp_path / "source.safetensors").write_bytes(b"no weights")
    refuse(
        str(tmp_path / "source.safetensors"),
        r"Scan: .*source\.safetensors cannot be read as a safetensors file",
    )
    refuse(
        str(addon("native").supple().shipped_models()["rotation"]),
        "Scan: .*holds no Supple network",
    )
    before = pairs.everything()
    with pytest.raises(api.UserError, match=r"Scan: .*0 epochs of adaptation or more"):
        model = learned.save(addon("native").supple(), tmp_path / "small.safetensors")
        api.find_correspondence(body, scan, epochs=-1, model=model)
    assert pairs.everything() == before


def test_too_coarse_meshes_are_told(model):
    square = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]
    first = bodies.add_mesh("First", square, [(0, 1, 2, 3)])
    second = bodies.add_mesh("Second", square, [(0, 1, 2, 3)])
    learned.choose(first, second, model, epochs=1)
    refusing.refuse(bpy.ops.supple.find_correspondence, "Second: ")


def test_the_curve_of_losses(addon):
    loss_curve = addon("loss_curve")
    assert loss_curve.curve([3.0, 2.5, 1.0]) == "█▆▁"
    assert loss_curve.curve([5.0]) == loss_curve.curve([5.0, 5.0])[:1] == "▁"
    many = loss_curve.curve(list(np.linspace(200, 100, 500)))
    assert len(many) == loss_curve.WIDTH and many == "".join(sorted(many, reverse=True))
    assert (many[0], many[-1]) == ("█", "▁")
    assert loss_curve.figures([287.31, 200.0, 191.96]) == "Loss 287.3 to 192"
    assert loss_curve.figures([0.012348]) == "Loss 0.01235"
