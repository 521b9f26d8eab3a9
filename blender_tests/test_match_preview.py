# SPDX-License-Identifier: GPL-3.0-or-later
"""What a window shows while features adapt, and that Esc leaves no trace of it.

The window is a stand-in; the 3D View is a real one.
"""

import time
from types import SimpleNamespace

import bpy
import learned
import numpy as np
import pairs
import pytest

ATTRIBUTE = "Supple Match"
ESC = SimpleNamespace(type="ESC", value="PRESS")
TIMER = SimpleNamespace(type="TIMER", value="NOTHING")


class Context:
    """Blender's own, but for what only a window has."""

    def __init__(self, view):
        self.window, self.space_data = SimpleNamespace(), view
        self.workspace = SimpleNamespace(status_text_set=lambda text: None)

        def nothing(*_, **__):
            return None

        self.window_manager = SimpleNamespace(
            windows=[],
            progress_begin=nothing,
            progress_update=nothing,
            progress_end=nothing,
            event_timer_add=nothing,
            event_timer_remove=nothing,
            modal_handler_add=nothing,
        )

    def __getattr__(self, name):
        return getattr(bpy.context, name)


@pytest.fixture
def pair():
    return learned.triangle_pair()


@pytest.fixture
def view(addon):
    return addon("colour_view").views()[0]


@pytest.fixture
def press(addon, view, monkeypatch):
    """Return a function that presses the button: the operator, its context, the event loop."""
    background, operators = addon("background"), addon("match_operators")
    window = SimpleNamespace(app=SimpleNamespace(background=False))
    monkeypatch.setattr(background, "bpy", window)

    class Button(operators.MatchOperator):
        def how(self, context):
            return addon("match_collect").options_of(context.scene)

        def report(self, level, message):
            self.said = message

        def wait_for(self, condition):
            """Let the window's timer go on until `condition`; return what `modal` said last."""
            said = {"RUNNING_MODAL"}
            while said == {"RUNNING_MODAL"} and not condition():
                said = self.modal(self.context, TIMER)
                time.sleep(0.001)
            return said

    def pressed():
        button = Button()
        button.context = Context(view)
        assert button.invoke(button.context, None) == {"RUNNING_MODAL"}
        assert background.running is button._stages
        return button

    yield pressed
    assert background.running is None


def choose(addon, tmp_path, pair, **settings):
    model = learned.save(addon("native").supple(), tmp_path / "larger", **learned.LARGER)
    pairs.choose(*pair[:2], "FEATURES", model=model, **settings)


def seen(pair, view):
    """Return all that a preview may change."""
    active = [obj.data.color_attributes.active_color for obj in pair[:2]]
    kept = [(obj.supple.colour_before, obj.supple.shading_before) for obj in pair[:2]]
    names = [colour.name if colour else None for colour in active]
    return pairs.everything(), names, kept, (view.shading.type, view.shading.color_type)


def paint(pair):
    """Give the target colour attributes of the user's own, of which the first is active."""
    attributes = pair[1].data.color_attributes
    for name in ("Mine", "Last"):
        attributes.new(name, "FLOAT_COLOR", "POINT")
    attributes.active_color = attributes["Mine"]


def show(pair, addon, view):
    """Show a match of before."""
    panel = bpy.context.scene.supple_match
    start, panel.start = panel.start, "NEAREST"
    bpy.ops.supple.match()
    bpy.ops.supple.match_show()
    addon("match_show").view(*pair[:2], view)
    panel.start = start


@pytest.mark.parametrize("before", ["plain", "painted", "shown"])
def test_esc_leaves_no_trace(addon, pair, view, press, tmp_path, before):
    body, scan, order = pair
    choose(addon, tmp_path, pair, epochs=100000)
    view.shading.type, view.shading.color_type = "MATERIAL", "RANDOM"
    if before != "plain":
        paint(pair)
    if before == "shown":
        show(pair, addon, view)
    state = seen(pair, view)
    button = press()
    button.wait_for(lambda: button._preview is not None)
    colours = [pairs.attribute(obj, ATTRIBUTE) for obj in (body, scan)]
    assert np.ptp(colours[0][:, :3], axis=0).min() > 0.99
    # A copy's vertices have the features of the original's, so most are found already.
    assert np.abs(colours[1] - colours[0][order]).mean() < 0.1
    assert addon("colour_view").is_viewed(scan, ATTRIBUTE, view)
    assert button._stages.learning.losses
    button.modal(button.context, ESC)
    assert button.wait_for(lambda: False) == {"CANCELLED"}
    assert button.said == "Scan: cancelled, nothing was changed"
    assert seen(pair, view) == state


def test_the_result_takes_the_previews_place(addon, pair, view, press, tmp_path):
    scan = pair[1]
    choose(addon, tmp_path, pair, epochs=4)
    before = view.shading.type, view.shading.color_type
    button = press()
    button.wait_for(lambda: button._preview is not None)
    assert button.wait_for(lambda: False) == {"FINISHED"}
    assert "Scan: matched to 'Body'" in button.said
    assert pairs.error(pair) < 0.01
    assert ATTRIBUTE not in scan.data.color_attributes
    assert (view.shading.type, view.shading.color_type) == before


def test_an_end_by_blender_leaves_no_trace(addon, pair, view, press, tmp_path):
    choose(addon, tmp_path, pair, epochs=100000)
    state = seen(pair, view)
    button = press()
    button.wait_for(lambda: button._preview is not None)
    button.cancel(button.context)
    assert seen(pair, view) == state


def test_no_preview_where_it_would_change_more(addon, pair, view, press, tmp_path):
    possible = addon("match_preview").is_possible
    body, scan, _ = pair
    assert possible(body, scan, view) and not possible(body, scan, None)
    choose(addon, tmp_path, pair, epochs=2, preview=False)
    button = press()
    assert button.wait_for(lambda: button._preview is not None) == {"FINISHED"}
    bpy.ops.object.mode_set(mode="EDIT")
    assert not possible(body, scan, view)
    bpy.ops.object.mode_set(mode="OBJECT")
    twin = bpy.data.objects.new("Twin", body.data)
    bpy.context.scene.collection.objects.link(twin)
    assert not possible(body, scan, view)
    bpy.data.objects.remove(twin)
    scan.data.attributes.new(ATTRIBUTE, "FLOAT", "FACE")
    assert not possible(body, scan, view)


def test_the_panel_draws_the_curve(addon):
    texts = []

    class Layout:
        def label(self, text):
            texts.append(text)

    learning = addon("stages").Learning()
    learning.begin(5)
    panel = addon("match_panel").SUPPLE_PT_match
    panel._draw_learning(None, Layout(), learning)
    learning.losses += [300.0, 200.0]
    panel._draw_learning(None, Layout(), learning)
    assert texts == ["0 of 5 epochs", "2 of 5 epochs", "█▁", "Loss 300 to 200"]
