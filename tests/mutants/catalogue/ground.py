"""Mutants of settings, files and hashes."""

from tests.mutants.mutant import of

MUTANTS = [
    *of(
        "settings.py", "test_settings.py",
        ("newer-fields-always-in-the-hash", "if name not in newer or value != newer[name]", "if True"),
        ("newer-fields-never-in-the-hash", "if name not in newer or value != newer[name]", "if name not in newer"),
    ),
    *of(
        "__main__.py", "test_command_line.py",
        ("every-room-for-one-command", "for room in asked or ROOMS:", "for room in ROOMS:"),
    ),
    *of(
        "paths.py", "experiments/test_shipped.py",
        ("a-name-comes-before-a-folder", "if not (own / CONFIG).exists() and str(name) in shipped():",
         "if str(name) in shipped():"),
    ),
]  # fmt: skip
