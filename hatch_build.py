"""What a wheel has beside the library, in mwlib/_material: notebooks, figures, Snakefile, licence; `mwlib course` copies them."""

from __future__ import annotations

import runpy
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface


class Material(BuildHookInterface):
    """Adds the files to a wheel; an editable install needs none, for mwlib finds them in the checkout."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Called by hatchling before it builds."""
        root = Path(self.root)
        carried = runpy.run_path(str(root / "mwlib" / "paths.py"))["carried"]
        if version == "standard":
            build_data["force_include"] |= {str(f): f"mwlib/_material/{f.relative_to(root).as_posix()}" for f in carried(root)}
