"""The embedded data: synthetic people who walk, run, turn, jump and gesture."""

from mwlib.data.synthetic.script import ACTIONS, synthetic_motions

__all__ = ["ACTIONS", "synthetic_motions"]
