"""Mutants of networks."""

from tests.mutants.mutant import of

MUTANTS = [
    *of(
        "networks/translinear.py", "networks/test_translinear.py",
        ("skips-in-the-order-held", "h = h + skips.pop()", "h = h + skips.pop(0)"),
        ("style-without-the-stream", "self.norm(h), 1 + scale", "self.norm(h), scale"),
        ("condition-always-counts", "added = added * keep.reshape(-1, 1)", "pass"),
        ("attention-of-the-first-block", "i in (half - 1, half)", "i in (0, half)"),
        ("time-with-sines-first", "torch.cat([waves[:, 1::2], waves[:, ::2]]", "torch.cat([waves[:, ::2], waves[:, 1::2]]"),
    ),
    *of(
        "networks/layers.py", "networks/test_translinear.py",
        ("dropout-without-its-scale", ".mul_(256 / (256 - self.dropped))", ""),
    ),
    *of(
        "networks/matching.py", "networks/test_matching.py",
        ("all-read-to-the-padded-end", "pack_padded_sequence(self.input_emb(x), lengths.cpu()",
         "pack_padded_sequence(self.input_emb(x), torch.full_like(lengths, x.shape[1]).cpu()",
         "networks/test_matching.py::test_padding_does_not_change_a_sentence"),
        ("padding-seen-by-the-movements", "torch.where(kept[..., None], x, 0.0)", "x",
         "networks/test_matching.py::test_padding_does_not_change_a_movement"),
        ("a-window-of-another-length", "WINDOW = 196", "WINDOW = 200",
         "matching/test_published.py::test_motions_are_padded_to_196_frames_and_no_further"),
        ("critic-refused-by-cudnn", "return super().train(True)", "return super().train(mode)",
         "networks/test_matching.py::test_a_frozen_critic_passes_gradients_to_the_motion"),
        ("contacts-seen", "x[..., :-CONTACTS].transpose(1, 2)", "x[..., CONTACTS:].transpose(1, 2)",
         "networks/test_matching.py::test_contacts_are_not_looked_at_and_all_else_is"),
    ),
    *of(
        "networks/layers.py", "networks/test_denoisers.py",
        ("sines-and-cosines-exchanged", "torch.stack([angle.sin(), angle.cos()]", "torch.stack([angle.cos(), angle.sin()]"),
        ("norm-before-the-attention", "x = self.norm1(x + self.after(", "x = x + self.norm1(self.after("),
        ("tokens-that-are-masked-are-seen", "else mask[:, None, None]", "else (mask | True)[:, None, None]"),
    ),
    *of(
        "networks/mdm.py", "networks/test_denoisers.py",
        ("a-part-valid-token-with-noise-in-it", "y_t = y_t.masked_fill(~mask[..., None], 0.0)", "y_t = y_t + 0.0"),
        ("a-token-valid-when-all-of-it-is", "unflatten(1, (-1, size)).any(-1)", "unflatten(1, (-1, size)).all(-1)"),
        ("those-with-a-sentence-are-dropped",
         "text.pooled.masked_fill(drop[:, None], 0.0)", "text.pooled.masked_fill(~drop[:, None], 0.0)"),
        ("a-correction-of-neighbours-alone", "h = h + F.silu(self.mix", "h = F.silu(self.mix"),
        ("neighbours-that-see-padding", "self.time(t)[:, None]) * seen[..., None]", "self.time(t)[:, None])"),
    ),
    *of(
        "networks/unet1d.py", "networks/test_denoisers.py",
        ("second-convolution-sees-padding", "1 + scale)) * valid", "1 + scale))"),
        ("padding-in-linear-attention", "k = k.masked_fill(~mask[:, None, :, None], float(\"-inf\")).softmax(dim=2)",
         "k = k.softmax(dim=2)"),
        ("queries-normed-over-frames", "y = q.softmax(dim=-1) @", "y = q.softmax(dim=-2) @"),
        ("skips-in-the-wrong-order", "torch.cat([grow(x) * valid[level], held[level]], dim=1)",
         "torch.cat([held[level], grow(x) * valid[level]], dim=1)"),
        ("the-first-level-not-masked-when-halved", "x = shrink(x) * valid[level + 1]", "x = shrink(x)"),
    ),
    *of(
        "networks/text.py", "networks/test_text.py",
        ("padding-in-the-mean", "(tokens * weight).sum(1) / weight.sum(1)", "tokens.mean(1)"),
        ("words-of-before-loading", "self._learn_numbers(self.vocabulary_in({\"spelling\": self.spelling}))", "pass"),
        ("groups-of-the-word-behind", "map(len, hashes[:-1])", "map(len, hashes[1:])",
         "networks/test_text.py::test_hashes_by_hand"),
        ("clip-cut-without-its-ends", "max_length=self.longest + 2)", "max_length=self.longest)"),
    ),
]  # fmt: skip
