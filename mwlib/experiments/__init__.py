"""Runs, results and tables of any system: trained or measured once, found again by hash."""

from mwlib.experiments.grids import Grid, read_grids
from mwlib.experiments.keyframes import inbetween
from mwlib.experiments.results import get_result
from mwlib.experiments.runs import get_model, get_run, load_run, train_run
from mwlib.experiments.sentences import generate
from mwlib.experiments.systems import register, system, system_of
from mwlib.experiments.tables import committed, committed_pairs, lines, measure

__all__ = [
    "Grid", "committed", "committed_pairs", "generate", "get_model", "get_result", "get_run", "inbetween", "lines", "load_run",
    "measure", "read_grids", "register", "system", "system_of", "train_run",
]  # fmt: skip
