"""The embedded data: synthetic people who walk, run, turn, jump and gesture, and others who do what a sentence says."""

from mwlib.synthetic.motions import ACTIONS, synthetic_motions
from mwlib.synthetic.sentences import perturbed, vocabulary

__all__ = ["ACTIONS", "perturbed", "synthetic_motions", "vocabulary"]
