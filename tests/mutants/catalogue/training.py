"""Mutants of training."""

from tests.mutants.mutant import of

MUTANTS = [
    *of(
        "training/checkpoint.py", "training/test_average.py",
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
        ("validation-with-dropout", "self.held_out_loss(network.eval(), generator)", "self.held_out_loss(network, generator)",
         "prediction/test_objective.py"),
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
        "training/loop.py", "training/test_loop.py::test_the_callers_randomness_is_left_alone",
        ("seeds-the-callers-noise", "if torch.cuda.is_available() else []):",
         "if torch.cuda.is_available() else [], enabled=False):"),
    ),
    *of(
        "training/model.py", "training/test_model.py",
        ("settings-of-the-copy-for-both", "other = copy.copy(self)", "other = self"),
        ("the-trained-model-changes", "if owners[name] not in self.sampling_groups", "if False"),
        ("no-sample-is-a-sample", "if count < 1:", "if count < 0:"),
        ("identities-of-other-windows", "if len(ids) != count:", "if len(ids) > count:"),
        ("a-chunk-overlaps-the-next", "yield slice(first, first + size)", "yield slice(first, first + size + 1)"),
        ("new-networks-draw", "with torch.random.fork_rng([]):", "if True:"),
        ("the-network-in-training", "self.net: Any = net.eval()", "self.net: Any = net"),
    ),
    *of(
        "training/loop.py", "training/test_model.py",
        ("held-out-noise-of-each-time", "with seeded(7, 7) as", "with seeded(int(torch.randint(9999, ()))) as"),
    ),
]  # fmt: skip
