"""Mutants of body."""

from tests.mutants.mutant import of

CALLS = "experiments/test_spoilt_calls.py::test_what_people_make_and_write_themselves_is_refused"
MUTANTS = [
    *of(
        "body/motion.py", CALLS,
        ("any-numbers-are-places", 'dtype.kind not in "fiu"', 'dtype.kind in "V"'),
        ("clips-are-cut-from-the-end", 'whole("start", start, 0, len(self) - 1)', 'whole("start", start, -99, len(self) - 1)'),
        ("a-cut-holds-nothing", 'whole("stop", stop, start + 1)', 'whole("stop", stop)'),
    ),
    *of(
        "body/skeleton.py", CALLS,
        ("a-side-is-anywhere", "whole(f\"{self.name}: {name}[{n}]\", value, least, most)",
         "whole(f\"{self.name}: {name}[{n}]\", value, least)"),
        ("numbers-stay-numpys", "object.__setattr__(self, name, self._numbers(name,", "(self._numbers(name,",
         "experiments/test_spoilt_calls.py::test_a_skeleton_of_lists_and_numpy_numbers_is_the_one_of_tuples"),
    ),
    *of(
        "body/fitting.py", "body/test_fitting.py",
        ("reflections-allowed", "sign[:, 2] = torch.det(u @ v).sign()", "pass"),
        ("twist-may-jump", "angle.abs() > most", "angle.abs() > 99.0"),
        ("bones-of-mean-length", ".median(dim=0).values", ".mean(dim=0)"),
        ("aimed-from-where-the-joint-was", "places[child] = places[joint] + rotate(turns[joint], rest[child])",
         "places[child] = target[:, child]"),
        ("rest-pose-faces-backward", "across.new_tensor([1.0, 0.0, 0.0])), bones", "across.new_tensor([-1.0, 0.0, 0.0])), bones"),
    ),
    *of(
        "body/following.py", "body/test_following.py",
        ("arms-aimed-from-where-they-were", "arms = rotate(moved[:, None], seen", "arms = rotate(none[:, None], seen"),
        ("elbows-bend-in-any-plane", "if joint in limbs and len", "if joint in [] and len"),
        ("twisted-the-other-way", "torch.linalg.cross(a, b)", "torch.linalg.cross(b, a)"),
        ("hinges-turn-about-all-axes", "return turns if len(axes) == 3 else", "return turns if axes else"),
        ("what-is-at-one-place-aims", "if way > COINCIDENT:", "if way > 0:"),
        ("poses-are-missed", "rig = _meeting(_followed(held, path, points, limbs, line, jump), rig, line)",
         "rig = _followed(held, path, points, limbs, line, jump)"),
        ("an-arm-flips-at-the-half-turn", "found = _steady(found, rotate(inverse(turns[joint]), arms[:, 0]),", "(found,"),
        ("a-twist-jumps-at-the-next-pose", "back - start - torch.from_numpy(line.share) * way", "back - start"),
        ("a-models-own-rotations-are-lost", "    if motion.rig is None:\n        return held", "    return held"),
        ("the-last-pose-is-held-no-longer", "max(0, int((last - at[-1]) * ratio + 1e-6))", "0"),
        ("the-root-carries-a-body-that-hangs-lower", "if point == 0 or rig.moves is None:", "if True:"),
        ("rates-do-not-matter", "times[:1]) * ratio + 0.5", "times[:1]) + 0.5"),
    ),
    *of(
        "body/joining.py", "body/test_joining.py",
        ("any-bones-will-do", "<= close:", "<= 9.0:"),
        ("any-joints-will-do", "if lost := sorted(one.keys() ^ other.keys()):", "if lost := [][:0]:"),
        ("shrugs-are-other-bodies", "if motion.skeleton != H36M17 or names[joint].endswith(FIRM)", "if True"),
        ("aligned-the-other-way", "motion.turn(float(angles[0] - angles[1]))", "motion.turn(float(angles[1] - angles[0]))"),
        ("lifted-to-the-others-height", "way[horizontal(motion.up)[2]] = 0", "pass"),
    ),
    *of(
        "body/skeleton.py", "body/test_correspondence.py",
        ("prefixes-count", "shared = len(commonprefix(skeleton.joints))", "shared = 0"),
    ),
    *of(
        "body/motion.py", "body/test_rig.py",
        ("resampled-without-the-next-frame", "high = np.minimum(low + 1, len(self) - 1)", "high = low"),
        ("chords-in-spite-of-a-rig", "positions[between] = rig.pick(between).positions()", "pass"),
        ("left-becomes-right", "np.stack([x, -sign * z, sign * y]", "np.stack([x, sign * z, sign * y]"),
        ("mirrored-without-an-exchange", "self.positions[:, order] * flip", "self.positions * flip"),
        ("rigs-elsewhere-are-taken", 'self._check_rig(of_kind("rig", self.rig, Rig, "a Rig or None"))', "pass"),
        ("other-skeletons-keep-their-rig", "[:, picked], skeleton=skeleton, rig=None", "[:, picked], skeleton=skeleton"),
    ),
    *of(
        "body/skeleton.py", "prediction/test_control.py",
        ("the-root-counts-as-a-part", "*self.joints[1:])", "*self.joints)"),
        ("a-joint-for-its-part", "if part in self.parts else", "if part not in self.joints else"),
    ),
    *of(
        "body/kinematics.py", "body/test_rig.py",
        ("heading-of-the-shoulders", "key=lambda pair: depth[pair[0]]", "key=lambda pair: -depth[pair[0]]"),
        ("heading-from-left-to-right",
         "torch.atan2(across[..., b], across[..., a])", "torch.atan2(-across[..., b], -across[..., a])"),
        ("bones-not-added-up", "chain[joint] += chain[parent]", "pass"),
        ("turns-in-the-wrong-order",
         "_times(turns[-1].index_select(2, parents), turn)", "_times(turn, turns[-1].index_select(2, parents))",
         "body/test_rig.py::test_places_of_six_numbers_are_those_of_fk_with_the_same_gradients"),
    ),
    *of(
        "body/rig.py", "body/test_rig.py",
        ("sides-of-what-stands-on-the-floor", "- offsets)[below].max(", "- offsets)[1:].max(",
         "body/test_rig.py::test_rooting_and_mirroring_can_be_exchanged"),
        ("mirrored-without-the-half-turn", "if axis:  #", "if False:  #",
         "body/test_rig.py::test_the_mirror_image_of_sides_along_another_axis"),
    ),
    *of(
        "body/rotation.py", "body/test_rotation.py::test_six_are_the_first_two_columns_and_lead_back",
        ("columns-not-across", "_unit(across - (x * across).sum(0) * x)", "_unit(across)",
         "body/test_rotation.py::test_six_numbers_of_no_rotation_become_gram_and_schmidts"),
        ("six-by-rows", "matrix(q)[..., :2].mT.flatten(-2)", "matrix(q)[..., :2].flatten(-2)"),
        ("largest-part-of-a-quaternion-not-looked-for", "dim2=-1).argmax(dim=-1)", "dim2=-1).argmax(dim=-1) * 0",
         "body/test_rotation.py::test_quaternions_of_matrices_at_half_turns"),
    ),
    *of(
        "body/skeleton.py", "data/formats/test_arrays.py",
        ("two-joints-of-one-name", "for n, each in enumerate(one) if each in one[:n]]", "for each in one[:0]]"),
    ),
    *of(
        "body/skeleton.py", "body/test_correspondence.py",
        ("collars-at-the-shoulders", "thorax:left_clavicle:0.4", "thorax:left_clavicle:0.9"),
    ),
    *of(
        "body/rotation.py", "body/test_rotation.py",
        ("opposite-directions-in-single-precision", "broadcast_tensors(a.double(), b.double())", "broadcast_tensors(a, b)"),
    ),
    *of(
        "body/motion.py", "data/test_sources.py",
        ("whole-numbers-stay-whole", 'if self.positions.dtype.kind != "f":', "if False:"),
    ),
    *of(
        "body/kinematics.py", "inbetweening/test_losses.py",
        ("levels-without-gradients", "@torch.inference_mode(False)  # what is kept must serve training, too\n", ""),
    ),
]  # fmt: skip
