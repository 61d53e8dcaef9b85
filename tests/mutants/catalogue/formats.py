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
        ("whole-clips-with-captions-of-stretches", "in captions if start == end == 0)", "in captions)"),
        ("words-parted-at-the-first-slash", 'token.rpartition("/")', 'token.partition("/")'),
    ),
    *of(
        "data/formats/bvh.py", "data/formats/test_bvh.py",
        ("positions-do-not-replace-offsets", "offsets[:, joint, MOVES.index(name)] = table[:, column]", "pass"),
        ("t-poses-are-kept",
         "first = int(hints.first_frame is None and starts_in_tpose(turns, positions, up.value))", "first = 0"),
        ("rates-are-never-vague", "if is_vague and fitting:", "if False:"),
    ),
    *of(
        "data/formats/bvh_writing.py", "data/formats/test_bvh_writing.py",
        ("channels-that-say-too-little", "if 2 * astray.max() > ALIKE:", "if False:"),
        ("end-sites-left-out", "if joint not in has_children:", "if False:"),
    ),
    *of(
        "data/formats/asf_amc.py", "data/formats/test_amc.py",
        ("axes-of-bones-left-out", "axis @ euler_matrices(", "euler_matrices("),
        ("radians-taken-for-degrees", 'degrees = degrees and word != ":radians"', "pass"),
        ("a-skeleton-of-somebody-else", "for candidates in (named, there):", "for candidates in (there[:1],):"),
    ),
    *of(
        "data/formats/glb_writing.py", "data/formats/test_glb_writing.py",
        ("scalar-first", "np.roll(rig.rotations[:, joint], -1, axis=-1)", "rig.rotations[:, joint]"),
        ("joints-stay-at-rest", "matrices[:, 3, :3] = -places", "pass"),
        ("moving-joints-stay", "moving = [] if rig.moves is None", "moving = [] if True"),
        ("faces-inside-out", "np.stack([b, d, c], axis=1)", "np.stack([b, c, d], axis=1)"),
    ),
    *of(
        "data/formats/smpl.py", "data/formats/test_smpl.py",
        ("the-path-is-the-root", "rest[0] + unit.value * path[:, 0]", "unit.value * path[:, 0]"),
        ("everybody-has-y-up", 'Stated("z", FORMAT) if is_amass else', 'Stated("y", FORMAT) if is_amass else'),
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
        ("joint-indices-of-nobody", "all(type(i) is int and 0 <= i < len(names) for i in row)",
         "all(type(i) is int for i in row)"),
        ("the-last-of-two-keys-of-json-counts", "if count > 1]", "if count > 2]"),
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
        ("turns-the-other-way", "Rotation.from_rotvec(-table[:, 3:]", "Rotation.from_rotvec(table[:, 3:]"),
        ("the-tpose-stays", "positions[first:]", "positions[:]"),
    ),
    *of(
        "data/formats/frames.py", "data/test_opening.py",
        ("signs-jump-between-blocks", ".numpy()[len(before) :] * signs", ".numpy()[len(before) :]"),
    ),
    *of(
        "data/formats/bvh.py", "data/formats/test_malformed.py",
        ("two-roots", 'if (word == "ROOT") == bool(stack) or (nodes and not stack):', 'if (word == "ROOT") == bool(stack):'),
        ("joints-of-one-name", "if len(set(names)) < len(names):", "if False:"),
        ("fewer-rows-than-said", "if len(table) != int(count):", "if len(table) > int(count):"),
        ("endless-hierarchies", "if len(nodes) > MOST_JOINTS or len(stack) > DEEPEST:", "if False:"),
    ),
    *of(
        "data/formats/asf_amc.py", "data/formats/test_malformed.py",
        ("bones-twice", 'if name in bones or name == "root" or len(bones) >= MOST_JOINTS:', 'if name == "root":'),
        ("frames-missing", "if np.any(np.diff(numbers) != 1):", "if False:"),
        ("bones-that-hang-nowhere", 'if bone.parent == "root" or', 'if bone.parent in ("root", "") or'),
    ),
    *of(
        "data/formats/bvh.py", "data/formats/test_bvh.py::test_the_frame_time_stands_for_a_whole_rate_if_its_digits_allow",
        ("bvh-rate-nearest", "float(min(fitting,", "float(max(fitting,"),
        ("bvh-rate-first", "float(min(fitting, key=lambda rate: abs(1 / rate - step)))", "float(fitting[0])"),
    ),
    *of(
        "data/formats/humanml_encoding.py", "data/formats/test_humanml_encoding.py::test_another_body_in_the_same_directions",
        ("hml-legs-one-side", "for chain in layout.chains[:2]", "for chain in layout.chains[:1]"),
    ),
    *of(
        "data/formats/frames.py", "data/formats/test_bvh.py::test_an_added_t_pose_is_dropped_and_nothing_else",
        ("turned-roots-are-t-poses", "or np.any(turn[0])", "or False"),
        ("arms-of-any-span", "WIDE[0] * height < width < WIDE[1] * height and ", ""),
    ),
]  # fmt: skip
