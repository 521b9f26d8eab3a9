# SPDX-License-Identifier: GPL-3.0-or-later
"""A walk along -Y as turns of the bones of samples/human/human_rig.json. NumPy only.

Feet are planned in the world, on a flat floor, and the legs are solved to reach them (two bones
each, law of cosines), so a foot that stands does not slide. A turn is a (3, 3) rotation, for column
vectors in the world, from the rest pose. Angles are in radians, lengths in metres, time in frames.
"""

import numpy as np

CYCLE = 30  # frames from a heel strike to the next of the same foot
STRIDE = 1.28
STANCE = 0.6  # part of a cycle that a foot is on the floor
STRIKE = 8.0  # the frame of the right foot's first heel strike
WIDTH = 0.095  # of an ankle from the path
HEEL = 0.05  # behind the ankle's rest place: where the foot rolls on landing
CLEARANCE = 0.035  # how much higher a swinging ankle goes than on the straight way

# (part of the cycle from heel strike, value); between them smooth, and level at each.
FOOT_PITCH = ((0.0, -13), (0.1, 0), (0.34, 0), (0.62, 46), (0.86, -10), (1.0, -13))
# How much of its foot's pitch the toe has: it stays flat while the heel rises.
TOE_SHARE = ((0.0, 1), (0.34, 0), (0.6, 0), (0.78, 1), (1.0, 1))
ARM_SWING = ((0.0, 18), (0.5, -16), (1.0, 18))
ELBOW_BEND = ((0.0, 4), (0.5, 22), (1.0, 4))

HIPS_HEIGHT = 0.966  # of the hips' middle, on average; at rest about 1.01
HIPS_BOB, HIPS_SWAY = 0.026, 0.016
HIPS_YAW, CHEST_YAW, LEAN = np.radians((5.0, 5.0, 3.0))
ARM_LOWERED, HAND_TURNED = np.radians((33.0, 8.0))  # from the A-pose of the rest shape


def turn(axis, angle):
    """Return the rotation about world axis 0, 1 or 2."""
    i, j = (axis + 1) % 3, (axis + 2) % 3
    matrix = np.eye(3)
    matrix[i, i] = matrix[j, j] = np.cos(angle)
    matrix[i, j], matrix[j, i] = -np.sin(angle), np.sin(angle)
    return matrix


def eased(knots, phase):
    """Return the value at `phase`, 0..1, of a curve through knots, level at each."""
    times, values = np.array(knots, dtype=float).T
    at = min(np.searchsorted(times, phase, side="right") - 1, len(times) - 2)
    t = (phase - times[at]) / (times[at + 1] - times[at])
    return values[at] + (values[at + 1] - values[at]) * t * t * (3 - 2 * t)


def phase_of(frame, side):
    """Return (whole cycles, part of one) since a heel strike of the foot of `side`."""
    cycles = (frame - STRIKE) / CYCLE + (0.0 if side == "R" else 0.5)
    return np.floor(cycles), cycles - np.floor(cycles)


def hips_way(frame):
    """Return how far the hips have come along -Y."""
    return STRIDE * (frame - STRIKE) / CYCLE


def footprint(cycle, side):
    """Return how far along -Y the ankle of a standing foot is, of its stance number `cycle`."""
    ahead = 0.46 * STANCE * STRIDE  # of the hips at heel strike
    return STRIDE * (cycle - (0.0 if side == "R" else 0.5)) + ahead


class Walker:
    """Poses a rig. rig: {"bones": {name: {"head", "tail", "parent"}}}."""

    def __init__(self, rig):
        self._bones = rig["bones"]
        self._head = {name: np.array(bone["head"]) for name, bone in self._bones.items()}

    def pose(self, frame):
        """Return ({bone: its turn}, (3,) how far the hips have moved)."""
        hips, offset = self._hips(frame)
        right = phase_of(frame, "R")[1]
        chest = turn(2, CHEST_YAW * np.cos(2 * np.pi * right)) @ turn(0, LEAN)
        turns = {
            "DEF-hips": hips,
            "DEF-spine": turn(0, LEAN),
            "DEF-chest": chest,
            "DEF-neck": turn(0, LEAN / 2),
            "DEF-head": np.eye(3),
        }
        for side in "LR":
            turns |= self._arm(frame, side, chest)
            turns |= self._leg(frame, side, hips, offset)
        return turns, offset

    def _hips(self, frame):
        right = phase_of(frame, "R")[1]
        way = np.array(
            [
                -HIPS_SWAY * np.sin(2 * np.pi * (right - 0.05)),
                -hips_way(frame),
                HIPS_HEIGHT
                - HIPS_BOB * np.cos(4 * np.pi * (right - 0.05))
                - self._head["DEF-hips"][2],
            ]
        )
        return turn(2, -HIPS_YAW * np.cos(2 * np.pi * right)), way

    def _arm(self, frame, side, chest):
        """An arm swings with the leg of the other side."""
        phase = phase_of(frame, "L" if side == "R" else "R")[1]
        out = 1 if side == "L" else -1
        forward = -np.radians(eased(ARM_SWING, phase))
        bend = -np.radians(eased(ELBOW_BEND, (phase + 0.5) % 1))
        lowered = turn(1, out * ARM_LOWERED)
        upper = chest @ turn(0, forward) @ lowered
        fore = chest @ turn(0, forward + bend) @ lowered
        return {
            f"DEF-shoulder.{side}": chest,
            f"DEF-upper_arm.{side}": upper,
            f"DEF-forearm.{side}": fore,
            f"DEF-hand.{side}": fore @ turn(2, -out * HAND_TURNED),
        }

    def _standing(self, side, cycle, phase):
        """Return (ankle, foot's turn) of a foot on the floor."""
        rest = self._head[f"DEF-foot.{side}"]
        toe = self._head[f"DEF-toe.{side}"]
        flat = np.array([WIDTH if side == "L" else -WIDTH, -footprint(cycle, side), rest[2]])
        pitch = np.radians(eased(FOOT_PITCH, phase))
        # It rolls on the heel, then on the joint of the toes.
        way = toe - rest if pitch > 0 else np.array([0.0, HEEL, -rest[2]])
        return flat + way - turn(0, pitch) @ way, turn(0, pitch)

    def _foot(self, frame, side):
        cycle, phase = phase_of(frame, side)
        if phase <= STANCE:
            return self._standing(side, cycle, phase)
        step = 1e-3
        start, _ = self._standing(side, cycle, STANCE)
        speed = (start - self._standing(side, cycle, STANCE - step)[0]) / step * (1 - STANCE)
        end, _ = self._standing(side, cycle + 1, 0.0)
        t = (phase - STANCE) / (1 - STANCE)
        # Cubic Hermite: it leaves as it rolled off and arrives at rest.
        ankle = start + (end - start) * t * t * (3 - 2 * t) + speed * t * (1 - t) ** 2
        ankle[2] += CLEARANCE * np.sin(np.pi * t) ** 2
        return ankle, turn(0, np.radians(eased(FOOT_PITCH, phase)))

    def _leg(self, frame, side, hips, offset):
        thigh, shin, foot = (self._head[f"DEF-{name}.{side}"] for name in ("thigh", "shin", "foot"))
        middle = self._head["DEF-hips"]
        hip = middle + offset + hips @ (thigh - middle)
        ankle, pitch = self._foot(frame, side)
        a, b = np.linalg.norm(shin - thigh), np.linalg.norm(foot - shin)
        reach = ankle - hip
        far = np.linalg.norm(reach)
        if far >= a + b:
            raise ValueError(f"frame {frame}: the {side} leg is {far - a - b:.3f} m too short")
        along = reach / far
        at_hip = np.arccos((a * a + far * far - b * b) / (2 * a * far))
        forward = np.array([0.0, -1.0, 0.0])
        bend = forward - along * (forward @ along)
        bend /= np.linalg.norm(bend)
        knee = hip + a * (np.cos(at_hip) * along + np.sin(at_hip) * bend)
        share = eased(TOE_SHARE, phase_of(frame, side)[1])
        degrees = eased(FOOT_PITCH, phase_of(frame, side)[1])
        return {
            f"DEF-thigh.{side}": _between(shin - thigh, knee - hip),
            f"DEF-shin.{side}": _between(foot - shin, ankle - knee),
            f"DEF-foot.{side}": pitch,
            f"DEF-toe.{side}": turn(0, np.radians(share * degrees)),
        }


def _between(rest, posed):
    """Return the rotation that lays direction rest on posed and keeps what looks forward there."""

    def frame(direction):
        z = direction / np.linalg.norm(direction)
        x = np.cross(z, (0.0, -1.0, 0.0))
        x /= np.linalg.norm(x)
        return np.stack([x, np.cross(z, x), z], axis=1)

    return frame(posed) @ frame(rest).T
