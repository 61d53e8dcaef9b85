"""Known data sets: a module of records each, found by lying in this folder."""

import importlib
import pkgutil
from pathlib import Path

from mwlib.body.skeleton import Skeleton
from mwlib.data.collections.record import Collection

_MODULES = (importlib.import_module(f"{__name__}.{found.name}") for found in pkgutil.iter_modules(__path__))
_RECORDS = (record for module in _MODULES for record in getattr(module, "RECORDS", ()))
COLLECTIONS: dict[str, Collection] = {c.name: c for c in sorted(_RECORDS, key=lambda c: (c.download is None, c.name))}
SKELETONS: dict[str, Skeleton] = {c.skeleton.name: c.skeleton for c in COLLECTIONS.values() if c.skeleton}

# Sources by the names of the presets that use them: what load_motions reads, at which rate.
NAMED_SOURCES = {"tiny": ("synthetic", 25.0), "laptop": ("synthetic", 50.0)} | {
    c.preset: (c.place, c.fps) for c in COLLECTIONS.values() if c.preset
}


def known_skeleton(skeleton: Skeleton) -> Skeleton:
    """The known skeleton that this one equals, which says more of its joints; else itself."""
    return next((known for known in SKELETONS.values() if known == skeleton), skeleton)


def named_source(source: str | Path) -> tuple[str | Path, float | None]:
    """What a source stands for and the rate that goes with it: a preset's data by the preset's name; else itself.

    Raises:
        ValueError: a file or folder of the working folder has the same name.
    """
    if not isinstance(source, str) or source not in NAMED_SOURCES:
        return source, None
    if Path(source).exists():
        raise ValueError(f"{source!r} names a preset's data and {Path(source).absolute()}; for the latter say ./{source}")
    return NAMED_SOURCES[source]


def acknowledgement(data: str) -> dict[str, str]:
    """What the owners of a data source want said beside any result on it: one entry, or none.

    A source is theirs if it or any folder on its path begins with the name of their folder, in any case: "cmu",
    "/data/CMU/asfamc", "my/cmu_benchmark", "LaFAN1".
    """
    folders = Path(data).expanduser().resolve().parts if Path(data).exists() else Path(data).parts
    for collection in COLLECTIONS.values():
        name = collection.place.split("/")[0]
        if collection.acknowledgement and any(folder.lower().startswith(name) for folder in folders):
            return {"acknowledgement": collection.acknowledgement}
    return {}
