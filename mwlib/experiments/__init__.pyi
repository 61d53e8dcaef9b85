from .grids import Grid, read_grids, register, system, system_of
from .runs import get_model, get_result, get_run, load_run, train_run
from .sampling import generate, inbetween
from .tables import committed, committed_pairs, lines, measure

__all__ = [
    "Grid", "committed", "committed_pairs", "generate", "get_model", "get_result", "get_run", "inbetween", "lines", "load_run",
    "measure", "read_grids", "register", "system", "system_of", "train_run",
]  # fmt: skip
