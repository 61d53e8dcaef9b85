"""The embedded data set: synthetic people who walk, run, turn, stop and gesture. Licence-free, the same for a given seed.

A clip is a script drawn from a small Markov chain: what the legs do (stand, walk, run, step on the spot), gestures on top, and
turns of the heading. Every event has a random moment and takes over within a few frames, so one history has several futures.
"""

import numpy as np

from mwlib.body.motion import Motion
from mwlib.body.skeleton import H36M17
from mwlib.synthetic.movements import GAITS, GESTURES, PoseTrack, gait_pose, gesture_tracks, stand_pose
from mwlib.synthetic.person import FPS, Body, Positions, draw_body, positions_of
from mwlib.synthetic.sentences import read_table

MARGIN = 10  # frames made before and after the clip and cut off, where smoothing has no neighbours


# action: what is going on > what may come next, likelier if named more often; a turn or a wave leaves the legs going
_CHAINS = read_table("""
walk: walk > walk walk walk veer
run: stand > run | run > run veer stand walk | walk > run stand
stop_and_go: stand > walk walk walk run | walk > stand stand stand turn | run > stand walk
turn: walk > turn turn turn stand | stand > turn walk | turn > walk walk turn
wave: stand > wave wave wave walk | wave > stand stand stand wave walk | walk > stand stand wave
sit: stand > sit sit sit walk | sit > stand stand stand sit walk | walk > stand stand sit
jump: stand > jump jump jump walk | jump > stand stand stand jump walk | walk > stand stand jump
pick_up: stand > pick_up pick_up reach reach walk | pick_up > stand stand stand pick_up walk | walk > stand stand pick_up |
    reach > stand stand pick_up
box: stand > box box box walk | box > stand stand stand box walk | walk > stand stand box
kick: stand > kick kick kick walk | kick > stand stand stand kick walk | walk > stand stand kick
direct: stand > direct direct direct turn wave | direct > stand stand stand direct walk | walk > stand stand direct
switch: stand > stand walk run turn wave box kick jump sit pick_up reach direct |
    walk > stand walk run turn wave box kick jump sit pick_up reach direct | run > stand walk turn
""")
ACTIONS: dict[str, dict[str, str]] = {
    action: dict(state.strip().split(" > ") for state in chain.split("|")) for action, chain in _CHAINS.items()
}


def synthetic_motions(subjects: int = 8, seconds: float = 6.4, seed: int = 0) -> list[Motion]:
    """One clip of every action by every subject: articulated, 17 joints (H36M17), metres, z up, 50 Hz, float64.

    Bone lengths are constant within a subject and differ between subjects. The defaults give 96 clips, ten minutes in all.
    Subjects are named P1, P2, ...; hold some out to test on bodies never seen. A clip depends on the seed, its subject, its
    action and `seconds` only, not on how many others are made.

    Own choice throughout: the papers use recorded motion, which cannot be redistributed.

    Raises:
        ValueError: no subjects, or clips shorter than two frames.
    """
    if subjects < 1 or seconds * FPS < 2:
        raise ValueError(f"subjects is {subjects} and seconds {seconds}; expected at least 1 and {2 / FPS}")
    motions = []
    for subject in range(subjects):
        body = draw_body(np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(0, subject))))
        for number, action in enumerate(ACTIONS):
            rng = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(1, subject, number)))
            name = f"P{subject + 1}"
            positions = _perform(action, body, int(seconds * FPS), rng)
            motions.append(Motion(positions, FPS, H36M17, subject=name, action=action, name=f"{name}_{action}"))
    return motions


class _Script(PoseTrack):
    """A clip that chance writes."""

    def __init__(self, body: Body, frames: int, rng: np.random.Generator) -> None:
        super().__init__(body, rng, frames, MARGIN, FPS)
        self.heading += rng.uniform(-np.pi, np.pi)
        self.legs, self.since, self.cadence, self.left_stands = "stand", 0.0, 0.0, True
        self.near = "right" if rng.random() < 0.5 else "left"

    def set_legs(self, legs: str, at: float) -> float:
        """Stand or change gait as soon as a foot swings past the other; returns when that is."""
        rng, body = self.rng, self.body
        if self.legs == "stand":
            self.left_stands = bool(rng.random() < 0.5)
        else:
            steps = np.ceil((at - self.since) * 2 * self.cadence)
            at, self.left_stands = self.since + steps / (2 * self.cadence), self.left_stands ^ bool(steps % 2)
        if legs == "stand":
            pose = stand_pose()
        else:
            gait, size = GAITS[legs], rng.uniform(0.8, 1.15)
            self.cadence = gait.cadence * body.pace * np.sqrt(size) * rng.uniform(0.95, 1.05)
            phase = gait.ahead + (0.0 if self.left_stands else 0.5) + self.cadence * (self.time - at)
            pose = gait_pose(gait, body, phase, size)
        self.change_to(pose, at, rng.uniform(0.14, 0.32))
        self.legs, self.since = legs, at
        return at

    def turn(self, at: float, degrees: tuple[float, float], seconds: tuple[float, float]) -> float:
        """Change the heading to either side; someone who stands steps round. Returns when it is done."""
        angle = np.deg2rad(self.rng.uniform(*degrees)) * self.rng.choice((-1.0, 1.0))
        lasts = self.rng.uniform(*seconds)
        if stood := self.legs == "stand":
            at, lasts = self.set_legs("march", at), lasts + 0.3
        self.heading += angle * self.rise(at, lasts)
        return self.set_legs("stand", at + lasts) if stood else at + lasts

    def gesture(self, name: str, at: float) -> float:
        """Lay a gesture over whatever the legs do, stopping first if it needs the legs; returns when it is over."""
        gesture, rng = GESTURES[name], self.rng
        if self.legs != "stand" and any("hip" in track or "knee" in track for track in gesture.tracks):
            at = self.set_legs("stand", at) + 0.15
        if rng.random() >= 0.5:
            self.near = "left" if self.near == "right" else "right"
        lasts = gesture.seconds / self.body.tempo * rng.uniform(0.85, 1.2)
        entries, values = gesture_tracks(name, self.near, (self.time - at) / lasts)
        onset = gesture.onset * rng.uniform(0.7, 1.3)
        self.overlay(entries, values * rng.uniform(0.92, 1.05), at, lasts, onset)
        return at + lasts

    def follow(self, event: str, at: float) -> float:
        """Let one event begin; returns when the next may."""
        rng = self.rng
        if event in GESTURES:
            return self.gesture(event, at) + rng.uniform(-0.1, 0.3)
        if event == "turn":
            return self.turn(at, (45, 140), (0.3, 0.55)) + rng.uniform(0.1, 0.8)
        if event == "veer":
            return self.turn(at, (10, 50), (0.8, 1.6)) + rng.uniform(0.0, 0.5)
        if event == "stand" and self.legs == "stand":
            return at + rng.uniform(0.2, 1.0)
        return self.set_legs(event, at) + rng.uniform(0.5, 2.0)


def _perform(action: str, body: Body, frames: int, rng: np.random.Generator) -> Positions:
    """World positions of one clip, which starts at the origin, amid something already under way."""
    chain, script = ACTIONS[action], _Script(body, frames, rng)
    event, at = str(rng.choice(list(chain))), -rng.uniform(0.5, 1.4)
    while at < frames / FPS:
        at = script.follow(event, at)
        event = str(rng.choice(chain.get(event, chain.get(script.legs, "stand")).split()))
    positions = positions_of(script.finished(), script.heading, body)[MARGIN:-MARGIN]
    return positions - positions[0, 0] * [1.0, 1.0, 0.0]
