"""Mutants of settings, files and hashes."""

from tests.mutants.mutant import of

MUTANTS = [
    *of(
        "files.py", "test_files.py",
        ("a-full-disk-names-no-file", "raise OSError(error.errno, error.strerror or str(error), str(file)) from None", "raise"),
    ),
    *of(
        "settings.py", "test_settings.py",
        ("the-last-of-two-words-counts", "if name.strip() in changes:", "if False:"),
        ("newer-fields-always-in-the-hash", "if name not in newer or value != newer[name]", "if True"),
        ("newer-fields-never-in-the-hash", "if name not in newer or value != newer[name]", "if name not in newer"),
        ("the-last-of-two-keys-counts", "            if name in first:\n", "            if False:\n"),
        ("keys-once-in-the-whole-file", "node, first = super().compose_mapping_node(anchor), {}",
         "node, first = super().compose_mapping_node(anchor), self.__dict__.setdefault('all', {})",
         "experiments/test_grids.py::test_the_papers_other_numbers_are_named"),
        ("too-deep-for-words", "(yaml.YAMLError, RecursionError, ValueError)", "(yaml.YAMLError, ValueError)",
         "experiments/test_grids.py::test_a_file_without_grids_is_told"),
        ("lines-from-zero", "found.line = node.start_mark.line + 1", "found.line = node.start_mark.line",
         "experiments/test_grids.py::test_what_cannot_be_meant_is_refused_with_its_line"),
    ),
    *of(
        "settings.py", "experiments/test_believed_runs.py::test_every_setting_of_a_run_is_there_but_newer_ones",
        ("a-part-is-all", "        if absent:\n", "        if False:\n"),
        ("newer-settings-are-missed", "and n not in tree[g] and n not in cls.newer", "and n not in tree[g]"),
    ),
    *of(
        "settings.py", "experiments/test_believed_runs.py::test_no_part_of_a_configuration_is_taken_for_all_of_it",
        ("groups-may-be-left-out", "for group in cls.groups() if not", "for group in () if not"),
    ),
    *of(
        "settings.py", "experiments/test_believed_runs.py::test_text_that_is_none_is_refused_by_name",
        ("bytes-fail-without-a-name", "(yaml.YAMLError, RecursionError, ValueError)", "(yaml.YAMLError, RecursionError)"),
    ),
    *of(
        "hashing.py", "test_hashing.py",
        ("texts-in-another-encoding", "errors=", "'utf-16', errors="),
        ("the-order-of-names-counts", "json.dumps(tree, sort_keys=True)", "json.dumps(tree)"),
        ("docstrings-count", "value = node.body[1:] if", "value = node.body if"),
        ("values-do-not-count", 'yield f" {node!r}"', 'yield f" {type(node)}"'),
        ("the-course-counts", 'in ("cli", "course", "_material")', 'in ("cli", "_material")'),
        ("other-files-do-not-count", 'if path.suffix != ".py" or modules is None', 'if path.suffix == ".py" and modules is None'),
        ("all-modules-count", "or name in modules:", "or True:"),
        ("pictures-count", '"experiments", "plots")', '"experiments")'),
        ("imports-at-second-hand-do-not-count", "name not in found and", "name == module and"),
        ("late-imports-do-not-count", "for node in ast.walk(_parsed(file)):", "for node in _parsed(file).body:"),
        ("names-stay-with-their-package", "        if called == name:", "        if False:"),
        ("new-names-are-not-followed", "alias.asname or alias.name", "alias.name"),
        ("stubs-are-not-read", "if stub.is_file() else", "if False else"),
    ),
    *of(
        "arguments.py", "test_arguments.py",
        ("rooms-take-anything", "return _checked(found) if isinstance(found, types.FunctionType) else found", "return found"),
        ("every-array-has-the-axes", "operator.ge if len(axes) < len(words) else operator.eq", "operator.ge"),
        ("sizes-from-the-front", "zip(axes[::-1], array.shape[::-1], strict=False)", "zip(axes, array.shape, strict=False)"),
        ("truth-is-a-rate", "isinstance(value, Real) and not isinstance(value, bool) or", "isinstance(value, Real) or"),
        ("no-rate-is-one", "not above < value < math.inf", "not above <= value < math.inf"),
        ("one-of-two-kinds-will-not-do", "if not all(faults):", "if not any(faults):"),
        ("letters-are-numbers", "str | bytes | Mapping", "bytes | Mapping"),
        ("texts-inside-are-numbers", "isinstance(value, list | tuple | Real))", "isinstance(value, list | tuple | str | Real))"),
        ("dense-or-not", "and not value.is_meta and not value.is_sparse", ""),
    ),
    *of(
        "paths.py", "experiments/test_shipped.py",
        ("a-name-comes-before-a-folder", "if not (own / CONFIG).exists() and str(name) in shipped():",
         "if str(name) in shipped():"),
    ),
]  # fmt: skip
