"""The embedded data: synthetic people who walk, run, turn, jump and gesture, and others who do what a sentence says."""

from mwlib.data.synthetic.captioned import captioned_people, captioned_positions
from mwlib.data.synthetic.grammar import vocabulary
from mwlib.data.synthetic.script import ACTIONS, synthetic_motions
from mwlib.data.synthetic.synonyms import perturbed

__all__ = ["ACTIONS", "captioned_people", "captioned_positions", "perturbed", "synthetic_motions", "vocabulary"]
