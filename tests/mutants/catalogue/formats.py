"""Mutants of formats."""

from tests.mutants.mutant import of

MUTANTS = [
    *of(
        "data/formats/pickles.py", "data/formats/test_pickles.py",
        ("lists-of-anything", "all(isinstance(item, str) for item in (*made[:1], *items))", "True"),
        ("any-dictionary-is-one-of-words", "if isinstance(tree, dict) and all(type(number) is int for number in tree.values()):",
         "if isinstance(tree, dict):"),
    ),
    *of(
        "data/formats/humanml.py", "data/formats/test_humanml.py",
        ("yaw-taken-as-the-whole-turn", "return 2 * torch.cat(", "return torch.cat("),
        ("steps-one-frame-early", "features[..., :-1, layout", "features[..., 1:, layout"),
        ("heights-added-twice", "torch.stack([x + path[..., :1], local[..., 1],",
         "torch.stack([x + path[..., :1], local[..., 1] + features[..., 3:4],"),
    ),
    *of(
        "data/formats/humanml_encoding.py", "data/formats/test_humanml_encoding.py",
        ("hips-of-the-published-code-everywhere", "        hips = -hips\n", "        hips = -hips\n    hips = -hips\n"),
        ("root-steps-in-the-heading-before", "root = _about_up(np.diff(world[:, :1], axis=0), -angle[1:])",
         "root = _about_up(np.diff(world[:, :1], axis=0), -angle[:-1])"),
        ("headings-less-smooth", "SMOOTHING = 20.0", "SMOOTHING = 18.0"),
        ("chains-begin-at-their-first-joint", "above[:, begins] = _start", "above[:, :1] = _start"),
        ("mirror-keeps-the-signs-of-rotations", "(1, -1, -1, -1, 1, 1)", "(1, 1, 1, 1, 1, 1)"),
        ("floor-of-the-first-frame", "positions[..., 1].min()", "positions[0, :, 1].min()"),
        ("first-heading-as-it-is-smoothed", "    angle[0] = 0.0\n", ""),
    ),
    *of(
        "data/formats/humanml.py", "data/formats/test_humanml_folder.py",
        ("longest-clip-one-frame-longer", "if frames >= TOO_LONG", "if frames > TOO_LONG"),
        ("stamps-at-the-rate-of-kit", "STAMP_FPS = 20.0", "STAMP_FPS = 12.5"),
        ("whole-clips-with-captions-of-stretches", "if caption.start == caption.end == 0)", ")"),
        ("words-parted-at-the-first-slash", 'token.rpartition("/")', 'token.partition("/")'),
    ),
]  # fmt: skip
