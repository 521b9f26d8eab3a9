# SPDX-License-Identifier: GPL-3.0-or-later
"""Features that were learned, and adapt to the pair they match. No bpy: it runs on any thread."""

from . import native

MODEL = "features"
EPOCHS = 15

# A preview takes about a sixth of an epoch's time.
EPOCHS_A_PREVIEW = 3


def load(model):
    """Return the `supple.MatchModel` of a name or a path."""
    return native.supple().load_match_model(model)


def match(model, epochs, source, target, stages):
    """Return the `supple.MatchResult` of prepared meshes, as the panel calls them.

    `stages.learning` has the losses as they come.
    """
    matcher = native.supple().Matcher(
        target, source, model=model, epochs=epochs, progress=stages.begin("Matching", 0.02)
    )
    learning = stages.learning
    learning.begin(epochs)

    def after(epoch):
        learning.losses.append(epoch.minimised)
        if learning.is_previewed and epoch.epoch % EPOCHS_A_PREVIEW == 0:
            learning.point_map = matcher.features_map().point_map

    return matcher.run(callback=after, progress=stages.begin("Matching", 0.88))
