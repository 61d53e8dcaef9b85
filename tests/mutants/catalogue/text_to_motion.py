"""Mutants of text to motion."""

from tests.mutants.mutant import of

MUTANTS = [
    *of(
        "text_to_motion/config.py", "text_to_motion/test_config.py",
        ("shorter-than-a-movement", "self.data.shortest < UNIT", "self.data.shortest < UNIT - 1"),
        ("judge-in-the-hash-of-a-training", 'frozenset({"sampling", "checkpoint_every"})', 'frozenset({"checkpoint_every"})'),
    ),
    *of(
        "text_to_motion/model.py", "text_to_motion/test_model.py",
        ("noise-of-other-lengths", "return noise()[:, :most] * mask[..., None]", "return noise()[:, -most:] * mask[..., None]"),
    ),
    *of(
        "text_to_motion/system.py", "experiments/test_runs.py::test_another_model_behind_a_run_makes_it_another_run",
        ("critic-without-a-hash", "+ critic", "+ []"),
        ("evaluator-without-a-hash", "return stands_on(cfg.sampling.evaluator)", "return []"),
    ),
    *of(
        "text_to_motion/spectra.py", "text_to_motion/test_spectra.py",
        ("noise-without-its-share", "return a * power + 1 - a", "return a * power + 1"),
        ("gain-without-the-root", "return alpha_bar.sqrt()[..., None] * power", "return alpha_bar[..., None] * power"),
        ("recovery-counted-from-the-other-end", "torch.arccos(level.sqrt())", "torch.arcsin(level.sqrt())"),
        ("recovery-level-of-the-noise", "return gamma / (gamma + power)", "return power / (gamma + power)"),
        ("estimate-with-the-gain-once", "estimates.append(gain**2 * v)", "estimates.append(gain * v)"),
        ("variance-with-the-factor-once", "v = keep**2 * v + added", "v = keep * v + added"),
        ("posterior-variance-upside-down", "return keep, (1 - after) / (1 - a) * (1 - ratio)",
         "return keep, (1 - a) / (1 - after) * (1 - ratio)"),
        ("eq36-noise-of-the-level-it-left", "return after.sqrt() * gain, 1 - after", "return after.sqrt() * gain, 1 - a"),
        ("spectrum-unscaled", 'axis=-2, norm="ortho"))', "axis=-2))"),
    ),
    *of(
        "text_to_motion/spectra.py", "text_to_motion/test_spectra.py",
        ("harmonic-of-the-same-phase", "1j * (2 * phi if bound else own)", "1j * (phi if bound else own)"),
        ("error-on-what-was-fitted", "missed = target[half:] - inputs[half:] @", "missed = target[:half] - inputs[:half] @"),
        ("noisy-phase-taken-for-the-true-one", "* (1 - torch.exp(-1 / sigma.square())) if bound", "* 0 if bound"),
    ),
    *of(
        "data/normalisation.py", "data/test_normalisation.py",
        ("deviations-of-each-feature", "deviation[block].mean() or 1.0", "deviation[block] + 1e-9"),
        ("weights-upside-down", "*= WEIGHT[self.kind] / WEIGHT[kind]", "*= WEIGHT[kind] / WEIGHT[self.kind]"),
        ("scaled-before-the-mean-is-gone", "(raw - self.mean.to(raw)) / self.deviation.to(raw)",
         "raw / self.deviation.to(raw) - self.mean.to(raw)"),
    ),
    *of(
        "text_to_motion/losses.py", "text_to_motion/test_losses.py",
        ("cosines-of-the-padded-length", "bank[n, :kept, :n] = ", "bank[n, :kept, :n] = (n / longest) * "),
        ("low-pass-without-the-mean", "rows = self._of(x, lengths)\n        return rows.mT",
         "rows = self._of(x, lengths)[:, 1:]\n        return rows.mT"),
        ("distance-per-padded-frame", "(lengths.to(error) * error.shape[-1])", "(error.shape[1] * error.shape[-1])"),
        ("high-band-with-padding", "kept = error * inside[..., None] - kept", "kept = error - kept"),
        ("meaning-that-is-never-detached", "        motion = motion.detach()\n", "        pass\n"),
        ("reward-of-everything", "-(close - threshold).clamp_min(0)", "-(close - threshold)"),
        ("penalty-instead-of-a-reward", "return -(close - threshold)", "return (close - threshold)"),
        ("eq16-without-its-last-step", "t <= int(EQ16 * steps)", "t < int(EQ16 * steps)"),
        ("prose-stage-turned-round", '"prose": (late, ~late)', '"prose": (~late, late)'),
    ),
    *of(
        "data/captioned.py", "data/test_captioned.py",
        ("pieces-from-the-beginning-only", "self._batch(picked, start, lengths, [", "self._batch(picked, 0 * start, lengths, ["),
        ("never-four-frames-shorter", "SHORTENED = 1 / 3", "SHORTENED = 0"),
        ("padding-that-is-not-zero", "Batch(y * mask[..., None], mask", "Batch(y, mask"),
    ),
    *of(
        "text_to_motion/objective.py", "text_to_motion/test_objective.py",
        ("meaning-at-every-noise", "weight[rows] * loss", "loss"),
        ("low-frequencies-at-every-noise", "o.low_weight * low * slow", "o.low_weight * slow"),
        ("critic-sees-scaled-features", "critic.embed_motion(self.statistics.denormalise(y0_hat[rows]), lengths",
         "critic.embed_motion(y0_hat[rows], lengths"),
    ),
    *of(
        "text_to_motion/model.py", "text_to_motion/test_model.py",
        ("guidance-of-eq-7", 'self.sampling.guidance, "alg1")', 'self.sampling.guidance, "eq7")'),
        ("noise-of-the-chunk", "[ids[i] for i in part]", "[*range(len(part))]"),
    ),
    *of(
        "text_to_motion/attributes.py", "text_to_motion/test_attributes.py",
        ("faces-backwards", "np.cross(left, [0.0, 1.0, 0.0])", "np.cross([0.0, 1.0, 0.0], left)"),
    ),
    *of(
        "text_to_motion/attributes.py", "text_to_motion/test_attributes.py",
        ("circles-to-the-other-side", '"left" if change > 0 else "right", "circle"',
         '"left" if change < 0 else "right", "circle"'),
        ("the-foot-that-stands", "side = int(len(spells[1]) > len(spells[0]))", "side = int(len(spells[1]) < len(spells[0]))"),
        ("the-last-action-first", "found[\"action\"] = events[0].action", "found[\"action\"] = events[-1].action"),
    ),
    *of(
        "text_to_motion/system.py", "text_to_motion/test_system.py",
        ("others-captions-are-their-own", "own[i - 1][: frames[i - 1]]", "own[i][: frames[i]]"),
        ("every-replicate-of-one-seed", "cfg.sampling.sampling_seed + 1000 * replicate", "cfg.sampling.sampling_seed"),
        ("replicates-with-holes-count-less", "there.sum(axis=0), np.nan)", "len(values), np.nan)"),
    ),
    *of(
        "text_to_motion/attributes.py", "text_to_motion/test_system.py",
        ("way-of-height-and-depth", "joints[:, 0, [0, 2]]", "joints[:, 0, [1, 2]]"),
        ("claims-always-met", "float(found.get(name) == value)", "float(name in found)"),
    ),
    *of(
        "text_to_motion/motions.py", "text_to_motion/test_motions.py",
        ("standing-foot-may-slide", "along[:, feet] *= ~standing[..., None]", "along[:, feet] *= 1"),
        ("heights-weighed-as-ways", "torch.full_like(weights, height_weight)", "weights"),
        ("steps-turned-the-other-way", "heading.cos(), heading.sin()", "heading.cos(), -heading.sin()"),
        ("weight-of-feet-that-move", "torch.where(standing, contact", "torch.where(~standing, contact"),
        ("weights-of-squares", "difference.T * weights.T[:, None]", "difference.T * weights.T[:, None] ** 2"),
    ),
    *of(
        "data/captioned.py", "data/test_captioned.py",
        ("parts-of-speech-without-a-hash", "{tagged or ''}", "", "data/formats/test_humanml_folder.py"),
        ("few-from-the-beginning", "np.linspace(0, len(items) - 1, kept)", "np.arange(kept)"),
    ),
]  # fmt: skip
