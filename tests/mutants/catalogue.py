"""The mutants: small wrong changes to the library that the unit tests must notice, and the tests that do."""

from __future__ import annotations

from typing import NamedTuple


class Mutant(NamedTuple):
    """One change of one place.

    Args:
        name: what is wrong then.
        file: of the library.
        old, new: text that stands in the file exactly once, and what replaces it.
        tests: files or ids, some of which must fail; all of them pass without the change.
    """

    name: str
    file: str
    old: str
    new: str
    tests: tuple[str, ...]

    def applies(self, text: str) -> bool:
        """Whether the place is there, once."""
        return text.count(self.old) == 1


def of(file: str, tests: str, *changes: tuple[str, ...]) -> list[Mutant]:
    """Mutants of one file: name, old, new and, where it is not the usual one, the test."""
    found = []
    for name, old, new, *own in changes:
        found.append(Mutant(name, f"mwlib/{file}", old, new, tuple(f"tests/{test}" for test in (own or [tests]))))
    return found


MUTANTS = [
    *of(
        "diffusion/guidance.py", "diffusion/test_guidance.py",
        ("cfg-weight-counts-one-less", "((1 + w) * conditional).sub_(w *", "(w * conditional).sub_((w - 1) *"),
        ("cfg-alg1-the-wrong-way", "w * (conditional - unconditional)", "w * (unconditional - conditional)"),
    ),
    *of(
        "diffusion/process.py", "diffusion/test_process.py",
        ("noise-and-signal-exchanged", "return _like(a.sqrt(), like), _like((1 - a).sqrt(), like)",
         "return _like((1 - a).sqrt(), like), _like(a.sqrt(), like)", "diffusion/test_masks.py"),
        ("v-with-the-other-sign", "return signal * eps - noise * y", "return signal * eps + noise * y"),
        ("v-read-with-the-other-sign", "return signal * output + noise * y_t", "return signal * output - noise * y_t"),
    ),
    *of(
        "diffusion/schedule.py", "diffusion/test_schedule.py",
        ("cosine-begins-later", "(u + 0.008) / 1.008", "(u + 0.016) / 1.016"),
        ("sqrt-begins-later", "torch.sqrt(u + 1e-4)", "torch.sqrt(u + 1e-3)"),
        ("sigmoid-steeper", "-3.0, 3.0, 0.7", "-3.0, 3.0, 0.6"),
        ("linear-whatever-the-steps", " * (1000 / steps)", ""),
        ("largest-step-smaller", "beta.clamp(0, 0.999)", "beta.clamp(0, 0.99)"),
        ("leading-ends-at-zero", "offset = 1 if subset < steps else 0", "offset = 0"),
        ("trailing-one-early", "round((i + 1) * steps / subset) - 1", "round(i * steps / subset)"),
    ),
    *of(
        "diffusion/noise.py", "diffusion/test_noise.py",
        ("noise-by-place-in-the-chunk", "(seed, int(w))).generate_state(1)[0]) for w in windows",
         "(seed, i)).generate_state(1)[0]) for i, _ in enumerate(windows)"),
        ("noise-without-a-seed", "SeedSequence((seed, int(w)))", "SeedSequence((0, int(w)))"),
    ),
    *of(
        "diffusion/samplers.py", "diffusion/test_samplers.py",
        ("last-step-leaves-noise", "[*here[1:], 1.0]", "[*here[1:], here[-1]]"),
        ("bound-without-its-noise", "eps = eps_of(y, y0_hat, a)", "pass"),
        ("ddim-deviation-of-ddpm", "eta * ((1 - a_prev) / (1 - a) * (1 - a / a_prev)) ** 0.5", "eta * (1 - a / a_prev) ** 0.5"),
        ("ddim-noise-comes-on-top", "max(1 - a_prev - sigma**2, 0.0)", "max(1 - a_prev, 0.0)"),
        ("ddim-deviation-squared", "y + sigma * noise()", "y + sigma**2 * noise()"),
        ("solver-twice-as-far", "h / (2 * h_last)", "h / h_last", "diffusion/test_solver.py"),
        ("solver-ratio-upside-down", "h / (2 * h_last)", "h_last / (2 * h)", "diffusion/test_solver.py"),
        ("solver-keeps-the-plain-noise", "noise = eps_of(y, denoised_d, a)", "pass", "diffusion/test_solver.py"),
        ("solver-remembers-the-extrapolated", "h_last, last = h, y0_hat",
         "h_last, last = h, denoised_d", "diffusion/test_solver.py"),
        ("eq6-without-the-root", "(1 - alpha) / (1 - a) ** 0.5 * eps", "(1 - alpha) / (1 - a) * eps"),
        ("eq6-noise-of-the-forward-step", "((1 - a_prev) / (1 - a) * (1 - alpha)) ** 0.5", "(1 - alpha) ** 0.5"),
        ("eq6-noise-in-the-last-step", "if noise is not None and a_prev < 1:", "if noise is not None:"),
    ),
    *of(
        "diffusion/masks.py", "diffusion/test_masks.py",
        ("mask-stops-a-step-early", "alpha_bar_prev > until", "alpha_bar_prev >= until", "prediction/test_control.py"),
        ("mask-inverted", "m * x_c + (1 - m) * tf.inverse(y)", "(1 - m) * x_c + m * tf.inverse(y)"),
        ("completion-of-one-more-frame", "torch.arange(x_padded.shape[-2]) < history",
         "torch.arange(x_padded.shape[-2]) <= history"),
    ),
    *of(
        "prediction/network.py", "prediction/test_network.py",
        ("guidance-reversed", "return eps[count:].reshape(y.shape), eps[:count].reshape(y.shape)",
         "return eps[:count].reshape(y.shape), eps[count:].reshape(y.shape)"),
        ("condition-of-another-window", ".expand(*y.shape[:2], -1).flatten(0, 1)",
         ".expand(*y.shape[:2], -1).transpose(0, 1).flatten(0, 1)"),
        ("unconditional-sees-the-condition", "return self._evaluate(y, t, None)[0]",
         "return self._evaluate(y, t, self._conditions(y))[0]"),
        ("attention-of-the-conditional", "torch.cat([y, y]), t, added, count", "torch.cat([y, y]), t, added.flip(0), count"),
    ),
    *of(
        "prediction/guidance.py", "prediction/test_guidance.py",
        ("tabg-the-wrong-way", "eps + acting.scale * (degraded - eps)", "eps - acting.scale * (degraded - eps)"),
        ("tabg-without-its-scale", "eps + acting.scale * (degraded - eps)", "degraded"),
        ("tabg-degrades-nothing", "branches.unconditional(y_hat, t)", "branches.unconditional(y, t)"),
        ("tabg-clean-estimates-wrongly-scaled", "(y - y_hat) / (1 - float(alpha_bar[t])) ** 0.5",
         "(y - y_hat) / float(alpha_bar[t]) ** 0.5"),
        ("tabg-mask-not-widened", "window, stride=1, padding=window // 2", "1, stride=1, padding=0"),
        ("tabg-attention-of-queries", ".sum(dim=-2)", ".sum(dim=-1)"),
        ("tabg-mask-inverted", "torch.where(mask, y_t - noise * eps + added, y_t)",
         "torch.where(mask, y_t, y_t - noise * eps + added)"),
        ("tabg-sigma-in-the-other-place", 'self.sigma_place == "alg1"', 'self.sigma_place != "alg1"'),
        ("tabg-draws-added-as-one", "(deviation**2 + noise**2) ** 0.5 * draw()", "(deviation + noise) * draw()"),
        ("tabg-keeps-its-own-noise", "deviation * draw() + noise * eps", "deviation * draw() + noise * draw()"),
        ("tabg-acts-always", "(self.active is None or t in self.active)", "True"),
        ("cfg-form-ignored", "classifier_free(conditional, eps, weight, form)", "classifier_free(conditional, eps, weight)"),
        ("cfg-off-is-zero-in-every-form", 'neutral = 0.0 if form == "eq7" else 1.0', "neutral = 0.0"),
    ),
    *of(
        "prediction/predictor.py", "prediction/test_predictor.py",
        ("cfg-weight-fixed", "weight=s.guidance_weight", "weight=0.3"),
        ("cfg-form-fixed", "form=s.guidance_form", 'form="eq7"'),
        ("eta-fixed", "eta=s.eta", "eta=0.0"),
        ("spacing-fixed", "self.sampling.ddim_steps, self.sampling.spacing", "self.sampling.ddim_steps"),
        ("solver-is-ddim", 'if s.sampler == "ddim":', 'if s.sampler != "eq6":'),
        ("tabg-sigma-is-the-threshold", "s.tabg_sigma, s.tabg_threshold", "s.tabg_threshold, s.tabg_sigma"),
        ("tabg-in-the-last-steps", "indices[: round(s.tabg_steps * len(indices))]",
         "indices[-round(s.tabg_steps * len(indices)) :]"),
        ("seed-of-the-call-ignored", "s.sampling_seed if seed is None else seed", "s.sampling_seed"),
        ("window-numbers-restart-in-each-chunk", "window_ids=ids[first : first + chunk]", "window_ids=range(len(part))"),
        ("future-one-frame-early", "motion[:, :, self.representation.history :]",
         "motion[:, :, self.representation.history - 1 : -1]"),
        ("bound-of-the-displacement", "(self.transform.inverse(y) + origin).clamp(-bound, bound) - origin",
         "self.transform.inverse(y).clamp(-bound, bound)"),
        ("bound-after-the-mask", "(self._on_y0_hat(x_history), on_y0_hat)", "(on_y0_hat, self._on_y0_hat(x_history))"),
        ("projection-in-the-other-place", 'if self.sampling.wmsg == "every_step"', 'if self.sampling.wmsg == "y0_hat"'),
        ("completion-with-a-pose-for-a-displacement", "self.representation.frames) - self.representation.origin(x_history)",
         "self.representation.frames)"),
        ("loading-draws-from-the-callers-noise", "with torch.random.fork_rng([]):", "if True:"),
    ),
    *of(
        "prediction/representation.py", "prediction/test_representation.py",
        ("origin-one-frame-late", "self.origin(x[:, : self.history])", "self.origin(x[:, : self.history + 1])"),
        ("scale-of-a-later-origin", "x[:, history - 1, None]", "x[:, history, None]"),
        ("condition-scaled-as-the-motion", "return self.condition(pad_history", "return self.motion(pad_history"),
        ("condition-scaled-by-whole-motions", "fit_scale(base, padded,", "fit_scale(base, x,"),
        ("decoding-without-the-origin", "self.motion.inverse(y) + self.origin(x_history)[:, None]", "self.motion.inverse(y)"),
    ),
    *of(
        "prediction/objective.py", "prediction/test_objective.py",
        ("condition-sees-one-future-frame", "x[:, : self.representation.history]", "x[:, : self.representation.history + 1]",
         "prediction/test_representation.py"),
        ("condition-dropped-the-other-way", "coins >= options.drop_condition", "coins < options.drop_condition"),
        ("condition-never-dropped", "coins >= options.drop_condition", "coins >= 0"),
        ("one-coin-for-all", 'if options.drop_per == "sample"', "if False"),
        ("metric-weight-not-squared", "torch.as_tensor(representation.motion.deviation) ** 2",
         "torch.as_tensor(representation.motion.deviation)"),
        ("metric-weight-of-another-mean", "weight / weight.mean()", "weight / weight.max()"),
        ("uniform-is-metric", 'if options.loss_weight == "metric" else None', "if True else None"),
        ("noise-step-zero-is-trained", "torch.randint(1, len(", "torch.randint(0, len("),
        ("noise-of-the-step-before", "self.alpha_bar[t]", "self.alpha_bar[t - 1]"),
        ("target-is-the-other-one", "network_target(self.prediction, y, eps, a)", "network_target(self.prediction, eps, y, a)"),
        ("validation-with-dropout", "        network.eval()\n", ""),
        ("trained-on-the-validation", "cls(cfg, split.train, split.validation",
         "cls(cfg, [*split.train, *split.validation], split.validation"),
    ),
    *of(
        "prediction/evaluation.py", "prediction/test_evaluation.py",
        ("threshold-of-the-sets-ignored", "all_test.x_future, options.mm_threshold)", "all_test.x_future, 0.5)"),
        ("singletons-ignored", "mm_singletons=options.mm_singletons", 'mm_singletons="keep"'),
        ("sets-by-the-first-pose", "all_test.x_history[:, -1]", "all_test.x_history[:, 0]"),
        ("sets-of-the-evaluated-windows-alone", "multimodal_futures(all_test.x_history[:, -1], all_test.x_future, options",
         "multimodal_futures(test.x_history[:, -1], test.x_future, options"),
        ("nearest-history-knows-the-test", "windows(split.train, cut.history", "windows(split.test, cut.history"),
        ("evaluation-numbers-restart", "predict(test.x_history[part], ids[part])",
         "predict(test.x_history[part], list(range(len(ids[part]))))"),
        ("sampling-seed-ignored", "sampling.samples, sampling.sampling_seed", "sampling.samples, 0"),
        ("samples-ignored", "predictor.predict(x_history, sampling.samples", "predictor.predict(x_history, None"),
        ("test-stride-of-the-training", "cut.test_stride", "cut.train_stride"),
        ("all-windows-are-evaluated", "every.thin(cfg.windows.test_windows)", "every"),
    ),
    *of(
        "prediction/control.py", "prediction/test_control.py",
        ("mask-acts-one-step-less", "noise, reached[count])", "noise, reached[max(count - 1, 0)])"),
        ("mask-on-estimates-acts-always", "iter([True] * steps)", "iter([True] * 10_000)"),
        ("mask-with-the-samplers-noise", "predictor.noise(own, ids", "predictor.noise(seed, ids"),
        ("target-is-no-displacement", "- representation.origin(history)", "- 0 * representation.origin(history)"),
        ("feather-too-short", "math.pi * k / (frames + 1)", "math.pi * k / frames"),
        ("error-counts-the-feather", "[..., mask == 1]", "[..., mask > 0]"),
        ("jerk-per-frame", "fps**3", "fps"),
    ),
    *of(
        "prediction/baselines.py", "prediction/test_baselines.py",
        ("velocity-over-the-history", "x_history[:, -2:-1]", "x_history[:, :1]"),
        ("farthest-history", "largest=False", "largest=True"),
        ("neighbours-not-turned", "turn if self.align", "0 * turn if self.align"),
    ),
    *of(
        "training/average.py", "training/test_average.py",
        ("average-never", "self.decay if step > self.start else 0.0", "0.0"),
        ("average-inverted", "get_ema_multi_avg_fn(decay)", "get_ema_multi_avg_fn(1 - decay)"),
        ("average-begins-a-step-early", "step > self.start", "step >= self.start"),
    ),
    *of(
        "training/checkpoint.py", "training/test_loop.py::test_a_training_by_hand",
        ("raw-weights-saved", "self.average.averaged().state_dict()", "self.network.state_dict()"),
        ("second-moments-forgotten", 'for k in ("step", "exp_avg", "exp_avg_sq")', 'for k in ("step", "exp_avg", "exp_avg")',
         "training/test_loop.py::test_resume_equals_uninterrupted_at_every_step"),
    ),
    *of(
        "training/loop.py", "training/test_loop.py::test_a_training_by_hand",
        ("schedule-ignored", "learning_rate(settings, state.step)", "settings.lr"),
        ("schedule-one-step-ahead", "learning_rate(settings, state.step)", "learning_rate(settings, state.step + 1)"),
        ("gradients-not-clipped", "if settings.clip_gradient:", "if False:"),
        ("weights-do-not-decay", "weight_decay=settings.weight_decay", "weight_decay=0.0"),
        ("averaging-left-out", "        state.average.update(state.step)\n", ""),
        ("averaging-counts-from-zero", "state.average.update(state.step)", "state.average.update(state.step - 1)"),
        ("every-step-draws-the-same", "seeded(settings.seed, state.step + 1, ", "seeded(settings.seed, 1, "),
        ("validation-of-the-raw-weights", "objective.validate(state.average.averaged())", "objective.validate(network.eval())",
         "training/test_loop.py::test_the_validation_is_of_the_averaged_weights"),
        ("half-precision-everywhere", "with seeded(settings.seed,", "with accelerator.autocast(), seeded(settings.seed,",
         "training/test_loop.py::test_half_precision_stays_within_the_network"),
        ("precision-ignored", "Accelerator(mixed_precision=settings.mixed_precision)", "Accelerator()",
         "training/test_loop.py::test_half_precision_stays_within_the_network"),
        ("processes-draw-the-same", "accelerator.process_index) as",
         "0) as", "training/test_loop.py::test_two_processes_share_each_batch"),
        ("every-process-a-whole-batch", "settings.batch // accelerator.num_processes", "settings.batch",
         "training/test_loop.py::test_two_processes_share_each_batch"),
    ),
    *of(
        "training/config.py", "training/test_config.py",
        ("milestone-one-step-late", "step >= m", "step > m"),
        ("warm-up-begins-at-zero", "(step + 1) / cfg.warmup", "step / cfg.warmup"),
        ("restarts-at-full-height", "cfg.lr_gamma**cycle * ", ""),
        ("cosine-without-warm-up", "return lr * 0.5 * (1 + math.cos(math.pi * step / cfg.train_steps))",
         "return cfg.lr * 0.5 * (1 + math.cos(math.pi * step / cfg.train_steps))"),
    ),
    *of(
        "training/randomness.py", "training/test_loop.py::test_the_callers_randomness_is_left_alone",
        ("seeds-the-callers-noise", "if torch.cuda.is_available() else []):",
         "if torch.cuda.is_available() else [], enabled=False):"),
    ),
    *of(
        "metrics/prediction.py", "metrics/test_prediction.py",
        ("apd-of-ordered-pairs", "p.shape[1] * (p.shape[1] - 1) // 2", "p.shape[1] ** 2 // 2"),
        ("ade-of-a-sample-per-frame", "dim=-1).mean(-1).amin(1)", "dim=-1).amin(1).mean(-1)"),
        ("ade-of-the-mean-sample", "dim=-1).mean(-1).amin(1)", "dim=-1).mean(-1).mean(1)"),
        ("fde-of-the-first-frame", "ade(p[:, :, -1:], g[:, -1:])", "ade(p[:, :, :1], g[:, :1])"),
        ("mmfde-of-all-frames", "mmade(p[:, :, -1:], MultimodalFutures(sets.futures[:, -1:], sets.members))", "mmade(p, sets)"),
        ("sets-of-one-size", "total / sets.sizes.to(p)", "total / sets.sizes.max().to(p)"),
        ("padded-futures-count", "best.masked_fill(member.to(p.device) < 0, 0).sum(1)", "best.sum(1)"),
        ("cmd-counts-from-the-start", "torch.arange(predicted.shape[1], 0, -1)", "torch.arange(1, predicted.shape[1] + 1)"),
        ("cmd-of-each-frame", "truth[rows].mean()", "truth[rows].mean(0)"),
        ("jitter-with-its-sign", ".diff(dim=2).abs().mean((1, 2, 3))", ".diff(dim=2).mean((1, 2, 3)).abs()"),
        ("apde-of-all-windows", "(predicted - multimodal)[multimodal > 0]", "(predicted - multimodal)"),
    ),
    *of(
        "metrics/multimodal.py", "metrics/test_prediction.py",
        ("threshold-is-close-enough", '_for_euclid_dist") < threshold', '_for_euclid_dist") <= threshold'),
        ("sets-of-the-window-alone", '_for_euclid_dist") < threshold', '_for_euclid_dist") <= 0'),
    ),
    *of(
        "metrics/table.py", "metrics/test_prediction.py",
        ("standard-error-is-the-deviation", "v.std() / len(v) ** 0.5", "v.std()"),
        ("sets-by-place-in-the-chunk", "self.gs.take(windows.tolist())", "self.gs.take(range(len(windows)))"),
        ("skip-mm-skips-all", 'if k.startswith("mm") else v[rows]', "if True else v[rows]"),
        ("paths-of-the-truth-alone", "(p, g[:, None]), strict=True", "(g[:, None], g[:, None]), strict=True"),
    ),
    *of(
        "data/windowing.py", "data/test_windowing.py",
        ("one-window-too-many", "np.arange(0, max(n - frames, 0), stride)", "np.arange(0, max(n - frames + 1, 0), stride)"),
        ("stride-ignored", "np.arange(0, max(n - frames, 0), stride)", "np.arange(0, max(n - frames, 0))"),
        ("thinning-takes-the-first", "torch.linspace(0, len(self) - 1, count", "torch.linspace(0, count - 1, count"),
        ("history-one-frame-long", "return self.x[:, : self.history]", "return self.x[:, : self.history + 1]"),
        ("last-window-never-drawn", "o + np.arange(n - frames) for", "o + np.arange(max(n - frames - 1, 1)) for"),
        ("mirrored-without-exchange", "other = turned[:, :, self.mirror]", "other = turned.clone()"),
        ("exchanged-without-mirroring", "other[..., a] *= -1", "other[..., a] *= 1"),
        ("always-mirrored", "torch.where(coins[1][..., None], other, turned)", "other"),
        ("heading-also-mirrors", 'elif self.augment == "heading_mirror":', "else:"),
        ("one-angle-for-all", "size = (1 if per_batch else len(x), 1, 1)", "size = (1, 1, 1)"),
        ("half-a-circle", "* (2 * math.pi)", "* math.pi"),
        ("turned-and-squeezed", "angle.sin() * p + angle.cos() * q", "angle.sin() * p - angle.cos() * q"),
        ("turned-about-z-always", "self.level = [0, 3 - up]", "self.level = [0, 1]"),
        ("one-coin-for-both-axes", "torch.where(coins[2], -1.0, 1.0)", "torch.where(coins[1], -1.0, 1.0)"),
        ("humanmac-always-turns", "angle = angle * coins[0]", "pass"),
        ("windows-drawn-alike-whoever", 'if sampling == "subject_action" else None', "if False else None"),
        ("people-by-their-clips", "subjects.count(m.subject) * (len(m) - frames)", "(len(m) - frames)"),
    ),
    *of(
        "data/sources.py", "data/test_sources.py",
        ("test-people-are-trained-on", "tuple(subject for subject in unnamed if subject not in test)", "tuple(unnamed)"),
        ("test-clips-are-trained-on", "Split(motions[:cut], [], motions[cut:])", "Split(motions, [], motions[cut:])"),
        ("named-people-are-tested-by-default", "tuple(unnamed[-max(1,", "tuple(present[-max(1,"),
        ("two-lists-allowed", "(both := sorted({*people} & {*others}))", "(both := [])"),
        ("fingerprint-of-the-test-alone", "fingerprint(self.train), fingerprint(self.test)",
         "fingerprint(self.test), fingerprint(self.test)"),
    ),
    *of(
        "experiments/grids.py", "experiments/test_tables.py",
        ("warm-up-not-shortened", '("train_steps", "lr_period", "warmup", "ema_start")',
         '("train_steps", "lr_period", "ema_start")'),
        ("average-begins-after-the-end", '("train_steps", "lr_period", "warmup", "ema_start")',
         '("train_steps", "lr_period", "warmup")'),
        ("milestones-not-shortened", "[round(share * m) for m in", "[m for m in"),
        ("base-wins-over-the-row", "return shared | row.changes", "return row.changes | shared"),
        ("budget-wins-over-the-base", "(shared | grid.base)", "(grid.base | shared)"),
        ("budget-ends-one-step-early", "<= b.until", "< b.until"),
        ("rows-without-pairs", '{"sampling_seed": seed, **', '{"sampling_seed": hash(row.name) % 1000 + seed, **'),
        ("one-training-for-all-seeds", '({"seed": seed} if grid.trains else {})', "{}"),
        ("training-seeds-where-none-is-trained", '({"seed": seed} if grid.trains else {})', '{"seed": seed}'),
    ),
    *of(
        "experiments/tables.py", "experiments/test_tables.py",
        ("deviation-of-a-population", "stdev(v) if", "stdev(v) * ((len(v) - 1) / len(v)) ** 0.5 if"),
        ("standard-error-of-the-last-seed", 'results[0]["standard_error"][m]', 'results[-1]["standard_error"][m]'),
        ("standard-error-in-metres", 'scale * row["standard_error"][m]', 'row["standard_error"][m]'),
        ("deviation-in-metres", "(value, scale * spread)", "(value, spread)"),
        ("numbers-of-the-first-seed", "m: mean(v) for", "m: v[0] for"),
    ),
]  # fmt: skip
