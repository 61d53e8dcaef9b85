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
        ("hips-of-the-published-code-everywhere", '(-hips if heading == "humanml3d" else hips)', "-hips"),
        ("root-steps-in-the-heading-before", "root = _about_up(np.diff(world[:, :1], axis=0), -angle[1:])",
         "root = _about_up(np.diff(world[:, :1], axis=0), -angle[:-1])"),
        ("headings-less-smooth", "SMOOTHING = 20.0", "SMOOTHING = 18.0"),
        ("chains-begin-at-their-first-joint", "above[:, begins] = start", "above[:, :1] = start"),
        ("floor-of-the-first-frame", "positions[..., 1].min()", "positions[0, :, 1].min()"),
        ("first-heading-as-it-is-smoothed", "    angle[0] = 0.0\n", ""),
    ),
    *of(
        "data/formats/humanml.py", "data/formats/test_humanml_folder.py",
        ("longest-clip-one-frame-longer", "if frames >= TOO_LONG", "if frames > TOO_LONG"),
        ("stamps-at-the-rate-of-kit", "STAMP_FPS = 20.0", "STAMP_FPS = 12.5"),
        ("whole-clips-with-captions-of-stretches", "if start == end == 0:", "if True:"),
        ("words-parted-at-the-first-slash", 'token.rpartition("/")', 'token.partition("/")'),
    ),
    *of(
        "data/formats/bvh.py", "data/formats/test_bvh.py",
        ("positions-do-not-replace-offsets", "offsets[:, joint, MOVES.index(name)] = table[:, column]", "pass"),
        ("t-poses-are-kept",
         "first = int(hints.first_frame is None and starts_in_tpose(turns[0].angles, positions, up.value))", "first = 0"),
        ("rates-are-never-vague", "if is_vague and abs(", "if False and abs("),
    ),
    *of(
        "data/formats/bvh.py", "data/formats/test_bvh_writing.py",
        ("channels-that-say-too-little", "if 2 * astray.max() > ALIKE:", "if False:"),
        ("end-sites-left-out", "if not children:", "if False:"),
    ),
    *of(
        "data/formats/asf_amc.py", "data/formats/test_amc.py",
        ("radians-taken-for-degrees", 'degrees = ":radians" not in', 'degrees = ":gradians" not in'),
        ("a-skeleton-of-somebody-else", "for candidates in (named, there):", "for candidates in (there[:1],):"),
    ),
    *of(
        "data/formats/glb_writing.py", "data/formats/test_glb_writing.py",
        ("scalar-first", "np.roll(rig.rotations[:, joint], -1, axis=-1)", "rig.rotations[:, joint]"),
        ("joints-stay-at-rest", "matrices[:, 3, :3] = -places", "pass"),
        ("moving-joints-stay", "if rig.moves is not None:", "if False:"),
        ("faces-inside-out", "np.stack([a, b, c, b, d, c]", "np.stack([a, b, c, b, c, d]"),
    ),
    *of(
        "data/formats/smpl.py", "data/formats/test_smpl.py",
        ("the-path-is-the-root", "rest[0] + unit.value * path[:, 0]", "unit.value * path[:, 0]"),
        ("everybody-has-y-up", 'else Stated("z", FORMAT)', 'else Stated("y", FORMAT)'),
        ("offsets-from-the-root", "rest[list(tree.parents[1:])]", "rest[:1]"),
    ),
    *of(
        "data/formats/smpl.py", "data/formats/test_smpl.py",
        ("faces-are-shapes", 'if family == "smplx":', "if False:"),
        ("the-mean-body-for-all", "return self.mean + self.ways", "return self.mean + 0 * self.ways"),
        ("any-tree", "parents[: len(HUMANML22)] != HUMANML22.parents or ", ""),
        ("shapes-that-change", "if np.any(rows != rows[0]):", "if False:"),
    ),
    *of(
        "data/formats/arrays.py", "data/formats/test_arrays.py",
        ("what-is-inside-counts-less",
         "skeleton = inside.skeleton or beside.skeleton", "skeleton = beside.skeleton or inside.skeleton",
         "data/test_stated.py", "data/formats/test_arrays.py"),
        ("sides-that-names-contradict", "if told.get(one) != other and", "if False and"),
        ("the-last-of-two-keys-of-json-counts", "if len(found) < len(pairs):", "if False:"),
        ("joints-with-blanks", ".strip() != name or not name:", "== 0:"),
    ),
    *of(
        "data/meaning.py", "data/formats/test_arrays.py",
        ("rates-of-any-kind", "if not isinstance(fps, str | int | float):", "if False:"),
    ),
    *of(
        "data/formats/h36m.py", "data/formats/test_h36m.py",
        ("corrupt-sequences-are-kept", "if (subject, action) not in CORRUPT\n", ""),
        ("takes-stay-in-the-action", 're.sub(r"( \\d+)?( chunk\\d+)?$", "", action)', "action"),
        ("joints-mixed", "if len({r.motion.skeleton.name for r in readings}) != 1:", "if not readings:"),
    ),
    *of(
        "data/formats/arrays.py", "data/formats/test_cmu_benchmark.py",
        ("turns-the-other-way", "Rotation.from_rotvec(-table[part, 3:]", "Rotation.from_rotvec(table[part, 3:]"),
        ("the-tpose-stays", "positions[first:]", "positions[:]"),
    ),
    *of(
        "data/formats/frames.py", "data/test_opening.py",
        ("blocks-overlap", "slice(start, start + step)", "slice(start, start + step + 1)"),
    ),
    *of(
        "data/formats/bvh.py", "data/formats/test_malformed.py",
        ("two-roots", "if (rest := next(words)) != END:", 'if (rest := next(words)) not in ("ROOT", END):'),
        ("joints-of-one-name", "enumerate(names) if name in names[:i]", "enumerate(names) if False"),
        ("fewer-rows-than-said", "if len(table) != int(rows):", "if len(table) > int(rows):"),
        ("endless-hierarchies", "if own >= MOST_JOINTS or depth > DEEPEST:", "if False:"),
    ),
    *of(
        "data/formats/asf_amc.py", "data/formats/test_malformed.py",
        ("bones-twice", "if name in bones or len(bones) > MOST_JOINTS:", "if len(bones) > MOST_JOINTS:"),
        ("bones-in-any-order", "np.any(table[:, names] != names, axis=1)", "np.any(table[:, names] < 0, axis=1)"),
        ("frames-missing", "np.diff(table[:, 0]) != 1", "np.diff(table[:, 0]) < 1"),
        ("bones-that-hang-nowhere", 'if bone.parent in ("root", *hung)', 'if bone.parent in ("root", "", *hung)'),
    ),
    *of(
        "data/formats/bvh.py", "data/formats/test_bvh.py::test_the_frame_time_stands_for_a_whole_rate_if_its_digits_allow",
        ("bvh-rate-nearest", "min(common or [whole],", "max(common or [whole],"),
        ("bvh-rate-first", "min(common or [whole], key=lambda rate: abs(1 / rate - step))", "(common or [whole])[0]"),
    ),
    *of(
        "data/formats/humanml_encoding.py", "data/formats/test_humanml_encoding.py::test_another_body_in_the_same_directions",
        ("hml-legs-one-side", "for chain in layout.chains[:2]", "for chain in layout.chains[:1]"),
    ),
    *of(
        "data/formats/frames.py", "data/formats/test_amc.py",
        ("axes-of-bones-left-out", "frame @ turn @ frame.T", "turn"),
    ),
    *of(
        "data/formats/frames.py", "data/formats/test_bvh.py::test_an_added_t_pose_is_dropped_and_nothing_else",
        ("turned-roots-are-t-poses", "or np.any(turn[0])", "or False"),
        ("arms-of-any-span", "WIDE[0] * height < width < WIDE[1] * height and ", ""),
    ),
]  # fmt: skip
